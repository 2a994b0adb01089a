"""Scenes of paper E's setting for bench/coarse.py: monitors and nodes anywhere in a field, reports as they arrive."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.region_radius import region_radius_m
from mine_loc_core.site import Monitor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import bearing_constants as bc
from mine_loc_sim.bearing_emulator import BearingEmulator, MonitorErrors
from mine_loc_sim.random_walk import RandomWalk

Array = NDArray[np.float64]
SIDE_M = 15_000.0
MONITORS = 8
ROUNDS = 12
NODES = (10, 15, 20, 25)
SHARP_M = 500.0
"""Nodes whose geometry predicts a CE95 up to this are those of `nodes.<n>`."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What arrived, and the truth for scoring: positions (n, 2) at `now_ns`, channels (n,).

    `heard_by` (n,) is how many monitors a node was in range of for at least half of the rounds, `predicted_ce95_m` (n,)
    the CE95 of one round of unbiased bearings from these (Cramér-Rao), infinite for fewer than two.
    """

    monitors: tuple[Monitor, ...]
    sent: tuple[tuple[int, BearingReport], ...]
    now_ns: int
    position_m: Array
    channel: NDArray[np.int64]
    heard_by: NDArray[np.int64]
    predicted_ce95_m: Array


def draw_scene(
    seed: int, nodes: int, *, rounds: int = ROUNDS, monitors: int = MONITORS, bias_deg: float = 0.0
) -> Scene:
    """Draw a scene. It ends when the last report of the last round must have come; then the situation is formed.

    With more monitors the field is larger, so that their density stays. `bias_deg` is the size of each monitor's
    constant error, its sign is drawn.
    """
    rng = np.random.default_rng([seed, nodes, monitors])
    high_m = np.full(2, SIDE_M * math.sqrt(monitors / MONITORS))
    places_m = rng.uniform(0.0, high_m, (monitors, 2))
    placed = tuple(Monitor(number + 1, (*place, 2.5)) for number, place in enumerate(places_m.tolist()))
    end_ns = rounds * bc.ROUND_NS
    now_ns = end_ns + bc.LONGEST_DELAY_NS
    walks = {str(node): RandomWalk(rng, np.zeros(2), high_m, now_ns / NS_PER_S) for node in range(nodes)}
    signs = rng.choice([-1.0, 1.0], monitors)
    errors = MonitorErrors(bias_rad={m.id: math.radians(bias_deg) * s for m, s in zip(placed, signs, strict=True)})
    emulator = BearingEmulator(placed, walks, errors, rng)
    sent, truth = emulator.play(now_ns + 1)
    arrivals = [each for reports in sent.values() for each in reports if each[1].stamp_ns < end_ns]
    heard = np.zeros((nodes, monitors))
    for bearing in truth:
        if bearing.stamp_ns < end_ns:
            heard[int(bearing.emitter), bearing.monitor_id - 1] += 1
    in_range = heard >= rounds / 2.0
    position_m = np.vstack([walk(np.array([now_ns]))[:, :2] for walk in walks.values()])
    return Scene(
        placed,
        tuple(sorted(arrivals, key=lambda each: each[0])),
        now_ns,
        position_m,
        np.array(list(emulator.channels.values())),
        in_range.sum(axis=1),
        np.array([_ce95_m(place, places_m[own]) for place, own in zip(position_m, in_range, strict=True)]),
    )


def channel_of(frequency_hz: Array) -> NDArray[np.int64]:
    """Channel numbers of frequencies."""
    numbers: NDArray[np.int64] = np.floor((frequency_hz - bc.FIRST_CHANNEL_HZ) / bc.CHANNEL_SPACING_HZ).astype(int)
    return numbers


def _ce95_m(position_m: Array, places_m: Array) -> float:
    """95 % radius by the Fisher information of one bearing from each place."""
    way_m = position_m - places_m
    across = np.stack([-way_m[:, 1], way_m[:, 0]], axis=1) / np.sum(way_m**2, axis=1, keepdims=True)
    information = across.T @ across / bc.NOISE_SD_RAD**2
    if len(places_m) < 2 or np.linalg.cond(information) > 1e12:
        return math.inf
    return float(region_radius_m(np.linalg.inv(information)[None], 0.95)[0])
