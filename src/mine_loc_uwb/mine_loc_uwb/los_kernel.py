"""The trained network compiled for the processor: a round of a few frames is too little work for torch's machinery.

The same arithmetic as `LosNetwork` in evaluation mode, frame by frame; a test holds the two together.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mine_loc_uwb import los_evidence as evidence
from mine_loc_uwb.cir_input import CHANNELS, EDGE_PER_TAP, EDGE_TAPS, TAPS, LosInput

Floats = NDArray[np.float32]
_CLIP = 2.5


class Weights(NamedTuple):
    """Arrays of float32; layers as (outputs, inputs), those of a convolution with its inputs by channel, then place."""

    convolutions: tuple[tuple[Floats, Floats], ...]
    to_gates: Floats
    again_to_gates: Floats
    gate_bias: Floats
    edge: Floats
    edge_bias: Floats
    side: Floats
    side_bias: Floats
    head: Floats
    head_bias: Floats
    side_mean: Floats
    side_scale: Floats
    temperature: Floats
    with_range: Floats
    without_range: Floats


def weights_of(state: Mapping[str, Any]) -> Weights:
    """Take the weights from a state dictionary of `LosNetwork` (tensors or arrays)."""
    given = {name: np.ascontiguousarray(value, np.float32) for name, value in state.items()}

    def layer(name: str) -> tuple[Floats, Floats]:
        weight = given[f"{name}.weight"]
        return weight.reshape(len(weight), -1), given[f"{name}.bias"]

    return Weights(
        tuple(layer(f"cnn.{number}") for number in (0, 2, 4)),
        given["lstm.weight_ih_l0"],
        given["lstm.weight_hh_l0"],
        given["lstm.bias_ih_l0"] + given["lstm.bias_hh_l0"],
        *layer("edge.0"),
        *layer("side.0"),
        *layer("head"),
        given["side_mean"],
        given["side_scale"],
        given["temperature"],
        given["evidence.with_range"],
        given["evidence.without_range"],
    )


class KernelClassifier:
    """Class probabilities of inputs; made and compiled before the first one."""

    def __init__(self, weights: Weights) -> None:
        self._weights = weights
        self(_nothing(len(weights.side_mean)))

    def __call__(self, given: LosInput) -> NDArray[np.float64]:
        """Probabilities (n, 4) of classes 1 to 4."""
        out = np.empty((len(given), 4))
        for number in range(len(given)):
            _judge(given.profile[number], given.edge[number], given.side[number], self._weights, out[number])
        return out


def _nothing(side: int) -> LosInput:
    profile, edge = np.zeros((1, CHANNELS, TAPS), np.float32), np.zeros((1, EDGE_TAPS * EDGE_PER_TAP), np.float32)
    return LosInput(profile, edge, np.full((1, side), np.nan, np.float32))


@njit(cache=True)
def _judge(profile: Floats, edge: Floats, side: Floats, weights: Weights, out: NDArray[np.float64]) -> None:
    """Write the probabilities (4,) of a frame with profile (channels, taps), edge (e,) and side features (2 f,)."""
    first, second, third = weights.convolutions
    seen = _convolve(profile, first[0], first[1], 5)
    seen = _convolve(seen, second[0], second[1], 5)
    seen = _convolve(seen, third[0], third[1], 3)
    last = _remember(seen, weights)
    edges = np.maximum(np.dot(weights.edge, edge) + weights.edge_bias, np.float32(0.0))
    sides = np.maximum(np.dot(weights.side, _known(side, weights)) + weights.side_bias, np.float32(0.0))
    read = np.dot(weights.head, np.concatenate((last, edges, sides))) + weights.head_bias
    temperature = weights.temperature[1 if math.isnan(side[evidence.POWER]) else 0]
    los = (_evidence(side, weights) + read[0]) / temperature
    out[0] = math.exp(_log_sigmoid(read[1]) + _log_sigmoid(-los))
    out[1] = math.exp(_log_sigmoid(-read[1]) + _log_sigmoid(-los))
    out[2] = math.exp(_log_sigmoid(read[2]) + _log_sigmoid(los))
    out[3] = math.exp(_log_sigmoid(-read[2]) + _log_sigmoid(los))


@njit(cache=True)
def _convolve(given: Floats, weight: Floats, bias: Floats, width: int) -> Floats:
    """Every second place of a convolution of (channels, places) with zeros about it, without what is negative."""
    channels, places = given.shape
    patches = np.zeros((channels * width, places // 2), np.float32)
    for channel in range(channels):
        for tap in range(width):
            for place in range(places // 2):
                source = 2 * place + tap - width // 2
                if 0 <= source < places:
                    patches[channel * width + tap, place] = given[channel, source]
    out: Floats = np.maximum(np.dot(weight, patches) + bias.reshape(-1, 1), np.float32(0.0))
    return out


@njit(cache=True)
def _remember(seen: Floats, weights: Weights) -> Floats:
    """Last output (h,) of the LSTM over places of (channels, places)."""
    size = weights.again_to_gates.shape[1]
    fed = np.dot(weights.to_gates, seen)
    output, cell = np.zeros(size, np.float32), np.zeros(size, np.float32)
    for place in range(seen.shape[1]):
        gates = np.dot(weights.again_to_gates, output) + weights.gate_bias
        for i in range(size):
            enter = _sigmoid(gates[i] + fed[i, place])
            keep = _sigmoid(gates[size + i] + fed[size + i, place])
            value = math.tanh(gates[2 * size + i] + fed[2 * size + i, place])
            cell[i] = keep * cell[i] + enter * value
            output[i] = _sigmoid(gates[3 * size + i] + fed[3 * size + i, place]) * math.tanh(cell[i])
    return output


@njit(cache=True)
def _known(side: Floats, weights: Weights) -> Floats:
    """Side features (2 f,) scaled and clipped, and after them which are missing: (4 f,)."""
    size = len(side)
    known = np.zeros(2 * size, np.float32)
    for i in range(size):
        scaled = (side[i] - weights.side_mean[i]) / weights.side_scale[i]
        if math.isnan(scaled):
            known[size + i] = 1.0
        else:
            known[i] = min(max(scaled, -_CLIP), _CLIP)
    return known


@njit(cache=True)
def _evidence(side: Floats, weights: Weights) -> float:
    """Logit of a line of sight from the powers, 0 where nothing is known; see `los_evidence`."""
    power = math.tanh(side[evidence.POWER] / evidence.POWER_SCALE_DB)
    first = math.tanh((side[evidence.FIRST_POWER] - evidence.FIRST_MIDDLE_DB) / evidence.FIRST_SCALE_DB)
    logit = power * weights.with_range[0] + first * weights.with_range[1] + weights.with_range[2]
    if math.isnan(logit):
        noise = (side[evidence.NOISE] - evidence.NOISE_MIDDLE) / evidence.NOISE_SCALE
        if math.isnan(noise):
            return 0.0
        noise = min(max(noise, -evidence.NOISE_MOST), evidence.NOISE_MOST)
        logit = noise * weights.without_range[0] + weights.without_range[1]
    return float(logit)


@njit(cache=True)
def _sigmoid(value: float) -> float:
    return 1.0 / (1.0 + math.exp(-value))


@njit(cache=True)
def _log_sigmoid(value: float) -> float:
    return min(value, 0.0) - math.log1p(math.exp(-abs(value)))
