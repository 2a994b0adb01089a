"""Whose frame positions are in: the map's, or that of the vehicle which carries the anchors."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Site, load_site
from mine_loc_uwb.anchor_frame import anchor_frame


@pytest.fixture
def site(tmp_path: Path) -> Site:
    """Anchors 1 and 2 hang in the mine, 3 and 4 are on a shuttle car, 5 on a loader; the trolley carries none."""

    def vehicle(name: str, *anchors: int) -> dict[str, object]:
        return {"id": name, "size_m": [6.0, 2.5, 2.0], "position_m": [0.0, 0.0, 0.0], "anchors": list(anchors)}

    content = {
        "schema": 1,
        "name": "mixed",
        "dimensions": 2,
        "tag_height_m": 1.0,
        "anchors": [{"id": i, "position_m": [float(i), 0.0, 2.0]} for i in range(1, 6)],
        "vehicles": [vehicle("shuttle", 3, 4), vehicle("loader", 5), vehicle("trolley")],
    }
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(content))
    return load_site(tmp_path)


def ids(frame):
    return [anchor.id for anchor in frame.anchors]


@pytest.mark.parametrize("wanted", ["", "map"])
def test_the_map_has_the_anchors_that_nobody_carries(site, wanted):
    frame = anchor_frame(site, wanted)
    assert (frame.name, ids(frame)) == ("map", [1, 2])


def test_a_vehicle_has_its_own_anchors_in_its_base_link(site):
    frame = anchor_frame(site, "shuttle")
    assert (frame.name, ids(frame)) == ("shuttle/base_link", [3, 4])


def only_carried(site, *vehicles):
    kept = tuple(vehicle for vehicle in site.vehicles if vehicle.id in vehicles)
    carried = {anchor for vehicle in kept for anchor in vehicle.anchor_ids}
    return replace(site, vehicles=kept, anchors=tuple(anchor for anchor in site.anchors if anchor.id in carried))


def test_the_only_vehicle_of_a_site_without_other_anchors_needs_no_naming(site):
    frame = anchor_frame(only_carried(site, "shuttle"), "")
    assert (frame.name, ids(frame)) == ("shuttle/base_link", [3, 4])


def test_the_only_vehicle_of_a_mine_that_has_anchors_of_its_own_must_be_named(site):
    assert ids(anchor_frame(replace(site, vehicles=site.vehicles[:1]), "")) == [1, 2, 5]


def test_of_several_vehicles_none_is_guessed(site):
    assert anchor_frame(only_carried(site, "shuttle", "loader"), "").name == "map"


@pytest.mark.parametrize("wanted", ["nowhere", "trolley", "Shuttle", "shuttle/base_link"])
def test_a_frame_that_has_no_anchors_here_is_refused_with_those_that_do(site, wanted):
    with pytest.raises(ConfigurationError, match=rf"uwb_solver: frame: '{wanted}' .* allowed: map, shuttle, loader$"):
        anchor_frame(site, wanted)
