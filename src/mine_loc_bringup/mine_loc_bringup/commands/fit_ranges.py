"""Fit a range correction from pairs of measured and true range, and write the file that uwb_solver loads.

Pairs come from CSV files with the columns
  measured_m, true_m          as the radio reported it, and as a tape or total station says
  label                       LOS or NLOS; without it all are NLOS
  receive_power_dbm           as the radio reported it; without it there is no bias by power
  group                       a name for each place: its pairs are never parted between fitting and judging;
                              without it, pairs of one true distance are a group
or from bags of `mine-loc simulate --bag`, which need --site for anchors and people.

Three stages, each on what the one before has left: an offset common to all links (antenna delay) and a bias by received
power from the LOS pairs, and a polynomial from measured to true range from the NLOS pairs, which uwb_solver applies as
far as a link is judged to be NLOS. From bags the latency of the stamps is found as well. The table shows errors before,
after, and on pairs that the fit had not seen (held out): trust the last.

On site: put a tag at 10 places or more per kind of link, from the shortest to the longest distance in use; take some
50 ranges at each while moving it a hand's breadth; write them down with the distance taped.

Examples:
  mine-loc fit-ranges survey.csv --out config/my_mine/range_correction.yaml
  mine-loc fit-ranges los.csv nlos.csv --out build/ranges.yaml --plot build/ranges.png --json build/ranges.json
  mine-loc fit-ranges survey.csv --power-bias aps011 --bandwidth 500 --prf 64 --out build/ranges.yaml
  mine-loc simulate --site config/gallery_2km --people 3 --seconds 300 --bag build/walk
  mine-loc fit-ranges build/walk --site config/gallery_2km --out build/ranges.yaml
"""

import argparse
import datetime as dt
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.antenna_delay import ticks_of_offset
from mine_loc_uwb.range_calibration import Calibration, CalibrationOptions, calibrate
from mine_loc_uwb.range_correction_file import range_correction_text
from mine_loc_uwb.range_pairs import RangePairs, joined
from mine_loc_uwb.stamp_latency import StampLatency, common_latency_s

