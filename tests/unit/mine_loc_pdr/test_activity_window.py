"""Windows of four seconds on a grid of time: what is in them, when they come, and what makes them begin anew."""

import itertools
import math

import numpy as np
import pytest
from activity_samples import START_NS, G, samples, windows

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.activity_window import BIN_NS, BINS, WINDOW_NS, WindowStream


def ends_s(found):
    return [(w.end_ns - START_NS) / NS_PER_S for w in found]


def test_a_window_lasts_four_seconds_as_in_paper_b():
    assert WINDOW_NS == BINS * BIN_NS == 4 * NS_PER_S


def test_windows_end_at_every_second_once_four_whole_seconds_are_there():
    # the bin in which the data begin is not whole, so the first window begins with the one after it
    assert ends_s(windows([0.0] * 8)) == [5.0, 6.0, 7.0]


def test_a_window_comes_with_the_first_sample_at_or_after_its_end():
    stream = WindowStream()
    for stamp_ns, heading, force in samples([0.0] * 7):
        window = stream.push(stamp_ns, heading, force)
        if window is not None:
            assert window.end_ns == stamp_ns


def test_the_heading_at_the_edges_starts_at_nought_and_ends_at_the_turn():
    found = windows([0.0, 30.0, 60.0, 0.0, 0.0, 0.0])[0]
    assert found.heading_rad.shape == (BINS + 1,)
    assert found.heading_rad[0] == 0.0
    assert np.degrees(found.turn_rad) == pytest.approx(90.0, abs=1e-6)
    assert np.degrees(found.heading_rad[5]) == pytest.approx(30.0, abs=1e-6)


def test_a_heading_that_passes_half_a_turn_goes_on():
    found = windows([90.0] * 8)
    assert [math.degrees(w.turn_rad) for w in found] == pytest.approx([360.0] * 3, abs=1e-6)


def test_the_bounce_of_walking_is_kept_as_mean_and_mean_square():
    found = windows([0.0] * 6, bounce_m_s2=2.0)[0]
    assert found.square_m2_s4.mean() == pytest.approx(2.0, rel=0.02)  # 2² / 2
    assert abs(found.vertical_m_s2.mean()) < 0.05


def test_the_force_counts_alike_however_the_sensor_is_worn():
    upright, askew = WindowStream(), WindowStream()
    for stamp_ns, heading, (_, _, up) in samples([20.0] * 6):
        one = upright.push(stamp_ns, heading, (0.0, 0.0, up))
        other = askew.push(stamp_ns, heading, (0.6 * up, 0.0, -0.8 * up))
        if one is not None:
            np.testing.assert_allclose(one.vertical_m_s2, other.vertical_m_s2, atol=1e-9)


@pytest.mark.parametrize("rate_hz", [25, 50, 200])
def test_the_rate_of_the_samples_does_not_matter(rate_hz):
    usual, other = windows([0.0, 45.0, 0.0, 0.0, 0.0, 0.0]), windows([0.0, 45.0, 0.0, 0.0, 0.0, 0.0], rate_hz=rate_hz)
    assert ends_s(usual) == ends_s(other)
    np.testing.assert_allclose(usual[0].heading_rad, other[0].heading_rad, atol=math.radians(0.1))


def test_samples_that_are_late_repeated_or_no_numbers_change_nothing():
    clean = list(samples([20.0] * 7))
    bad = [
        clean[250],  # once more
        (clean[200][0], 3.0, (0.0, 0.0, 50.0)),
        (clean[251][0] - 1, 0.0, (math.nan, 0.0, G)),
        (clean[251][0] - 1, 0.0, (0.0, math.inf, G)),
        (clean[251][0] - 1, 0.0, (0.0, 0.0, 1e200)),
    ]
    found = [w for stream in [WindowStream()] for s in [*clean[:251], *bad, *clean[251:]] if (w := stream.push(*s))]
    for one, other in itertools.zip_longest(found, windows([20.0] * 7)):
        assert one.end_ns == other.end_ns
        np.testing.assert_array_equal(one.heading_rad, other.heading_rad)
        np.testing.assert_array_equal(one.square_m2_s4, other.square_m2_s4)


def push_all(stream, items):
    return [w for s in items if (w := stream.push(*s)) is not None]


def test_after_a_gap_there_is_no_window_until_four_whole_seconds_are_there_again():
    items = list(samples([0.0] * 14))
    gap = [s for s in items if not 6.0 <= (s[0] - START_NS) / NS_PER_S < 6.25]
    # data go on at 6.25 s, the first whole bin begins at 6.4 s
    assert ends_s(push_all(WindowStream(), gap)) == [5.0, 11.0, 12.0, 13.0]


def test_lost_packets_shorter_than_a_bin_do_no_harm():
    items = list(samples([0.0] * 9))
    gap = [s for s in items if not 6.0 < (s[0] - START_NS) / NS_PER_S < 6.2]
    assert ends_s(push_all(WindowStream(), gap)) == [5.0, 6.0, 7.0, 8.0]


def test_a_clock_set_back_begins_anew():
    stream = WindowStream()
    push_all(stream, samples([0.0] * 6))
    again = push_all(stream, samples([90.0] * 6, start_ns=START_NS - 3600 * NS_PER_S))
    assert [w.end_ns for w in again] == [START_NS - 3595 * NS_PER_S]
    assert math.degrees(again[0].turn_rad) == pytest.approx(360.0)


def test_windows_may_be_asked_for_at_every_bin():
    found = windows([0.0] * 6, hop_ns=BIN_NS)
    assert np.diff([w.end_ns for w in found]).tolist() == [200 * NS_PER_MS] * (len(found) - 1)
    assert ends_s(found)[0] == pytest.approx(4.2)
