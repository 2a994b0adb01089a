"""Accumulators of a round come in one message, whatever a line loses and in whatever order it speaks."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import CirWindow, Range, RangingRound
from mine_loc_uwb.window_gatherer import MOST_WINDOWS, WindowGatherer


def ranging(seq, links=3, tag=7, failed=0):
    ranges = [Range(anchor, 4.0) for anchor in range(links)] + [Range(99, math.nan)] * failed
    return RangingRound(tag, 1, seq, 1000 * seq, tuple(ranges), corrected=True)


def window(seq, anchor=0, tag=7):
    samples = np.zeros(4, np.int16)
    return CirWindow(tag, anchor, seq, 1000 * seq, 4.0, 745.0, 744, 400, 40.0, (1, 2, 3), 9, 5, 64, samples, samples)


def taken(gatherer, *messages):
    return [each for message in messages for each in gatherer.take(message)]


def counts(gathered):
    """How many windows came together, in order; 0 for what is none."""
    return [len(each) if isinstance(each, tuple) else 0 for each in gathered]


def windows(seq, number, tag=7):
    return [window(seq, anchor, tag) for anchor in range(number)]


def test_the_windows_of_a_round_come_together_with_the_last_of_them():
    gatherer = WindowGatherer()
    assert taken(gatherer, ranging(1, failed=1), *windows(1, 2)) == [ranging(1, failed=1)]
    ((*found,),) = taken(gatherer, window(1, 2))
    assert [(each.seq, each.anchor_id) for each in found] == [(1, 0), (1, 1), (1, 2)]


def test_of_a_round_that_lost_a_window_the_others_come_before_what_follows():
    gatherer = WindowGatherer()
    assert counts(taken(gatherer, ranging(1), *windows(1, 2), ranging(2))) == [0, 2, 0]
    assert counts(gatherer.release()) == []
    taken(gatherer, window(2))
    assert counts(gatherer.release()) == [1]


def test_a_device_that_never_sends_all_is_not_waited_for():
    gatherer = WindowGatherer()
    taken(gatherer, ranging(1), window(1), ranging(2, links=4))
    assert counts(taken(gatherer, *windows(2, 2))) == [2]


def test_windows_before_their_round_come_with_it():
    gatherer = WindowGatherer()
    assert counts(taken(gatherer, *windows(1, 3), ranging(1))) == [3, 0]


def test_rounds_of_tags_between_each_other_are_not_mixed():
    gatherer = WindowGatherer()
    told = taken(gatherer, ranging(1, tag=7), ranging(5, tag=8), *windows(1, 3), *windows(5, 3, tag=8))
    assert counts(told) == [0, 0, 3, 3]


def test_after_an_interruption_nothing_old_comes():
    gatherer = WindowGatherer()
    taken(gatherer, ranging(1), window(1))
    gatherer.reset()
    assert counts(taken(gatherer, window(1))) == []
    assert counts(gatherer.release()) == [1]


LINE = st.lists(
    st.one_of(
        st.builds(ranging, st.integers(0, 3), st.integers(0, 4), st.integers(7, 8)),
        st.builds(window, st.integers(0, 3), st.integers(0, 4), st.integers(7, 8)),
    ),
    max_size=200,
)


@given(LINE)
def test_nothing_is_lost_or_told_twice_and_no_message_holds_two_rounds(line):
    gatherer = WindowGatherer()
    told = [*taken(gatherer, *line), *gatherer.release()]
    flat = [one for each in told for one in (each if isinstance(each, tuple) else [each])]
    assert [id(one) for one in flat] == [id(one) for one in line]
    for each in told:
        if isinstance(each, tuple):
            assert len({(one.tag_id, one.seq) for one in each}) == 1
            assert len(each) <= MOST_WINDOWS


def test_memory_is_bounded():
    gatherer = WindowGatherer()
    for tag in range(1, 2000):
        assert len(taken(gatherer, ranging(1, tag=tag))) == 1
    assert counts(taken(gatherer, *[window(1, tag=5000)] * 200)) == [MOST_WINDOWS] * 3
    assert len(gatherer._rounds) <= 256
