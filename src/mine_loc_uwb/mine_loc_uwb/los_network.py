"""The CNN-LSTM of paper A for the four classes of a link, beside a cautious reading of the powers.

Whether there is a line of sight is a sum of evidence: what the powers say against free space, each with a weight that
cannot turn its sign, and what the network reads from the profile. Which of the two NLOS and of the two LOS classes it is
follows from the network alone. So labels of two or three classes train the parts they inform.
"""

import torch
from torch import Tensor, nn

from mine_loc_uwb.cir_input import CHANNELS, EDGE_PER_TAP, EDGE_TAPS, SIDE_NAMES

CLASSES = 4
_FEATURES = len(SIDE_NAMES)
_MEDIANS = {name: _FEATURES + number for number, name in enumerate(SIDE_NAMES)}
_WIDTH, _HIDDEN, _EDGE, _SIDE = 16, 24, 16, 24
_CLIP = 2.5
_OUTPUTS = 3  # LOS, class 1 of NLOS, class 3 of LOS


class Evidence(nn.Module):
    """Monotone logit of a line of sight from the powers of the last second: more power never speaks against it.

    Squashed, since a deficit of ten decibels says no more than one of four. With a range, power and first-path power
    are held against free space; without one the noise a symbol is the level meter that automatic gain leaves uncompressed.
    """

    def __init__(self) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.full((2, 3), 0.5))
        self.bias = nn.Parameter(torch.zeros(2))
        self.register_buffer("noise_mean", torch.zeros(1))
        self.register_buffer("noise_scale", torch.ones(1))

    def forward(self, side: Tensor) -> Tensor:
        """Logits (n,) of side features (n, 2 f); 0 where nothing is known."""
        power_db = side[:, _MEDIANS["receive_power_against_free_space_db"]]
        first_db = side[:, _MEDIANS["first_path_power_against_free_space_db"]]
        noise = (side[:, _MEDIANS["log_noise_per_symbol"]] - self.noise_mean) / self.noise_scale
        seen = torch.stack([torch.tanh(power_db / 2.0), torch.tanh(first_db / 4.0 + 1.5), noise.clamp(-_CLIP, _CLIP)], 1)
        regime = power_db.isnan().long()
        known = ~seen.isnan().all(dim=1)
        sums = (seen.nan_to_num(0.0) * nn.functional.softplus(self.weight)[regime]).sum(dim=1)
        return torch.where(known, sums + self.bias[regime], torch.zeros_like(sums))


class LosNetwork(nn.Module):
    """Logits of the four classes from profile, leading edge and side features."""

    def __init__(self, dropout: float = 0.3) -> None:
        super().__init__()
        self.register_buffer("side_mean", torch.zeros(2 * _FEATURES))
        self.register_buffer("side_scale", torch.ones(2 * _FEATURES))
        self.register_buffer("temperature", torch.ones(2))
        self.evidence = Evidence()
        self.cnn = nn.Sequential(
            nn.Conv1d(CHANNELS, _WIDTH, 5, stride=2, padding=2), nn.ReLU(),
            nn.Conv1d(_WIDTH, _WIDTH, 5, stride=2, padding=2), nn.ReLU(),
            nn.Conv1d(_WIDTH, _HIDDEN, 3, stride=2, padding=1), nn.ReLU(),
        )  # fmt: skip
        self.lstm = nn.LSTM(_HIDDEN, _HIDDEN, batch_first=True)
        self.edge = nn.Sequential(nn.Linear(EDGE_TAPS * EDGE_PER_TAP, _EDGE), nn.ReLU())
        self.side = nn.Sequential(nn.Linear(4 * _FEATURES, _SIDE), nn.ReLU())
        self.dropout = nn.Dropout(dropout)
        self.head = nn.Linear(_HIDDEN + _EDGE + _SIDE, _OUTPUTS)

    def standardise(self, side: Tensor) -> None:
        """Learn means and spreads of side features (n, 2 f), NaN left out."""
        known = ~side.isnan()
        count = known.sum(dim=0).clamp_min(1)
        mean = side.nan_to_num(0.0).sum(dim=0) / count
        spread = (((side - mean).nan_to_num(0.0) ** 2).sum(dim=0) / count).sqrt()
        self.side_mean.copy_(mean)
        self.side_scale.copy_(torch.where(spread > 1e-3, spread, torch.ones_like(spread)))
        noise = _MEDIANS["log_noise_per_symbol"]
        self.evidence.noise_mean.copy_(self.side_mean[noise])
        self.evidence.noise_scale.copy_(self.side_scale[noise])

    def read(self, profile: Tensor, edge: Tensor, side: Tensor) -> Tensor:
        """Say what the network reads beside the evidence: (n, 3) logits of LOS, of 1 in NLOS and of 3 in LOS."""
        scaled = (side - self.side_mean) / self.side_scale
        missing = scaled.isnan()
        known = torch.cat([scaled.nan_to_num(0.0).clamp(-_CLIP, _CLIP), missing.to(side.dtype)], dim=1)
        last = self.lstm(self.cnn(profile).transpose(1, 2))[1][0][-1]
        return self.head(self.dropout(torch.cat([last, self.edge(edge), self.side(known)], dim=1)))

    def forward(self, profile: Tensor, edge: Tensor, side: Tensor) -> Tensor:
        """Log-probabilities (n, 4) of the classes, calibrated."""
        return self.judge(self.read(profile, edge, side), side)

    def judge(self, read: Tensor, side: Tensor) -> Tensor:
        """Add the evidence to what was read (n, 3): log-probabilities (n, 4)."""
        regime = side[:, _MEDIANS["receive_power_against_free_space_db"]].isnan().long()
        los = (self.evidence(side) + read[:, 0]) / self.temperature[regime]
        return class_log_probability(torch.cat([los[:, None], read[:, 1:]], dim=1))


def class_log_probability(logits: Tensor) -> Tensor:
    """(n, 4) from logits (n, 3) of LOS, of class 1 given NLOS and of class 3 given LOS."""
    yes, no = nn.functional.logsigmoid(logits), nn.functional.logsigmoid(-logits)
    return torch.stack([no[:, 0] + yes[:, 1], no[:, 0] + no[:, 1], yes[:, 0] + yes[:, 2], yes[:, 0] + no[:, 2]], dim=1)
