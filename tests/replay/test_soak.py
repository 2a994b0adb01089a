"""Hours of one person through the nodes: memory stays what it was, and nothing is forgotten on the way.

The suite takes minutes of it; `make nightly` takes an hour (MINE_LOC_SOAK_SECONDS).
"""

import gc
import os
import tracemalloc
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from replay.faults import IMU, RANGES, shifted

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.nodes.offline_replay import OfflineReplay
from mine_loc_core.stamps import NS_PER_S

WALK = Path(__file__).parent / "walk" / "bag"
SECONDS = float(os.environ.get("MINE_LOC_SOAK_SECONDS", "120"))
ROUND_S = 46
MOST_GROWN_BYTES = 1_000_000


class Counted:
    """A sink that keeps nothing but numbers."""

    def __init__(self) -> None:
        self.written: Counter[str] = Counter()

    def write(self, topic: str, kind: object, stamp_ns: int, data: bytes) -> None:  # noqa: ARG002
        self.written[topic] += 1


@pytest.mark.timeout(1200)
def test_memory_stays_what_it_was():
    rounds = max(round(SECONDS / ROUND_S), 4)
    with open_bag(WALK) as bag:
        messages = list(bag.read({RANGES, IMU}))
        topics, start_ns = {topic: bag.topics[topic] for topic in (RANGES, IMU)}, bag.start_ns
    sink = Counted()
    run = OfflineReplay(topics, WALK / "site", start_ns, sink)
    tracemalloc.start()
    sizes, poses = [], []
    for number in range(rounds):
        for message in messages:
            run.take(shifted(message, number * ROUND_S * NS_PER_S))
        gc.collect()
        sizes.append(tracemalloc.get_traced_memory()[0])
        poses.append(sink.written["/fused/poses"])
    tracemalloc.stop()
    run.close()
    grown_bytes = sizes[-1] - sizes[rounds // 2]
    assert grown_bytes < MOST_GROWN_BYTES, f"{sizes}"
    assert not run.faults
    assert min(after - before for before, after in pairwise(poses)) > 440  # as many each round
