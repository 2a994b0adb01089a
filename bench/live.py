"""The live graph as users start it, on byte streams: latency, fleet and load; writes bench/results/live.json.

    python bench/live.py [--json FILE] [--only one_person fleet fleet_steps_only] [--people N] [--stages]

`--people N` plays N people once instead of searching for the fleet, `--stages` also says when a round passed which
topic (and costs time itself). docs/live.md explains the figures.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import Any

os.environ.setdefault("ROS_DOMAIN_ID", "43")  # beside a mine's own graph, not in it
sys.path.insert(0, str(Path(__file__).parent))

from live_fleet import held, largest_fleet
from live_graph import Run, run, two_cores
from live_latency import latencies, stage_table
from live_streams import StreamMaker
from rich.console import Console
from rich.table import Table

RESULTS = Path(__file__).parent / "results" / "live.json"
WARM_UP_S = 8.0
ONE_PERSON_S, ONE_PERSON_RATE_HZ, ONE_PERSON_RUNS = 28.0, 10.0, 3
FLEET_S, FLEET_RATE_HZ = 24.0, 2.0
FLEET_FROM, STEPS_FROM = 25, 100
_CONSOLE = Console()


def one_person(arguments: argparse.Namespace) -> dict[str, Any]:
    """Latency and load of one person at 10 rounds a second, over several runs of the graph."""
    maker = StreamMaker(ONE_PERSON_S, ONE_PERSON_RATE_HZ, simulated=1)
    runs = [_figures(run(maker.streams(1), WARM_UP_S, stages=arguments.stages)) for _ in range(arguments.runs)]
    return {
        "latency_p50_ms": median(each["latency_p50_ms"] for each in runs),
        "latency_p99_ms": median(each["latency_p99_ms"] for each in runs),
        "one_person": {
            "round_rate_hz": ONE_PERSON_RATE_HZ,
            "runs": len(runs),
            "spread_ms": {
                name: [min(each[name] for each in runs), max(each[name] for each in runs)]
                for name in ("latency_p50_ms", "latency_p99_ms")
            },
            "each_run": runs,
        },
    }


def fleet(arguments: argparse.Namespace) -> dict[str, Any]:
    """People held with an IMU each."""
    return _fleet("fleet", arguments, FLEET_FROM, inertial=True)


def fleet_steps_only(arguments: argparse.Namespace) -> dict[str, Any]:
    """People held whose steps come ready-made."""
    return _fleet("fleet_steps_only", arguments, STEPS_FROM, inertial=False)


def _fleet(name: str, arguments: argparse.Namespace, first: int, *, inertial: bool) -> dict[str, Any]:
    maker = StreamMaker(FLEET_S, FLEET_RATE_HZ)

    def play(people: int) -> dict[str, Any]:
        figures = _figures(run(maker.streams(people, inertial=inertial), WARM_UP_S, stages=arguments.stages))
        shown = f"p50 {figures['latency_p50_ms']:.1f} ms, p99 {figures['latency_p99_ms']:.1f} ms"
        _CONSOLE.print(f"{name}: {people} people: {shown}, {'held' if held(figures) else 'not held'}")
        return figures

    if arguments.people:
        return {f"{name}_of_{arguments.people}": play(arguments.people)}
    people, tried = largest_fleet(play, first)
    return {name: people, f"{name}_runs": {str(count): figures for count, figures in sorted(tried.items())}}


def _figures(done: Run) -> dict[str, Any]:
    found = latencies(done.fed, done.seen, WARM_UP_S)
    figures: dict[str, Any] = {
        "latency_p50_ms": found.percentile_ms(50.0),
        "latency_p99_ms": found.percentile_ms(99.0),
        "latency_p10_ms": found.percentile_ms(10.0),
        "rounds": found.rounds,
        "unheard_share": found.unheard_share,
        "unanswered_share": found.unanswered_share,
        "nodes": {kind: asdict(usage) for kind, usage in done.usage.items()},
        "feeding_cpu_share": done.feeding_share,
        "feeding_latest_ms": 1e3 * done.fed.latest_s,
        "watching_cpu_share": done.watching_share,
    }
    if stages := stage_table(done.fed, done.seen, WARM_UP_S):
        figures["stages_ms"] = stages
    return figures


PARTS: Mapping[str, Callable[[argparse.Namespace], dict[str, Any]]] = {
    "one_person": one_person,
    "fleet": fleet,
    "fleet_steps_only": fleet_steps_only,
}


def show(name: str, figures: Mapping[str, Any]) -> Table:
    """Load of each kind of node in one run."""
    table = Table("node", "processes", "CPU, share of a core", "memory [MB]", title=name)
    for kind, usage in figures["nodes"].items():
        table.add_row(kind, str(usage["processes"]), f"{usage['cpu_share']:.3f}", f"{usage['rss_mb']:.0f}")
    for part in ("feeding", "watching"):
        table.add_row(f"(bench: {part})", "1", f"{figures[f'{part}_cpu_share']:.3f}", "")
    return table


def main() -> int:
    """Run the chosen parts and write them beside those already in the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, default=RESULTS, help="file to write into")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="parts to run (default all)")
    parser.add_argument("--people", type=int, default=0, help="play so many once instead of searching")
    parser.add_argument("--runs", type=int, default=ONE_PERSON_RUNS, help="runs with one person")
    parser.add_argument("--stages", action="store_true", help="watch the topics between bytes and poses too")
    arguments = parser.parse_args()
    two_cores()
    path: Path = arguments.json
    figures: dict[str, Any] = json.loads(path.read_text("utf-8")) if path.exists() else {}
    for part in arguments.only:
        began = time.monotonic()
        found = PARTS[part](arguments)
        figures |= found
        _CONSOLE.print(f"{part}: {time.monotonic() - began:.0f} s")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(figures, indent=2, sort_keys=True) + "\n", "utf-8")
        _tell(found)
    _CONSOLE.print(f"written: {path}")
    return 0


def _tell(found: Mapping[str, Any]) -> None:
    for name, value in found.items():
        if not isinstance(value, dict):
            _CONSOLE.print(f"{name}: {value}")
        elif "nodes" in value:
            _CONSOLE.print(show(name, value), value.get("stages_ms", ""))
        elif "each_run" in value:
            for each in value["each_run"]:
                _CONSOLE.print(
                    {
                        key: each[key]
                        for key in ("latency_p10_ms", "latency_p50_ms", "latency_p99_ms", "unanswered_share")
                    }
                )
            _CONSOLE.print(show(name, value["each_run"][-1]), value["each_run"][-1]["stages_ms"])


if __name__ == "__main__":
    sys.exit(main())
