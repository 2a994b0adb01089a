"""Variations of training frames that a receiver could have made of the same link."""

import torch
from torch import Tensor

from mine_loc_uwb.cir_input import SIDE_NAMES

_NOISE = 0.02
_ECHO_SHARE, _ECHO_MOST, _ECHO_TAPS = 0.3, 0.4, 40
_EDGE_STEPS = 1
_LEVEL_SD_DB = 0.3
_SIDE_SD = 0.1
_FEATURES = len(SIDE_NAMES)


def augmented(profile: Tensor, edge: Tensor, side: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Noise, first-path jitter, an added echo and gain errors: same shapes as `los_input` and history give."""
    count = len(profile)
    shift = int(torch.randint(-1, 2, ()))
    profile = torch.roll(profile, shift, dims=2)
    edge = torch.roll(edge, int(torch.randint(-_EDGE_STEPS, _EDGE_STEPS + 1, ())), dims=1)
    delay = int(torch.randint(2, _ECHO_TAPS, ()))
    strength = _ECHO_MOST * torch.rand(count, 1, 1) * (torch.rand(count, 1, 1) < _ECHO_SHARE)
    echo = torch.nn.functional.pad(profile, (delay, 0))[..., : profile.shape[2]]
    profile = profile + strength * echo * torch.tensor([1.0, 0.0])[:, None]
    profile = profile + _NOISE * torch.randn_like(profile)
    edge = edge + _NOISE * torch.randn_like(edge)
    return profile, edge, _with_level_errors(side)


def _with_level_errors(side: Tensor) -> Tensor:
    """Shift all levels in decibels by one gain error a frame, and waver every feature a little."""
    gain_db = _LEVEL_SD_DB * torch.randn(len(side), 1)
    spread = side.std(dim=0).nan_to_num(0.0) if not side.isnan().any() else torch.zeros(side.shape[1])
    shifted = side + _SIDE_SD * spread * torch.randn_like(side)
    for name in ("receive_power_dbm", *(SIDE_NAMES[number] for number in (4, 5))):
        number = SIDE_NAMES.index(name)
        shifted[:, [number, number + _FEATURES]] += gain_db
    return shifted


def without(side: Tensor, features: tuple[int, ...], share: float = 1.0) -> Tensor:
    """Hide some features (and their medians) in a share of the frames (n, 2 f), as if they were not known."""
    hidden = torch.zeros(side.shape[1], dtype=torch.bool)
    hidden[[column + offset for column in features for offset in (0, _FEATURES)]] = True
    rows = torch.rand(len(side), 1) < share
    return side.masked_fill(hidden & rows, torch.nan)
