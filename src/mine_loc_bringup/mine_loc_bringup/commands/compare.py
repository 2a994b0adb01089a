"""Replay a bag with one estimator after the other, and judge each against the truth in the bag.

Every estimator gets the same messages at the same times. The bags of the replays stay under --out, one a method, for
mine-loc evaluate --plot.

Examples:
  mine-loc compare build/one_shift
  mine-loc compare build/m1l --methods mine_loc ekf robust_kf --align rigid --apply-time-offset
  mine-loc compare build/one_shift --json build/methods.json
"""

import argparse
import json
import shutil
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from mine_loc_core.errors import ConfigurationError
from mine_loc_fusion.parameters import METHODS

_LEAST_WIDTH = 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("bag", type=Path, metavar="BAG", help="a bag with truth/<person>/pose")
    add("--methods", nargs="+", default=list(METHODS), choices=METHODS, metavar="METHOD", help=", ".join(METHODS))
    add("--site", type=Path, metavar="FOLDER", help="site folder (default: the one in the bag's folder or beside it)")
    add("--map", type=Path, metavar="FILE", help="what the topics of the bag are called here (see mine-loc replay)")
    add("--set", action="append", default=[], metavar="NODE.PARAMETER=VALUE", help="a parameter, for all methods")
    add("--align", choices=("none", "rigid"), default="none", help="rigid: truth has a frame of its own (default none)")
    add("--apply-time-offset", action="store_true", help="truth has a clock of its own")
    add("--out", type=Path, default=Path("build/compare"), metavar="DIR", help="made anew (default build/compare)")
    add("--json", type=Path, metavar="FILE", help="write all figures")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 after all replays."""
    from mine_loc_bringup.evaluation.bag_evaluation import evaluate_bag  # noqa: PLC0415 slow
    from mine_loc_bringup.evaluation.measures import Comparing  # noqa: PLC0415
    from mine_loc_bringup.evaluation.table import columns_table  # noqa: PLC0415
    from mine_loc_bringup.offline_run import replay_offline  # noqa: PLC0415

    if arguments.bag.resolve().is_relative_to(arguments.out.resolve()):
        raise ConfigurationError(f"--out: {arguments.out} holds the bag and is made anew; allowed: another folder")
    shutil.rmtree(arguments.out, ignore_errors=True)
    comparing = Comparing(rigid=arguments.align == "rigid", apply_time_offset=arguments.apply_time_offset)
    together = {}
    for method in arguments.methods:
        changes = [*arguments.set, f"fusion.method={method}"]
        out = arguments.out / method
        replay_offline(arguments.bag, out, site=arguments.site, mapping=arguments.map, changes=changes)
        together[method] = evaluate_bag(out, comparing=comparing).together
    terminal = Console()
    terminal.width = max(terminal.width, _LEAST_WIDTH)
    terminal.print(columns_table(together, str(arguments.bag)))
    if arguments.json:
        figures = {method: asdict(measures) for method, measures in together.items()}
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(figures, indent=2, allow_nan=False) + "\n", "utf-8")
        print(f"written: {arguments.json}")
    return 0
