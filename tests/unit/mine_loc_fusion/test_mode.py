"""Every mode and what leads to it."""

import math

import numpy as np
import pytest

from mine_loc_fusion.estimate import Estimate
from mine_loc_fusion.mode import Mode, ModeLimits, mode_of

LIMITS = ModeLimits(uwb_timeout_s=1.0, step_timeout_s=2.0, lost_ce95_m=50.0)
NEVER = math.inf
NOW, LONG_AGO = 0.0, 100.0


def mode(uwb_s, step_s, region_s=NEVER, *, sd_m=0.1, yaw=0.0):
    covariance = np.diag([sd_m**2, sd_m**2, 1.0, 1.0])
    return mode_of(Estimate(0, np.zeros(2), np.zeros(2), covariance, yaw, uwb_s, step_s, region_s), LIMITS)


@pytest.mark.parametrize(
    ("uwb_s", "step_s", "region_s", "wanted"),
    [
        (NOW, NOW, NEVER, Mode.UWB_PDR),
        (NOW, LONG_AGO, NEVER, Mode.UWB_ONLY),
        (NOW, NEVER, NEVER, Mode.UWB_ONLY),
        (LONG_AGO, NOW, NEVER, Mode.DEAD_RECKONING),
        (NEVER, NOW, NEVER, Mode.DEAD_RECKONING),
        (LONG_AGO, LONG_AGO, NEVER, Mode.COASTING),
        (NEVER, NEVER, NEVER, Mode.COASTING),
        (NEVER, NEVER, NOW, Mode.COARSE_ONLY),
        (NEVER, NEVER, LONG_AGO, Mode.COARSE_ONLY),
        (LONG_AGO, NEVER, NOW, Mode.COARSE_ONLY),
        (LONG_AGO, NEVER, LONG_AGO + 1.0, Mode.COASTING),
        (NOW, NEVER, NOW, Mode.UWB_ONLY),
        (NOW, NOW, NOW, Mode.UWB_PDR),
    ],
)
def test_the_mode_is_what_the_estimate_rests_on(uwb_s, step_s, region_s, wanted):
    assert mode(uwb_s, step_s, region_s) is wanted


def test_steps_do_not_count_before_the_yaw_is_known():
    assert mode(NOW, NOW, yaw=None) is Mode.UWB_ONLY
    assert mode(LONG_AGO, NOW, yaw=None) is Mode.COASTING


@pytest.mark.parametrize(
    ("before", "after", "limit_s"),
    [(Mode.UWB_PDR, Mode.DEAD_RECKONING, LIMITS.uwb_timeout_s), (Mode.UWB_PDR, Mode.UWB_ONLY, LIMITS.step_timeout_s)],
)
def test_what_is_as_old_as_its_timeout_is_absent(before, after, limit_s):
    def at_age(age_s):
        return mode(age_s, NOW) if after is Mode.DEAD_RECKONING else mode(NOW, age_s)

    assert at_age(limit_s - 1e-9) is before
    assert at_age(limit_s) is after


def test_beyond_the_circle_the_person_is_lost_unless_a_region_bounds_them():
    sd_m = LIMITS.lost_ce95_m / math.sqrt(-2.0 * math.log(0.05))  # the Rayleigh quantile
    assert mode(LONG_AGO, NOW, sd_m=0.999 * sd_m) is Mode.DEAD_RECKONING
    assert mode(LONG_AGO, NOW, sd_m=1.001 * sd_m) is Mode.LOST
    assert mode(NOW, NOW, sd_m=1.001 * sd_m) is Mode.LOST
    assert mode(LONG_AGO, NOW, NOW, sd_m=1.001 * sd_m) is Mode.COARSE_ONLY


def test_modes_are_the_constants_of_the_message():
    msg = pytest.importorskip("mine_loc_interfaces.msg")
    for each in Mode:
        assert getattr(msg.PersonPose, "MODE_UNKNOWN" if each is Mode.UNKNOWN else each.name) == each
