"""Dead reckoning on recordings of waists and phones; writes bench/results/pdr.json.

    python bench/pdr.py [--json FILE] [--only ipol oxford mobgap shaken streams activity paper_b]

Needs MINE_LOC_DATA. What is learnt is learnt on the other people (ipol) or on ipol (oxford, mobgap); paper_b
and shaken are simulated. docs/pdr.md explains the rows.
"""

import argparse
import itertools
import json
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core: before numpy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

import pdr_activity
import pdr_distance
import pdr_heading
import pdr_mounting
import pdr_paper_b
import pdr_recordings
import pdr_shaken
import pdr_steps
import pdr_streams
from pdr_recordings import Recording
from pdr_references import references
from pdr_step_network import held_out_weights
from pdr_tracks import shipped_detector, track
from rich.console import Console
from rich.table import Column, Table

from mine_loc_pdr.step_detector import NetworkStepDetector
from mine_loc_pdr.steps import StepDetector

RESULTS = Path(__file__).parent / "results" / "pdr.json"


def ipol() -> dict[str, Any]:
    """Thirteen people, 10 m out, U-turn, 10 m back."""
    recordings = list(pdr_recordings.ipol())
    steps, models = pdr_steps.ipol(recordings, held_out_weights(recordings))
    detectors = {recording.name: model for recording, model in zip(recordings, models, strict=True)}

    def held_out(recording: Recording) -> StepDetector:
        return NetworkStepDetector(detectors[recording.name])

    tracks = [track(recording, held_out(recording)) for recording in recordings]
    distance, stretch = pdr_distance.ipol(recordings, held_out)
    heading = pdr_heading.ipol(recordings, tracks, stretch)
    mounting = pdr_mounting.ipol(recordings, held_out)
    return {"steps": steps, "heading": heading, "distance": distance, "mounting": mounting}


def oxford() -> dict[str, Any]:
    """Phones in hands, pockets and pouches."""
    return {"steps": pdr_steps.oxford(list(pdr_recordings.oxford()))}


def mobgap() -> dict[str, Any]:
    """Short walks and a simulation of daily activities."""
    recordings = list(pdr_recordings.mobgap())
    tracks = [track(recording, shipped_detector()) for recording in recordings]
    return {
        "steps": pdr_steps.mobgap(recordings),
        "distance": pdr_distance.mobgap(recordings, tracks),
        "references": references(recordings, tracks),
    }


def streams() -> dict[str, Any]:
    """How many people one core carries."""
    return pdr_streams.streams(list(itertools.islice(pdr_recordings.ipol(), 8)))


PARTS: Mapping[str, Callable[[], dict[str, Any]]] = {
    "ipol": ipol,
    "oxford": oxford,
    "mobgap": mobgap,
    "shaken": pdr_shaken.shaken,
    "streams": streams,
    "activity": pdr_activity.activity,
    "paper_b": pdr_paper_b.paper_b,
}


def table(figures: Mapping[str, Any]) -> Table:
    """Every leaf that a reader compares with a target; the file has all."""
    shown = Table(Column("figure", overflow="fold"), "value", title="dead reckoning")
    for path, value in _leaves(figures, ""):
        shown.add_row(path, value)
    return shown


def _leaves(node: Mapping[str, Any], path: str) -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for name, value in node.items():
        here = f"{path}.{name}".lstrip(".")
        if isinstance(value, dict) and "mean" in value:
            end = "max" if "max" in value else "min"
            rows.append((here, f"{value['mean']} ± {value['sd']} ({end} {value[end]})"))
        elif isinstance(value, dict):
            rows += _leaves(value, here)
        else:
            rows.append((here, str(value)))
    return rows


def main() -> int:
    """Run the chosen parts and write them beside those already in the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, default=RESULTS, help="file to write into")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="parts to run (default all)")
    arguments = parser.parse_args()
    console = Console()
    if not os.environ.get("MINE_LOC_DATA"):
        console.print("left out: MINE_LOC_DATA is not set")
        return 0
    path: Path = arguments.json
    figures: dict[str, Any] = json.loads(path.read_text("utf-8")) if path.exists() else {}
    for part in arguments.only:
        with console.status(part):
            figures[part] = PARTS[part]()
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(figures, indent=2, sort_keys=True) + "\n", "utf-8")
    console.print(table(figures))
    console.print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
