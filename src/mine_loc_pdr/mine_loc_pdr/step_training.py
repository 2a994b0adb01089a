"""Training of the step network on walks whose heel strikes are marked, so that it also knows other people and devices.

Crops of walks are stretched in time (slower and faster walkers), turned about the vertical (any yaw of the mounting),
mirrored, scaled, given noise and offsets; some ring (`ringing.py`). Among them are drawn motions that hold no step
(`shaking.py`). Times are seconds from the first frame's end; draws come from the seed alone.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.marked_motion import MarkedMotion
from mine_loc_pdr.ringing import ringing
from mine_loc_pdr.shaking import shaking
from mine_loc_pdr.step_detector import LOOKAHEAD_S
from mine_loc_pdr.step_frames import FRAME_NS
from mine_loc_pdr.step_kernel import Floats, weights_of
from mine_loc_pdr.step_network import StepNetwork

Array = NDArray[np.float64]

ROUNDS = 200
_FRAME_S = FRAME_NS / NS_PER_S
_FRAMES = 300  # of a crop
_CROPS = 256  # of a round
_BATCH = 32
_LEARNING_RATE = 4e-3
_STRIKE_SD_S = 0.035  # of the target about the marked instant
_STRIKE_WEIGHT = 2.0  # what a strike's frame weighs more than another
_STRETCH = (-0.15, 0.25)  # logarithm of the time a walk takes
_UNSEEN = 40  # frames at the start of a crop that are not judged: what was before them is not known
_SHAKING_SHARE = 0.25
_RINGING_SHARE = 0.3  # of the walks
_GAIN_LOG_SD = 0.3
_NOISE = np.array([0.05, 0.05, 0.05, 0.01, 0.01, 0.01])  # m/s², rad/s
_OFFSET_M_S2 = 0.1


def train(
    walks: Sequence[MarkedMotion], seed: int = 0, rounds: int = ROUNDS, progress: Callable[[], None] | None = None
) -> Floats:
    """Weights for `StepStream`; `progress` is called once a round."""
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    network = StepNetwork()
    optimiser = torch.optim.Adam(network.parameters(), _LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, _LEARNING_RATE, total_steps=rounds * (_CROPS // _BATCH))
    for _ in range(rounds):
        frames, target, weight = (torch.from_numpy(part.astype(np.float32)) for part in _crops(rng, walks))
        for first in range(0, _CROPS, _BATCH):
            batch = slice(first, first + _BATCH)
            loss = nn.functional.binary_cross_entropy_with_logits(
                network(frames[batch]), target[batch], weight[batch] * (1.0 + _STRIKE_WEIGHT * target[batch])
            )
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            schedule.step()
        if progress is not None:
            progress()
    return weights_of({name: tensor.detach() for name, tensor in network.state_dict().items()})


def _crops(rng: np.random.Generator, walks: Sequence[MarkedMotion]) -> tuple[Array, Array, Array]:
    """Frames (crops, frames, CHANNELS), targets and weights (crops, frames)."""
    shares = np.array([len(walk.frames) for walk in walks], dtype=float)
    chosen = rng.choice(len(walks), size=_CROPS, p=shares / shares.sum())
    crops = [_shaken(rng) if rng.random() < _SHAKING_SHARE else _crop(rng, walks[number]) for number in chosen]
    frames, target, weight = (np.stack(part) for part in zip(*crops, strict=True))
    weight[:, :_UNSEEN] = 0.0
    return _varied(rng, frames), target, weight


def _shaken(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    return shaking(rng, _FRAMES), np.zeros(_FRAMES), np.ones(_FRAMES)


def _crop(rng: np.random.Generator, walk: MarkedMotion) -> tuple[Array, Array, Array]:
    """A piece of a walk, as if the same way took `slower` times as long, so that accelerations go with its square."""
    slower = math.exp(rng.uniform(*_STRETCH))
    first = rng.uniform(-30.0, max(1.0, len(walk.frames) - 0.7 * _FRAMES / slower))
    places, rows = first + np.arange(_FRAMES) / slower, np.arange(len(walk.frames))
    frames: Array = np.column_stack([np.interp(places, rows, column) for column in walk.frames.T])
    frames[:, :3] /= slower**2
    frames[:, 3:] /= slower
    times_s = np.arange(_FRAMES, dtype=np.float64) * _FRAME_S
    strikes_s: Array = (walk.strikes_s - first * _FRAME_S) * slower + LOOKAHEAD_S
    near: Array = strikes_s[(strikes_s > -1.0) & (strikes_s < times_s[-1] + 1.0)]
    if rng.random() < _RINGING_SHARE:
        frames[:, :3] += ringing(rng, times_s, near - LOOKAHEAD_S)
    target = np.exp(-0.5 * ((times_s[:, None] - near) / _STRIKE_SD_S) ** 2).max(axis=1, initial=0.0)
    return frames, target, (times_s < (walk.end_s - first * _FRAME_S) * slower + LOOKAHEAD_S).astype(float)


def _varied(rng: np.random.Generator, frames: Array) -> Array:
    """The same crops of other people, mountings and devices."""
    count = len(frames)
    yaw = rng.uniform(0.0, math.tau, (count, 1))
    c, s = np.cos(yaw), np.sin(yaw)
    mirrored = rng.random(count) < 0.5
    for a, b in ((1, 2), (4, 5)):
        x, y = frames[..., a].copy(), frames[..., b].copy()
        frames[..., a], frames[..., b] = c * x - s * y, s * x + c * y
    for channel in (2, 3, 4):  # left, yaw rate, roll rate
        frames[mirrored, :, channel] *= -1.0
    for channels in (slice(0, 3), slice(3, 6)):
        frames[..., channels] *= np.exp(_GAIN_LOG_SD * rng.standard_normal((count, 1, 1)))
    frames += _NOISE * rng.standard_normal(frames.shape)
    frames[..., 0] += _OFFSET_M_S2 * rng.standard_normal((count, 1))
    return frames
