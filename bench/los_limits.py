"""How far an accumulator can tell the simulator's four classes at all: boosted trees that are told parts of the truth.

Tags stand on tripods in the scenes of bench/sim_scenes, elsewhere in the test than in training, equal numbers of each
class. Trees see all inputs of the network for one frame, then also the true loss of the obstacle, then also the true
error of the range: what is still confused then cannot be read from a reception. Prints accuracy and confusion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sim_channel import BUILDINGS, HARDER, HERE, TRIPOD, free_place
from sklearn.ensemble import HistGradientBoostingClassifier

from mine_loc_core.site import load_site
from mine_loc_sim.labelled_links import received_frames
from mine_loc_sim.radio_constants import Environment
from mine_loc_sim.ranging_link import Radios, TagLinks
from mine_loc_sim.site_mine import mine_of
from mine_loc_uwb.cir_input import Refusal, los_input, refusals
from mine_loc_uwb.los_measures import class_measures

TAGS = 400
TRAINING_SEEDS, TEST_SEEDS = (100, 101, 102), (200, 201)
MOST_LOSS_DB = 60.0
PROFILE_TAPS = 48


@dataclass(frozen=True, slots=True)
class Told:
    """Inputs (n, f), true obstacle loss (n,), true range error (n,) and class 0 to 3 (n,)."""

    inputs: NDArray[np.float64]
    loss_db: NDArray[np.float64]
    error_m: NDArray[np.float64]
    kind: NDArray[np.int64]


def tripods(name: str, environment: Environment, seed: int) -> Told:
    """Range every anchor of a scene once from each of many places."""
    site = load_site(HERE / "sim_scenes" / name)
    mine, anchors_m = mine_of(site), np.array([anchor.position_m for anchor in site.anchors])
    size_m, which = np.max(site.chambers[0].polygon_m, axis=0), np.arange(len(anchors_m))
    rng = np.random.default_rng(seed)
    radios, rows = Radios.draw(len(anchors_m), rng), []
    for tag_rng in rng.spawn(TAGS):
        tag_m = free_place(mine, size_m, tag_rng)
        ways = mine.look(np.repeat(tag_m[None], len(which), axis=0), anchors_m)
        links = TagLinks(environment, Radios.draw(1, tag_rng), radios, TRIPOD, tag_rng)
        ranges = links.measure(tag_m[None], np.zeros(1), anchors_m[None], which[None], ways)
        assert ranges.exchanges is not None
        heard = np.flatnonzero(ranges.received & ranges.exchanges.registers.detected)
        frames = received_frames(ranges.exchanges, ranges.range_m, heard)
        fit = refusals(frames) == Refusal.NOT
        given, heard = los_input(frames.take(fit)), heard[fit]
        seen = np.column_stack([given.side, given.edge, given.profile[:, 1, :PROFILE_TAPS]])
        error_m = (ranges.range_m - ways.distance_m)[heard]
        rows.append((seen, np.minimum(ways.loss_db[heard], MOST_LOSS_DB), error_m, ranges.link_class[heard] - 1))
    return Told(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def collect(seeds: tuple[int, ...]) -> Told:
    """All scenes and seeds, equal numbers of each class."""
    parts = [tripods(name, environment, seed) for name, environment in (BUILDINGS | HARDER).items() for seed in seeds]
    columns = [np.concatenate([getattr(part, name) for part in parts]) for name in Told.__slots__]
    rng, kind = np.random.default_rng(1), columns[-1]
    fewest = np.bincount(kind).min()
    kept = np.concatenate([rng.permutation(np.flatnonzero(kind == each))[:fewest] for each in range(4)])
    return Told(*(column[kept] for column in columns))


def main() -> None:
    training, test = collect(TRAINING_SEEDS), collect(TEST_SEEDS)
    for told in ((), ("loss_db",), ("loss_db", "error_m")):
        trees = HistGradientBoostingClassifier(max_iter=120, learning_rate=0.12, random_state=1)
        columns = [np.column_stack([data.inputs, *(getattr(data, name) for name in told)]) for data in (training, test)]
        said = trees.fit(columns[0], training.kind).predict(columns[1])
        found = class_measures(said, test.kind, 4)
        print(
            f"told {', '.join(told) or 'nothing'}: accuracy {found['accuracy']:.3f}, {found['confusion']}", flush=True
        )


if __name__ == "__main__":
    main()
