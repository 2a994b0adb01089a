"""Range correction against paper A's table 2, and on real ranges: `paper_a_range_correction` and `hanyang_static`.

    python bench/uwb_range_correction.py [--json FILE] [--machine-width M ...]

Simulated: ten tests, a seed each, of ranges through CM7 and CM8 in bench/uwb_scenes/range_correction*. What is scored
was measured at other places, with other radios and other draws of the channel than what is fitted. Real: the static
ranges of hanyang_outdoor_uwb, fitted on every second distance and scored on the others, and the latency of the stamps
of its runs, each from the other runs (both need MINE_LOC_DATA).
"""

import argparse
import json
import os
import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

import hanyang
import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

import mine_loc_uwb
from mine_loc_core.site import Site, load_site
from mine_loc_sim.labelled_links import received_frames
from mine_loc_sim.radio_constants import INDUSTRIAL
from mine_loc_sim.ranging_link import Radios, Ranges, TagLinks
from mine_loc_sim.site_mine import mine_of
from mine_loc_sim.wearer import Wearer
from mine_loc_uwb.link_judgement import Classifier, LinkJudge, load_classifier
from mine_loc_uwb.parameters import Dwm1000DriverParameters
from mine_loc_uwb.range_calibration import CalibrationOptions, corrected_m, errors_by_label, fit_correction
from mine_loc_uwb.range_correction import CorrectedRanges, RangeCorrection
from mine_loc_uwb.range_pairs import RangePairs, joined
from mine_loc_uwb.received_power import los_probability_from_powers
from mine_loc_uwb.stamp_latency import fit_stamp_latency

Reals = NDArray[np.float64]
SCENES = Path(__file__).parent / "uwb_scenes"
SHIPPED_MODEL = Path(mine_loc_uwb.__file__).parent / "models" / "los.safetensors"
TEST_SEEDS, FIT_SEEDS, KNOB_SEEDS = range(1, 11), range(101, 121), range(201, 221)
PLACES = 60
ASIDE_M = 0.75
DRIVER_SD_M = Dwm1000DriverParameters().range_sd_m
TRIPOD = Wearer(loss_db=0.0, delay_m=0.0)


@dataclass(frozen=True, slots=True)
class Scene:
    """A site, the stretch of its gallery's centre line beside which the tag is put up, and how far from obstacles."""

    site: Site
    along_m: tuple[float, float]
    keep_off_m: float


def machine_scene(keep_off_m: float = 1.5) -> Scene:
    """The scene of the ten tests; who works there keeps so far off the machine."""
    return Scene(load_site(SCENES / "range_correction"), (0.5, 13.5), keep_off_m)


def bend_scene() -> Scene:
    """The harder scene: rock, beyond which only scattered waves arrive."""
    return Scene(load_site(SCENES / "range_correction_bend"), (12.0, 28.0), 0.0)


@dataclass(frozen=True, slots=True)
class Test:
    """Ranges of a seed: pairs (n,), labelled by what is in the way, and the probability of NLOS as the node has it."""

    pairs: RangePairs
    by_classifier: Reals
    by_powers: Reals
    power_gap_db: Reals  # reception over first path


def by_powers(ranges: Ranges) -> Reals:
    """Probability of NLOS (n,) as the driver gives it, from the two powers (DW1000 User Manual 4.7)."""
    rows = zip(ranges.first_path_power_dbm.tolist(), ranges.receive_power_dbm.tolist(), strict=True)
    return 1.0 - np.array([los_probability_from_powers(*row) for row in rows])


@cache
def shipped_classifier() -> Classifier:
    """The network that `los_classifier` loads."""
    return load_classifier(SHIPPED_MODEL, "cpu")[0]


