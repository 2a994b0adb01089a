"""Walls: a Gaussian that reaches through them is cut off, what lies well inside stays as it is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walks import at, ranges_to

from mine_loc_core.site import Chamber, Gallery
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion.estimate import EpochInputs
from mine_loc_fusion.gallery_walls import between_walls, inside
from mine_loc_fusion.tightly_coupled import TightlyCoupled

GALLERY = Gallery("g", ((0, 0, 0), (100, 0, 0)), width_m=4.0, height_m=3.0)
CROSSING = Gallery("c", ((50, -50, 0), (50, 50, 0)), width_m=4.0, height_m=3.0)
AREA = WalkableArea([GALLERY])


def spread(along_m, across_m, correlated_speed=0.0):
    covariance = np.diag([along_m**2, across_m**2, 1.0, 1.0])
    covariance[1, 3] = covariance[3, 1] = correlated_speed
    return covariance


def test_the_moments_are_those_of_samples_that_stay_between_the_walls():
    rng = np.random.default_rng(1)
    covariance = spread(2.0, 1.5, correlated_speed=0.8)
    samples = rng.multivariate_normal([30.0, 1.8, 1.0, 0.0], covariance, 400_000)
    kept = samples[np.abs(samples[:, 1]) < 2.0]
    position, velocity, found = between_walls(np.array([30.0, 1.8]), np.array([1.0, 0.0]), covariance, AREA)
    assert np.array([*position, *velocity]) == pytest.approx(kept.mean(axis=0), abs=0.02)
    assert found == pytest.approx(np.cov(kept.T), abs=0.03)


@given(st.floats(-1.0, 1.0), st.floats(0.01, 0.2))
def test_well_inside_nothing_changes(off_m, sd_m):
    covariance = spread(1.0, sd_m)
    position, _, found = between_walls(np.array([30.0, off_m]), np.zeros(2), covariance, AREA)
    assert position == pytest.approx([30.0, off_m], abs=1e-3)
    assert found == pytest.approx(covariance, abs=1e-3)


@given(st.floats(-6.0, 6.0), st.floats(0.05, 5.0), st.floats(0.05, 5.0))
def test_the_covariance_stays_one_and_never_grows(off_m, along_m, across_m):
    covariance = spread(along_m, across_m)
    _, _, found = between_walls(np.array([30.0, off_m]), np.zeros(2), covariance, AREA)
    assert np.linalg.eigvalsh(found)[0] >= -1e-9
    assert np.linalg.eigvalsh(covariance - found)[0] >= -1e-9


@pytest.mark.parametrize(
    ("at", "area"),
    [
        ((50.0, 1.9), WalkableArea([GALLERY, CROSSING])),  # at a crossing
        ((30.0, 1.9), WalkableArea([GALLERY], [Chamber("r", ((25, 2), (35, 2), (35, 9), (25, 9)), 0.0, 3.0)])),
        ((30.0, 30.0), AREA),  # where there is no gallery
    ],
)
def test_where_walls_are_not_those_of_one_gallery_nothing_changes(at, area):
    covariance = spread(1.0, 1.0)
    position, _, found = between_walls(np.array(at), np.zeros(2), covariance, area)
    assert position == pytest.approx(at)
    assert found == pytest.approx(covariance)


@given(st.floats(-500.0, 500.0), st.floats(2.1, 50.0), st.sampled_from([-1.0, 1.0]))
def test_from_the_rock_the_nearest_gallery_is_seen_across_and_nothing_along(along_m, off_m, side):
    """Beyond the gallery's end the nearest of it is that end."""
    place_m, covariance_m2 = inside(np.array([along_m, side * off_m]), AREA)
    variances, axes = np.linalg.eigh(covariance_m2)
    assert variances == pytest.approx([4.0 / 3.0, 1e6])
    if 0.0 <= along_m <= 100.0:
        assert place_m == pytest.approx([along_m, 0.0], abs=1e-6)
        assert abs(axes[1, 0]) == pytest.approx(1.0)


@given(st.floats(0.0, 100.0), st.floats(-2.0, 2.0))
def test_between_the_walls_they_say_nothing_new(along_m, off_m):
    assert inside(np.array([along_m, off_m]), AREA) is None


@given(st.floats(-2.0, 2.0), st.floats(0.05, 0.5))
def test_whom_ranges_placed_in_the_rock_lately_is_only_known_to_be_in_the_gallery(off_m, across_m):
    _, _, found = between_walls(np.array([30.0, off_m]), np.zeros(2), spread(0.3, across_m), AREA, doubted=True)
    assert found[1, 1] == pytest.approx(4.0 / 3.0)
    assert found[0, 0] == pytest.approx(0.09)


IN_LINE = np.array([[0.0, 1.8, 2.4], [25.0, -1.8, 2.4], [45.0, -1.8, 2.4], [60.0, 1.8, 2.4]])


def test_ranges_too_long_both_ways_along_a_gallery_do_not_place_anybody_in_the_rock():
    """Without the map they do: a person far out across the gallery would explain them."""
    found = {}
    for name, area in (("map", AREA), ("none", None)):
        subject = TightlyCoupled(area=area)
        rng = np.random.default_rng(3)
        for number in range(100):
            place_m, stamp_ns = (30.0 + 0.1 * number, 0.5), at(0.1 * number)
            noise_m = 0.6 + rng.normal(0.0, 0.05, len(IN_LINE))
            ranges = ranges_to(place_m, stamp_ns, noise_m=noise_m, anchors=IN_LINE)
            subject.update(EpochInputs(stamp_ns, ranges=(ranges,)))
        found[name] = subject.estimate(stamp_ns)
    assert abs(found["none"].position_m[1]) > 2.5
    assert abs(found["map"].position_m[1]) < 2.2
