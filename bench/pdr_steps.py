"""Step counts and instants: the network of the other people, against paper B's detector and a peak counter."""

import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from gait_recordings import RATE_HZ, Array
from pdr_recordings import Recording
from pdr_tracks import (
    HALT_S,
    SEARCH_S,
    TOLERANCE_S,
    f1,
    false_steps,
    inside,
    lags,
    offset_s,
    shipped_detector,
    spread,
    track,
)
from scipy.signal import butter, find_peaks, sosfiltfilt

from mine_loc_pdr.step_detector import NetworkStepDetector, StepModel
from mine_loc_pdr.step_kernel import Floats
from mine_loc_pdr.steps import PeakStepDetector, StepThresholds

THRESHOLDS = (0.15, 0.2, 0.25, 0.3, 0.35)  # of the network's probability, in rhythm
ADAPTING_GRID = tuple(
    StepThresholds(start_peak_m_s2=start, peak_share=share, weak_peak_m_s2=weak)
    for start, share, weak in itertools.product((0.8, 1.0, 1.2), (0.1, 0.2, 0.3), (0.02, 0.04, 0.08, float("inf")))
)
NO_WEAK = {"weak_peak_m_s2": float("inf")}
FIXED_GRID = tuple(
    StepThresholds(start, start, 0.0, valley, **NO_WEAK)
    for start, valley in itertools.product((0.2, 0.4, 0.6, 0.8), (0.05, 0.1, 0.2, 0.4))
)
Found = Sequence[Array]


def peak_counter(recording: Recording) -> Array:
    """Peaks of the band-passed magnitude, at least 0.3 s apart; not causal."""
    times_s = recording.samples_s
    grid_s = np.arange(times_s[0], times_s[-1], 1.0 / RATE_HZ)
    magnitude = np.interp(grid_s, times_s, np.linalg.norm(recording.force_m_s2, axis=1))
    band = butter(2, [0.5, 3.0], "bandpass", fs=RATE_HZ, output="sos")
    peaks, _ = find_peaks(sosfiltfilt(band, magnitude - magnitude.mean()), height=0.5, distance=int(0.3 * RATE_HZ))
    return grid_s[peaks]


def in_trial(times_s: Array, recording: Recording) -> Array:
    """Those between the marked boundaries of the trial."""
    return times_s[inside(times_s, recording.bouts, HALT_S)]


def count_error_pct(found: Array, marked: Array) -> float:
    """Absolute, of one recording."""
    return 100.0 * abs(len(found) - len(marked)) / len(marked)


def _loss(found: Found, recordings: Sequence[Recording]) -> float:
    """What the choice on the training people goes by: count error and missing F1, both in per cent."""
    marked = [in_trial(r.strikes_s, r) for r in recordings]
    own = [in_trial(f, r) for f, r in zip(found, recordings, strict=True)]
    late = offset_s(own, marked)
    hits = sum(len(lags(f - late, m, TOLERANCE_S)) for f, m in zip(own, marked, strict=True))
    errors = [count_error_pct(f, m) for f, m in zip(own, marked, strict=True)]
    return float(np.mean(errors)) + 100.0 * (1.0 - f1(hits, sum(map(len, own)), sum(map(len, marked))))


def held_out(recordings: Sequence[Recording], candidates: Mapping[Any, Found]) -> tuple[Found, dict[str, Any]]:
    """For each person the candidate that does best on the others, less the offset found on the others; and which."""
    result: dict[int, Array] = {}
    chosen: dict[str, Any] = {}
    for person in dict.fromkeys(r.person for r in recordings):
        others = [i for i, r in enumerate(recordings) if r.person != person]
        seen = [recordings[i] for i in others]
        best = min(candidates, key=lambda c: _loss([candidates[c][i] for i in others], seen))
        chosen[person] = best
        late = offset_s([candidates[best][i] for i in others], [r.strikes_s for r in seen])
        result |= {i: candidates[best][i] - late for i, r in enumerate(recordings) if r.person == person}
    return [result[i] for i in range(len(recordings))], chosen


def score(recordings: Sequence[Recording], found: Found) -> dict[str, Any]:
    """Within the trials, and over the whole recordings against all marks."""
    rows: dict[str, Any] = {}
    for name, cut in (("", in_trial), ("_whole_recording", lambda times, _: times)):
        own = [cut(f, r) for f, r in zip(found, recordings, strict=True)]
        marked = [cut(r.strikes_s, r) for r in recordings]
        hits = sum(len(lags(f, m, TOLERANCE_S)) for f, m in zip(own, marked, strict=True))
        total, true = sum(map(len, own)), sum(map(len, marked))
        rows[f"step_count_error{name}_pct"] = spread([count_error_pct(f, m) for f, m in zip(own, marked, strict=True)])
        rows[f"step_f1{name}"] = round(f1(hits, total, true), 4)
        rows[f"steps{name}"] = {"found": total, "marked": true, "matched": hits}
    return rows


