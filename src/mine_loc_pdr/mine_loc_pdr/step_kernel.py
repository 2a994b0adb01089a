"""The trained step network compiled for one person's stream: 50 frames a second are too little work for torch.

The same arithmetic as `StepNetwork`, frame by frame; what the convolutions reach back to is kept in rings. A test holds
the two together.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mine_loc_pdr.step_frames import CHANNELS

Floats = NDArray[np.float32]

WIDTH = 16
TAPS = 5
DILATIONS = (1, 2, 4, 8)
SCALE = np.array([3.0, 3.0, 3.0, 1.0, 1.0, 1.0], np.float32)  # of the channels: m/s² and rad/s
REACH = 1 + (TAPS - 1) * sum(DILATIONS)  # frames that one output sees
_LAYERS = len(DILATIONS)
_RINGS = tuple((TAPS - 1) * dilation + 1 for dilation in DILATIONS)
_LONGEST = max(_RINGS)


def weights_of(state: Mapping[str, Any]) -> Floats:
    """Flatten a state dictionary of `StepNetwork` (tensors or arrays) into the order in which the kernel reads it."""
    parts = []
    for layer in range(_LAYERS):
        kernel = np.asarray(state[f"layers.{layer}.weight"], np.float32)  # (outputs, inputs, taps)
        parts += [kernel.transpose(2, 1, 0).ravel(), np.asarray(state[f"layers.{layer}.bias"], np.float32)]
    parts += [np.asarray(state["head.weight"], np.float32).ravel(), np.asarray(state["head.bias"], np.float32)]
    return np.concatenate(parts)


WEIGHTS = TAPS * WIDTH * (CHANNELS + (_LAYERS - 1) * WIDTH) + _LAYERS * WIDTH + WIDTH + 1


class StepStream:
    """Logits of a heel strike, frame by frame."""

    def __init__(self, weights: Floats) -> None:
        """`weights` (WEIGHTS,) as `weights_of` makes them."""
        self._weights = weights
        self._rings = np.zeros((_LAYERS, _LONGEST, WIDTH), np.float32)
        self._frame = 0
        self.push(np.zeros(CHANNELS))  # compiled before the first frame is waiting
        self.reset()

    def reset(self) -> None:
        """Forget the frames so far."""
        self._rings[:] = 0.0
        self._frame = 0

    def push(self, frame: NDArray[np.float64]) -> float:
        """Take a frame (CHANNELS,) and return its logit."""
        logit = _advance(self._weights, self._rings, self._frame, frame)
        self._frame += 1
        return logit


@njit(cache=True, fastmath=True)
def _advance(weights: Floats, rings: Floats, number: int, frame: NDArray[np.float64]) -> float:
    """Carry every layer on by the frame `number`, whose inputs are kept in rings (layers, places, width)."""
    values = np.empty(WIDTH, np.float32)
    for c in range(CHANNELS):
        values[c] = np.float32(frame[c]) / SCALE[c]
    inputs, at = CHANNELS, 0
    for layer in range(_LAYERS):
        places = _RINGS[layer]
        ring = rings[layer]
        now = number % places
        for i in range(inputs):
            ring[now, i] = values[i]
        out = weights[at + TAPS * inputs * WIDTH : at + (TAPS * inputs + 1) * WIDTH].copy()
        for tap in range(TAPS):
            then = ring[(now + 1 + tap * DILATIONS[layer]) % places]
            for i in range(inputs):
                value = then[i]
                row = at + (tap * inputs + i) * WIDTH
                for o in range(WIDTH):
                    out[o] += weights[row + o] * value
        at += (TAPS * inputs + 1) * WIDTH
        for o in range(WIDTH):
            seen = max(out[o], np.float32(0.0))
            values[o] = seen + values[o] if layer else seen
        inputs = WIDTH
    logit = weights[at + WIDTH]
    for o in range(WIDTH):
        logit += weights[at + o] * values[o]
    return float(logit)
