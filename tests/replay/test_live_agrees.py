"""One bag through the live graph and offline: the same poses, to a centimetre."""

import math
import sys
import time
from pathlib import Path

import pytest
from graph.domains import lent_domain
from graph.observer import Observer
from graph.processes import running, up_command
from mine_loc_interfaces.msg import PersonPoseArray
from replay.fused_places import places, places_of

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.message_types import workspace_types
from mine_loc_bringup.offline_run import replay_offline
from mine_loc_core.stamps import to_stamp_ns

pytestmark = pytest.mark.graph

FOLDER = Path(__file__).parent
NODES = ("uwb_solver", "pdr", "synchroniser", "fusion")
QUIET_S = 1.5
MOST_APART_M = 0.01
LEAST_SHARE = 0.98
"""Of the stamps: under load a step may come a coast's period later, and then that one pose is another."""


@pytest.mark.timeout(180)
@pytest.mark.parametrize(("scene", "rate"), [("damaged_lines", "3"), ("judged_links", "0.4")])
def test_live_and_offline_agree_within_a_centimetre(scene, rate, tmp_path):
    """Slowly where a classifier works: a judgement that misses its round by load is another input."""
    bag = FOLDER / scene / "bag"
    replay_offline(bag, tmp_path / "out")
    types, offline = workspace_types(), places_of(tmp_path / "out")
    rounds = {to_stamp_ns(types.deserialize_cdr(each.data, each.type_name).header.stamp) for each in read(bag)}
    nodes = ("los_classifier", *NODES) if scene == "judged_links" else NODES
    live = {}
    with lent_domain() as domain:
        observer = Observer(domain)
        try:
            poses = observer.listen(PersonPoseArray, "fused/poses")
            up = up_command(bag / "site", "--sim-time", "--only", *nodes)
            with running(up, domain, tmp_path / "up.log"):
                observer.wait_for(lambda: {name.split(":")[0] for name in observer.status} >= set(nodes), 60.0, "nodes")
                words = [sys.executable, "-m", "mine_loc_bringup.main", "replay", str(bag), "--live", "--rate", rate]
                with running(words, domain, tmp_path / "replay.log") as player:
                    observer.wait_for(lambda: not player.alive, 120.0, "the end of the bag")
                    observer.wait_for(lambda: time.monotonic() - poses.at_s[-1] > QUIET_S, 30.0, "the last pose")
        finally:
            observer.close()
    for array in poses.messages:
        live |= places(array)
    both = [key for key in offline.keys() & live.keys() if key[1] in rounds]
    assert len(both) > 0.9 * len(rounds)  # poses of ranging rounds; those between are when a timer ran
    near = sum(math.dist(offline[key], live[key]) < MOST_APART_M for key in both)
    worst = max(math.dist(offline[key], live[key]) for key in both)
    assert near >= LEAST_SHARE * len(both), f"{near} of {len(both)}, at worst {worst:.3f} m apart"


def read(bag: Path) -> list:
    """The ranging rounds of a bag."""
    with open_bag(bag) as found:
        return list(found.read({"/uwb/ranges"}))
