"""The recorder under load and under `kill -9`, and the player's punctuality; writes bench/results/recorder.json.

    python bench/recorder.py [--json FILE] [--only kills cost rate jitter] [--kills N]

docs/bags.md explains the figures. Rates and costs hold for the machine; the counts of kills must be what they are
everywhere: the last second missing at most, no gap. A repaired bag that another reader cannot read ends the bench.
"""

import argparse
import json
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from graph.domains import lent_domain
from graph.observer import Observer
from graph.processes import node_command, running
from graph.recorder_kills import Load, Publisher, await_heard, numbers_in, record_and_kill, recorder
from rich.console import Console
from rich.progress import track
from std_msgs.msg import UInt8MultiArray

from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_bringup.bags.bag_folder import Storage

RESULTS = Path(__file__).parent / "results" / "recorder.json"
SEED = 9
_CONSOLE = Console()
_SETTLE_S = 1.0


def kills(arguments: argparse.Namespace) -> dict[str, Any]:
    """`kill -9` at a random instant of a recording of 4 MB/s, by turns of both storages, whole and in parts."""
    draw = random.Random(SEED)
    outcomes = []
    for index in track(range(arguments.kills), "kills", console=_CONSOLE):
        storage, split_mb = list(Storage)[index % 2], (0.0, 2.0)[index // 2 % 2]
        with tempfile.TemporaryDirectory() as folder, lent_domain() as domain:
            outcomes.append(record_and_kill(Path(folder), domain, storage, draw.uniform(1.0, 4.0), Load(), split_mb))
    lost_s = sorted(outcome.lost_s for outcome in outcomes)
    return {
        "kills": len(outcomes),
        "lost_s_median": statistics.median(lost_s),
        "lost_s_max": lost_s[-1],
        "recordings_with_gaps": sum(outcome.gaps > 0 for outcome in outcomes),
        "files_with_a_torn_end": sum(outcome.torn_ends for outcome in outcomes),
        "messages_recovered": sum(outcome.recovered for outcome in outcomes),
        "messages_published": sum(outcome.published for outcome in outcomes),
    }


def cost(_: argparse.Namespace) -> dict[str, Any]:
    """Processor time of the recorder for each message, of 200 bytes and of 4 kB."""
    return {
        f"{storage.value}_{size}_bytes_us": round(_cost_us(storage, Load(4000.0, size)), 1)
        for storage in Storage
        for size in (200, 4000)
    }


def _cost_us(storage: Storage, load: Load) -> float:
    with tempfile.TemporaryDirectory() as folder, lent_domain() as domain:
        publisher = Publisher(domain, load)
        with recorder(Path(folder), domain, storage=storage.value, topics="load_*") as run:
            await_heard(publisher, run)
            time.sleep(_SETTLE_S)
            before_s = run.cpu_s
            time.sleep(_SETTLE_S)
            idle_share = (run.cpu_s - before_s) / _SETTLE_S
            before_s = run.cpu_s
            publisher.play(5.0)
            used_s = run.cpu_s - before_s - 5.0 * idle_share
        publisher.close()
        return 1e6 * used_s / len(publisher.at_ns)


def rate(_: argparse.Namespace) -> dict[str, Any]:
    """The highest rate of which nothing is missing after 5 s, in steps of 5 000 messages a second."""
    found = {}
    for storage in Storage:
        for size in (200, 4000):
            held_hz = 0.0
            for rate_hz in range(5_000, 60_001, 5_000):
                published_hz, complete = _recorded(storage, Load(float(rate_hz), size))
                _CONSOLE.print(f"{storage.value}, {size} bytes: {published_hz:.0f}/s {'held' if complete else 'not'}")
                if not complete or published_hz < 0.9 * rate_hz:
                    break
                held_hz = published_hz
            found[f"{storage.value}_{size}_bytes_hz"] = round(held_hz)
    return found


def _recorded(storage: Storage, load: Load) -> tuple[float, bool]:
    with tempfile.TemporaryDirectory() as folder, lent_domain() as domain:
        publisher = Publisher(domain, load)
        with recorder(Path(folder), domain, storage=storage.value, topics="load_*") as run:
            await_heard(publisher, run)
            time.sleep(_SETTLE_S)
            began_s = time.monotonic()
            publisher.play(5.0)
            lasted_s = time.monotonic() - began_s
            time.sleep(_SETTLE_S)
            run.stop()
        publisher.close()
        recorded = sum(1 for _ in numbers_in(Path(folder) / "bag"))
        return len(publisher.at_ns) / lasted_s, recorded == len(publisher.at_ns)


def jitter(_: argparse.Namespace) -> dict[str, Any]:
    """How late the player's messages are heard, by the earliest: 200 Hz for 10 s, in another process."""
    with tempfile.TemporaryDirectory() as folder, lent_domain() as domain:
        bag = Path(folder) / "bag"
        writer = BagWriter(bag)
        from rclpy.serialization import serialize_message  # noqa: PLC0415

        for number in range(2000):
            writer.write("/beat", UInt8MultiArray, number * 5_000_000, serialize_message(UInt8MultiArray()))
        writer.close()
        observer = Observer(domain)
        heard = observer.listen(UInt8MultiArray, "/beat")
        with running(node_command("mine_loc_bringup.nodes.player", {"bag": bag}), domain, Path(folder) / "log") as run:
            observer.wait_for(lambda: not run.alive, 60.0)
        observer.close()
    late_ms = sorted(1e3 * (at_s - 0.005 * index) for index, at_s in enumerate(heard.at_s))
    late_ms = [each - late_ms[0] for each in late_ms]
    return {
        "messages": len(late_ms),
        "late_p50_ms": round(statistics.median(late_ms), 2),
        "late_p99_ms": round(late_ms[round(0.99 * len(late_ms)) - 1], 2),
        "late_max_ms": round(late_ms[-1], 2),
    }


_PARTS: dict[str, Callable[[argparse.Namespace], dict[str, Any]]] = {
    "kills": kills,
    "cost": cost,
    "rate": rate,
    "jitter": jitter,
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, default=RESULTS)
    parser.add_argument("--only", nargs="+", choices=_PARTS, default=list(_PARTS))
    parser.add_argument("--kills", type=int, default=50)
    arguments = parser.parse_args()
    results = {name: _PARTS[name](arguments) for name in arguments.only}
    arguments.json.parent.mkdir(exist_ok=True)
    arguments.json.write_text(json.dumps(results, indent=1) + "\n")
    _CONSOLE.print_json(data=results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
