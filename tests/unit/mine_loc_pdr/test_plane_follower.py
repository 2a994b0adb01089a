"""Samples in, verdicts out: once a pose was given, turns are matched; gaps and jumps of the clock are allowed for."""

import math

import numpy as np
import pytest

from mine_loc_core.site import TurnMarker
from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_pdr.dead_reckoning import StepEvent
from mine_loc_pdr.map_track import MapPose
from mine_loc_pdr.plane_follower import PlaneFollower
from mine_loc_pdr.pseudo_plane import PseudoPlane, Verdict

CORNER = TurnMarker("corner", (14.0, 0.0, 0.0), (math.pi / 2, -math.pi / 2), 4.0)
PERIOD_S, STEP_S = 0.01, 0.5
BEGIN_S = 100.0


def samples(seconds=16.0, turn_s=11.0, begin_s=BEGIN_S):
    """Standing for a second, walking east at 1.4 m/s, a corner to the left at `turn_s`: stamp, heading, steps."""
    count = 0
    for number in range(round(seconds / PERIOD_S)):
        at_s = number * PERIOD_S
        heading = math.radians(90.0) * min(max(at_s - turn_s + 0.5, 0.0), 1.0)
        steps = []
        if at_s > 1.0 and number % round(STEP_S / PERIOD_S) == 0:
            count += 1
            stamp_ns = to_ns(begin_s + at_s)
            steps = [StepEvent(stamp_ns, count, STEP_S, 0.7, 0.004, heading, 0.01, 0.0, 0.0, 1.0)]
        yield to_ns(begin_s + at_s), heading, steps


def given(stamp_ns=0):
    return MapPose(stamp_ns, 0.0, 0.0, 0.0, np.diag([0.01, 0.01, 0.003]))


def follow(follower, rows):
    fixes = [follower.push(*row) for row in rows]
    return [fix for fix in fixes if fix is not None]


def started(rows):
    follower = PlaneFollower(PseudoPlane([CORNER]))
    follower.push(*next(rows))
    assert follower.set_pose(given(), 0.06**2, 0.001) is None
    return follower


def test_a_turn_at_a_marker_is_matched_and_corrects_the_pose():
    rows = samples()
    follower = started(rows)
    (fix,) = follow(follower, rows)
    assert (fix.verdict, fix.marker) == (Verdict.MATCHED, CORNER)
    assert follower.counts["matched"] == 1
    assert math.hypot(follower.pose.x_m - 14.0, follower.pose.y_m - 6.0) < 1.0


def test_without_a_pose_no_turn_is_matched():
    follower = PlaneFollower(PseudoPlane([CORNER]))
    assert follow(follower, samples()) == []
    assert follower.pose is None


def test_a_pose_is_refused_before_the_first_sample_and_when_it_is_not_of_now():
    follower = PlaneFollower(PseudoPlane([CORNER]))
    assert "horizon" in follower.set_pose(given(), 0.06**2, 0.001)
    follower.push(*next(samples()))
    assert "not now" in follower.set_pose(given(to_ns(BEGIN_S - 5.0)), 0.06**2, 0.001)
    assert follower.set_pose(given(to_ns(BEGIN_S + 0.5)), 0.06**2, 0.001) is None


def test_a_gap_makes_the_pose_as_unsure_as_the_walk_allows():
    def variance_m2(lost_s):
        rows = samples()
        follower = started(rows)
        follow(follower, (row for row in rows if not 0.0 < row[0] / NS_PER_S - BEGIN_S - 5.0 < lost_s))
        return follower.pose.covariance[0, 0]

    assert variance_m2(2.0) > variance_m2(0.0) + 1.5**2


def test_a_clock_that_jumps_back_ends_the_track_until_a_pose_is_given():
    rows = samples()
    follower = started(rows)
    follow(follower, rows)
    assert follow(follower, samples(begin_s=BEGIN_S - 50.0)) == []
    assert follower.pose is None


@pytest.mark.parametrize("late_s", [0.0, 0.3])
def test_repeated_and_late_samples_change_nothing(late_s):
    clean, disturbed = (started(samples()) for _ in range(2))
    follow(clean, samples())
    for number, row in enumerate(samples()):
        disturbed.push(*row)
        if number % 50 == 0:
            disturbed.push(row[0] - to_ns(late_s), row[1] + 1.0, row[2])
    assert disturbed.pose.x_m == pytest.approx(clean.pose.x_m)
    assert disturbed.pose.y_m == pytest.approx(clean.pose.y_m)
    assert disturbed.counts["heading_backward" if late_s else "heading_duplicate"] > 10
