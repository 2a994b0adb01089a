"""The one intake of ranges: what it makes of what is good, beyond what the round solver's tests say of refusals."""

import math

import numpy as np
import pytest
from uwb_rounds import NOW_NS, PLACES, ranges

from mine_loc_core.site import Anchor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_uwb.range_intake import MeasuredRange, RangeIntake
from mine_loc_uwb.received_power import uncompress_dbm


def intake(max_range_m=300.0, sd_m=0.0, offset_m=0.0):
    return RangeIntake([Anchor(i, str(i), at, sd_m, offset_m) for i, at in PLACES.items()], max_range_m)


def take(items, subject=None, height_m=1.0, source=Source.RANGE, stamp_ns=NOW_NS):
    return (subject or intake()).take(7, stamp_ns, items, height_m, source)


def test_measurements_are_of_the_good_items_in_their_order_at_their_anchors():
    items = ranges()
    items[1] = MeasuredRange(2, math.nan, 0.01)
    measured, reasons = take(items)
    assert reasons == [Reason.ACCEPTED, Reason.INVALID] + [Reason.ACCEPTED] * 3
    assert measured.anchor_ids.tolist() == [1, 3, 4, 5]
    assert measured.anchors_m.tolist() == [list(PLACES[i]) for i in (1, 3, 4, 5)]
    assert measured.range_m == pytest.approx([item.range_m for item in items if item.anchor_id != 2])
    assert (measured.stamp_ns, measured.height_m, measured.shared_offset) == (NOW_NS, 1.0, False)


def test_of_nothing_good_there_are_measurements_of_no_link():
    measured, reasons = take([MeasuredRange(99, 5.0, 0.01)])
    assert reasons == [Reason.UNKNOWN_SENSOR]
    assert len(measured) == 0
    assert measured.anchors_m.shape == (0, 3)


def test_arrivals_of_a_blink_may_be_negative_and_no_longer_than_a_range_and_keep_their_offset():
    items = [MeasuredRange(1, 0.0, 0.01), MeasuredRange(2, -7.0, 0.01), MeasuredRange(3, -20.1, 0.01)]
    measured, reasons = take(items, intake(max_range_m=20.0, offset_m=0.8), source=Source.TDOA)
    assert reasons == [Reason.ACCEPTED, Reason.ACCEPTED, Reason.INVALID]
    assert measured.range_m.tolist() == [0.0, -7.0]
    assert measured.shared_offset


def test_the_reference_of_a_blink_is_always_at_nothing_and_never_frozen():
    subject = intake()
    for number in range(40):
        items = [MeasuredRange(1, 0.0, 0.01), MeasuredRange(2, 3.0, 0.01)]
        _, reasons = take(items, subject, source=Source.TDOA, stamp_ns=NOW_NS + number)
    assert reasons == [Reason.ACCEPTED, Reason.FROZEN]


def test_a_range_that_its_anchor_s_offset_leaves_nothing_of_is_invalid():
    _, reasons = take([MeasuredRange(1, 0.7, 0.01), MeasuredRange(2, 0.9, 0.01)], intake(offset_m=0.8))
    assert reasons == [Reason.INVALID, Reason.ACCEPTED]


@pytest.mark.parametrize(
    ("claimed_m2", "used_m2"),
    [(0.04, 0.04), (0.0, 0.01), (-1.0, 0.01), (math.nan, 0.01), (math.inf, 0.01), (1e-12, 1e-6), (1e12, 1e6)],
)
def test_a_variance_is_what_a_radio_can_mean_and_that_of_the_anchor_s_place(claimed_m2, used_m2):
    measured, _ = take([MeasuredRange(1, 5.0, claimed_m2)], intake(sd_m=0.3))
    assert measured.variance_m2.tolist() == pytest.approx([used_m2 + 0.09])


@pytest.mark.parametrize("level_dbm", [math.nan, math.inf, -math.inf, 200.0, -1e30])
def test_what_is_no_level_counts_as_not_reported(level_dbm):
    items = [MeasuredRange(1, 5.0, 0.01, receive_power_dbm=level_dbm), MeasuredRange(2, 5.0, 0.01, 0, 0.5, -80.0)]
    measured, _ = take(items)
    assert np.isnan(measured.receive_power_dbm[0])
    assert measured.receive_power_dbm[1] == uncompress_dbm(np.array([-80.0]), 64)[0]


def test_a_judgement_counts_for_its_tag_and_its_link_within_a_second_either_way():
    subject = intake()
    subject.link_state(7, 1, NOW_NS, 0.2)
    subject.link_state(8, 2, NOW_NS, 0.2)
    for late_ns, told in ((-NS_PER_S, 0.2), (0, 0.2), (NS_PER_S, 0.2), (NS_PER_S + 1, math.nan)):
        measured, _ = take(ranges()[:2], subject, stamp_ns=NOW_NS + late_ns)
        assert measured.los_probability.tolist() == pytest.approx([told, math.nan], nan_ok=True)


def test_after_a_reset_neither_judgements_nor_repeats_are_remembered():
    subject = intake()
    subject.link_state(7, 1, NOW_NS, 0.2)
    for _ in range(30):
        _, reasons = take(ranges()[:1], subject)
    assert reasons == [Reason.FROZEN]
    subject.reset()
    measured, reasons = take(ranges()[:1], subject)
    assert reasons == [Reason.ACCEPTED]
    assert np.isnan(measured.los_probability).all()