def by_classifier(ranges: Ranges) -> Reals:
    """Probability of NLOS (n,) by the shipped classifier, each link heard once; by the powers where it refuses."""
    assert ranges.exchanges is not None
    judged = by_powers(ranges)
    heard = np.flatnonzero(ranges.received & ranges.exchanges.registers.detected)
    frames = received_frames(ranges.exchanges, ranges.range_m, heard)
    found = LinkJudge(shipped_classifier()).judge(frames, heard.tolist(), [0] * len(heard))
    for link, judgement in zip(heard, found, strict=True):
        if np.isfinite(judgement.los_probability):
            judged[link] = 1.0 - judgement.los_probability
    return judged


def places_along(scene: Scene, rng: np.random.Generator) -> Reals:
    """Draw places (PLACES, 3) beside the centre line of the site's gallery, clear of obstacles."""
    line_m = np.array(scene.site.galleries[0].centre_line_m)[:, :2]
    way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    boxes_m = [(np.min(each.polygon_m, axis=0), np.max(each.polygon_m, axis=0)) for each in scene.site.obstacles]
    places: list[Reals] = []
    while len(places) < PLACES:
        at_m, aside_m = rng.uniform(*scene.along_m), rng.uniform(-ASIDE_M, ASIDE_M)
        leg = min(int(np.searchsorted(way_m, at_m, side="right")) - 1, len(line_m) - 2)
        along = (line_m[leg + 1] - line_m[leg]) / (way_m[leg + 1] - way_m[leg])
        place_m = line_m[leg] + (at_m - way_m[leg]) * along + aside_m * np.array([-along[1], along[0]])
        away_m = [np.linalg.norm(place_m - np.clip(place_m, low_m, high_m)) for low_m, high_m in boxes_m]
        if min(away_m, default=np.inf) > scene.keep_off_m:
            places.append(np.array([*place_m, scene.site.tag_height_m]))
    return np.array(places)


def measure(scene: Scene, seed: int) -> Test:
    """One range from each place to each anchor, those that are lost left out; the radios are the seed's own."""
    rng = np.random.default_rng(seed)
    anchors_m = np.array([anchor.position_m for anchor in scene.site.anchors])
    count = len(anchors_m)
    tag_m = places_along(scene, rng)
    ways = mine_of(scene.site).look(np.repeat(tag_m, count, axis=0), np.tile(anchors_m, (PLACES, 1)))
    links = TagLinks(INDUSTRIAL, Radios.draw(1, rng), Radios.draw(count, rng), TRIPOD, rng)
    every = np.tile(np.arange(count), (PLACES, 1))
    ranges = links.measure(tag_m, np.zeros(PLACES), np.tile(anchors_m, (PLACES, 1, 1)), every, ways)
    group = np.repeat(np.arange(PLACES), count)
    pairs = RangePairs(ranges.range_m, ways.distance_m, ~ways.clear, ranges.receive_power_dbm, group)
    heard, gap_db = ranges.received, ranges.receive_power_dbm - ranges.first_path_power_dbm
    return Test(pairs.only(heard), by_classifier(ranges)[heard], by_powers(ranges)[heard], gap_db[heard])


def error_m(test: Test, range_m: Reals, *, nlos: bool) -> float:
    """Mean absolute error of the links with or without line of sight."""
    kind = test.pairs.nlos == nlos
    return float(np.mean(np.abs(range_m - test.pairs.true_m)[kind]))


def over_tests(values: list[float]) -> dict[str, float]:
    """Mean and standard deviation over tests."""
    return {"mean": float(np.mean(values)), "sd_over_tests": float(np.std(values, ddof=1)), "n": len(values)}


def unexplained(correction: RangeCorrection, tests: list[Test]) -> dict[str, float]:
    """Rank correlation of the error that known NLOS links have left with what else the node knows of them."""
    hidden = [(test, test.pairs.nlos) for test in tests]
    left_m = np.concatenate([(corrected_m(correction, t.pairs) - t.pairs.true_m)[which] for t, which in hidden])
    known = {
        "measured_range": np.concatenate([t.pairs.measured_m[which] for t, which in hidden]),
        "receive_power": np.concatenate([t.pairs.receive_power_dbm[which] for t, which in hidden]),
        "power_gap": np.concatenate([t.power_gap_db[which] for t, which in hidden]),
    }
    return {name: float(spearmanr(left_m, values).statistic) for name, values in known.items()}


