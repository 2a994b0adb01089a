"""The corner of a turn is where the ways before and after it cross, whatever lies between."""

import math

import numpy as np
import pytest

from mine_loc_core.stamps import to_ns
from mine_loc_pdr.turn_corner import CLEAR_NS, corner_of
from mine_loc_pdr.turns import Turn


def corner_in(track, begin_s=10.0, angle_rad=math.pi / 2):
    """Of a turn whose tenths are CLEAR_NS after `begin_s` and before 20 s, where the ways of a track (s, x, y) bend."""
    turn = Turn(to_ns(begin_s) + CLEAR_NS, to_ns(15.0), to_ns(20.0) - CLEAR_NS, 0.0, angle_rad, 0.01)
    return corner_of(turn, [(to_ns(t), x, y) for t, x, y in track])


def test_a_cut_corner_is_where_the_ways_would_have_crossed():
    track = [(0, 0.0, 0.0), (10, 9.0, 0.0), (20, 10.0, 1.0), (30, 10.0, 4.0)]
    corner = corner_in(track)
    assert np.array([10.0, 4.0]) - corner.since == pytest.approx([10.0, 0.0])
    assert corner.loop == pytest.approx([0.0, 0.0])


def test_lengths_of_steps_in_the_turn_do_not_move_the_way_after_it_sideways():
    long_steps = [(0, 0.0, 0.0), (10, 9.0, 0.0), (20, 11.5, 1.0), (30, 11.5, 4.0)]
    assert corner_in(long_steps).since[0] == pytest.approx(0.0)


def test_a_reversal_is_made_on_the_spot_and_its_loop_is_told():
    track = [(0, 0.0, 0.0), (10, 9.5, 0.0), (15, 10.0, 0.5), (20, 9.5, 1.0), (30, 7.0, 1.0)]
    corner = corner_in(track, angle_rad=math.pi)
    assert corner.since == pytest.approx([-3.0, 0.0])
    assert corner.loop == pytest.approx([0.0, 1.0])


def test_a_flat_turn_is_where_its_middle_was():
    track = [(0, 0.0, 0.0), (10, 9.0, 0.0), (20, 10.0, 0.3), (30, 12.0, 1.0)]
    corner = corner_in(track, angle_rad=math.radians(25.0))
    assert np.array([12.0, 1.0]) - corner.since == pytest.approx([9.5, 0.15])


def test_ways_that_cross_behind_the_person_are_not_taken():
    track = [(0, 0.0, 0.0), (10, 9.0, 0.0), (20, 6.0, 1.0), (30, 6.0, 4.0)]
    corner = corner_in(track)
    assert np.array([6.0, 4.0]) - corner.since == pytest.approx([7.5, 0.5])


def test_a_track_that_does_not_reach_back_has_no_corner():
    assert corner_in([(10, 0.0, 0.0), (20, 1.0, 0.0)], begin_s=5.0) is None
    assert corner_in([], begin_s=5.0) is None
