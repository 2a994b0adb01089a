import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S
from mine_loc_uwb.stamp_latency import StampLatency, TimedRanges, common_latency_s, fit_stamp_latency

ANCHORS_M = np.array([[0.0, 0.0, 2.0], [30.0, 0.0, 2.0], [30.0, 20.0, 2.0], [0.0, 20.0, 2.0]])
START_NS = 1_700_000_000 * NS_PER_S


def at(seconds):
    """A walk on an ellipse at about 1.2 m/s."""
    angle = seconds * 0.12
    return np.stack([15.0 + 11.0 * np.cos(angle), 10.0 + 8.0 * np.sin(angle), np.full(len(angle), 1.1)], axis=1)


def walk(latency_s, seed=1, speed=1.0, seconds=120.0, anchors=4):
    """Ranges at 8 Hz to each anchor, with an offset of each, noise, and every twentieth some metres too long."""
    rng = np.random.default_rng(seed)
    anchor = np.tile(np.arange(anchors), int(seconds * 8))
    taken_s = np.sort(rng.uniform(0.0, seconds, len(anchor)))
    range_m = np.linalg.norm(at(speed * taken_s) - ANCHORS_M[anchor], axis=1)
    range_m += np.array([0.1, -0.2, 0.3, 0.0])[anchor] + rng.normal(0.0, 0.05, len(anchor))
    range_m += np.where(rng.random(len(anchor)) < 0.05, rng.exponential(4.0, len(anchor)), 0.0)
    track_s = np.arange(0.0, seconds, 0.1)
    stamps = START_NS + np.rint((taken_s + latency_s) * NS_PER_S).astype(np.int64)
    track_ns = START_NS + np.rint(track_s * NS_PER_S).astype(np.int64)
    return TimedRanges(stamps, range_m, anchor, ANCHORS_M[anchor], track_ns, at(speed * track_s))


@settings(max_examples=8)
@given(st.floats(-0.4, 0.4), st.integers(0, 1000))
def test_the_latency_is_found_with_its_sign_in_spite_of_offsets_and_outliers(latency_s, seed):
    found = fit_stamp_latency(walk(latency_s, seed))
    assert found.latency_s == pytest.approx(latency_s, abs=0.015)
    assert found.standard_error_s < 0.02
    assert found.residual_after_m <= found.residual_before_m


def test_ranges_that_were_not_measured_count_for_nothing():
    ranges = walk(0.18)
    ranges.range_m[::7] = np.nan
    assert fit_stamp_latency(ranges).latency_s == pytest.approx(0.18, abs=0.015)


def test_a_tag_at_rest_is_refused_with_its_speed():
    with pytest.raises(ConfigurationError, match=r"speed along the links: 0\.0\d\d m/s; allowed: 0\.05"):
        fit_stamp_latency(walk(0.18, speed=0.01))


def test_ranges_outside_of_the_track_are_refused_with_their_number():
    ranges = walk(0.18)
    ranges.stamp_ns[:] += 1000 * NS_PER_S
    with pytest.raises(ConfigurationError, match="ranges within the true track: 0; allowed: 50"):
        fit_stamp_latency(ranges)


def latency(latency_s, error_s):
    return StampLatency(latency_s, error_s, 0.2, 0.1)


def test_a_common_latency_weighs_the_sure_more_and_is_nothing_where_it_might_be_nothing():
    assert common_latency_s([latency(0.18, 0.01), latency(0.3, 0.1)]) == pytest.approx(0.1812, abs=1e-3)
    assert common_latency_s([latency(0.03, 0.02), latency(-0.02, 0.02)]) == 0.0
    assert common_latency_s([]) == 0.0
