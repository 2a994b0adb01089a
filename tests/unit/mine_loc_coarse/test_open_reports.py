import math
from dataclasses import replace

import pytest

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.open_reports import OpenReports
from mine_loc_coarse.settings import CoarseSettings
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S

NOW_NS = 1_000 * NS_PER_S
GOOD = BearingReport(7, NOW_NS - NS_PER_S, 433e6, 433.016e6, 1, 0.02, -80.0, 1.0, 0.8)


def opened(*reports, cap=1000):
    reports_open = OpenReports([3, 7], CoarseSettings(), cap)
    reports_open.add(reports, NOW_NS)
    return reports_open


def test_a_report_is_a_column_of_the_window_until_the_window_has_passed():
    reports = opened(GOOD)
    (monitor,) = reports.current(NOW_NS).monitor.tolist()
    assert monitor == 1
    assert len(reports.current(NOW_NS + 66 * NS_PER_S)) == 0
    assert not reports.refused


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"monitor_id": 8}, "unknown_monitor"),
        ({"azimuth_rad": math.nan}, "azimuth"),
        ({"azimuth_rad": 7.0}, "azimuth"),
        ({"start_frequency_hz": math.nan}, "frequency"),
        ({"stop_frequency_hz": math.inf}, "frequency"),
        ({"start_frequency_hz": 434e6}, "frequency"),
        ({"confidence": math.nan}, "confidence"),
        ({"stamp_ns": NOW_NS + 2 * NS_PER_S}, "future"),
        ({"stamp_ns": 2**80}, "future"),
        ({"stamp_ns": -(2**80)}, "stale"),
        ({"stamp_ns": NOW_NS - 66 * NS_PER_S}, "stale"),
    ],
)
def test_what_makes_no_sense_is_refused_under_its_reason_and_the_rest_is_kept(change, reason):
    reports = opened(GOOD, replace(GOOD, **change))
    assert len(reports) == 1
    assert reports.refused == {reason: 1}


def test_the_same_report_counts_once_however_often_it_comes():
    reports = opened(GOOD, GOOD)
    reports.add([GOOD], NOW_NS)
    assert len(reports) == 1
    assert reports.refused == {"duplicate": 2}


def test_memory_is_bounded_and_the_oldest_go():
    many = [replace(GOOD, stamp_ns=GOOD.stamp_ns + number) for number in range(20)]
    reports = opened(*many, cap=5)
    assert sorted(reports.current(NOW_NS).stamp_ns.tolist()) == [each.stamp_ns for each in many[-5:]]
    assert reports.refused == {"overflow": 15}


def test_settings_that_cannot_be_are_refused_with_what_is_allowed():
    with pytest.raises(ConfigurationError, match=r"azimuth_sd_rad.*allowed"):
        CoarseSettings(azimuth_sd_rad=0.0)
    with pytest.raises(ConfigurationError, match=r"heard_share.*allowed"):
        CoarseSettings(heard_share=1.0)
