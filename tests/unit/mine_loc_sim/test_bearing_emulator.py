import math
from collections.abc import Mapping

import numpy as np
import pytest

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Monitor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import bearing_constants as bc
from mine_loc_sim.bearing_emulator import BearingEmulator, MonitorErrors, Sent, Track, TrueBearing, received_dbm

MONITORS = (Monitor(1, (0.0, 0.0, 2.5)), Monitor(7, (4000.0, 0.0, 2.5)))
EXACT = MonitorErrors(noise_sd_rad=0.0, longest_delay_ns=0, lost_share=0.0)


def standing(x_m: float, y_m: float) -> Track:
    return lambda stamp_ns: np.tile([x_m, y_m, 0.0], (len(stamp_ns), 1))


def eastward(stamp_ns: np.ndarray) -> np.ndarray:
    return np.column_stack([stamp_ns / NS_PER_S, np.full(len(stamp_ns), 1000.0), np.zeros(len(stamp_ns))])


def emulator(
    tracks: Mapping[str, Track], errors: MonitorErrors = EXACT, seed: int = 1, monitors: tuple[Monitor, ...] = MONITORS
) -> BearingEmulator:
    return BearingEmulator(monitors, tracks, errors, np.random.default_rng(seed))


def played(
    emulated: BearingEmulator, seconds: int, block_s: int = 5
) -> tuple[dict[int, list[Sent]], list[TrueBearing]]:
    sent: dict[int, list[Sent]] = {}
    truth: list[TrueBearing] = []
    for stop_s in range(block_s, seconds + block_s, block_s):
        block, measured = emulated.play(min(stop_s, seconds) * NS_PER_S)
        truth += measured
        for monitor_id, reports in block.items():
            sent.setdefault(monitor_id, []).extend(reports)
    return sent, truth


def reports(sent: Mapping[int, list[Sent]]) -> list[BearingReport]:
    return [report for each in sent.values() for _, report in each]


def middle_hz(report: BearingReport) -> float:
    return (report.start_frequency_hz + report.stop_frequency_hz) / 2.0


def test_without_errors_a_bearing_points_from_the_monitor_to_where_the_emitter_was():
    sent, _ = played(emulator({"a": eastward}), 60)
    assert len(sent[1]) == len(sent[7]) == 12
    for monitor_id, monitor_x_m in ((1, 0.0), (7, 4000.0)):
        for at_ns, report in sent[monitor_id]:
            assert at_ns == report.stamp_ns
            yaw_rad = math.atan2(1000.0, report.stamp_ns / NS_PER_S - monitor_x_m)
            assert report.azimuth_rad == pytest.approx(yaw_rad, abs=1e-12)


def test_every_monitor_measures_an_emission_at_one_instant_once_a_round():
    sent, _ = played(emulator({"a": standing(2000.0, 100.0), "b": standing(2000.0, 300.0)}), 60)
    stamps = {monitor_id: [report.stamp_ns for _, report in each] for monitor_id, each in sent.items()}
    assert stamps[1] == stamps[7]
    assert len(stamps[1]) == 24
    assert {b - a for a, b in zip(stamps[1], stamps[1][2:], strict=False)} == {bc.ROUND_NS}


def test_the_block_in_which_a_scene_is_played_changes_nothing():
    errors = MonitorErrors()
    whole, pieces = (played(emulator({"a": eastward}, errors), 60, block_s) for block_s in (60, 7))
    assert whole == pieces
    assert whole != played(emulator({"a": eastward}, errors, seed=2), 60)


def test_only_emitters_within_the_detection_range_are_reported():
    _, truth = played(emulator({"near": standing(-900.0, 0.0), "far": standing(-4999.0, 0.0)}), 20)
    assert {(bearing.emitter, bearing.monitor_id) for bearing in truth} == {("near", 1), ("near", 7), ("far", 1)}


def test_the_error_of_a_bearing_has_the_asked_spread_about_the_monitors_own_bias():
    errors = MonitorErrors(bias_rad={7: math.radians(1.0)})
    sent, truth = played(emulator({"a": standing(2000.0, 1000.0)}, errors), 10_000, 10_000)
    for monitor_id, bias_deg in ((1, 0.0), (7, 1.0)):
        error_deg = np.degrees([bearing.error_rad for bearing in truth if bearing.monitor_id == monitor_id])
        assert np.mean(error_deg) == pytest.approx(bias_deg, abs=4 * 2.0 / math.sqrt(2000))
        assert np.std(error_deg) == pytest.approx(2.0, rel=0.07)
    told = {(bearing.monitor_id, bearing.stamp_ns): bearing for bearing in truth}
    for report in reports(sent):
        bearing = told[report.monitor_id, report.stamp_ns]
        off_rad = math.remainder(report.azimuth_rad - bearing.azimuth_rad - bearing.error_rad, math.tau)
        assert off_rad == pytest.approx(0.0, abs=1e-12)


