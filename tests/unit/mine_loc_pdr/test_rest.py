"""Rest: a second of standing still yields the gyro's mean rate, anything else nothing."""

import numpy as np
import pytest

from mine_loc_pdr.rest import RestDetector

G = (0.0, 0.0, 9.81)


def rests(rates, forces, rate_hz=100):
    detector = RestDetector()
    results = [detector.push(1 / rate_hz, tuple(r), tuple(f)) for r, f in zip(rates, forces, strict=True)]
    return [r for r in results if r is not None]


def test_three_seconds_of_rest_give_three_mean_rates():
    rates = np.random.default_rng(0).normal((0.004, -0.002, 0.001), 0.005, (303, 3))
    found = rests(rates, [G] * 303)
    assert len(found) == 3
    assert np.mean(found, axis=0) == pytest.approx((0.004, -0.002, 0.001), abs=1e-3)


def test_walking_is_no_rest():
    t = np.arange(1000) / 100
    forces = np.column_stack((np.zeros(1000), np.zeros(1000), 9.81 + np.sin(11 * t)))
    assert rests(np.zeros((1000, 3)), forces) == []


def test_turning_to_and_fro_is_no_rest():
    t = np.arange(1000) / 100
    rates = np.column_stack((np.zeros(1000), np.zeros(1000), 0.3 * np.sin(3 * t)))
    assert rests(rates, [G] * 1000) == []


def test_reset_begins_a_new_second():
    detector = RestDetector()
    for _ in range(60):
        detector.push(0.01, (0.0, 0.0, 0.0), G)
    detector.reset()
    assert all(detector.push(0.01, (0.0, 0.0, 0.0), G) is None for _ in range(60))
