"""The demonstration's report: error against truth, availability, latency, and what was missed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from mine_loc_bringup.demo.playback import Truth
from mine_loc_core.alignment import Alignment, align, truth_at
from mine_loc_core.error_measures import availability, horizontal_error

Array = npt.NDArray[np.float64]

_MAX_AGE_S = 0.5
_GAP_S = 0.5
_SEARCH_S = 10.0
_COASTING_MODES = {5, 6, 7}  # COASTING, COARSE_ONLY, LOST of mine_loc_interfaces/PersonPose


@dataclass(frozen=True, slots=True)
class Track:
    """What was published for one person: times since the recording's start [s], positions (n, 2) [m], latencies [s]."""

    times_s: Array
    received_s: Array
    positions_m: Array
    ce95_m: Array
    modes: npt.NDArray[np.int64]

    @property
    def measured(self) -> npt.NDArray[np.bool_]:
        """Outputs that rest on a measurement of their instant, not on prediction alone."""
        coasting: npt.NDArray[np.bool_] = ~np.isin(self.modes, list(_COASTING_MODES))
        return coasting


@dataclass(frozen=True, slots=True)
class PersonReport:
    """One person's figures, with the track and the aligned truth (n, 2), NaN where there is none, for the plot."""

    name: str
    figures: Mapping[str, object]
    track: Track
    truth_m: Array


def person_report(name: str, track: Track, truth: Truth, end_s: float) -> PersonReport:
    """Score a track; raises ValueError when nothing was published or truth covers too little of it."""
    if not len(track.times_s):
        raise ValueError(f"{name}: no output was received")
    alignment = _alignment(track, truth)
    truth_m = alignment.apply(
        truth_at(track.times_s + alignment.time_offset_s, truth.times_s, truth.positions_m[:, :2])
    )
    distances = np.linalg.norm(track.positions_m - truth_m, axis=1)
    known = np.isfinite(distances)  # there is truth at that instant
    errors = horizontal_error(distances[known])
    latencies_ms = (track.received_s - track.times_s)[track.measured] * 1e3
    gaps = [(a, b) for a, b in zip(track.received_s, track.received_s[1:], strict=False) if b - a > _GAP_S]
    figures = {
        "availability": availability(track.received_s, 1.0, end_s, max_age_s=_MAX_AGE_S),
        "availability_measured": availability(track.received_s[track.measured], 1.0, end_s, max_age_s=_MAX_AGE_S),
        "outputs": errors.count,
        "horizontal_mean_m": errors.mean_m,
        "rmse_m": errors.rmse_m,
        "median_m": errors.median_m,
        "third_quartile_m": errors.third_quartile_m,
        "ce95_m": errors.ce95_m,
        "max_m": errors.max_m,
        "claimed_ce95_holds": float(np.mean(distances[known] <= track.ce95_m[known])),
        "latency_p50_ms": float(np.percentile(latencies_ms, 50)) if len(latencies_ms) else None,
        "latency_p99_ms": float(np.percentile(latencies_ms, 99)) if len(latencies_ms) else None,
        "gaps_over_half_a_second": [{"at_s": round(float(a), 2), "length_s": round(float(b - a), 2)} for a, b in gaps],
        "modes": {str(mode): count for mode, count in sorted(Counter(track.modes.tolist()).items())},
        "alignment": {
            "time_offset_s": alignment.time_offset_s,
            "yaw_deg": float(np.degrees(alignment.yaw_rad)),
            "shift_m": alignment.shift_m.tolist(),
        },
    }
    return PersonReport(name, figures, track, truth_m)


def together(reports: Sequence[PersonReport]) -> dict[str, object]:
    """All people as one: pooled errors and latencies, mean availability."""
    distances = np.concatenate([np.linalg.norm(r.track.positions_m - r.truth_m, axis=1) for r in reports])
    latencies_ms = 1e3 * np.concatenate([(r.track.received_s - r.track.times_s)[r.track.measured] for r in reports])
    errors = asdict(horizontal_error(distances[np.isfinite(distances)]))
    errors["horizontal_mean_m"] = errors.pop("mean_m")
    return {
        "availability": float(np.mean([float(str(r.figures["availability"])) for r in reports])),
        **errors,
        "latency_p50_ms": float(np.percentile(latencies_ms, 50)) if len(latencies_ms) else None,
        "latency_p99_ms": float(np.percentile(latencies_ms, 99)) if len(latencies_ms) else None,
    }


def plot(reports: Sequence[PersonReport], anchors_m: Array, title: str, file: Path) -> None:
    """Tracks over truth, and the error over time with the claimed 95 % circle."""
    import matplotlib as mpl  # noqa: PLC0415 slow, and only the end of a run needs it

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, (plan, course) = plt.subplots(1, 2, figsize=(13, 5.5), layout="constrained")
    plan.plot(*anchors_m.T[:2], "k^", label="anchors")
    for number, report in enumerate(reports):
        colour = f"C{number}"
        plan.plot(*report.truth_m.T, color="0.6", linewidth=3, label="truth" if not number else None)
        plan.plot(*report.track.positions_m.T, color=colour, linewidth=1, label=report.name)
        error_m = np.linalg.norm(report.track.positions_m - report.truth_m, axis=1)
        course.plot(report.track.times_s, error_m, color=colour, label=f"{report.name}: error")
        course.plot(report.track.times_s, report.track.ce95_m, color=colour, linestyle=":", label="claimed 95 % circle")
    plan.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="track over truth")
    course.set(xlabel="time [s]", ylabel="horizontal [m]", title="error over time", ylim=(0, None))
    for axes in (plan, course):
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    figure.suptitle(title)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def _alignment(track: Track, truth: Truth) -> Alignment:
    if truth.shared_clock_and_frame:
        return Alignment(0.0, 0.0, np.zeros(2))
    return align(track.times_s, track.positions_m, truth.times_s, truth.positions_m[:, :2], search_s=_SEARCH_S)
