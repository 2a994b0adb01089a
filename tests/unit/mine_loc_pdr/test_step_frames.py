"""Frames of motion: means of the line through the samples, the same at any rate, with an offset taken out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.step_frames import CHANNELS, FRAME_NS, FrameStream


def motion(values):
    return (0.0, *values, *[0.0] * (CHANNELS - 1 - len(values)))


def frames_of(stamps_ns, values):
    stream = FrameStream()
    return np.concatenate([stream.push(t, motion([v])).copy() for t, v in zip(stamps_ns, values, strict=True)])[:, 1]


@given(st.lists(st.integers(1, 200), min_size=2, max_size=60), st.floats(-3, 3), st.floats(-3, 3))
def test_a_line_is_met_at_the_middle_of_every_frame_whatever_the_stamps(apart_ms, at_start, slope):
    stamps_ns = 10**18 + np.concatenate(([0], np.cumsum(apart_ms))) * NS_PER_MS
    found = frames_of(stamps_ns.tolist(), at_start + slope * (stamps_ns - stamps_ns[0]) / NS_PER_S)
    first = -(-stamps_ns[0] // FRAME_NS)
    assert len(found) == stamps_ns[-1] // FRAME_NS - (stamps_ns[0] // FRAME_NS)
    middles_s = ((first + np.arange(len(found)) + 0.5) * FRAME_NS - stamps_ns[0]) / NS_PER_S
    np.testing.assert_allclose(found, at_start + slope * middles_s, atol=1e-6)


@pytest.mark.parametrize("rate_hz", [25, 50, 100, 400])
def test_a_wave_of_walking_is_the_same_at_any_rate(rate_hz):
    def wave(hz):
        stamps_ns = np.arange(4 * hz + 1) * (NS_PER_S // hz)
        return frames_of(stamps_ns.tolist(), np.sin(2 * np.pi * 1.8 * stamps_ns / NS_PER_S))

    np.testing.assert_allclose(wave(rate_hz), wave(1000), atol=0.02)


def test_an_offset_of_the_vertical_goes_away_and_no_other():
    stream = FrameStream()
    frames = np.concatenate(
        [stream.push(k * 10 * NS_PER_MS, (1.0, 1.0, 0.0, 0.0, 0.0, 0.0)).copy() for k in range(2000)]
    )
    assert frames[-1, 0] == pytest.approx(0.0, abs=0.01)
    assert frames[-1, 1] == pytest.approx(1.0)


def test_after_a_reset_nothing_of_before_is_left():
    stream = FrameStream()
    for k in range(100):
        stream.push(k * 7 * NS_PER_MS, motion([9.0]))
    stream.reset()
    fresh = FrameStream()
    for k in range(100):
        stamp_ns = 10**12 + k * 7 * NS_PER_MS
        np.testing.assert_array_equal(stream.push(stamp_ns, motion([1.0])), fresh.push(stamp_ns, motion([1.0])))
