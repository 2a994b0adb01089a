"""The simulator against what it simulates, and how fast it is: writes bench/results/sim.json.

    python bench/sim.py [--json FILE] [--only chain emulators channel gait] [--seconds S]

`channel` is bench/sim_channel.py and `gait` bench/sim_gait.py (both need MINE_LOC_DATA for what is compared with
recordings); `chain` is the speed of radio, walkers and inertial sensors together on one core, inertial frames as
payloads; `emulators` counts what the drivers' decoders lose of ten people at full rate, byte by byte.
"""

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core: before numpy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

import sim_channel
import sim_gait

from mine_loc_coarse import monitor_protocol
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site
from mine_loc_pdr.fdilink import FdilinkDecoder
from mine_loc_sim.byte_streams import byte_blocks
from mine_loc_sim.scenario import Scenario
from mine_loc_sim.scene import SceneOptions, crew, line_formats
from mine_loc_uwb.wire.detect import make_decoder

HERE = Path(__file__).parent
SITE = HERE.parent / "config" / "example_mine"
PARTS = ("chain", "emulators", "channel", "gait")
REPEATS = 3


def scenario(people: int, options: SceneOptions) -> Scenario:
    """A scene in the example mine."""
    site = load_site(SITE)
    return Scenario(site, crew(site, tuple(load_people(SITE)), people), options)


def chain_speed(people: int, options: SceneOptions) -> dict[str, float]:
    """Person-seconds made a second of processor time: all devices' frames and the truth, best and worst of repeats."""
    speeds = []
    for _ in range(REPEATS):
        scene = scenario(people, options)
        began = time.process_time()
        for _ in scene.blocks():
            pass
        speeds.append(people * options.seconds / (time.process_time() - began))
    return {"best": max(speeds), "worst": min(speeds), "n": REPEATS}


def chain() -> dict[str, Any]:
    """4 links at 10 Hz and an N100 at 100 Hz a person."""
    fast = SceneOptions(seed=1, seconds=60.0)
    list(scenario(1, SceneOptions(seconds=1.0)).blocks())  # reads the range law and its receptions, once a process
    speeds = {
        "with_cir": chain_speed(4, SceneOptions(seed=1, seconds=10.0, cir=True)),
        "without_cir": chain_speed(10, fast),
    }
    best = {name: figures["best"] for name, figures in speeds.items()}
    return {"person_seconds_per_s": {**best, "spread": speeds}}


def emulators(seconds: float) -> dict[str, Any]:
    """Decode ten people at full rate; losses of all lines together, by kind, and what was decoded."""
    scene = scenario(10, SceneOptions(seed=1, seconds=seconds, tdoa=True))
    others: dict[str, Callable[[], Any]] = {"fdilink": FdilinkDecoder, "mldf": monitor_protocol.decoder}
    formats = line_formats(scene.site, scene.people)
    decoders = {line: others[each]() if each in others else make_decoder(each) for line, each in formats.items()}
    decoded: Counter[str] = Counter()
    began = time.process_time()
    for block in byte_blocks(scene):
        for line, arrivals in block.items():
            decoded[line] += sum(len(decoders[line].feed(data)) for _, data in arrivals if isinstance(data, bytes))
    took_s = time.process_time() - began
    losses: Counter[str] = sum((decoder.losses for decoder in decoders.values()), Counter())
    return {
        "emulators": {
            "people": 10,
            "seconds": seconds,
            "messages": sum(decoded.values()),
            "losses": dict(+losses),
            "person_seconds_per_s": 10 * seconds / took_s,
        }
    }


def main() -> int:
    """Write the chosen parts beside those already in the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, default=HERE / "results" / "sim.json", help="file to write into")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="parts to run (default all)")
    parser.add_argument("--seconds", type=float, default=600.0, help="length of the emulators' run (default 600)")
    arguments = parser.parse_args()
    path: Path = arguments.json
    known: dict[str, Any] = json.loads(path.read_text("utf-8")) if path.exists() else {}
    if "channel" in arguments.only:
        figures = sim_channel.run()
        figures["radio_person_seconds_per_s"] = figures.pop("person_seconds_per_s")
        known |= figures
    if "gait" in arguments.only and os.environ.get("MINE_LOC_DATA"):
        known["gait"] = sim_gait.run()
    if "chain" in arguments.only:
        known |= chain()
    if "emulators" in arguments.only:
        known |= emulators(arguments.seconds)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(known, indent=2, sort_keys=True) + "\n", "utf-8")
    print(json.dumps({key: known[key] for key in ("person_seconds_per_s", "emulators") if key in known}, indent=2))
    print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
