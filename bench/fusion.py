"""Fusion against paper A, its rivals and GTSAM; a minute without ranges; proximity; a recording.

    make bench-fusion        (MINE_LOC_DATA names the folder of public recordings; without it that row is left out)

Writes fusion.json beside the results of the other benches; docs/fusion.md says what each row means.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

import fusion_blackout
import fusion_carried
import fusion_isas
import fusion_paper_a
import fusion_proximity

RESULTS = Path(__file__).parent / "results" / "fusion.json"
PARTS: Mapping[str, Callable[[], Any]] = {
    "paper_a": fusion_paper_a.run,
    "isas_walk1": fusion_isas.run,
    "carried": fusion_carried.run,
    "blackout": fusion_blackout.run,
    "proximity": fusion_proximity.proximity_rows,
    "proximity_obstacles": partial(fusion_proximity.proximity_rows, "loading_place", "obstacles"),
    "proximity_anchors_on_vehicle": partial(fusion_proximity.proximity_rows, "vehicle", "spikes"),
}


def main() -> None:
    """Run the parts and keep the results of those that are not run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=PARTS, nargs="+", default=list(PARTS), help="parts to run; default: all")
    results = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {}
    for name in parser.parse_args().only:
        if name == "isas_walk1" and not os.environ.get("MINE_LOC_DATA"):
            print("isas_walk1: left out, MINE_LOC_DATA is not set", file=sys.stderr)
            continue
        results[name] = PARTS[name]()
        print(json.dumps({name: results[name]}, indent=2), flush=True)
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(results, indent=2) + "\n", "utf-8")


if __name__ == "__main__":
    main()
