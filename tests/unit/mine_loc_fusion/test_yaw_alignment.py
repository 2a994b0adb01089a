"""The yaw of the odom frame from a walked track: when it is told, how right, and how sure."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_fusion.yaw_alignment import YawAlignment


def told(headings, yaw_rad, *, length_m=0.6, scale=1.0, sd_m=0.0, subject=None, seed=0):
    """Walk along these headings of the odom frame; what was told after each step."""
    rng, subject = np.random.default_rng(seed), subject or YawAlignment()
    place_m, answers = np.array([100.0, -40.0]), []
    for heading in headings:
        angle = heading + yaw_rad
        place_m = place_m + length_m * np.array([math.cos(angle), math.sin(angle)])
        answers.append(subject.step(length_m * scale, heading, place_m + rng.normal(0.0, sd_m, 2)))
    return answers


def off(yaw_rad, wanted_rad):
    return abs(math.remainder(yaw_rad - wanted_rad, math.tau))


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi), st.floats(0.8, 1.2))
def test_without_noise_the_yaw_is_exact_whatever_the_heading_and_the_length_of_steps(yaw_rad, heading_rad, scale):
    found = told([heading_rad] * 12, yaw_rad, scale=scale)[-1]
    assert off(found[0], yaw_rad) < 1e-9


def test_before_three_metres_nothing_is_told():
    answers = told([0.0] * 10, 1.0)
    first = next(number for number, answer in enumerate(answers) if answer)
    assert [answer is None for answer in answers] == [number < first for number in range(10)]
    assert first == 5 or 0.6 * first >= 3.0


def test_who_walks_on_the_spot_tells_nothing():
    assert set(told([0.0, math.pi] * 60, 1.0)) == {None}


@pytest.mark.parametrize("sd_m", [0.05, 0.3])
def test_the_variance_covers_the_error(sd_m):
    errors = []
    for seed in range(100):
        yaw_rad, variance_rad2 = told([0.3] * 12, 1.0, sd_m=sd_m, seed=seed)[-1]
        errors.append(off(yaw_rad, 1.0) / math.sqrt(variance_rad2))
    assert np.sqrt(np.mean(np.square(errors))) < 1.3


def test_after_a_new_start_the_places_before_it_do_not_count():
    subject = YawAlignment()
    told([0.0] * 20, 2.0, subject=subject)
    subject.forget_places()
    answers = told([0.0] * 12, 1.0, subject=subject)
    assert answers[0] is None
    assert off(answers[-1][0], 1.0) < 1e-9


def test_what_is_added_to_a_copy_is_not_added_to_the_other():
    subject = YawAlignment()
    told([0.0] * 4, 1.0, subject=subject)
    before = (subject.odom_m.tolist(), len(subject.pairs))
    told([1.0] * 4, 1.0, subject=subject.copy())
    assert (subject.odom_m.tolist(), len(subject.pairs)) == before