def judged(correction: RangeCorrection, test: Test) -> CorrectedRanges:
    """Ranges as the node corrects them."""
    return correction.correct(test.pairs.measured_m, test.pairs.receive_power_dbm, test.by_classifier)


def judged_by_powers(correction: RangeCorrection, test: Test) -> CorrectedRanges:
    """The same where modules send no accumulators."""
    return correction.correct(test.pairs.measured_m, test.pairs.receive_power_dbm, test.by_powers)


def within_two_sd(correction: RangeCorrection, test: Test, *, nlos: bool) -> float:
    """Share of ranges whose error is within twice the standard deviation that the node gives them."""
    found = judged(correction, test)
    off = (found.range_m - test.pairs.true_m) ** 2 / (DRIVER_SD_M**2 + found.added_variance_m2)
    return float(np.mean(off[test.pairs.nlos == nlos] <= 4.0))


def simulated(scene: Scene) -> dict[str, Any]:
    """Ten tests in one scene. All figures are mean absolute errors a test [m]."""
    survey = joined([measure(scene, seed).pairs for seed in FIT_SEEDS])
    full = fit_correction(survey, CalibrationOptions())
    hidden_only = survey.only(survey.nlos)
    alone = fit_correction(hidden_only, CalibrationOptions(power_bias="none"))
    squares = fit_correction(hidden_only, CalibrationOptions(power_bias="none", loss="squares"))
    tests = [measure(scene, seed) for seed in TEST_SEEDS]
    rows = {
        "before_m": [error_m(test, test.pairs.measured_m, nlos=True) for test in tests],
        "after_polynomial_least_squares_m": [error_m(t, corrected_m(squares, t.pairs), nlos=True) for t in tests],
        "after_polynomial_m": [error_m(test, corrected_m(alone, test.pairs), nlos=True) for test in tests],
        "after_known_nlos_m": [error_m(test, corrected_m(full, test.pairs), nlos=True) for test in tests],
        "after_m": [error_m(test, judged(full, test).range_m, nlos=True) for test in tests],
        "after_by_powers_m": [error_m(test, judged_by_powers(full, test).range_m, nlos=True) for test in tests],
        "clear_before_m": [error_m(test, test.pairs.measured_m, nlos=False) for test in tests],
        "clear_after_m": [error_m(test, judged(full, test).range_m, nlos=False) for test in tests],
    }
    assert full.nlos is not None
    missed = [float(np.mean(test.by_classifier[test.pairs.nlos] < 0.5)) for test in tests]
    by_powers_missed = [float(np.mean(test.by_powers[test.pairs.nlos] < 0.5)) for test in tests]
    return {
        **{name: over_tests(values) for name, values in rows.items()},
        "tests": [dict(zip(rows, values, strict=True)) for values in zip(*rows.values(), strict=True)],
        "nlos_missed": over_tests(missed),
        "nlos_missed_by_powers": over_tests(by_powers_missed),
        "nlos_within_two_sd": over_tests([within_two_sd(full, test, nlos=True) for test in tests]),
        "clear_within_two_sd": over_tests([within_two_sd(full, test, nlos=False) for test in tests]),
        "left_error_rank_correlation": unexplained(full, tests),
        "degree": full.nlos.degree,
        "power_bias": full.power_bias.kind,
        "antenna_offset_m": full.antenna_offset_m,
    }