def test_a_tenth_is_lost_and_the_rest_comes_up_to_5_s_late():
    sent, truth = played(emulator({"a": standing(2000.0, 1000.0)}, MonitorErrors()), 10_000)
    lost = [bearing.sent_ns is None for bearing in truth]
    assert len(truth) == 4000
    assert np.mean(lost) == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / 4000))
    late_s = [(bearing.sent_ns - bearing.stamp_ns) / NS_PER_S for bearing in truth if bearing.sent_ns is not None]
    assert min(late_s) >= 0.0
    assert max(late_s) <= 5.0
    assert np.mean(late_s) == pytest.approx(2.5, abs=4 * 5.0 / math.sqrt(12 * 3600))
    waiting = sum(bearing.sent_ns is not None and bearing.sent_ns >= 10_000 * NS_PER_S for bearing in truth)
    assert len(reports(sent)) == len(truth) - sum(lost) - waiting


def test_reports_of_several_emitters_overtake_each_other_and_come_in_order_of_sending():
    tracks = {str(number): standing(2000.0, 10.0 * number) for number in range(10)}
    sent, _ = played(emulator(tracks, MonitorErrors()), 60)
    stamps = [report.stamp_ns for _, report in sent[1]]
    assert stamps != sorted(stamps)
    for each in sent.values():
        assert [at_ns for at_ns, _ in each] == sorted(at_ns for at_ns, _ in each)


def test_an_emission_lies_in_its_channel_to_a_kilohertz_and_channels_are_drawn_evenly():
    tracks = {str(number): standing(2000.0, 100.0) for number in range(1000)}
    emulated = emulator(tracks)
    sent, truth = played(emulated, 5)
    channels = np.array(list(emulated.channels.values()))
    assert 0 <= channels.min() < 10
    assert 245 < channels.max() < bc.CHANNELS
    assert np.mean(channels) == pytest.approx((bc.CHANNELS - 1) / 2.0, abs=4 * bc.CHANNELS / math.sqrt(12_000))
    by_stamp = {bearing.stamp_ns: bearing.channel for bearing in truth}
    detuned_hz = [
        middle_hz(report) - (bc.FIRST_CHANNEL_HZ + (by_stamp[report.stamp_ns] + 0.5) * bc.CHANNEL_SPACING_HZ)
        for report in reports(sent)
    ]
    assert np.max(np.abs(detuned_hz)) <= bc.FREQUENCY_ACCURACY_HZ
    assert np.std(detuned_hz) == pytest.approx(bc.FREQUENCY_ACCURACY_HZ / math.sqrt(3.0), rel=0.1)


def test_level_and_confidence_fall_with_distance():
    tracks = {str(x_m): standing(-float(x_m), 0.0) for x_m in (10, 1000, 3000, 5000)}
    sent, truth = played(emulator(tracks, monitors=MONITORS[:1]), 5)
    distance_m = {bearing.stamp_ns: bearing.distance_m for bearing in truth}
    near_to_far = sorted(reports(sent), key=lambda report: distance_m[report.stamp_ns])
    levels, confidences = ([getattr(r, name) for r in near_to_far] for name in ("level_dbm", "confidence"))
    assert levels == sorted(levels, reverse=True)
    assert confidences == sorted(confidences, reverse=True)
    assert confidences[0] == 1.0
    assert confidences[-1] == pytest.approx(0.5)


def test_free_space_takes_85_db_over_a_kilometre_at_433_mhz():
    assert bc.TRANSMIT_POWER_DBM - received_dbm(1000.0, 433e6) == pytest.approx(85.2, abs=0.05)


def test_a_place_without_monitors_has_no_reports():
    assert played(emulator({"a": eastward}, monitors=()), 20) == ({}, [])


@pytest.mark.parametrize(
    "mistake",
    [{"detection_range_m": 0.0}, {"noise_sd_rad": -0.1}, {"longest_delay_ns": -1}, {"lost_share": 1.1}],
    ids=str,
)
def test_errors_that_cannot_be_are_refused_with_what_is_allowed(mistake: dict[str, float]):
    with pytest.raises(ConfigurationError, match=f"{next(iter(mistake))}.*allowed"):
        MonitorErrors(**mistake)