_MOST_PAIRS = 200_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("pairs", type=Path, nargs="+", metavar="PAIRS", help="CSV files, or folders of bags")
    add("--out", type=Path, required=True, metavar="FILE", help="file to write")
    add("--site", type=Path, metavar="FOLDER", help="folder of site.yaml and people.yaml, for bags")
    add(
        "--power-bias",
        choices=("auto", "none", "aps011", "table"),
        default="auto",
        help="law of the bias by power (default auto: what does best on held-out LOS pairs); none for firmware that "
        "has corrected its ranges itself, such as DWM1001 and TREK1000",
    )
    add("--bandwidth", type=int, choices=(500, 900), default=500, help="of the channel, MHz, for aps011 (default 500)")
    add("--prf", type=int, choices=(16, 64), default=64, help="MHz, for aps011 (default 64)")
    add(
        "--loss",
        choices=("absolute", "squares"),
        default="absolute",
        help="of the polynomial: least absolute errors, which a tail of long ranges does not draw (default), or least "
        "squares as in paper A",
    )
    add("--max-degree", type=int, default=6, metavar="K", help="highest degree tried, 1 to 10 (default 6)")
    add("--date", metavar="YYYY-MM-DD", help="date written into the file (default today)")
    add("--json", type=Path, metavar="FILE", help="write the figures there as well")
    add("--plot", type=Path, metavar="FILE", help="draw the pairs before and after")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 when the file is written."""
    date = _date(arguments.date)
    if not 1 <= arguments.max_degree <= 10:
        raise ConfigurationError(f"--max-degree: {arguments.max_degree}; allowed: 1 to 10")
    with Console(stderr=True).status("reading pairs") as status:
        pairs, latencies = _read(arguments.pairs, arguments.site)
        status.update(f"fitting {len(pairs)} pairs")
        options = CalibrationOptions(
            arguments.power_bias,
            arguments.bandwidth,
            arguments.prf,
            arguments.loss,
            arguments.max_degree,
            common_latency_s(latencies),
        )
        calibration = calibrate(pairs, options)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(range_correction_text(calibration, date), "utf-8")
    _print(calibration, latencies)
    print(f"written: {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(_figures(calibration, latencies), indent=2) + "\n", "utf-8")
    if arguments.plot:
        from mine_loc_bringup.range_correction_plot import plot_correction  # noqa: PLC0415 matplotlib is slow to load

        plot_correction(pairs, calibration.correction, arguments.plot)
    return 0


def _date(text: str | None) -> str:
    if text is None:
        return dt.datetime.now(tz=dt.UTC).date().isoformat()
    try:
        return dt.date.fromisoformat(text).isoformat()
    except ValueError:
        raise ConfigurationError(f"--date: {text!r}; allowed: a day as YYYY-MM-DD") from None


def _read(paths: list[Path], site: Path | None) -> tuple[RangePairs, list[StampLatency]]:
    parts: list[RangePairs] = []
    latencies: list[StampLatency] = []
    for path in paths:
        if path.is_dir() or path.suffix == ".mcap":
            from mine_loc_bringup.range_pairs_bag import read_bag  # noqa: PLC0415 rosbags is slow to load

            if site is None:
                raise ConfigurationError(f"--site: missing, but {path} is a bag; allowed: the folder of its site.yaml")
            pairs, found = read_bag(path, site)
            latencies += found
        else:
            from mine_loc_bringup.range_pairs_csv import read_csv  # noqa: PLC0415 as above

            pairs = read_csv(path)
        parts.append(pairs)
    pairs = joined(parts)
    if len(pairs) > _MOST_PAIRS:
        raise ConfigurationError(f"PAIRS: {len(pairs)} pairs; allowed: {_MOST_PAIRS} in all")
    return pairs, latencies


def _print(calibration: Calibration, latencies: list[StampLatency]) -> None:
    table = Table("label", "ranges", "pairs", "mean error [m]", "mean |error| [m]", "RMSE [m]", title="range errors")
    stages = {"before": calibration.before, "after": calibration.after, "after, held out": calibration.held_out}
    for label in calibration.before:
        for name, errors in stages.items():
            if label in errors:
                e = errors[label]
                row = (f"{e.mean_m:+.3f}", f"{e.mean_absolute_m:.3f}", f"{e.rmse_m:.3f}")
                table.add_row(label, name, str(e.pairs), *row)
    console = Console()
    console.print(table)
    found = calibration.correction
    ticks = ticks_of_offset(found.antenna_offset_m)
    print(f"antenna delay: {found.antenna_offset_m:+.3f} m, as {ticks:+d} ticks in the antenna delays of one radio")
    print(f"bias by power: {found.power_bias.kind}")
    if found.nlos is None:
        print("polynomial: none, for want of NLOS pairs")
    else:
        powers = " ".join(f"a{k}={value:.4g}" for k, value in enumerate(found.nlos.powers()))
        low_m, high_m = found.nlos.valid_m
        print(f"polynomial: degree {found.nlos.degree}, changes ranges from {low_m:.1f} to {high_m:.1f} m; {powers}")
    for each in latencies:
        print(
            f"a tag's stamps: {1e3 * each.latency_s:+.0f} ms late, standard error {1e3 * each.standard_error_s:.0f} ms"
        )
    if latencies:
        print(f"stamp latency: {1e3 * found.stamp_latency_s:+.0f} ms; 0 where it is within two standard errors")


def _figures(calibration: Calibration, latencies: list[StampLatency]) -> dict[str, Any]:
    found = calibration.correction
    told = {"before": calibration.before, "after": calibration.after, "held_out": calibration.held_out}
    figures: dict[str, Any] = {
        when: {label: asdict(error) for label, error in errors.items()} for when, errors in told.items()
    }
    figures |= {"antenna_offset_m": found.antenna_offset_m, "power_bias": found.power_bias.kind}
    if found.nlos is not None:
        figures["polynomial"] = {
            "degree": found.nlos.degree,
            "powers": found.nlos.powers(),
            "valid_m": found.nlos.valid_m,
            "residual_sd_m": found.nlos.residual_sd_m,
        }
    return figures | {"stamp_latency": [asdict(each) for each in latencies]}