def ipol(recordings: Sequence[Recording], weights: Mapping[str, Floats]) -> tuple[dict[str, Any], list[StepModel]]:
    """All that is chosen or learnt comes from the other people; also the model so found for each recording.

    The one number of the threshold is chosen by how networks do that have seen the person it is for, though not those
    that they are scored on.
    """

    def peaks(grid: Sequence[StepThresholds]) -> dict[str, Found]:
        return {_name(t): [track(r, PeakStepDetector(t)).steps_s for r in recordings] for t in grid}

    tracks = {
        t: [track(r, NetworkStepDetector(StepModel(weights[r.person], t))) for r in recordings] for t in THRESHOLDS
    }
    ours, best = held_out(recordings, {t: [each.steps_s for each in own] for t, own in tracks.items()})
    latency = np.concatenate([tracks[best[r.person]][i].latency_s for i, r in enumerate(recordings)])
    adapting, _ = held_out(recordings, peaks(ADAPTING_GRID))
    fixed, _ = held_out(recordings, peaks(FIXED_GRID))
    counter, _ = held_out(recordings, {"": [peak_counter(r) for r in recordings]})
    rows = score(recordings, ours) | {
        "thresholds_chosen": {str(t): count for t, count in Counter(best.values()).items()},
        "shipped_on_people_it_learnt_of": score(recordings, [track(r, shipped_detector()).steps_s for r in recordings]),
        "adapting_thresholds": score(recordings, adapting),
        "paper_b_fixed_thresholds": score(recordings, fixed),
        "peak_counter": score(recordings, counter),
        "latency_s": {f"p{q}": round(float(np.percentile(latency, q)), 3) for q in (50, 95, 99, 100)},
    }
    return rows, [StepModel(weights[r.person], best[r.person]) for r in recordings]


def _name(thresholds: StepThresholds) -> str:
    default = asdict(StepThresholds())
    return ", ".join(f"{k} {v}" for k, v in asdict(thresholds).items() if v != default[k]) or "defaults"


def oxford(recordings: Sequence[Recording]) -> dict[str, Any]:
    """Counts of the device beside. Phones have no gyro: the detector is the one that needs none, as chosen on ipol."""

    def errors(found: Callable[[Recording], Array]) -> dict[str, float]:
        return {r.name: 100.0 * (len(found(r)) - r.counted) / r.counted for r in recordings if r.counted}

    ours, counter = errors(lambda r: track(r, PeakStepDetector()).steps_s), errors(peak_counter)
    network = errors(lambda r: track(r, shipped_detector()).steps_s)
    paper_b = replace(StepThresholds(), peak_share=0.0, **NO_WEAK)
    fixed = errors(lambda r: track(r, PeakStepDetector(paper_b)).steps_s)
    return {
        "step_count_error_pct": spread(np.abs(list(ours.values()))),
        "per_file_pct": {name: round(value, 2) for name, value in ours.items()},
        "network": {"step_count_error_pct": spread(np.abs(list(network.values())))},
        "paper_b_fixed_thresholds": {"step_count_error_pct": spread(np.abs(list(fixed.values())))},
        "peak_counter": {"step_count_error_pct": spread(np.abs(list(counter.values())))},
    }


def mobgap(recordings: Sequence[Recording]) -> dict[str, Any]:
    """Contacts within the reference's bouts; false steps 1 s or more outside what either reference saw as walking."""
    return {
        **_mobgap(recordings, lambda r: track(r, shipped_detector()).steps_s),
        "adapting_thresholds": _mobgap(recordings, lambda r: track(r, PeakStepDetector()).steps_s),
        "peak_counter": _mobgap(recordings, peak_counter),
    }


def _mobgap(recordings: Sequence[Recording], find: Callable[[Recording], Array]) -> dict[str, Any]:
    found = [find(r) for r in recordings]
    late = offset_s(found, [r.strikes_s for r in recordings])
    hits = total = false = 0
    rest_s = 0.0
    for steps, recording in zip(found, recordings, strict=True):
        own = (steps - late)[inside(steps - late, recording.bouts, SEARCH_S)]
        hits += len(lags(own, recording.strikes_s, TOLERANCE_S))
        total += len(own)
        false_here, rest_here_s = false_steps(recording, steps - late, recording.active)
        false, rest_s = false + false_here, rest_s + rest_here_s
    marked = sum(len(r.strikes_s) for r in recordings)
    return {
        "step_f1": round(f1(hits, total, marked), 4),
        "steps": {"found": total, "marked": marked, "matched": hits},
        "false_steps_per_min": round(60.0 * false / rest_s, 2),
        "rest_s": round(rest_s),
    }
