"""Rooms of anchors and what a tag in them measures, for the tests of the solvers."""

from collections.abc import Sequence

import numpy as np

from mine_loc_core.stamps import NS_PER_S
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.robust_tracker import RobustTracker
from mine_loc_uwb.tracker_settings import RobustTrackerSettings

ROOM = np.array(
    [[0.0, 0.0, 2.4], [20.0, 0.0, 2.8], [20.0, 15.0, 2.4], [0.0, 15.0, 2.8], [10.0, -2.0, 0.4], [9.0, 17.0, 2.0]]
)
"""Six anchors round a hall, high and low, so that they determine a position in space too."""

LINE = np.column_stack([np.arange(0.0, 50.0, 10.0), np.zeros(5), np.full(5, 2.4)])
"""Anchors along the wall of a gallery: a place and its mirror image behind the wall look the same."""


def distances(anchors: np.ndarray, tag: Sequence[float]) -> np.ndarray:
    return np.linalg.norm(anchors - np.asarray(tag), axis=1)


def measurements(
    at_s: float,
    anchors: np.ndarray,
    ranges: np.ndarray,
    *,
    height_m: float | None,
    sd_m: float = 0.1,
    ids: Sequence[int] | None = None,
    los_probability: float = np.nan,
    shared_offset: bool = False,
) -> Measurements:
    """A round of ranges to anchors of ids 1, 2, …, claiming this standard deviation."""
    count = len(ranges)
    return Measurements(
        stamp_ns=round(at_s * NS_PER_S),
        anchor_ids=np.array(range(1, count + 1) if ids is None else ids, np.uint64),
        anchors_m=np.asarray(anchors, float).reshape(-1, 3),
        range_m=np.asarray(ranges, float),
        variance_m2=np.full(count, sd_m**2),
        since_s=np.zeros(count),
        los_probability=np.full(count, los_probability),
        receive_power_dbm=np.full(count, np.nan),
        height_m=height_m,
        shared_offset=shared_offset,
    )


class Tag:
    """A tag that ranges to anchors with white noise, standing or walking straight on."""

    def __init__(
        self,
        seed: int = 0,
        *,
        anchors: np.ndarray = ROOM,
        start_m: Sequence[float] = (6.0, 5.0, 1.0),
        velocity_m_s: Sequence[float] = (0.0, 0.0, 0.0),
        sd_m: float = 0.05,
        space: bool = False,
    ) -> None:
        self.rng = np.random.default_rng(seed)
        self.anchors, self._start, self._velocity = anchors, np.array(start_m), np.array(velocity_m_s)
        self.sd_m, self.space = sd_m, space

    def at(self, at_s: float) -> np.ndarray:
        return self._start + self._velocity * at_s

    def round(
        self, at_s: float, only: Sequence[int] | None = None, excess: dict[int, float] | None = None
    ) -> Measurements:
        """Ranges to the anchors (places in the array) heard; `excess` is added to some, `only` says which are heard."""
        heard = list(range(len(self.anchors)) if only is None else only)
        ranges = distances(self.anchors[heard], self.at(at_s)) + self.rng.normal(0.0, self.sd_m, len(heard))
        for place, more_m in (excess or {}).items():
            ranges[heard.index(place)] += more_m
        return measurements(
            at_s,
            self.anchors[heard],
            ranges,
            height_m=None if self.space else float(self.at(at_s)[2]),
            sd_m=self.sd_m,
            ids=[place + 1 for place in heard],
        )

    def error_m(self, fix, at_s: float) -> float:
        return float(np.linalg.norm(fix.position_m - self.at(at_s)))


PERIOD_S = 0.1


class Track:
    """A tag and its tracker, round after round."""

    def __init__(self, tag: Tag, settings: RobustTrackerSettings | None = None) -> None:
        self.tag, self.tracker, self.at_s = tag, RobustTracker(settings), 0.0

    def round(self, **what):
        """The next round; see `Tag.round`."""
        self.at_s += PERIOD_S
        return self.tracker.solve(self.tag.round(self.at_s, **what))

    def play(self, seconds: float, **what):
        """Rounds for so long; the last solution."""
        for _ in range(round(seconds / PERIOD_S)):
            solution = self.round(**what)
        return solution

    def silence(self, seconds: float) -> None:
        self.at_s += seconds

    def error_m(self, solution) -> float:
        return self.tag.error_m(solution.fix, self.at_s)

    def pretending(self, place, who) -> dict[int, float]:
        """The excess with which these anchors agree that the tag is at another place."""
        here, there = (distances(self.tag.anchors, at) for at in (self.tag.at(self.at_s + PERIOD_S), place))
        return {anchor: float((there - here)[anchor]) for anchor in who}


def tracked(seed=0, seconds=3.0, **tag):
    track = Track(Tag(seed, **tag))
    track.play(seconds)
    return track


def is_covariance(matrix: np.ndarray) -> bool:
    """Finite, symmetric and positive semi-definite, to rounding."""
    if not (np.isfinite(matrix).all() and np.allclose(matrix, matrix.T, rtol=1e-9, atol=1e-15)):
        return False
    return bool(np.linalg.eigvalsh(matrix)[0] >= -1e-9 * max(1e-6, np.abs(matrix).max()))


def sd_m(fix) -> float:
    return float(np.sqrt(np.trace(fix.covariance_m2)))
