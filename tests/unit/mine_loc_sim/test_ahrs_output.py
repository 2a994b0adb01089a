import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mine_loc_sim import imu_constants as ic
from mine_loc_sim.ahrs_output import AhrsOutput
from mine_loc_sim.waist_motion import WaistMotion

RATE_HZ = 50.0


def facing(heading_rad, count=1, pitch_rad=0.0):
    zeros = np.zeros((count, 3))
    x, y, z, w = Rotation.from_euler("ZYX", [heading_rad, pitch_rad, 0.0]).as_quat()
    return WaistMotion(
        np.arange(count),
        zeros,
        zeros,
        zeros,
        np.tile([w, x, y, z], (count, 1)),
        np.full(count, heading_rad),
        zeros,
        zeros,
    )


def output(seed=1, mounting=None):
    return AhrsOutput(mounting or Rotation.identity(), RATE_HZ, np.random.default_rng(seed))


def ned_rotation(quaternion):
    return Rotation.from_quat(np.asarray(quaternion, dtype=float)[..., [1, 2, 3, 0]])


@pytest.fixture
def flawless(monkeypatch):
    for name in ("AHRS_TILT_SD_RAD", "AHRS_DRIFT_SD_RAD_S", "AHRS_HEADING_WALK"):
        monkeypatch.setattr(ic, name, 0.0)


@pytest.mark.usefixtures("flawless")
def test_a_turn_to_the_left_lowers_the_heading_and_tilt_is_kept():
    device = output()
    first, second = (ned_rotation(device.estimate(facing(h, pitch_rad=0.2))[0]).as_euler("ZYX") for h in (0.0, 0.3))
    assert math.remainder(second[0] - first[0], 2 * math.pi) == pytest.approx(-0.3, abs=1e-6)
    assert first[1:] == pytest.approx([-0.2, 0.0], abs=1e-6)  # nose down: FLU pitch positive, FRD negative


@pytest.mark.usefixtures("flawless")
def test_the_mounting_turns_the_reported_attitude():
    rolled = output(mounting=Rotation.from_euler("x", 0.4)).estimate(facing(1.0))
    assert ned_rotation(rolled[0]).as_euler("ZYX")[1:] == pytest.approx([0.0, -0.4], abs=1e-6)


def test_tilt_wanders_within_its_deviation_and_heading_drifts_away():
    count = int(3600 * RATE_HZ)
    angles = ned_rotation(output().estimate(facing(0.0, count))).as_euler("ZYX")
    assert angles[:, 1:].std() == pytest.approx(ic.AHRS_TILT_SD_RAD, rel=0.15)
    heading = np.unwrap(angles[:, 0])
    expected = math.hypot(ic.AHRS_DRIFT_SD_RAD_S * 3600, ic.AHRS_HEADING_WALK * 60)
    assert 0.01 * expected < abs(heading[-1] - heading[0]) < 3.5 * expected


def test_the_same_seed_gives_the_same_attitudes_in_blocks_of_any_size():
    whole = output(3).estimate(facing(0.5, 500))
    device = output(3)
    pieces = [device.estimate(facing(0.5, n)) for n in (1, 199, 300)]
    np.testing.assert_allclose(whole, np.concatenate(pieces), atol=1e-6)
    assert whole.dtype == np.float32
    assert not np.allclose(whole, output(4).estimate(facing(0.5, 500)), atol=1e-3)
