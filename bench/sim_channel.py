"""Radio half of the simulator against the figures measured on real DW1000 links: writes into bench/results/sim.json.

Links are measured with tags on tripods (no wearer), as the public recordings were, in the scenes under
bench/sim_scenes: two buildings, which the figures at the top level pool, and a harder hall beside them in `by_scene`.
Every figure is given over seeds: mean, standard deviation over seeds, n.
"""

import argparse
import json
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cir_features import Receptions, balanced_accuracy, features, fit, leave_one_placement_out, read_real
from numpy.typing import NDArray

from mine_loc_core.site import load_site
from mine_loc_sim.channel_15_4a import BIN_NS, delay_statistics, draw_responses
from mine_loc_sim.mine import Mine
from mine_loc_sim.prism import contains
from mine_loc_sim.radio_constants import CM7, CM8, INDUSTRIAL, OFFICE, Environment
from mine_loc_sim.range_law import FastTagLinks, range_law
from mine_loc_sim.ranging_link import LinkClass, Radios, Ranges, TagLinks
from mine_loc_sim.site_mine import mine_of
from mine_loc_sim.wearer import Wearer

HERE = Path(__file__).parent
BUILDINGS = {"flat": OFFICE, "offices": OFFICE}
HARDER = {"hall": INDUSTRIAL}
SEEDS = (1, 2, 3)
TAGS, ROUNDS = 60, 8
TRIPOD = Wearer(loss_db=0.0, delay_m=0.0)


@dataclass(frozen=True, slots=True)
class Survey:
    """Links of one scene and seed: (links, rounds) each but `obstructed` (links,) and the features of first rounds."""

    error_m: NDArray[np.float64]
    power_gap_db: NDArray[np.float64]
    obstructed: NDArray[np.bool_]
    first_rounds: Receptions


def survey(name: str, environment: Environment, seed: int) -> Survey:
    """Put tags at random free places and range each anchor some times with CIR."""
    site = load_site(HERE / "sim_scenes" / name)
    mine, anchors_m = mine_of(site), np.array([anchor.position_m for anchor in site.anchors])
    size_m = np.max(site.chambers[0].polygon_m, axis=0)
    seeds = np.random.SeedSequence(seed).spawn(TAGS + 1)
    rng = np.random.default_rng(seeds[0])
    radios = Radios.draw(len(anchors_m), rng)
    errors, gaps, blocked, vectors, classes = [], [], [], [], []
    which = np.arange(len(anchors_m))
    for tag_seed in seeds[1:]:
        tag_rng = np.random.default_rng(tag_seed)
        tag_m = free_place(mine, size_m, tag_rng)
        count = ROUNDS * len(which)
        ways = mine.look(np.repeat(tag_m[None], count, axis=0), np.tile(anchors_m, (ROUNDS, 1)))
        links = TagLinks(environment, Radios.draw(1, tag_rng), radios, TRIPOD, tag_rng)
        still = np.repeat(tag_m[None], ROUNDS, axis=0), np.zeros(ROUNDS), np.tile(anchors_m, (ROUNDS, 1, 1))
        ranges = links.measure(*still, np.tile(which, (ROUNDS, 1)), ways)
        gap_db = ranges.receive_power_dbm - ranges.first_path_power_dbm
        errors.append((ranges.range_m - ways.distance_m).reshape(ROUNDS, -1).T)
        gaps.append(gap_db.reshape(ROUNDS, -1).T)
        blocked.append(~ways.clear[: len(which)])
        heard = np.flatnonzero(ranges.received[: len(which)])
        vectors.append(first_features(ranges, heard))
        classes.append(ranges.link_class[heard])
    obstructed = np.concatenate(classes) <= LinkClass.OBSTRUCTED
    receptions = Receptions(np.concatenate(vectors), obstructed, np.zeros(len(obstructed), int))
    return Survey(np.concatenate(errors), np.concatenate(gaps), np.concatenate(blocked), receptions)


