"""Paper D's setting: blinks of one tag on a straight walk, heard by three anchors through CM7 or CM8.

Every reception goes through the simulator's full chain: channel response, accumulator, leading edge, registers. `cm7`
is the clear channel of INDUSTRIAL. In `cm8` the clear channel itself is CM8, so that every link is the standard's
industrial channel without line of sight, at all places and times: paper D's own special case, harsher than a gallery,
where some anchor is usually in sight. Nobody's body is in the way. Time differences are those of `tdoa_blink`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.site import Site, load_site
from mine_loc_sim.mine import LinkGeometry
from mine_loc_sim.radio_constants import CM8, INDUSTRIAL, Environment
from mine_loc_sim.ranging_link import Radios, TagLinks
from mine_loc_sim.site_mine import mine_of
from mine_loc_sim.tdoa_blink import AnchorSync, range_differences
from mine_loc_sim.wearer import Wearer
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.received_power import los_probability_from_powers, odds_of_power_rule, uncompress_dbm

Reals = NDArray[np.float64]
Scene = Literal["triangle", "gallery"]
Channel = Literal["cm7", "cm8"]
SCENES: tuple[Scene, ...] = ("triangle", "gallery")
ENVIRONMENTS: dict[str, Environment] = {"cm7": INDUSTRIAL, "cm8": Environment(CM8, CM8)}
HERE = Path(__file__).parent
SPEED_M_PER_S, RATE_HZ, SECONDS = 1.0, 20, 12
WHITE_SD_M = 0.03
"""White noise that arrivals claim: what a link at rest shows (hardware table D.1); neither channel is in it."""
_NOBODY = Wearer(loss_db=0.0, delay_m=0.0)
_ROUNDS_AT_A_TIME = 10


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """One seed's blinks: what was measured and where the tag truly was, (n, 3)."""

    blinks: Sequence[Measurements]
    truth_m: Reals
    anchors_m: Reals
    late_m: Reals  # (n, anchors), truth: how late each arrival is, NaN = not heard
    level_dbm: Reals  # (n, anchors), uncompressed


@cache
def paper_d_runs(scene: Scene, channel: Channel, seed: int) -> Walk:
    """Blinks of one walk, the same for the same arguments; some tenths of a second to make."""
    site = load_site(HERE / "uwb_scenes" / scene)
    anchors_m = np.array([anchor.position_m for anchor in site.anchors])
    table = _simulate(site, anchors_m, scene, channel, seed)
    ids = np.array([anchor.id for anchor in site.anchors], np.uint64)
    blinks = [_blink(number, row, ids, anchors_m, site.tag_height_m) for number, row in enumerate(table)]
    late_m = table[..., 3] + table[..., 6] - np.linalg.norm(table[..., :3] - anchors_m, axis=2)
    level_dbm = np.full(late_m.shape, np.nan)
    for number, blink in enumerate(blinks):
        level_dbm[number, np.isin(ids, blink.anchor_ids)] = blink.receive_power_dbm
    return Walk(blinks, table[:, 0, :3], anchors_m, late_m, level_dbm)


def walks(scene: Scene, channel: Channel, seeds: range) -> Iterator[Walk]:
    """Walks of several seeds."""
    for seed in seeds:
        yield paper_d_runs(scene, channel, seed)


def _blink(number: int, row: Reals, ids: NDArray[np.uint64], anchors_m: Reals, height_m: float) -> Measurements:
    """Measurements of one blink from its row (anchors, 7): see `_simulate`."""
    heard = np.isfinite(row[:, 3])
    count = int(heard.sum())
    levels = zip(row[heard, 5].tolist(), row[heard, 4].tolist(), strict=True)
    return Measurements(
        stamp_ns=number * (1_000_000_000 // RATE_HZ),
        anchor_ids=ids[heard],
        anchors_m=anchors_m[heard],
        range_m=range_differences(row[heard, 3], row[heard, 6], 0) if count else np.empty(0),
        variance_m2=np.full(count, WHITE_SD_M**2),
        since_s=np.zeros(count),
        los_probability=np.array([odds_of_power_rule(los_probability_from_powers(*pair)) for pair in levels]),
        receive_power_dbm=np.array([uncompress_dbm(level, 64) for level in row[heard, 4].tolist()]),
        height_m=height_m,
        shared_offset=True,
    )


def _simulate(site: Site, anchors_m: Reals, scene: Scene, channel: Channel, seed: int) -> Reals:
    """Table (blinks, anchors, 7): truth x y z, range, level reported and of the first path, clock error as a way."""
    rng = np.random.default_rng([seed, SCENES.index(scene), int(channel[-1])])
    truth_m = _line(scene, site.tag_height_m, rng)
    count = len(anchors_m)
    radios = Radios.draw(count, rng)
    links = TagLinks(ENVIRONMENTS[channel], Radios.draw(1, rng), radios, _NOBODY, rng)
    sync = AnchorSync(count, rng)
    mine, tables = mine_of(site), []
    for tag_m in np.split(truth_m, range(_ROUNDS_AT_A_TIME, len(truth_m), _ROUNDS_AT_A_TIME)):
        rounds = len(tag_m)
        ways = mine.look(np.repeat(tag_m, count, axis=0), np.tile(anchors_m, (rounds, 1)))
        ranges = _measure(links, tag_m, anchors_m, ways)
        sync_m = np.array([sync.advance(1.0 / RATE_HZ) for _ in range(rounds)])
        columns = [*ranges, sync_m]
        truth = np.broadcast_to(tag_m[:, None], (rounds, count, 3))
        tables.append(np.concatenate([truth, np.stack(columns, axis=2)], axis=2))
    return np.concatenate(tables)


def _measure(links: TagLinks, tag_m: Reals, anchors_m: Reals, ways: LinkGeometry) -> tuple[Reals, Reals, Reals]:
    """Ranges without their bias by level, levels and first-path levels, each (rounds, anchors)."""
    shape = len(tag_m), len(anchors_m)
    which = np.broadcast_to(np.arange(shape[1]), shape)
    everywhere = np.broadcast_to(anchors_m, (*shape, 3))
    ranges = links.measure(tag_m, np.zeros(shape[0]), everywhere, which, ways)
    corrected = (ranges.range_m - ranges.level_bias_m).reshape(shape)
    return corrected, ranges.receive_power_dbm.reshape(shape), ranges.first_path_power_dbm.reshape(shape)


@cache
def _bounds(scene: Scene) -> tuple[Reals, Reals]:
    """Corners (x, y) of the box where walks begin."""
    return {
        "triangle": (np.array([3.0, 0.0]), np.array([17.0, 14.0])),
        "gallery": (np.array([12.0, -1.2]), np.array([38.0, 1.2])),
    }[scene]


def _line(scene: Scene, height_m: float, rng: np.random.Generator) -> Reals:
    """A straight walk that stays in the box: truth (blinks, 3)."""
    low, high = _bounds(scene)
    way_m = SPEED_M_PER_S * np.arange(SECONDS * RATE_HZ) / RATE_HZ
    while True:
        start, yaw = rng.uniform(low, high), rng.uniform(-np.pi, np.pi)
        if scene == "gallery":
            yaw = rng.integers(2) * np.pi + rng.uniform(-0.05, 0.05)
        line = start + way_m[:, None] * [np.cos(yaw), np.sin(yaw)]
        if np.all((line[-1] >= low) & (line[-1] <= high)):
            return np.column_stack([line, np.full(len(line), height_m)])
