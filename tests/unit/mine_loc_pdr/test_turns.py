"""Turns are found from headings alone, soon after they are over, and swaying is none."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_S, to_ns, to_s
from mine_loc_pdr.turns import LEAST_ANGLE_RAD, TurnDetector

RATE_HZ = 100.0
STRIDE_HZ = 0.9


def headings(angle_deg, begin_s=5.0, duration_s=1.2, seconds=12.0, sway_deg=6.0, start_deg=0.0):
    """A walk (n, 2) of stamps in s and headings: straight, a turn at a steady rate, straight, and the hips' sway."""
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    turned = np.clip((t - begin_s) / duration_s, 0.0, 1.0) * math.radians(angle_deg)
    sway = math.radians(sway_deg) * np.sin(math.tau * STRIDE_HZ * t)
    return np.column_stack([t, math.radians(start_deg) + turned + sway])


def found(rows, detector=None):
    """(reported_s, turn) of each."""
    detector = detector or TurnDetector()
    pushed = ((t, detector.push(to_ns(t), h)) for t, h in rows.tolist())
    return [(t, turn) for t, turn in pushed if turn is not None]


@pytest.mark.parametrize("angle_deg", [45.0, -45.0, 90.0, -90.0, 135.0, 180.0, -180.0])
def test_a_turn_is_found_with_its_angle_and_its_middle(angle_deg):
    ((reported_s, turn),) = found(headings(angle_deg))
    assert math.degrees(turn.angle_rad) == pytest.approx(angle_deg, abs=6.0)
    assert to_s(turn.middle_ns) == pytest.approx(5.6, abs=0.1)
    assert to_s(turn.begin_ns) == pytest.approx(5.0, abs=0.4)
    assert to_s(turn.end_ns) == pytest.approx(6.2, abs=0.4)
    assert reported_s - 6.2 < 1.3
    assert math.degrees(turn.before_rad) == pytest.approx(0.0, abs=4.0)
    assert abs(turn.angle_rad - math.radians(angle_deg)) < 3.0 * math.sqrt(turn.angle_variance_rad2)


@pytest.mark.parametrize("start_deg", [170.0, -170.0, 179.9])
def test_headings_may_wrap_in_a_turn(start_deg):
    rows = headings(90.0, start_deg=start_deg)
    rows[:, 1] = np.remainder(rows[:, 1] + math.pi, math.tau) - math.pi
    ((_, turn),) = found(rows)
    assert math.degrees(turn.angle_rad) == pytest.approx(90.0, abs=6.0)


@pytest.mark.parametrize("sway_deg", [5.0, 15.0, 25.0])
@pytest.mark.parametrize("stride_hz", [0.7, 0.9, 1.1])
def test_the_sway_of_the_hips_is_no_turn(sway_deg, stride_hz):
    t = np.arange(0.0, 60.0, 1.0 / RATE_HZ)
    assert found(np.column_stack([t, math.radians(sway_deg) * np.sin(math.tau * stride_hz * t)])) == []


def test_a_curved_gallery_and_a_slow_drift_are_no_turn():
    t = np.arange(0.0, 60.0, 1.0 / RATE_HZ)
    assert found(np.column_stack([t, math.radians(7.0) * t])) == []


def test_two_turns_one_after_the_other_are_two():
    rows = headings(90.0, seconds=20.0)
    rows[:, 1] += headings(-90.0, begin_s=9.0, seconds=20.0, sway_deg=0.0)[:, 1]
    assert [round(math.degrees(turn.angle_rad) / 90.0) for _, turn in found(rows)] == [1, -1]


def test_turning_on_and_on_is_no_turn_of_a_marker():
    assert found(headings(1800.0, duration_s=40.0, seconds=60.0)) == []


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (lambda t, _: [(t, math.nan)], "not_finite"),
        (lambda t, h: [(t, h), (t, h + 1.0)], "duplicate"),
        (lambda t, h: [(t, h), (t - 0.1, h + 1.0)], "backward"),
    ],
)
def test_bad_headings_are_counted_and_change_nothing(damage, fault):
    detector = TurnDetector()
    rows = [
        row
        for number, (t, h) in enumerate(headings(90.0).tolist())
        for row in ([(t, h)], damage(t, h))[number % 25 == 0]
    ]
    ((_, turn),) = found(np.array(rows), detector)
    assert math.degrees(turn.angle_rad) == pytest.approx(90.0, abs=6.0)
    assert detector.faults[fault] > 10


def test_a_turn_that_went_unseen_in_a_gap_is_none():
    rows = headings(90.0)
    assert found(rows[(rows[:, 0] < 5.0) | (rows[:, 0] > 6.3)]) == []


def test_a_clock_that_jumps_back_starts_anew():
    detector = TurnDetector()
    later = headings(90.0)
    later[:, 0] += 1000.0
    assert len(found(later, detector)) == 1
    assert len(found(headings(90.0), detector)) == 1


@given(st.lists(st.tuples(st.integers(-3 * NS_PER_S, 10 * NS_PER_S), st.floats(allow_nan=True)), max_size=200))
def test_whatever_comes_a_turn_is_a_sound_one(rows):
    detector = TurnDetector()
    stamps = itertools.accumulate(stamp // 20 for stamp, _ in rows)
    for stamp_ns, (_, heading) in zip(stamps, rows, strict=True):
        turn = detector.push(stamp_ns, heading)
        if turn is not None:
            assert turn.begin_ns <= turn.middle_ns <= turn.end_ns <= stamp_ns
            assert abs(turn.angle_rad) >= LEAST_ANGLE_RAD
            assert turn.angle_variance_rad2 > 0.0
