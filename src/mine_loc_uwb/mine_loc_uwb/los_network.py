"""The CNN-LSTM of paper A for the four classes of a link, beside a cautious reading of the powers.

Whether there is a line of sight is a sum of evidence (`los_evidence`) and of what the network reads from the profile.
Which of the two NLOS and of the two LOS classes it is follows from the network alone. So labels of two or three classes
train the parts they inform.
"""

import torch
from torch import Tensor, nn

from mine_loc_uwb import los_evidence as evidence
from mine_loc_uwb.cir_input import CHANNELS, EDGE_PER_TAP, EDGE_TAPS, SIDE_NAMES
from mine_loc_uwb.los_evidence import EvidenceWeights

_POWERS = [evidence.POWER, evidence.FIRST_POWER]
_FEATURES = len(SIDE_NAMES)
_WIDTH, _HIDDEN, _EDGE, _SIDE = 24, 32, 24, 32
_CLIP = 2.5
_OUTPUTS = 3  # LOS, class 1 of NLOS, class 3 of LOS
_PATHS = torch.tensor([[0, 0, 1, 1], [1, 0, 0, 0], [0, 0, 1, 0], [1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]).float()
"""Which of yes to the three, then no to the three, each class takes."""


class Evidence(nn.Module):
    """Logit of a line of sight from the powers of the last second; see `los_evidence`."""

    with_range: Tensor
    without_range: Tensor
    middle_db: Tensor
    scale_db: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("with_range", torch.zeros(3))
        self.register_buffer("without_range", torch.zeros(2))
        self.register_buffer("middle_db", torch.tensor([0.0, evidence.FIRST_MIDDLE_DB]), persistent=False)
        self.register_buffer(
            "scale_db", torch.tensor([evidence.POWER_SCALE_DB, evidence.FIRST_SCALE_DB]), persistent=False
        )

    def set(self, weights: EvidenceWeights) -> None:
        """Take over fitted weights."""
        self.with_range.copy_(torch.tensor(weights.with_range))
        self.without_range.copy_(torch.tensor(weights.without_range))

    def forward(self, side: Tensor) -> Tensor:
        """Logits (n,) of side features (n, 2 f); NaN where nothing is known."""
        power_and_first = torch.tanh((side[:, _POWERS] - self.middle_db) / self.scale_db)
        noise = ((side[:, evidence.NOISE] - evidence.NOISE_MIDDLE) / evidence.NOISE_SCALE).clamp(
            -evidence.NOISE_MOST, evidence.NOISE_MOST
        )
        ranged = power_and_first @ self.with_range[:2] + self.with_range[2]
        return torch.where(ranged.isnan(), noise * self.without_range[0] + self.without_range[1], ranged)


class LosNetwork(nn.Module):
    """Logits of the four classes from profile, leading edge and side features."""

    side_mean: Tensor
    side_scale: Tensor
    temperature: Tensor

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

    def read(self, profile: Tensor, edge: Tensor, side: Tensor) -> Tensor:
        """Say what the network reads beside the evidence: (n, 3) logits of LOS, of 1 in NLOS and of 3 in LOS."""
        scaled = (side - self.side_mean) / self.side_scale
        missing = scaled.isnan()
        known = torch.cat([scaled.nan_to_num(0.0).clamp(-_CLIP, _CLIP), missing.to(side.dtype)], dim=1)
        last = self.lstm(self.cnn(profile).transpose(1, 2))[1][0][-1]
        read: Tensor = self.head(self.dropout(torch.cat([last, self.edge(edge), self.side(known)], dim=1)))
        return read

    def forward(self, profile: Tensor, edge: Tensor, side: Tensor) -> Tensor:
        """Log-probabilities (n, 4) of the classes, calibrated."""
        return self.judge(self.read(profile, edge, side), side)

    def judge(self, read: Tensor, side: Tensor) -> Tensor:
        """Add the evidence to what was read (n, 3): log-probabilities (n, 4)."""
        without_range = side[:, evidence.POWER].isnan().long()
        los = (self.evidence(side).nan_to_num(0.0) + read[:, 0]) / self.temperature[without_range]
        return class_log_probability(torch.cat([los[:, None], read[:, 1:]], dim=1))


def class_log_probability(logits: Tensor) -> Tensor:
    """(n, 4) from logits (n, 3) of LOS, of class 1 given NLOS and of class 3 given LOS."""
    return nn.functional.logsigmoid(torch.cat([logits, -logits], dim=1)) @ _PATHS.to(logits.device)
