"""The history of a link: medians of its own last frames, and of no others."""

import numpy as np
import pytest

from mine_loc_uwb.link_history import DEPTH, LinkHistory, with_history

STEP_NS = 100_000_000


def row(*values):
    return np.array(values, np.float32)


def test_features_come_with_the_median_of_the_links_frames():
    found = with_history(["a"] * 3, [0, STEP_NS, 2 * STEP_NS], np.array([[1.0], [9.0], [2.0]], np.float32))
    assert found.tolist() == [[1.0, 1.0], [9.0, 5.0], [2.0, 2.0]]


def test_links_do_not_hear_one_another():
    found = with_history(["a", "b"], [0, 0], np.array([[1.0], [9.0]], np.float32))
    assert found[:, 1].tolist() == [1.0, 9.0]


@pytest.mark.parametrize("later_ns", [-1, 2 * 10**9 + 1])
def test_a_gap_or_a_step_back_begins_anew(later_ns):
    history = LinkHistory()
    history.extend("a", 0, row(1.0))
    assert history.extend("a", later_ns, row(9.0)).tolist() == [9.0, 9.0]


def test_only_the_last_frames_count():
    history = LinkHistory()
    for number in range(DEPTH):
        history.extend("a", number, row(0.0))
    last = [history.extend("a", DEPTH + number, row(1.0))[1] for number in range(DEPTH)]
    assert last[0] == 0.0
    assert last[-1] == 1.0


def test_what_is_missing_now_and_then_is_left_out_and_what_never_came_stays_nan():
    found = with_history(["a"] * 2, [0, 1], np.array([[np.nan, np.nan], [4.0, np.nan]], np.float32))
    assert found[1, 2] == 4.0
    assert np.isnan(found[1, 3])


def test_links_heard_longest_ago_are_forgotten_first():
    history = LinkHistory()
    for number in range(5000):
        history.extend(number, 0, row(1.0))
    assert history.extend(0, 1, row(9.0)).tolist() == [9.0, 9.0]
    assert history.extend(4999, 1, row(9.0)).tolist() == [9.0, 5.0]
    assert len(history._links) == 4096
