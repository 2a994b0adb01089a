"""Dead reckoning over a recording, and the scores of step instants."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from gait_recordings import RATE_HZ, Array
from pdr_recordings import START_NS, Recording

from mine_loc_core.stamps import to_s
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning, StepEvent
from mine_loc_pdr.step_detector import NetworkStepDetector
from mine_loc_pdr.step_model_file import load_step_model, shipped_step_model
from mine_loc_pdr.steps import StepDetector
from mine_loc_pdr.stride import PendulumStrideModel, StepLengthModel

TOLERANCE_S = 0.15
SEARCH_S = 0.3  # in which lags are looked for, to find the one constant offset
HALT_S = 0.5  # the last strike of a trial falls on its marked end
UNKNOWN_HEIGHT_M = 1.70
_FALSE_FROM_S = 1.0


@dataclass(frozen=True, slots=True)
class Track:
    """What dead reckoning made of a recording; times in s from START_NS."""

    steps: list[StepEvent]
    steps_s: Array
    latency_s: Array  # from the stamp to the sample with which a step was reported
    times_s: Array  # of the headings
    heading_rad: Array  # of the waist, unwrapped


def samples(recording: Recording) -> Iterator[ImuSample]:
    """In order."""
    rows = zip(recording.stamps_ns.tolist(), recording.rate_rad_s.tolist(), recording.force_m_s2.tolist(), strict=True)
    return (ImuSample(stamp_ns, tuple(rate), tuple(force)) for stamp_ns, rate, force in rows)


def shipped_detector() -> NetworkStepDetector:
    """As the node has it."""
    return NetworkStepDetector(load_step_model(shipped_step_model())[0])


def track(recording: Recording, detector: StepDetector, model: StepLengthModel | None = None) -> Track:
    """Push every sample, as the node does."""
    model = model or PendulumStrideModel(recording.height_m or UNKNOWN_HEIGHT_M)
    pdr = PedestrianDeadReckoning(model, detector=detector)
    steps, latency_s, headings = [], [], []
    for sample in samples(recording):
        stamp_ns = sample.stamp_ns
        for step in pdr.push(sample):
            steps.append(step)
            latency_s.append(to_s(stamp_ns - step.stamp_ns))
        if pdr.heading_rad is not None:
            headings.append((to_s(stamp_ns - START_NS), pdr.heading_rad))
    table = np.array(headings)
    return Track(
        steps,
        np.array([to_s(step.stamp_ns - START_NS) for step in steps]),
        np.array(latency_s),
        table[:, 0],
        np.unwrap(table[:, 1]),
    )


def lags(found_s: Sequence[float] | Array, marked_s: Sequence[float] | Array, within_s: float) -> list[float]:
    """found − marked of the pairs, in order and each used once, that lie within `within_s` of each other."""
    pairs, i, j = [], 0, 0
    while i < len(found_s) and j < len(marked_s):
        lag = float(found_s[i] - marked_s[j])
        if abs(lag) <= within_s:
            pairs.append(lag)
        i += lag <= within_s
        j += lag >= -within_s
    return pairs


def offset_s(found: Sequence[Array], marked: Sequence[Array]) -> float:
    """The one constant offset of all: the median lag."""
    pairs = zip(found, marked, strict=True)
    return float(np.median(list(itertools.chain.from_iterable(lags(f, m, SEARCH_S) for f, m in pairs))))


def f1(hits: int, found: int, marked: int) -> float:
    """Harmonic mean of precision and recall; NaN where there is nothing to find."""
    return 2 * hits / (found + marked) if found + marked else math.nan


def inside(times_s: Array, spans: Sequence[tuple[float, ...]], margin_s: float) -> np.ndarray:
    """Mask of the times that lie in a span (begin, end, …), widened by margin_s."""
    mask = np.zeros(len(times_s), dtype=bool)
    for begin, end, *_ in spans:
        mask |= (times_s >= begin - margin_s) & (times_s <= end + margin_s)
    return mask


def false_steps(recording: Recording, steps_s: Array, walking: Sequence[tuple[float, ...]]) -> tuple[int, float]:
    """Steps that lie 1 s or more outside the spans of walking, and the seconds recorded there."""
    at_rest = ~inside(recording.samples_s, walking, _FALSE_FROM_S)
    return int(np.sum(~inside(steps_s, walking, _FALSE_FROM_S))), float(np.sum(at_rest)) / RATE_HZ


def spread(values: Sequence[float] | Array, digits: int = 3) -> dict[str, float]:
    """Mean, standard deviation and largest value."""
    array = np.asarray(values, dtype=float)
    return {
        "mean": round(float(array.mean()), digits),
        "sd": round(float(array.std()), digits),
        "max": round(float(array.max()), digits),
    }
