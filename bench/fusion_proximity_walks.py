"""People on foot past a standing vehicle: who comes into its danger zone, who only passes, and what is ranged.

They walk as bench/uwb_scenes/approaches.yaml says, at `loading_place` (six anchors on the walls) or round
`vehicle` (six on the machine).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from uwb_paper_c import LAW, Run, anchors_of, through_channel, with_spikes
from uwb_tracks import Array

from mine_loc_core.site import Site, load_site
from mine_loc_fusion.zone_shape import ZoneShape, outline

SCENES = Path(__file__).parent / "uwb_scenes"
APPROACHES: dict[str, Any] = yaml.safe_load((SCENES / "approaches.yaml").read_text("utf-8"))
DANGER = ZoneShape(outline(*APPROACHES["body_m"]), APPROACHES["danger_m"])
SITES = {name: load_site(SCENES / name) for name in ("loading_place", "vehicle")}
Place = Literal["loading_place", "vehicle"]
Channel = Literal["spikes", "obstacles"]
_OFF_OBSTACLES_M = 0.4
_FINE_S = 0.005


@dataclass(frozen=True, slots=True)
class Walks:
    """`n` walks of at most `k` rounds: instants and true distance from the danger zone, negative inside, (n, k), NaN
    after the end of a walk; when the person comes into the zone and is out of it again (n,), NaN = never; the ranges.
    """

    times_s: Array
    distance_m: Array
    entered_s: Array
    left_s: Array
    runs: tuple[Run, ...]
    anchors_m: Array


def walks(seeds: Sequence[int], place: Place, channel: Channel) -> Walks:
    """Two walks a seed: into the zone, and by it."""
    made = [_walk(seed, place, channel, into=into) for seed in seeds for into in (True, False)]
    longest = max(len(run.truth_m) for run, _, _ in made)
    times_s, distance_m = (np.full((len(made), longest), np.nan) for _ in range(2))
    for row, (run, _, _) in enumerate(made):
        count = len(run.truth_m)
        times_s[row, :count] = LAW["period_s"] * np.arange(count)
        distance_m[row, :count] = DANGER.signed_distance_m(run.truth_m)
    entered_s, left_s = (np.array([crossed[which] for _, *crossed in made]) for which in range(2))
    return Walks(times_s, distance_m, entered_s, left_s, tuple(run for run, _, _ in made), anchors_of(SITES[place]))


def _walk(seed: int, place: Place, channel: Channel, *, into: bool) -> tuple[Run, float, float]:
    """What is ranged, and when the person comes into the zone and leaves it [s] (NaN = never)."""
    rng, site, way_m = np.random.default_rng([seed, into]), SITES[place], APPROACHES["way_m"]
    speed_m_s = rng.uniform(*APPROACHES["speed_m_s"])
    start_m, course = _clear_line(rng, APPROACHES["into_m" if into else "by_m"], way_m, site)
    along = np.array([np.cos(course), np.sin(course)])
    lasts_s = 2.0 * way_m / speed_m_s

    def at(times_s: Array) -> Array:
        return np.asarray(start_m + speed_m_s * times_s[:, None] * along)

    truth_m = at(np.arange(0.0, lasts_s, LAW["period_s"]))
    if channel == "spikes":
        run = with_spikes(truth_m, rng, anchors_m=anchors_of(site))
    else:
        run = through_channel(truth_m, np.full(len(truth_m), course), rng, site)
    fine_s = np.arange(0.0, lasts_s, _FINE_S)
    inside_s = fine_s[DANGER.signed_distance_m(at(fine_s)) <= 0.0]
    return (run, float(inside_s[0]), float(inside_s[-1])) if len(inside_s) else (run, np.nan, np.nan)


def _clear_line(rng: np.random.Generator, nearest_m: Sequence[float], way_m: float, site: Site) -> tuple[Array, float]:
    """Start and course of a straight way that passes the body at such a distance and goes through no obstacle."""
    obstacles = [ZoneShape(np.array(obstacle.polygon_m, dtype=float)) for obstacle in site.obstacles]
    points_m = np.linspace(-way_m, way_m, 301)[:, None]
    while True:
        course, side = rng.uniform(-np.pi, np.pi), rng.choice((-1.0, 1.0))
        along = np.array([np.cos(course), np.sin(course)])
        aside = side * np.array([-along[1], along[0]])
        half_m = 0.5 * float(np.abs(aside) @ np.array(APPROACHES["body_m"]))  # the body reaches so far to this side
        line_m = (half_m + rng.uniform(*nearest_m)) * aside + points_m * along
        if all(np.min(shape.signed_distance_m(line_m)) > _OFF_OBSTACLES_M for shape in obstacles):
            return line_m[0], course
