import numpy as np
import pytest

from mine_loc_coarse.region_radius import region_radius_m


@pytest.mark.parametrize("ratio", [1.0, 0.5, 0.1, 0.0])
@pytest.mark.parametrize("probability", [0.5, 0.95, 0.999])
def test_the_circle_holds_drawn_points_as_often_as_it_says(ratio, probability):
    rng = np.random.default_rng(1)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    points = rng.standard_normal((200_000, 2)) * [300.0, 300.0 * ratio] @ turn.T
    covariance = turn @ np.diag([300.0**2, (300.0 * ratio) ** 2]) @ turn.T
    radius_m = region_radius_m(covariance[None], probability)[0]
    held = np.mean(np.hypot(*points.T) <= radius_m)
    assert held == pytest.approx(probability, abs=4.0 * np.sqrt(probability * (1 - probability) / 200_000) + 1e-3)
