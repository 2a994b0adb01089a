"""Judge the poses in a bag against the truth in it, by yourself or for continuous integration.

BAG holds fused/poses and, for each person, truth/<person>/pose: a bag of `mine-loc simulate`, `mine-loc import` or
a survey of your own, replayed. Errors are horizontal, in the words of ISO/IEC 18305; docs/evaluate.md explains every
measure. Nothing is adjusted that you do not ask for: --align rigid lays the truth over the outputs by one rotation and
shift, where it is in a frame of its own; --apply-time-offset moves it by the time offset that is reported anyway.

With --expect FILE every bound of the file is checked, and the exit status is 1 when one does not hold; --junit FILE
writes the checks for your build server. The exit status is 2 for what cannot be read.

Examples:
  mine-loc evaluate build/replayed
  mine-loc evaluate build/m1l --align rigid --apply-time-offset --plot build/m1l_plots
  mine-loc evaluate build/ours --truth-bag survey/bag --truth "rover/<person>/odometry" --json build/figures.json
  mine-loc evaluate build/replayed --expect ci/gallery.yaml --junit build/gallery.xml
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

from mine_loc_core.errors import ConfigurationError

_TRUTH = "truth/<person>/pose"
_LEAST_WIDTH = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("bag", type=Path, metavar="BAG", help="a rosbag2 folder with fused/poses")
    add("--truth", default=None, metavar="TOPIC", help=f"where the truth is (default {_TRUTH})")
    add("--truth-bag", type=Path, metavar="BAG", help="another bag that holds the truth, on the same clock")
    add("--align", choices=("none", "rigid"), default="none", help="rigid: truth has a frame of its own (default none)")
    add("--apply-time-offset", action="store_true", help="truth has a clock of its own, or outputs a known delay")
    add("--json", type=Path, metavar="FILE", help="write all figures")
    add("--plot", type=Path, metavar="DIR", help="draw tracks, error over time and its distribution")
    add("--expect", type=Path, metavar="FILE", help="bounds to check")
    add("--junit", type=Path, metavar="FILE", help="write the checks of --expect as JUnit XML")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 if all bounds hold, 1 if not, 2 for what the user can mend."""
    from mine_loc_bringup.evaluation.expectations import checks, load_expectations  # noqa: PLC0415 slow
    from mine_loc_bringup.evaluation.table import measures_table, verdict_table  # noqa: PLC0415

    if arguments.junit and not arguments.expect:
        raise ConfigurationError(f"--junit: {arguments.junit}: there is nothing to check; allowed: with --expect")
    expected = load_expectations(arguments.expect) if arguments.expect else {}
    found = _evaluate(arguments)
    terminal = Console()
    terminal.width = max(terminal.width, _LEAST_WIDTH)
    terminal.print(measures_table(found, str(arguments.bag)))
    if found.verdicts:
        terminal.print(verdict_table(found))
    for note in found.notes:
        print(note, file=sys.stderr)
    if arguments.json:
        _write_json(arguments.json, arguments, found.as_json())
    if arguments.plot:
        from mine_loc_bringup.evaluation.plots import write_plots  # noqa: PLC0415 slow

        for file in write_plots(found.compared, str(arguments.bag), arguments.plot):
            print(f"written: {file}")
    return _judge(list(checks(expected, found)), arguments)


def _evaluate(arguments: argparse.Namespace) -> Any:
    from mine_loc_bringup.evaluation.bag_evaluation import evaluate_bag  # noqa: PLC0415 slow
    from mine_loc_bringup.evaluation.measures import Comparing  # noqa: PLC0415

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("reading", total=1.0)
        return evaluate_bag(
            arguments.bag,
            truth_bag=arguments.truth_bag,
            truth=arguments.truth,
            comparing=Comparing(rigid=arguments.align == "rigid", apply_time_offset=arguments.apply_time_offset),
            progress=lambda share: progress.update(task, completed=share),
        )


def _write_json(file: Path, arguments: argparse.Namespace, figures: dict[str, Any]) -> None:
    settings = {
        "bag": str(arguments.bag),
        "truth_bag": str(arguments.truth_bag or arguments.bag),
        "truth": arguments.truth or _TRUTH,
        "align": arguments.align,
        "time_offset_applied": arguments.apply_time_offset,
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(settings | figures, indent=2, allow_nan=False) + "\n", "utf-8")
    print(f"written: {file}")


def _judge(checked: Sequence[Any], arguments: argparse.Namespace) -> int:
    from mine_loc_bringup.evaluation.junit import write_junit  # noqa: PLC0415

    failed = [check for check in checked if not check.passed]
    if arguments.junit:
        write_junit(checked, f"mine-loc evaluate {arguments.bag}", arguments.junit)
        print(f"written: {arguments.junit}")
    for check in failed:
        print(f"FAILED: {check}", file=sys.stderr)
    if checked:
        print(f"{len(checked) - len(failed)} of {len(checked)} bounds hold")
    return 1 if failed else 0
