"""The demonstration's report: figures that follow from the track and the truth."""

import numpy as np
import pytest

from mine_loc_bringup.demo.playback import Truth
from mine_loc_bringup.demo.report import person_report, plot, together
from mine_loc_bringup.evaluation.track import Track

STARTED_NS = 1_700_000_000 * 10**9
TIMES_S = np.arange(0.0, 20.0, 0.1)
PATH_M = np.column_stack([4 * np.sin(0.5 * TIMES_S) + 0.3 * TIMES_S, 3 * np.cos(0.31 * TIMES_S)])


def track(*, shift=(0.0, 0.0), keep=slice(None), modes=3):
    count = len(TIMES_S[keep])
    stamp_ns = STARTED_NS + np.round(TIMES_S[keep] * 1e9).astype(np.int64)
    covariance_m2 = np.tile(0.06 * np.eye(2), (count, 1, 1))
    places_m = PATH_M[keep] + shift
    return Track(stamp_ns, stamp_ns + 20_000_000, places_m, covariance_m2, np.full(count, 0.6), np.full(count, modes))


def truth(*, shared=True, until_s=20.0, yaw=0.0, offset_s=0.0):
    inside = until_s >= TIMES_S
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    positions = np.column_stack([PATH_M @ turn.T, np.zeros(len(TIMES_S))])
    return Truth("ann", TIMES_S[inside] + offset_s, positions[inside], shared)


def test_a_known_error_is_reported_as_it_is():
    figures = person_report("ann", track(shift=(0.3, 0.4)), truth(), STARTED_NS, 20.0).figures
    assert figures["horizontal_mean_m"] == pytest.approx(0.5)
    assert figures["ce95_m"] == pytest.approx(0.5)
    assert figures["claimed_ce95_holds"] == 1.0
    assert figures["availability"] == pytest.approx(1.0, abs=0.01)
    assert figures["latency_p50_ms"] == pytest.approx(20.0)
    assert figures["gaps_over_half_a_second"] == []


def test_truth_with_its_own_clock_and_frame_is_laid_over_first():
    report = person_report("ann", track(), truth(shared=False, yaw=0.7, offset_s=1.5), STARTED_NS, 20.0)
    assert report.figures["rmse_m"] < 0.02
    assert report.figures["alignment"]["time_offset_s"] == pytest.approx(1.5, abs=0.02)
    assert report.figures["alignment"]["yaw_deg"] == pytest.approx(-40.1, abs=0.5)


def test_outputs_without_truth_are_not_scored():
    report = person_report("ann", track(shift=(0.3, 0.4)), truth(until_s=12.0), STARTED_NS, 20.0)
    assert report.figures["max_m"] == pytest.approx(0.5)
    assert report.figures["scored"] == 121
    assert together([report])["max_m"] == pytest.approx(0.5)


def test_a_gap_lowers_availability_and_is_listed():
    keep = (TIMES_S < 8.0) | (TIMES_S > 11.0)
    figures = person_report("ann", track(keep=keep), truth(), STARTED_NS, 20.0).figures
    (gap,) = figures["gaps_over_half_a_second"]
    assert gap["at_s"] == pytest.approx(7.92)
    assert gap["length_s"] == pytest.approx(3.2, abs=0.11)
    assert figures["availability"] == pytest.approx(1 - 2.7 / 20, abs=0.02)


def test_coasting_is_an_output_but_not_a_measured_one():
    figures = person_report("ann", track(modes=5), truth(), STARTED_NS, 20.0).figures
    assert figures["availability"] == pytest.approx(1.0, abs=0.01)
    assert figures["availability_measured"] == 0.0
    assert figures["latency_p50_ms"] is None


def test_nothing_published_is_an_error_that_names_the_person():
    with pytest.raises(ValueError, match="ann: no output"):
        person_report("ann", track(keep=slice(0)), truth(), STARTED_NS, 20.0)


def test_people_are_pooled():
    reports = [
        person_report(name, track(shift=(x, 0.0)), truth(), STARTED_NS, 20.0)
        for name, x in (("ann", 1.0), ("bob", 3.0))
    ]
    pooled = together(reports)
    assert pooled["horizontal_mean_m"] == pytest.approx(2.0)
    assert pooled["scored"] == 2 * len(TIMES_S)


def test_the_plot_is_written_even_where_truth_is_missing(tmp_path):
    plot(
        [person_report("ann", track(), truth(until_s=12.0), STARTED_NS, 20.0)],
        np.zeros((2, 3)),
        "title",
        tmp_path / "plot.png",
    )
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