def first_features(ranges: Ranges, which: NDArray[np.int64]) -> NDArray[np.float64]:
    """Features of some receptions."""
    found = ranges.exchanges
    assert found is not None
    return features(
        np.abs(found.reception.samples[which]),
        found.registers.first_path_index[which],
        found.reception.symbols[which],
        ranges.receive_power_dbm[which],
        ranges.first_path_power_dbm[which],
    )


def free_place(mine: Mine, size_m: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw a place at least 0.5 m from the walls of a room of this size, clear of obstacles."""
    while True:
        place_m = np.array([*rng.uniform(0.5, size_m - 0.5), 1.1])
        if not contains(mine.obstacle_parts, place_m[None])[0]:
            return place_m


def link_figures(one: Survey) -> dict[str, float]:
    """Compute the measured tables' figures over one survey."""
    heard = np.isfinite(one.error_m).sum(axis=1) > 1
    error_m, gap_db = one.error_m[heard], one.power_gap_db[heard]
    clear, blocked = ~one.obstructed[heard], one.obstructed[heard]
    middle = np.nanmedian(error_m, axis=1)
    white = np.nanstd(error_m, axis=1, ddof=1)
    return {
        "los_bias_sd_m": float(np.nanstd(middle[clear])),
        "nlos_bias_sd_m": float(np.nanstd(middle[blocked])),
        "nlos_bias_min_m": float(np.nanmin(middle[blocked])),
        "nlos_bias_median_m": float(np.median(middle[blocked])),
        "nlos_bias_p95_m": float(np.quantile(middle[blocked], 0.95)),
        "nlos_bias_mean_m": float(np.nanmean(middle[blocked])),
        "white_noise_m": float(np.nanmedian(white)),
        "los_flagged": float(np.mean(gap_db[clear] > 6.0)),
        "nlos_missed": float(np.mean(~(gap_db[blocked] > 6.0))),
    }


def channel_figures(draws: int = 1000) -> dict[str, Any]:
    """Delay statistics of the bare channels."""
    figures: dict[str, Any] = {}
    for name, parameters in (("cm7", CM7), ("cm8", CM8)):
        taken = [delay_statistics(draw_responses(parameters, draws, np.random.default_rng(s)), BIN_NS) for s in SEEDS]
        figures[name] = {
            "mean_excess_delay_ns": spread([mean.mean() for mean, _ in taken], draws),
            "rms_delay_spread_ns": spread([rms.mean() for _, rms in taken], draws),
        }
    return figures


def spread(values: list[float], count: int) -> dict[str, float]:
    """Mean over seeds, standard deviation over seeds, samples a seed."""
    return {
        "mean": float(np.mean(values)),
        "sd_over_seeds": float(np.std(values, ddof=1)),
        "n": count,
        "seeds": len(SEEDS),
    }


def walk(anchors_m: NDArray[np.float64], seconds: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Lay out a person's rounds at 10 Hz along the main gallery, 1.3 m/s, and the nearest four anchors of each."""
    count = 10 * seconds
    x_m = 45.0 + 40.0 * np.sin(np.arange(count) * 0.13 / 40.0)
    tag_m = np.column_stack([x_m, np.zeros(count), np.full(count, 1.1)])
    return tag_m, np.argsort(np.linalg.norm(tag_m[:, None] - anchors_m, axis=2), axis=1)[:, :4]


def range_walk(
    links: TagLinks | FastTagLinks,
    mine: Mine,
    anchors_m: NDArray[np.float64],
    tag_m: NDArray[np.float64],
    which: NDArray[np.int64],
) -> Ranges:
    """Range along a walk."""
    ways = mine.look(np.repeat(tag_m, which.shape[1], axis=0), anchors_m[which].reshape(-1, 3))
    return links.measure(tag_m, np.zeros(len(tag_m)), anchors_m[which], which, ways)


def throughput() -> dict[str, float]:
    """Person-seconds a processor second: geometry, channel and receiver, 4 links at 10 Hz in the example mine."""
    site = load_site(HERE.parent / "config" / "example_mine")
    mine, anchors_m = mine_of(site), np.array([anchor.position_m for anchor in site.anchors])
    rng = np.random.default_rng(5)
    radios, wearer = Radios.draw(len(anchors_m), rng), Wearer.draw(rng)
    full = TagLinks(INDUSTRIAL, Radios.draw(1, rng), radios, wearer, rng)
    tag_m, which = walk(anchors_m, 10)
    began = time.process_time()
    for second in np.split(np.arange(len(tag_m)), len(tag_m) // 10):
        range_walk(full, mine, anchors_m, tag_m[second], which[second])
    with_cir = 10.0 / (time.process_time() - began)
    range_law(INDUSTRIAL)
    fast = FastTagLinks(INDUSTRIAL, Radios.draw(1, rng), radios, wearer, rng)
    tag_m, which = walk(anchors_m, 200)
    began = time.process_time()
    range_walk(fast, mine, anchors_m, tag_m, which)
    return {"with_cir": with_cir, "without_cir": 200.0 / (time.process_time() - began)}


def cross_domain(surveys: list[Survey]) -> dict[str, Any] | None:
    """Train on one world, score on the other; None without the recordings."""
    folder = os.environ.get("MINE_LOC_DATA")
    if folder is None:
        print("cross_domain left out: MINE_LOC_DATA is not set")
        return None
    real = read_real(Path(folder) / "uwb_cirs_2018")
    forth, back, own = [], [], []
    decide = fit(real)
    for number, one in enumerate(surveys):
        simulated, other = one.first_rounds, surveys[number - 1].first_rounds
        forth.append(balanced_accuracy(decide(simulated.features), simulated.obstructed))
        back.append(balanced_accuracy(fit(simulated)(real.features), real.obstructed))
        own.append(balanced_accuracy(fit(other)(simulated.features), simulated.obstructed))
    count = len(simulated.obstructed)
    return {
        "real_to_sim": spread(forth, count),
        "sim_to_real": spread(back, len(real.obstructed)),
        "sim_to_sim": spread(own, count),
        "real_to_real_placements_out": leave_one_placement_out(real),
    }


def run() -> dict[str, Any]:
    """Compute all figures of the radio half."""
    surveys = {
        name: [survey(name, environment, seed) for seed in SEEDS] for name, environment in (BUILDINGS | HARDER).items()
    }
    pooled = [pool([surveys[name][number] for name in BUILDINGS]) for number in range(len(SEEDS))]
    figures = over_seeds(pooled)
    rule = {key: figures.pop(key) for key in ("los_flagged", "nlos_missed")}
    crossed = cross_domain([pool([scenes[number] for scenes in surveys.values()]) for number in range(len(SEEDS))])
    return {
        **channel_figures(),
        **figures,
        "power_rule": rule,
        "by_scene": {name: over_seeds(scenes) for name, scenes in surveys.items()},
        **({"cross_domain": crossed} if crossed else {}),
        "person_seconds_per_s": throughput(),
    }


def pool(scenes: list[Survey]) -> Survey:
    """Join the surveys of several scenes."""
    parts = [one.first_rounds for one in scenes]
    return Survey(
        np.concatenate([one.error_m for one in scenes]),
        np.concatenate([one.power_gap_db for one in scenes]),
        np.concatenate([one.obstructed for one in scenes]),
        Receptions(
            np.concatenate([part.features for part in parts]),
            np.concatenate([part.obstructed for part in parts]),
            np.concatenate([part.placement for part in parts]),
        ),
    )


def over_seeds(surveys: list[Survey]) -> dict[str, Any]:
    """Spread of each figure over the seeds."""
    rows = [link_figures(one) for one in surveys]
    return {key: spread([row[key] for row in rows], len(surveys[0].obstructed)) for key in rows[0]}


def main() -> None:
    """Write the figures beside those that other benches put into the same file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, default=HERE / "results" / "sim.json", help="file to write into")
    path: Path = parser.parse_args().json
    known = json.loads(path.read_text()) if path.exists() else {}
    known.update(run())
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(known, indent=2, sort_keys=True) + "\n")
    print(json.dumps(known, indent=2, sort_keys=True))


if __name__ == "__main__":
    main()
