"""What the live map shows: ellipses that hold the people, borders that are those of the zones, everything once."""

import math
from pathlib import Path

import numpy as np
import pytest

from mine_loc_core.site import load_site
from mine_loc_fusion.map_drawing import GREEN, RED, YELLOW, border, draw_person, draw_site, draw_vehicles, draw_zones
from mine_loc_fusion.mode import Mode
from mine_loc_fusion.possible_presence import SeenPerson
from mine_loc_fusion.proximity import Pose2
from mine_loc_fusion.site_zones import proximity_zones
from mine_loc_fusion.zone_shape import ZoneShape, outline

CONFIG = Path(__file__).parents[3] / "config"
SITE = load_site(CONFIG / "example_mine")
ZONES = proximity_zones(SITE)
CAR = {"shuttle_car": Pose2(10.0, 1.0, math.pi / 2)}


def seen(covariance, mode=Mode.UWB_PDR) -> SeenPerson:
    return SeenPerson("fitter", 0, np.array([3.0, 4.0]), np.array(covariance), mode)


def test_a_person_s_ellipse_holds_them_with_95_percent_and_lies_along_the_doubt():
    covariance = np.array([[2.0, 1.5], [1.5, 2.0]])  # 45 degrees
    ellipse, label = draw_person(seen(covariance), 1.0)
    assert ellipse.yaw_rad % math.pi == pytest.approx(math.pi / 4)
    turn = np.array(
        [
            [math.cos(ellipse.yaw_rad), math.sin(ellipse.yaw_rad)],
            [-math.sin(ellipse.yaw_rad), math.cos(ellipse.yaw_rad)],
        ]
    )
    drawn = np.random.default_rng(1).multivariate_normal([3.0, 4.0], covariance, 100_000) - ellipse.position_m[:2]
    inside = np.sum((drawn @ turn.T / (0.5 * np.array(ellipse.size_m[:2]))) ** 2, axis=1) <= 1.0
    assert inside.mean() == pytest.approx(0.95, abs=0.003)
    assert label.text == "fitter UWB_PDR"


@pytest.mark.parametrize(("mode", "colour"), [(Mode.UWB_ONLY, GREEN), (Mode.COASTING, YELLOW), (Mode.LOST, RED)])
def test_its_colour_says_how_well_the_person_is_known(mode, colour):
    assert next(draw_person(seen(np.eye(2), mode), 1.0)).colour == colour


def test_a_person_without_a_position_is_not_drawn():
    assert list(draw_person(seen(np.full((2, 2), math.nan)), 1.0)) == []


def test_a_drawn_border_is_where_the_zone_ends():
    shape = ZoneShape(outline(6.0, 2.5), 2.0).placed(5.0, 5.0, 0.4)
    assert np.abs(shape.signed_distance_m(border(shape))).max() < 1e-9
    sharp = ZoneShape(outline(6.0, 2.5))
    assert np.array_equal(border(sharp), sharp.polygon_m)


def test_the_place_shows_every_anchor_gallery_and_zone_once():
    drawn = list(draw_site(SITE, ZONES))
    names = {group: [each.name for each in drawn if each.group == group] for group in {each.group for each in drawn}}
    assert len(names["anchors"]) == len(SITE.anchors)
    assert names["galleries"] == ["main", "branch"]
    assert names["zones"] == ["portal", "pump_room", "face", "pump_drive"]
    assert names["danger"] == names["warning"] == ["pump_drive"]  # the car's go with the car


def test_anchors_that_a_vehicle_carries_are_not_part_of_the_place():
    site = load_site(CONFIG / "vehicle")
    assert not [each for each in draw_site(site, ()) if each.group == "anchors"]


def test_a_vehicle_is_drawn_with_its_zones_where_it_is_and_not_at_all_where_it_is_unknown():
    carried = tuple(zone for zone in ZONES if zone.vehicle)
    (body, _), zones = draw_vehicles(SITE, CAR), list(draw_zones(carried, CAR))
    assert (body.position_m[:2], body.yaw_rad) == ((10.0, 1.0), math.pi / 2)
    danger = next(zone for zone in zones if zone.group == "danger").points_m
    assert danger[:, 1].max() == pytest.approx(1.0 + 4.0 + 3.0)  # half its length, and 3 m
    assert list(draw_vehicles(SITE, {})) == list(draw_zones(carried, {})) == []
