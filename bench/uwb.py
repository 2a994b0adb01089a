"""UWB positions: the tables of papers A, C and D, real recordings and peers; writes bench/results/uwb.json.

    python bench/uwb.py [--json FILE] [--only range_correction paper_c paper_d hanyang trek_lab]

Each part can be run alone: bench/uwb_range_correction.py, uwb_paper_c.py, uwb_paper_d.py, uwb_hanyang.py and
uwb_trek_lab.py. The last two, and half of the first, need MINE_LOC_DATA. docs/uwb-solvers.md explains the rows.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core: before numpy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

import uwb_hanyang
import uwb_paper_c
import uwb_paper_d
import uwb_range_correction
import uwb_trek_lab
from rich.console import Console
from rich.table import Table

RESULTS = Path(__file__).parent / "results" / "uwb.json"
PARTS: Mapping[str, Callable[[], dict[str, Any]]] = {
    "paper_c": lambda: {"paper_c": uwb_paper_c.run()},
    "range_correction": uwb_range_correction.run,
    "trek_lab": lambda: {"trek_lab": uwb_trek_lab.run()},
    "hanyang": lambda: {"hanyang": uwb_hanyang.run()},
    "paper_d": lambda: {"paper_d": uwb_paper_d.run()},
}
NEED_DATA = {"hanyang", "trek_lab"}
_ERRORS = ("rmse_2d_m", "median_m")


def tables(figures: Mapping[str, Any]) -> list[Table]:
    """The rows a reader looks for first; the file has all."""
    shown = []
    if "paper_c" in figures:
        table = Table("solver", "spikes [cm]", "obstacles [cm]", title="paper C, mean error ± sd over runs")
        for row in (key for key in figures["paper_c"]["spikes"] if key.endswith("_cm")):
            found = [figures["paper_c"][scene][row] for scene in ("spikes", "obstacles")]
            table.add_row(row.removesuffix("_cm"), *(f"{each['mean']:.1f} ± {each['sd']:.1f}" for each in found))
        shown.append(table)
    shown.extend(_recording(part, figures[part]) for part in ("hanyang", "trek_lab") if part in figures)
    if "paper_d" in figures:
        shown.append(uwb_paper_d.show(figures["paper_d"]))
    return shown


def _recording(part: str, figures: Mapping[str, Any]) -> Table:
    runs = [run for run, rows in figures.items() if "least_squares" in rows and isinstance(rows["least_squares"], dict)]
    measure = next(name for name in _ERRORS if name in figures[runs[0]]["least_squares"])
    table = Table("solver", *runs, title=f"{part}, {measure}")
    for solver in figures[runs[0]]:
        if solver != "constants":
            table.add_row(solver, *(f"{figures[run][solver][measure]:.3f}" for run in runs))
    return table


def main() -> int:
    """Run the chosen parts and write them beside those already in the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, default=RESULTS, help="file to write into")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="parts to run (default all)")
    arguments = parser.parse_args()
    path: Path = arguments.json
    figures: dict[str, Any] = json.loads(path.read_text("utf-8")) if path.exists() else {}
    console = Console()
    for part in arguments.only:
        if part in NEED_DATA and not os.environ.get("MINE_LOC_DATA"):
            console.print(f"{part} left out: MINE_LOC_DATA is not set")
            continue
        began = time.monotonic()
        figures |= PARTS[part]()
        console.print(f"{part}: {time.monotonic() - began:.0f} s")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(figures, indent=2, sort_keys=True) + "\n", "utf-8")
    for table in tables(figures):
        console.print(table)
    console.print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
