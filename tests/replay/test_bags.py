"""Every committed bag through the nodes, against the bounds beside it; the public recordings where they are."""

import os
from pathlib import Path

import pytest

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.evaluation.bag_evaluation import evaluate_bag
from mine_loc_bringup.evaluation.expectations import checks, load_expectations
from mine_loc_bringup.evaluation.measures import Comparing
from mine_loc_bringup.main import main as mine_loc
from mine_loc_bringup.message_types import workspace_types
from mine_loc_bringup.offline_run import replay_offline

FOLDER = Path(__file__).parent
SCENES = sorted(file.parent for file in FOLDER.glob("*/expect.yaml"))
REAL = sorted((FOLDER / "recordings").glob("*.yaml"))


def judged(bag: Path, bounds: Path, comparing: Comparing | None = None) -> list[str]:
    """Bounds that do not hold."""
    found = list(checks(load_expectations(bounds), evaluate_bag(bag, comparing=comparing)))
    assert found
    return [str(check) for check in found if not check.passed]


@pytest.mark.parametrize("scene", SCENES, ids=lambda folder: folder.name)
def test_the_bounds_beside_a_bag_hold(scene, tmp_path):
    run = replay_offline(scene / "bag", tmp_path / "out")
    assert not run.faults
    assert judged(tmp_path / "out", scene / "expect.yaml") == []


def test_bearings_alone_make_regions_about_those_who_are_heard(tmp_path):
    replay_offline(FOLDER / "bearings" / "bag", tmp_path / "out")
    types = workspace_types()
    with open_bag(tmp_path / "out") as bag:
        found = [(each.topic, types.deserialize_cdr(each.data, each.type_name)) for each in bag.read(set(bag.topics))]
    places = {}
    held = []
    for topic, message in found:
        if topic.startswith("/truth/"):
            places[topic] = message.pose.position
        elif topic == "/coarse/regions" and len(places) == 2:
            near = (min((region.center.x - p.x) ** 2 + (region.center.y - p.y) ** 2 for p in places.values()) ** 0.5
                    for region in message.regions)  # fmt: skip
            held += [off_m < 3.0 * region.radius for off_m, region in zip(near, message.regions, strict=True)]
    assert len(held) > 50
    assert all(held)


@pytest.mark.parametrize("bounds", REAL, ids=lambda file: file.stem)
def test_a_public_recording_is_imported_and_replayed_within_its_bounds(bounds, tmp_path):
    data = os.environ.get("MINE_LOC_DATA")
    if not data:
        pytest.skip("MINE_LOC_DATA is not set: the public recordings are not here")
    folder, name = bounds.stem.split(".")
    kind = {"isas_walk_uwb_imu": "isas", "trek1000_bielefeld": "trek1000", "hanyang_outdoor_uwb": "hanyang"}[folder]
    assert mine_loc(["import", kind, f"{data}/{folder}", str(tmp_path), "--recording", name]) == 0
    assert not replay_offline(tmp_path / name, tmp_path / "out").faults
    comparing = Comparing(rigid=kind != "hanyang", apply_time_offset=kind == "trek1000")
    assert judged(tmp_path / "out", bounds, comparing) == []
