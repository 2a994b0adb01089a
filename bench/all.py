"""Every bench, one after the other, and docs/results.md from what they found.

    make bench
    python bench/all.py --only uwb coarse          (that page goes to build/results.md)

Files of earlier runs are put aside into bench/results/earlier first, so that each figure on the page is of this run.
A bench that fails or takes longer than its limit is named on the page, the others go on, and the exit status is 1.
"""

import argparse
import contextlib
import json
import os
import platform
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml
from results_page import BenchRun, RunFacts, page
from rich.console import Console

HERE = Path(__file__).parent
ROOT, RESULTS = HERE.parent, HERE / "results"
WHOLE_MINUTES = 73.0
STOP_S = 20.0
NOT_ASKED_FOR = "not asked for"


@dataclass(frozen=True, slots=True)
class Bench:
    """A bench, what it is given, and how long it may take."""

    name: str
    limit_minutes: float
    options: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """As a user types it."""
        return " ".join(("python", f"bench/{self.name}.py", *self.options))


BENCHES = (
    Bench("coarse", 4),
    Bench("replay", 8),
    Bench("uwb", 10),
    Bench("fusion", 15),
    Bench("pdr", 20),
    Bench("los", 15),
    Bench("sim", 8),
    Bench("recorder", 8, ("--only", "kills", "cost", "jitter")),  # the search for the highest rate may take ten minutes
    Bench("store", 8, ("--rows", "2000000")),  # ten million may not fit the limit; the page says how many
    Bench("live", 22),
)
"""Two searches for a fleet come last: what they may take is what the others leave."""


def main() -> int:
    """Run, write the page, and say with the exit status whether all went well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [bench.name for bench in BENCHES]
    parser.add_argument("--only", nargs="+", choices=names, default=names, help="benches to run (default all)")
    parser.add_argument(
        "--page", type=Path, help="page to write (default docs/results.md, with --only build/results.md)"
    )
    arguments = parser.parse_args()
    whole = set(arguments.only) == set(names)
    path: Path = arguments.page or ROOT / ("docs/results.md" if whole else "build/results.md")
    console, ends = Console(), time.monotonic() + 60.0 * WHOLE_MINUTES
    logs = ROOT / "build" / "bench"
    logs.mkdir(parents=True, exist_ok=True)
    runs = []
    for bench in BENCHES:
        if bench.name not in arguments.only:
            runs.append(BenchRun(bench.name, bench.command, 0.0, NOT_ASKED_FOR))
            continue
        put_aside(RESULTS / f"{bench.name}.json")
        with console.status(f"{bench.name} ({len(runs) + 1} of {len(BENCHES)}), at most {bench.limit_minutes:.0f} min"):
            runs.append(run(bench, ends, logs / f"{bench.name}.log"))
        console.print(f"{bench.name}: {runs[-1].outcome}, {runs[-1].seconds:.0f} s")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(write_page(runs), "utf-8")
    console.print(f"written: {path}; what the benches printed: {logs}")
    return 0 if all(each.outcome in ("done", NOT_ASKED_FOR) for each in runs) else 1


def put_aside(file: Path) -> None:
    """Keep what an earlier run found where no page reads it."""
    if file.exists():
        (file.parent / "earlier").mkdir(exist_ok=True)
        file.replace(file.parent / "earlier" / file.name)


def run(bench: Bench, ends: float, log: Path) -> BenchRun:
    """Run one bench with its children in a group of their own, which ends with it, at the latest at its limit."""
    limit_s = min(60.0 * bench.limit_minutes, ends - time.monotonic())
    if limit_s <= 0.0:
        return BenchRun(bench.name, bench.command, 0.0, "not begun: no time left")
    began, command = time.monotonic(), [sys.executable, str(HERE / f"{bench.name}.py"), *bench.options]
    with log.open("wb") as output:
        child = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, cwd=ROOT, start_new_session=True)
        try:
            outcome = "done" if child.wait(limit_s) == 0 else f"failed with status {child.returncode}"
        except subprocess.TimeoutExpired:
            outcome = f"stopped at its limit of {limit_s / 60:.0f} min"
        finally:
            stop(child)
    if outcome == "done" and not (RESULTS / f"{bench.name}.json").exists():
        outcome = "ran, but wrote nothing"
    return BenchRun(bench.name, bench.command, time.monotonic() - began, outcome)


def stop(child: subprocess.Popen[bytes]) -> None:
    """Interrupt a bench that still runs, so that it ends what it started; kill what is left of its group."""
    if child.poll() is None:
        child.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(STOP_S)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def write_page(runs: list[BenchRun]) -> str:
    """Markdown from the files that the runs left; what of a bench that failed is there counts as well."""
    spec = yaml.safe_load((HERE / "results_page.yaml").read_text("utf-8"))
    files: dict[str, dict[str, Any]] = {}
    for each in runs:
        file = RESULTS / f"{each.name}.json"
        if each.outcome != NOT_ASKED_FOR and file.exists():
            files[each.name] = json.loads(file.read_text("utf-8"))
    folder = os.environ.get("MINE_LOC_DATA")
    sets = frozenset(each.name for each in Path(folder).iterdir() if each.is_dir()) if folder else frozenset()
    return page(spec, files, RunFacts(f"{datetime.now(UTC):%Y-%m-%d}", machine(), sets, runs))


def machine() -> dict[str, str]:
    """What a reader needs to judge the times by."""
    lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
    cores = len(os.sched_getaffinity(0))
    return {"processor": model, "cores": str(cores), "Python": platform.python_version()}


if __name__ == "__main__":
    sys.exit(main())
