"""The input stage: aligned on the first path, free of gain and of window, and refusing what cannot be read."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from los_samples import pulses

from mine_loc_uwb.cir_input import (
    BEFORE,
    EDGE_PER_TAP,
    RANGE_FEATURES,
    SIDE_NAMES,
    TAPS,
    Refusal,
    los_input,
    refusals,
)

POWER = SIDE_NAMES.index("receive_power_against_free_space_db")


@given(st.floats(740.0, 752.0))
def test_the_leading_edge_lies_at_the_same_place_wherever_the_first_path_is(index):
    given_ = los_input(pulses([745.0, index], noise=0.0))
    middle = slice(2, 2 + 3 * EDGE_PER_TAP)
    assert given_.edge[1][middle] == pytest.approx(given_.edge[0][middle], abs=0.06)
    assert given_.profile[1, 0].argmax() == BEFORE + 1


def test_gain_changes_neither_profile_nor_edge():
    loud, quiet = los_input(pulses([745.3])), los_input(pulses([745.3], gain=0.5))
    assert loud.profile == pytest.approx(quiet.profile, abs=0.03)
    assert loud.edge == pytest.approx(quiet.edge, abs=5e-3)


def test_a_window_with_the_noise_register_gives_what_the_whole_accumulator_gives():
    whole = pulses([745.3])
    noise = np.hypot(*whole.samples[0, :700].astype(float).T).std()
    window = pulses([745.3], noise_std=np.array([0.87 * noise]), start_index=np.array([700]))
    window = type(window)(
        **{n: getattr(window, n) for n in window.__dataclass_fields__} | {"samples": whole.samples[:, 700:900]}
    )
    assert (refusals(window) == Refusal.NOT).all()
    for name in ("profile", "edge", "side"):
        assert getattr(los_input(window), name) == pytest.approx(getattr(los_input(whole), name), abs=0.1)


def test_power_in_free_space_speaks_for_itself():
    """-58.8 dBm at 1 m, minus 20 log 4, compressed above -88: Friis at 3993.6 MHz and the manual's saturation."""
    true_dbm = -14.3 - 20.0 * np.log10(4.0 * np.pi * 4.0 / (299_702_547.0 / 3993.6e6))
    reported_dbm = -88.0 + (true_dbm + 88.0) / 2.1667
    side = los_input(pulses([745.0], receive_power_dbm=np.array([reported_dbm]))).side
    assert side[0, POWER] == pytest.approx(0.0, abs=1e-3)


def test_what_is_not_known_is_nan_and_the_rest_is_there():
    frames = pulses([745.0], receive_power_dbm=np.array([-np.inf]), symbols=np.array([0.0]))
    side = los_input(frames.without_range()).side[0]
    missing = {name for name, value in zip(SIDE_NAMES, side, strict=True) if np.isnan(value)}
    assert missing == {
        "receive_power_dbm",
        "first_path_gap_db",
        "log_noise_per_symbol",
        "log_symbols",
        *(SIDE_NAMES[number] for number in RANGE_FEATURES),
    }
    assert los_input(frames).without_range().side[0, POWER] != 0.0


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 9.0), st.floats(0.0, 1100.0), st.sampled_from([0, 100, 128, 300]))
def test_whatever_stands_in_an_accumulator_is_read_without_nan_or_refused(seed, log_counts, index, taps):
    rng = np.random.default_rng(seed)
    samples = (np.exp(log_counts) * rng.standard_normal((1, taps, 2)) * (rng.random((1, taps, 1)) < 0.3)).astype(
        np.int16
    )
    columns = {
        "samples": samples,
        "start_index": np.array([700]),
        "range_m": rng.choice([np.nan, -1.0, np.inf, 9.0], 1),
    }
    frames = pulses([index])
    frames = type(frames)(**{name: getattr(frames, name) for name in frames.__dataclass_fields__} | columns)
    if refusals(frames)[0] == Refusal.NOT:
        found = los_input(frames)
        assert np.isfinite(found.profile).all()
        assert np.isfinite(found.edge).all()
        assert not np.isinf(found.side).any()


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        ({"first_path_index": np.array([np.nan])}, Refusal.NO_FIRST_PATH),
        ({"first_path_index": np.array([0.0])}, Refusal.NO_FIRST_PATH),
        ({"first_path_index": np.array([1500.0])}, Refusal.NO_FIRST_PATH),
        ({"first_path_index": np.array([5.0])}, Refusal.TRUNCATED),
        ({"start_index": np.array([740])}, Refusal.TRUNCATED),
        ({"samples": np.full((1, 1016, 2), 32767, np.int16)}, Refusal.SATURATED),
        ({"samples": np.full((1, 1016, 2), -32768, np.int16)}, Refusal.SATURATED),
        ({"samples": np.zeros((1, 1016, 2), np.int16)}, Refusal.EMPTY),
        ({"samples": np.pad(np.ones((1, 9, 2), np.int16), ((0, 0), (0, 1007), (0, 0)))}, Refusal.EMPTY),
        ({"samples": np.zeros((1, 0, 2), np.int16)}, Refusal.EMPTY),
        ({"samples": np.full((1, TAPS - 1, 2), 5, np.int16), "start_index": np.array([729])}, Refusal.TRUNCATED),
        ({}, Refusal.NOT),
    ],
)
def test_frames_that_cannot_be_read_are_refused_with_the_reason(columns, reason):
    frames = pulses([745.0])
    named = {name: getattr(frames, name) for name in frames.__dataclass_fields__}
    assert refusals(type(frames)(**named | columns)).tolist() == [reason]
