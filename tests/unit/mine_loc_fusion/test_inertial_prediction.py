"""Without steps: what changes of velocity teach, what they carry through, which are refused."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from subjects import own, reasons, state_bytes, walked
from walks import HALL, HEIGHT_M, at, ranges_to, step_fix

from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_fusion import inertial_kernel
from mine_loc_fusion.estimate import EpochInputs, VelocityChange
from mine_loc_fusion.late_inputs import LateInputCorrector
from mine_loc_fusion.step_kernel import YAW
from mine_loc_fusion.tightly_coupled import TightlyCoupled, rehearse


@dataclass
class Ride:
    """On an ellipse once in twelve seconds, up and down by half a metre where that is solved for, without steps.

    What is told of the velocity is in an odom frame turned by −yaw and errs by `error_m_s2`.
    """

    yaw_rad: float = 0.7
    space: bool = False
    error_m_s2: tuple[float, float, float] = (0.1, -0.05, 0.08)
    seed: int = 0
    number: int = 0

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)

    @property
    def stamp_ns(self):
        return at(0.1 * self.number)

    def place_m(self, number):
        phase = 2.0 * math.pi * 0.1 * number / 12.0
        up_m = 0.5 * math.sin(2.0 * phase) if self.space else 0.0
        return np.array([15.0 + 4.0 * math.cos(phase), 10.0 + 3.0 * math.sin(phase), HEIGHT_M + up_m])

    def change(self):
        before, here, ahead = (self.place_m(self.number + each) for each in (-1, 0, 1))
        earlier = self.place_m(self.number - 2)
        dx, dy, dz = ((ahead - before) - (here - earlier)) / 0.2
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        told = np.array([c * dx + s * dy, c * dy - s * dx, dz]) + 0.1 * np.array(self.error_m_s2)
        return VelocityChange(told + self.rng.normal(0.0, 0.005, 3), 0.1)

    def next(self, *, changes=True, ranges=True):
        """The epoch of the next tenth of a second."""
        self.number += 1
        place_m = self.place_m(self.number)
        noise_m = self.rng.normal(0.0, 0.1, len(HALL))
        true_m = np.linalg.norm(HALL - place_m, axis=1)
        round_ = replace(ranges_to((0.0, 0.0), self.stamp_ns, space=self.space), range_m=true_m + noise_m)
        told = self.change()
        return EpochInputs(
            self.stamp_ns, ranges=(round_,) if ranges else (), velocity_changes=(told,) if changes else ()
        )

    def play(self, subject, seconds, **what):
        """Errors [m] and the last verdicts."""
        errors, verdicts = [], ()
        for _ in range(round(10 * seconds)):
            verdicts = subject.update(self.next(**what))
            estimate = subject.estimate(self.stamp_ns)
            d = 3 if self.space else 2
            found_m = np.append(estimate.position_m, estimate.height_m) if self.space else estimate.position_m
            errors.append(float(np.linalg.norm(found_m - self.place_m(self.number)[:d])))
        return np.array(errors), verdicts


def carried(seconds, *, space=False, changes=True, **ride):
    subject, ride = TightlyCoupled(height_m=HEIGHT_M if space else None), Ride(space=space, **ride)
    errors, verdicts = ride.play(subject, seconds, changes=changes)
    return subject, ride, errors, verdicts


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("yaw_rad", [-3.0, -1.0, 0.7, 2.5])
def test_the_yaw_of_odom_is_found_without_a_step_within_what_is_claimed(yaw_rad, space):
    subject, ride, _, verdicts = carried(40.0, yaw_rad=yaw_rad, space=space)
    assert [v.reason for v in verdicts if v.source is Source.IMU] == [Reason.ACCEPTED]
    estimate = subject.estimate(ride.stamp_ns)
    assert estimate.yaw_offset_rad is not None
    _, sd_rad = own(subject, YAW)
    off_rad = abs(math.remainder(estimate.yaw_offset_rad - yaw_rad, math.tau))
    assert sd_rad < math.radians(10.0)
    assert off_rad < 4.0 * sd_rad
    assert estimate.since_step_s == math.inf


@pytest.mark.parametrize("space", [False, True])
def test_changes_of_velocity_make_a_ride_with_ranges_better(space):
    errors = [
        np.mean([carried(40.0, space=space, changes=c, seed=s)[2][100:].mean() for s in range(3)]) for c in (1, 0)
    ]
    assert errors[0] < 0.8 * errors[1]


def test_of_changes_that_are_no_rotation_of_the_motion_no_yaw_is_made_and_they_do_little_harm():
    errors = []
    for mirrored in (True, False):
        subject, ride = TightlyCoupled(), Ride()
        off_m = []
        for _ in range(400):
            inputs = ride.next(changes=mirrored)
            told = tuple(replace(c, change_m_s=c.change_m_s * [1.0, -1.0, 1.0]) for c in inputs.velocity_changes)
            subject.update(replace(inputs, velocity_changes=told))
            off_m.append(np.linalg.norm(subject.estimate(ride.stamp_ns).position_m - ride.place_m(ride.number)[:2]))
        assert subject.estimate(ride.stamp_ns).yaw_offset_rad is None
        errors.append(np.mean(off_m))
    assert errors[0] < 1.5 * errors[1]


def test_through_five_seconds_without_ranges_changes_of_velocity_carry_the_person():
    off_m = []
    for changes in (True, False):
        subject, ride, _, _ = carried(40.0, changes=changes)
        errors, _ = ride.play(subject, 5.0, changes=changes, ranges=False)
        off_m.append(errors[-1])
        deviation_m = math.sqrt(np.trace(subject.estimate(ride.stamp_ns).covariance[:2, :2]))
        assert errors[-1] < 4.0 * deviation_m
    assert off_m[0] < 0.5 * off_m[1]


def test_the_first_change_and_one_after_a_pause_are_not_measured_but_begin_anew():
    subject, ride, _, _ = carried(1.0, changes=False)
    assert reasons(subject.update(ride.next(ranges=False))) == [Reason.NOT_INITIALISED]
    assert reasons(subject.update(ride.next(ranges=False))) == [Reason.ACCEPTED]
    ride.next()
    assert reasons(subject.update(ride.next(ranges=False))) == [Reason.NOT_INITIALISED]
    assert reasons(subject.update(ride.next(ranges=False))) == [Reason.ACCEPTED]


def test_before_anybody_is_placed_a_change_is_not_initialised():
    subject, ride = TightlyCoupled(), Ride()
    assert reasons(subject.update(ride.next(ranges=False))) == [Reason.NOT_INITIALISED]
    assert subject.estimate(ride.stamp_ns) is None


def test_a_change_that_nobody_can_have_made_is_refused_by_the_gate_and_not_used():
    subject, ride, _, _ = carried(40.0)
    before = subject.estimate(ride.stamp_ns).velocity_ms
    inputs = ride.next(ranges=False)
    (verdict,) = subject.update(replace(inputs, velocity_changes=(VelocityChange(np.array([8.0, 0.0, 0.0]), 0.1),)))
    assert (verdict.source, verdict.reason) == (Source.IMU, Reason.GATE)
    assert verdict.mahalanobis_sq > verdict.threshold
    assert subject.estimate(inputs.stamp_ns).velocity_ms == pytest.approx(before)


@pytest.mark.parametrize(
    ("change_m_s", "interval_s"),
    [((math.nan, 0.0, 0.0), 0.1), ((0.0, 0.0, math.inf), 0.1), ((0.0, 0.0, 0.0), 0.0), ((0.0, 0.0, 0.0), math.nan),
     ((11.0, 0.0, 0.0), 0.1), ((0.0, 0.0, 0.0), 1.1)],
)  # fmt: skip
def test_a_change_that_is_none_is_invalid_and_changes_nothing(change_m_s, interval_s):
    subject, ride, _, _ = carried(2.0)
    subject.update(EpochInputs(ride.stamp_ns + 10**7))
    before = state_bytes(subject)
    bad = EpochInputs(ride.stamp_ns + 10**7, velocity_changes=(VelocityChange(np.array(change_m_s), interval_s),))
    assert reasons(subject.update(bad)) == [Reason.INVALID]
    assert state_bytes(subject) == before


def test_beside_steps_changes_are_duplicates_and_change_nothing():
    subject, walk = walked()
    before = state_bytes(subject)
    change = VelocityChange(np.array([0.3, 0.0, 0.0]), 0.1)
    assert reasons(subject.update(EpochInputs(walk.stamp_ns, velocity_changes=(change,)))) == [Reason.DUPLICATE]
    assert state_bytes(subject) == before


def test_a_person_who_rode_walks_on_with_the_yaw_that_was_found():
    subject, ride, _, _ = carried(40.0)
    step, stamp_ns = step_fix(0.6, 0.0), ride.stamp_ns
    found = [
        verdict
        for number in (1, 2)
        for verdict in subject.update(EpochInputs(stamp_ns + number * NS_PER_S // 2, steps=(step,)))
    ]
    assert reasons(found) == [Reason.NOT_INITIALISED, Reason.ACCEPTED]


def test_changes_that_come_late_end_where_those_on_time_do():
    ends = []
    for late in (0, 3):
        subject, ride, waiting = LateInputCorrector(TightlyCoupled(), 2 * NS_PER_S), Ride(), []
        for _ in range(200):
            inputs = ride.next()
            subject.update(replace(inputs, velocity_changes=()))
            waiting.append(replace(inputs, ranges=()))
            if len(waiting) > late:
                subject.update(waiting.pop(0))
        for each in waiting:
            subject.update(each)
        ends.append(subject.estimate(ride.stamp_ns))
    assert ends[0].position_m == pytest.approx(ends[1].position_m, abs=1e-9)
    assert ends[0].covariance == pytest.approx(ends[1].covariance, abs=1e-9)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_after_a_rehearsal_nothing_is_left_to_compile(dimensions):
    kernels = [each for each in vars(inertial_kernel).values() if hasattr(each, "nopython_signatures")]
    rehearse(dimensions)
    before = [len(each.nopython_signatures) for each in kernels]
    assert len(before) == 6
    assert 0 not in before
    carried(40.0, space=dimensions == 3)
    assert [len(each.nopython_signatures) for each in kernels] == before
