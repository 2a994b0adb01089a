"""The measures of positioning: error in the words of ISO/IEC 18305, consistency, availability, latency, modes.

A person's outputs are compared with the truth once (`compare`); measures are then those of one comparison or of several
together, whose errors and latencies are pooled while their availabilities are averaged.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mine_loc_bringup.evaluation.track import Array, Booleans, StepCount, Track, Truth
from mine_loc_core.alignment import Alignment, align, truth_at
from mine_loc_core.consistency import consistent_mean_nees, independent_count, nees, share_interval
from mine_loc_core.error_measures import availability, horizontal_error
from mine_loc_core.stamps import NS_PER_S
from mine_loc_fusion.mode import Mode

MAX_AGE_S = 0.5
"""An output counts as there for so long: the silence after which `fused/poses` must not be trusted."""
SEARCH_S = 10.0
_MOST_OUTPUTS = 2000
"""To find a time offset so many outputs are enough, evenly taken."""
_LEAST_WAY_M = 1.0
_NO_ALIGNMENT = Alignment(0.0, 0.0, np.zeros(2))


@dataclass(frozen=True, slots=True)
class Comparing:
    """How truth is laid under the outputs: by one rigid transform, at the time offset that fits best, or as it is."""

    rigid: bool = False
    apply_time_offset: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """One person's outputs and, where it is known, the truth at their instants (n, 2), NaN where not.

    `time_offset_s`: the truth fits best at an output's stamp plus this; None = cannot be told. `alignment` is what was
    applied. `span_s` is when outputs are due, `times_s` and `logged_s` (n,) are on the same clock.
    """

    person: str
    track: Track
    times_s: Array
    logged_s: Array
    truth_m: Array
    span_s: tuple[float, float]
    alignment: Alignment = _NO_ALIGNMENT
    time_offset_s: float | None = None
    steps: StepCount | None = None
    has_truth: bool = True

    @property
    def due(self) -> bool:
        """Whether outputs are to be expected: some came, or it is known where the person was."""
        return bool(len(self.track)) or self.has_truth

    @property
    def error_m(self) -> Array:
        """Output minus truth (n, 2), NaN where there is no truth."""
        return np.asarray(self.track.position_m - self.truth_m)

    @property
    def distance_m(self) -> Array:
        """Horizontal error (n,), NaN where there is no truth."""
        return np.asarray(np.linalg.norm(self.error_m, axis=1))

    @property
    def scored(self) -> Booleans:
        """Valid outputs with truth."""
        return np.asarray(self.track.valid & np.isfinite(self.truth_m).all(axis=1))


@dataclass(frozen=True, slots=True)
class Measures:
    """Figures of one person or several; None = not measured. Shares are from 0 to 1, intervals hold with 95 %.

    `horizontal_mean_m` to `max_m` are those of valid outputs with truth. NEES of two dimensions; its interval is where
    the mean of an honest estimator lies, given that `independent_errors` are as many as the scored ones are worth.
    """

    outputs: int = 0
    scored: int = 0
    not_finite: int = 0
    backward_stamps: int = 0
    horizontal_mean_m: float | None = None
    rmse_m: float | None = None
    median_m: float | None = None
    third_quartile_m: float | None = None
    ce95_m: float | None = None
    max_m: float | None = None
    claimed_ce95_m: float | None = None
    """Median radius of the claimed 95 % circles."""
    claimed_ce95_holds: float | None = None
    claimed_ce95_holds_low: float | None = None
    claimed_ce95_holds_high: float | None = None
    nees_mean: float | None = None
    nees_low: float | None = None
    nees_high: float | None = None
    independent_errors: float | None = None
    availability: float | None = None
    availability_measured: float | None = None
    first_output_s: float | None = None
    longest_gap_s: float | None = None
    latency_p50_ms: float | None = None
    latency_p99_ms: float | None = None
    time_offset_s: float | None = None
    steps_true: int | None = None
    steps_found: int | None = None
    step_count_error: float | None = None
    """Found minus true, over true."""
    modes: dict[str, float] = field(default_factory=dict)
    """Share of the time in each mode, an output standing until the next, for half a second at most."""


def compare(
    person: str,
    track: Track,
    truth: Truth | None,
    span_ns: tuple[int, int],
    comparing: Comparing,
    steps: StepCount | None = None,
) -> Compared:
    """Lay the truth under a person's outputs. `span_ns`: when there was input; outputs are due then, while truth lasts.

    Raises ValueError where a transform or offset is asked for and truth covers too little of the outputs.
    """
    origin_ns, end_ns = span_ns
    times_s, logged_s = (track.stamp_ns - origin_ns) / NS_PER_S, (track.logged_ns - origin_ns) / NS_PER_S
    span_s = (0.0, (end_ns - origin_ns) / NS_PER_S)
    if truth is None or not len(truth.stamp_ns):
        nowhere = np.full((len(track), 2), np.nan)
        return Compared(person, track, times_s, logged_s, nowhere, span_s, steps=steps, has_truth=False)
    truth_s = (truth.stamp_ns - origin_ns) / NS_PER_S
    times, places_m = times_s[track.valid], track.position_m[track.valid]
    offset_s = _time_offset(times, places_m, truth_s, truth.position_m, comparing) if len(times) else None
    applied_s = (offset_s or 0.0) if comparing.apply_time_offset else 0.0
    alignment = Alignment(applied_s, 0.0, np.zeros(2))
    if comparing.rigid and len(times):
        found = align(times + applied_s, places_m, truth_s, truth.position_m, search_s=0.0)
        alignment = Alignment(applied_s, found.yaw_rad, found.shift_m)
    truth_m = alignment.apply(truth_at(times_s + alignment.time_offset_s, truth_s, truth.position_m))
    due_s = truth_s[[0, -1]] - alignment.time_offset_s
    span_s = (max(float(due_s[0]), span_s[0]), min(float(due_s[1]), span_s[1]))
    return Compared(person, track, times_s, logged_s, truth_m, span_s, alignment, offset_s, steps)


def measure(compared: Sequence[Compared]) -> Measures:
    """Measures of one person, or of several together."""
    tracks = [each.track for each in compared]
    latency_ms = _joined([(each.logged_s - each.times_s)[each.track.measured] * 1e3 for each in compared])
    firsts = [np.maximum(each.logged_s[each.track.valid][:1] - each.span_s[0], 0.0) for each in compared]
    figures: dict[str, float | int | None] = {
        "outputs": sum(map(len, tracks)),
        "not_finite": sum(int((~track.finite).sum()) for track in tracks),
        "backward_stamps": sum(int((np.diff(track.stamp_ns) < 0).sum()) for track in tracks),
        "availability": _availability(compared, [track.valid for track in tracks]),
        "availability_measured": _availability(compared, [track.measured for track in tracks]),
        "first_output_s": max((float(first[0]) for first in firsts if len(first)), default=None),
        "longest_gap_s": max(
            (float(np.diff(each.logged_s).max()) for each in compared if len(each.track) > 1), default=None
        ),
        "latency_p50_ms": float(np.percentile(latency_ms, 50)) if len(latency_ms) else None,
        "latency_p99_ms": float(np.percentile(latency_ms, 99)) if len(latency_ms) else None,
        "time_offset_s": compared[0].time_offset_s if len(compared) == 1 else None,
    }
    figures |= _errors(compared) | _steps(compared)
    known = {name: value for name, value in figures.items() if value is not None and np.isfinite(value)}
    return Measures(**known, modes=_mode_shares(compared))  # type: ignore[arg-type]


def _errors(compared: Sequence[Compared]) -> dict[str, float | int | None]:
    distance_m = _joined([each.distance_m[each.scored] for each in compared])
    if not len(distance_m):
        return {"scored": 0}
    error = horizontal_error(distance_m)
    radius_m = _joined([each.track.ce95_m[each.scored] for each in compared])
    squares = [nees(each.error_m[each.scored], each.track.covariance_m2[each.scored]) for each in compared]
    squares = [each[np.isfinite(each)] for each in squares]
    within = [(each.distance_m <= each.track.ce95_m)[each.scored].astype(float) for each in compared]
    # A circle that always holds or never does not vary; its errors do.
    worth = sum(independent_count(each.distance_m[each.scored]) for each in compared if each.scored.any())
    holds = float(_joined(within).mean())
    holds_in = share_interval(holds, worth)
    found: dict[str, float | int | None] = {
        "scored": error.count,
        "horizontal_mean_m": error.mean_m,
        "rmse_m": error.rmse_m,
        "median_m": error.median_m,
        "third_quartile_m": error.third_quartile_m,
        "ce95_m": error.ce95_m,
        "max_m": error.max_m,
        "claimed_ce95_m": float(np.median(radius_m)),
        "claimed_ce95_holds": holds,
        "claimed_ce95_holds_low": holds_in.low,
        "claimed_ce95_holds_high": holds_in.high,
        "independent_errors": worth,
    }
    if any(map(len, squares)):
        honest = consistent_mean_nees(2, worth)
        found |= {"nees_mean": float(_joined(squares).mean()), "nees_low": honest.low, "nees_high": honest.high}
    return found


def _steps(compared: Sequence[Compared]) -> dict[str, float | int | None]:
    counts = [each.steps for each in compared if each.steps is not None]
    if not counts:
        return {}
    true, found = sum(each.true for each in counts), sum(each.found for each in counts)
    return {"steps_true": true, "steps_found": found, "step_count_error": (found - true) / true if true else None}


def _availability(compared: Sequence[Compared], which: Sequence[Booleans]) -> float | None:
    """The mean over those whose outputs are due."""
    shares = [
        availability(each.logged_s[used], *each.span_s, max_age_s=MAX_AGE_S)
        for each, used in zip(compared, which, strict=True)
        if each.due
    ]
    return float(np.mean(shares)) if shares else None


def _mode_shares(compared: Sequence[Compared]) -> dict[str, float]:
    stood_s: dict[str, float] = defaultdict(float)
    for each in compared:
        held_s = np.clip(np.diff(each.logged_s, append=each.logged_s[-1:] + MAX_AGE_S), 0.0, MAX_AGE_S)
        for number in np.unique(each.track.modes).tolist():
            name = Mode(number).name if number in Mode.__members__.values() else Mode.UNKNOWN.name
            stood_s[name] += float(held_s[each.track.modes == number].sum())
    whole_s = sum(stood_s.values())
    return {name: stood_s[name] / whole_s for name in sorted(stood_s)} if whole_s > 0.0 else {}


def _time_offset(times_s: Array, track_m: Array, truth_s: Array, truth_m: Array, comparing: Comparing) -> float | None:
    """None for who hardly moves, and where the best fit lies at the end of the search or truth covers too little."""
    if float(np.linalg.norm(np.ptp(truth_m, axis=0))) < _LEAST_WAY_M:
        return None
    try:
        found = align(*_thinned(times_s, track_m), truth_s, truth_m, search_s=SEARCH_S, rigid=comparing.rigid)
    except ValueError:
        return None
    return found.time_offset_s if abs(found.time_offset_s) < SEARCH_S - 0.01 else None


def _thinned(times_s: Array, track_m: Array) -> tuple[Array, Array]:
    step = -(-len(times_s) // _MOST_OUTPUTS)
    return times_s[::step], track_m[::step]


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate(parts) if parts else np.empty(0)
