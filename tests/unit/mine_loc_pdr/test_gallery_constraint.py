"""A gallery guides who walks along it, and nobody else."""

import math

import numpy as np
import pytest

from mine_loc_core.site import Chamber, Gallery
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_pdr.gallery_constraint import ACROSS_SD_SHARE, COURSE_SD_RAD, STRETCH_M, GalleryConstraint

MAIN = Gallery("main", ((0, 0, 0), (100, 0, 0)), width_m=4.0, height_m=3.0)
CROSSCUT = Gallery("crosscut", ((50, 0, 0), (50, 40, 0)), width_m=4.0, height_m=3.0)
BENT = Gallery("bent", ((0, 100, 0), (50, 100, 0), (100, 110, 0)), width_m=4.0, height_m=3.0)
ROOM = Chamber("room", ((80, -10), (90, -10), (90, 10), (80, 10)), floor_m=0.0, height_m=3.0)
SITE = GalleryConstraint(WalkableArea([MAIN, CROSSCUT, BENT], [ROOM]))


def guide(x, y, course_deg, sd_m=0.5, length_m=0.7, site=SITE):
    return site.guide(np.array([x, y], dtype=float), sd_m, math.radians(course_deg), length_m)


@pytest.mark.parametrize("course_deg", [10.0, 190.0, -170.0])
def test_a_gallery_may_be_walked_either_way(course_deg):
    guidance = guide(20, 1.5, course_deg)
    assert guidance.across_m == pytest.approx(1.5)
    assert guidance.left == pytest.approx([0.0, 1.0])
    assert math.degrees(guidance.course_off_rad) == pytest.approx(10.0)


def test_a_stretch_of_steps_tells_what_one_observation_does():
    guidance = guide(20, 0, 0.0, length_m=0.5)
    assert guidance.across_variance_m2 / (STRETCH_M / 0.5) == pytest.approx((4.0 * ACROSS_SD_SHARE) ** 2)
    assert guidance.course_variance_rad2 / (STRETCH_M / 0.5) == pytest.approx(COURSE_SD_RAD**2)


@pytest.mark.parametrize(
    ("x", "y", "course_deg", "sd_m"),
    [
        (20, 0, 45.0, 0.5),  # across the gallery
        (20, 20, 0.0, 0.5),  # in the rock
        (50, 0, 45.0, 0.5),  # round a corner
        (78, 0, 0.0, 1.0),  # a chamber is in reach
        (20, 50, 0.0, 30.0),  # either of two galleries
    ],
)
def test_no_guidance_where_it_may_be_wrong(x, y, course_deg, sd_m):
    assert guide(x, y, course_deg, sd_m) is None


def test_at_a_junction_the_course_tells_which_gallery():
    assert guide(50, 1, 0.0).left == pytest.approx([0.0, 1.0])
    assert guide(50, 1, 90.0).left == pytest.approx([-1.0, 0.0])


def test_legs_of_one_gallery_do_not_compete():
    assert guide(50, 100.5, 5.0) is not None


def test_a_site_without_galleries_guides_nobody():
    assert guide(85, 0, 0.0, site=GalleryConstraint(WalkableArea([], [ROOM]))) is None


def test_a_step_of_no_length_tells_nothing():
    assert guide(20, 0, 0.0, length_m=0.0) is None
