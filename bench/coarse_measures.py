"""The measures of bench/coarse.py; docs/coarse.md defines them in the paper's words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from coarse_methods import Answer, Initial
from coarse_scenes import SHARP_M, Scene, channel_of
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mine_loc_coarse.settings import CoarseSettings

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
NEAR_M = 500.0
"""The paper's region: a point counts as a node's when it is within this, or within its own 99.9 % circle."""
CLEAR_M = 500.0
RANGE_M = CoarseSettings().communication_range_m
_FAR = 1e9


@dataclass(frozen=True, slots=True)
class Score:
    """One scene: per node (n,) error (NaN = not found), radius, whether held, number of regions that hold it; sets."""

    error_m: Array
    radius_m: Array
    held: Flags
    holding_wide: NDArray[np.int64]
    holding: NDArray[np.int64]
    true_near: Flags
    told_near: Flags
    distance_m: Array
    informed: Flags
    initial: int
    ghosts: int
    ghosts_of_nodes: int
    ambiguous: int
    seconds: float
    cpu_seconds: float
    nodes: Flags
    all_nodes: Flags


def score(scene: Scene, answer: Answer, initial: Initial) -> Score:
    """Match what was stated to the truth, one to one on the same channel, by the least sum of distances."""
    channel = channel_of(answer.frequency_hz)
    same = scene.channel[:, None] == channel
    away_m = np.hypot(*(scene.position_m[:, None] - answer.position_m).transpose(2, 0, 1))
    may = same & (away_m <= np.maximum(NEAR_M, answer.wide_m))
    count = len(scene.channel)
    rows, columns = linear_sum_assignment(np.where(may, away_m, _FAR))
    matched = np.full(count, -1)
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        if may[row, column]:
            matched[row] = column
    found = matched >= 0
    index = np.where(found, matched, 0)
    padded = answer.position_m if len(answer.position_m) else np.full((1, 2), np.nan)
    error_m = np.where(found, np.hypot(*(padded[index] - scene.position_m).T), np.nan)
    radius_m = np.where(found, np.append(answer.radius_m, np.nan)[index], np.nan)
    told_near = np.zeros((count, count), bool)
    pairs = np.ix_(np.flatnonzero(found), np.flatnonzero(found))
    told_near[pairs] = answer.neighbours[np.ix_(matched[found], matched[found])]
    distance_m = np.hypot(*(scene.position_m[:, None] - scene.position_m).transpose(2, 0, 1))
    ghosts = len(answer.frequency_hz) - int(found.sum())
    hearable = scene.heard_by >= 2
    sharp = hearable & (scene.predicted_ce95_m <= SHARP_M)
    return Score(
        error_m,
        radius_m,
        error_m <= radius_m,
        np.sum(same & (away_m <= answer.wide_m), axis=1),
        np.sum(same & (away_m <= answer.radius_m), axis=1),
        distance_m <= RANGE_M,
        told_near,
        distance_m,
        _informed(scene, initial),
        len(initial.emission),
        ghosts,
        ghosts - _misplaced(scene, channel, matched, hearable & ~sharp),
        answer.ambiguous,
        answer.seconds,
        answer.cpu_seconds,
        sharp,
        hearable,
    )


def _misplaced(scene: Scene, channel: NDArray[np.int64], matched: NDArray[np.int64], others: Flags) -> int:
    """Unmatched regions on the channels of unmatched nodes outside `nodes`, one a node: theirs, in a wrong place."""
    free = np.ones(len(channel), bool)
    free[matched[matched >= 0]] = False
    count = 0
    for node in np.flatnonzero(others & (matched < 0)).tolist():
        own = np.flatnonzero(free & (channel == scene.channel[node]))
        if len(own):
            free[own[0]] = False
            count += 1
    return count


def _informed(scene: Scene, initial: Initial) -> Flags:
    """Nodes (n,) of which the initial set holds the key information: a crossing on their channel near them."""
    if not len(initial.emission):
        return np.zeros(len(scene.channel), bool)
    channel = channel_of(initial.emission_hz[initial.emission])
    away_m = np.hypot(*(scene.position_m[:, None] - initial.position_m).transpose(2, 0, 1))
    near: Flags = np.any((scene.channel[:, None] == channel) & (away_m <= NEAR_M), axis=1)
    return near


def summary(scores: Sequence[Score], which: str) -> dict[str, Any]:
    """The measures over scenes, of the set of nodes `which`."""
    chosen = [getattr(each, which) for each in scores]
    error_m = np.concatenate([each.error_m[own] for each, own in zip(scores, chosen, strict=True)])
    found = np.isfinite(error_m)
    one_wide = np.concatenate([each.holding_wide[own] == 1 for each, own in zip(scores, chosen, strict=True)])
    one = np.concatenate([each.holding[own] == 1 for each, own in zip(scores, chosen, strict=True)])
    held = np.concatenate([each.held[own] for each, own in zip(scores, chosen, strict=True)])[found]
    radius_m = np.concatenate([each.radius_m[own] for each, own in zip(scores, chosen, strict=True)])[found]
    informed = np.concatenate([each.informed[own] for each, own in zip(scores, chosen, strict=True)])
    clear, every = _topology(scores, chosen)
    redundant = sum(max(each.initial - int(each.informed.sum()), 0) for each in scores)
    ghosts = np.array([each.ghosts if which == "all_nodes" else each.ghosts_of_nodes for each in scores], float)
    seconds = np.array([each.seconds for each in scores])
    means_m = np.array(
        [np.nanmean(e.error_m[own]) for e, own in zip(scores, chosen, strict=True) if np.isfinite(e.error_m[own]).any()]
    )
    figures: dict[str, Any] = {
        "scenes": len(scores),
        "count": len(error_m),
        "share": float(np.mean(np.concatenate(chosen))),
        "time_s": float(np.median(seconds)),
        "time_p95_s": float(np.percentile(seconds, 95)),
        "cpu_time_s": float(np.median([each.cpu_seconds for each in scores])),
        "cpu_time_p95_s": float(np.percentile([each.cpu_seconds for each in scores], 95)),
        "error_m": float(error_m[found].mean()),
        "error_m_sd_over_scenes": float(means_m.std(ddof=1)),
        "error_ce95_m": float(np.percentile(error_m[found], 95)),
        "region_radius_m": float(np.median(radius_m)),
        "ghosts_per_scene": float(ghosts.mean()),
        "ghosts_per_scene_ci95": poisson_interval(int(ghosts.sum()), len(scores)),
        "ambiguous_per_scene": float(np.mean([each.ambiguous for each in scores])),
        "redundancy_removed": 1.0 - float(ghosts.sum()) / redundant,
    }
    shares = {
        "containment": held,
        "found": found,
        "position_prediction_accuracy": one_wide,
        "position_prediction_accuracy_95": one,
        "topology_accuracy": clear,
        "topology_accuracy_all_pairs": every,
        "key_information_kept": found[informed],
    }
    for name, flags in shares.items():
        figures[name] = float(np.mean(flags))
        figures[f"{name}_ci95"] = wilson_interval(int(np.sum(flags)), len(flags))
    return figures


def _topology(scores: Sequence[Score], chosen: Sequence[Flags]) -> tuple[Flags, Flags]:
    """Whether each pair is told rightly to be near or not: pairs clear of the range, and all."""
    clear, every = [], []
    for each, own in zip(scores, chosen, strict=True):
        i, j = np.triu_indices(int(own.sum()), 1)
        numbers = np.flatnonzero(own)
        i, j = numbers[i], numbers[j]
        right = each.true_near[i, j] == each.told_near[i, j]
        every.append(right)
        clear.append(right[np.abs(each.distance_m[i, j] - RANGE_M) > CLEAR_M])
    return np.concatenate(clear), np.concatenate(every)


def wilson_interval(successes: int, trials: int) -> list[float]:
    """95 % interval of a share (Wilson)."""
    if not trials:
        return [0.0, 1.0]
    z2 = 1.96**2
    middle = (successes + z2 / 2.0) / (trials + z2)
    half = 1.96 * np.sqrt(successes * (trials - successes) / trials + z2 / 4.0) / (trials + z2)
    return [float(max(middle - half, 0.0)), float(min(middle + half, 1.0))]


def poisson_interval(events: int, trials: int) -> list[float]:
    """95 % interval of a rate (Garwood)."""
    from scipy.stats import chi2  # noqa: PLC0415 used once a row

    low = chi2.ppf(0.025, 2 * events) / 2.0 if events else 0.0
    return [float(low / trials), float(chi2.ppf(0.975, 2 * events + 2) / 2.0 / trials)]