def hanyang_static() -> dict[str, Any]:
    """Real ranges of 2 to 60 m: every second distance fits, the others score; and the same the other way round."""
    pairs, left_out = hanyang.static_pairs()
    places = np.unique(pairs.true_m)
    fits = np.isin(pairs.true_m, places[::2])
    laws = {
        "after": CalibrationOptions(),
        "after_aps011": CalibrationOptions(power_bias="aps011"),
        "after_no_power_bias": CalibrationOptions(power_bias="none"),
        "after_least_squares": CalibrationOptions(loss="squares"),
    }
    figures: dict[str, Any] = {"left_out_rows": left_out}
    for half, known in (("even", fits), ("odd", ~fits)):
        fitted, scored = pairs.only(known), pairs.only(~known)
        rows = {"before": errors_by_label(scored, scored.measured_m)}
        rows |= {
            name: errors_by_label(scored, corrected_m(fit_correction(fitted, o), scored)) for name, o in laws.items()
        }
        figures[f"fitted_on_{half}_distances"] = {
            name: {
                label: {k: getattr(e, k) for k in ("pairs", "mean_m", "mean_absolute_m", "rmse_m")}
                for label, e in by.items()
            }
            for name, by in rows.items()
        }
    return figures


def hanyang_latency() -> dict[str, Any]:
    """Latency of the stamps of each run, and its residuals with the median of the other runs' latencies."""
    runs = {name: hanyang.timed_ranges(name) for name in hanyang.RUNS}
    found = {name: fit_stamp_latency(ranges) for name, ranges in runs.items()}
    figures = {}
    for name, ranges in runs.items():
        others_s = float(np.median([each.latency_s for other, each in found.items() if other != name]))
        residuals = {key: ranges.residual_m(late_s) for key, late_s in (("before", 0.0), ("after", others_s))}
        spread = {key: float(np.nanmedian(np.abs(r - np.nanmedian(r)))) for key, r in residuals.items()}
        figures[name] = {
            "latency_s": found[name].latency_s,
            "standard_error_s": found[name].standard_error_s,
            "others_latency_s": others_s,
            "median_residual_before_m": spread["before"],
            "median_residual_after_m": spread["after"],
        }
    return figures


def run() -> dict[str, Any]:
    """All figures; links of simulated ranges are judged by the shipped classifier, never by truth."""
    table = {
        **simulated(machine_scene()),
        "harder_up_to_the_machine": simulated(machine_scene(keep_off_m=0.0)),
        "harder_bend": simulated(bend_scene()),
        "paper": {"before_m": 1.37, "after_m": 0.78},
        "note": "1.37 m before is more than buildings show (0.23 to 1.04 m): the scene is made for it by one knob, the "
        "machine's width, fitted on other seeds to the error before; that places keep off it was set knowing "
        "what it does to the error after (docs/range-correction.md), so read it beside the harder rows.",
    }
    figures: dict[str, Any] = {"paper_a_range_correction": table}
    if os.environ.get("MINE_LOC_DATA"):
        figures["hanyang_static"] = hanyang_static()
        figures["hanyang_latency"] = hanyang_latency()
    else:
        print("hanyang_static, hanyang_latency left out: MINE_LOC_DATA is not set")
    return figures


def before_by_width(widths_m: list[float]) -> dict[str, float]:
    """Mean error before of the knob's seeds by width of the machine: how the scene's width was found."""
    scene, found = machine_scene(), {}
    machine = scene.site.obstacles[0]
    for width_m in widths_m:
        polygon_m = tuple((x, np.copysign(0.5 * width_m, y)) for x, y in machine.polygon_m)
        site = replace(scene.site, obstacles=(replace(machine, polygon_m=polygon_m),))
        tests = [measure(replace(scene, site=site), seed) for seed in KNOB_SEEDS]
        found[f"{width_m:g}"] = float(np.mean([error_m(test, test.pairs.measured_m, nlos=True) for test in tests]))
    return found


def main() -> int:
    """Print the figures, and write them where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="file to write")
    parser.add_argument("--machine-width", type=float, nargs="+", metavar="M", help="only the error before, by width")
    arguments = parser.parse_args()
    text = json.dumps(before_by_width(arguments.machine_width) if arguments.machine_width else run(), indent=2)
    print(text)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(text + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
