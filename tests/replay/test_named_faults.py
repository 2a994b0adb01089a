"""Every named fault, as a transformation of the bag `walk`, through the nodes, against the bounds beside the bag.

The bounds are files for `mine-loc evaluate --expect`: walk/expect/<fault>.yaml.
"""

import shutil
from pathlib import Path

import pytest
from replay import faults

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_bringup.evaluation.bag_evaluation import evaluate_bag
from mine_loc_bringup.evaluation.expectations import checks, load_expectations
from mine_loc_bringup.nodes.offline_replay import OfflineReplay

WALK = Path(__file__).parent / "walk"
EXPECTATIONS = sorted((WALK / "expect").glob("*.yaml"))


def replayed(fault: str, out: Path) -> None:
    """The bag with a fault, replayed into another."""
    site = out.parent / "site"
    shutil.copytree(WALK / "bag" / "site", site)
    change = getattr(faults, fault)
    with open_bag(WALK / "bag") as bag:
        messages = list(bag.read(set(bag.topics)))
        topics = bag.topics
    if fault in faults.OF_SITE:
        change(site)
    else:
        messages = list(change(messages))
        topics |= {message.topic: message.type_name for message in messages}
    writer = BagWriter(out)
    run = OfflineReplay(topics, site, messages[0].log_ns, writer)
    for message in messages:
        run.take(message)
    run.close()
    writer.close()
    assert not run.faults, "a node raised an exception"


def test_every_fault_has_its_expectations():
    assert {file.stem for file in EXPECTATIONS} == set(faults.NAMES)


@pytest.mark.parametrize("expectations", EXPECTATIONS, ids=lambda file: file.stem)
def test_the_graph_stands(expectations, tmp_path):
    replayed(expectations.stem, tmp_path / "out")
    found = list(checks(load_expectations(expectations), evaluate_bag(tmp_path / "out")))
    assert found
    assert [str(check) for check in found if not check.passed] == []
