"""What a person does: standing, straight or turning, with the shipped model and with made-up ones."""

import math

import numpy as np
import pytest
from activity_samples import START_NS, samples, window

from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.activity import ActivityKind, ActivityModel, ActivityRecogniser, Logistic
from mine_loc_pdr.activity_model_file import load_model, shipped_model
from mine_loc_pdr.activity_svm import Svm


@pytest.fixture(scope="module")
def shipped():
    return load_model(shipped_model())[0]


def turn_above(border_deg, turning):
    """A linear machine that takes a change of heading above the border for a turn, 10° a margin."""
    svm = Svm("linear", 1.0, np.full(3, np.radians(border_deg)), np.full(3, np.radians(10.0)), np.eye(3)[:1],
              np.ones(1), 0.0)  # fmt: skip
    return ActivityModel("turn", svm, Logistic(10.0, 10.0), turning)


def activities(model, turns_deg, **how):
    recogniser = ActivityRecogniser(model)
    return [a for sample in samples(turns_deg, **how) if (a := recogniser.push(*sample)) is not None]


@pytest.mark.parametrize("turn_deg", [-180.0, -90.0, -45.0, 45.0, 90.0, 180.0])
@pytest.mark.parametrize("begin_s", [0.2, 1.5, 2.6])
def test_the_shipped_model_sees_a_turn_to_either_side_anywhere_in_the_window(shipped, turn_deg, begin_s):
    found = shipped.judge(window(turn_deg, begin_s=begin_s, lasts_s=1.2, swing_deg=2.0))
    assert found.kind == ActivityKind.TURNING
    assert found.probability > 0.9
    assert math.copysign(1.0, found.turn_rad) == math.copysign(1.0, turn_deg)


@pytest.mark.parametrize("turn_deg", [0.0, 8.0, -8.0])
@pytest.mark.parametrize("swing_deg", [0.0, 3.0])
def test_the_shipped_model_takes_walking_with_a_swinging_waist_for_straight(shipped, turn_deg, swing_deg):
    found = shipped.judge(window(turn_deg, swing_deg=swing_deg))
    assert found.kind == ActivityKind.STRAIGHT
    assert found.probability > 0.9


def test_who_does_not_go_up_and_down_stands_whatever_the_heading_does(shipped):
    for turn_deg in (0.0, 90.0):  # the cage of a hoist, a vehicle
        found = shipped.judge(window(turn_deg, sd_m_s2=0.03))
        assert found.kind == ActivityKind.STANDING
        assert found.probability > 0.9


def test_activities_follow_one_another_each_second_with_the_stamp_of_their_end(shipped):
    found = activities(shipped, [0.0] * 6 + [70.0] + [0.0] * 6)
    assert [a.stamp_ns for a in found] == [START_NS + s * NS_PER_S for s in range(5, 13)]
    assert {a.window_s for a in found} == {4.0}
    kinds = [a.kind for a in found]
    assert kinds == [ActivityKind.STRAIGHT] * 2 + [ActivityKind.TURNING] * 4 + [ActivityKind.STRAIGHT] * 2
    assert [round(math.degrees(a.turn_rad)) for a in found] == [0, 0, 70, 70, 70, 70, 0, 0]


def test_a_turn_is_one_exactly_where_the_decision_is_above_nought():
    model = turn_above(30.0, Logistic(5.0, 0.0))
    assert model.judge(window(30.1)).kind == ActivityKind.TURNING
    assert model.judge(window(29.9)).kind == ActivityKind.STRAIGHT


def test_the_probability_is_that_of_what_is_said():
    model = turn_above(30.0, Logistic(2.0, 0.0))
    for turn_deg, margin in ((40.0, 1.0), (20.0, 1.0), (60.0, 3.0)):
        assert model.judge(window(turn_deg)).probability == pytest.approx(1 / (1 + math.exp(-2.0 * margin)), rel=1e-4)


def test_what_is_said_is_never_called_less_likely_than_the_contrary():
    model = turn_above(30.0, Logistic(2.0, -1.0))  # crosses one half where the decision is at half a margin
    found = model.judge(window(32.0))
    assert found.kind == ActivityKind.TURNING
    assert found.probability == pytest.approx(0.5, abs=1e-4)


def test_a_logistic_far_out_is_nought_or_one_and_no_overflow():
    steep = Logistic(1e6, 0.0)
    assert (steep(-1e6), steep(1e6)) == (pytest.approx(0.0), pytest.approx(1.0))
