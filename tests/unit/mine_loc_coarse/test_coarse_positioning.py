"""The whole of coarse positioning on emulated monitors, read as its specification."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.coarse_positioning import CoarsePositioning
from mine_loc_coarse.settings import CoarseSettings
from mine_loc_coarse.tracks import Status
from mine_loc_core.site import Gallery, Monitor
from mine_loc_core.stamps import NS_PER_S

TWO = (Monitor(1, (0.0, 0.0, 2.0)), Monitor(2, (4000.0, 0.0, 2.0)))
FOUR = (*TWO, Monitor(3, (0.0, 4000.0, 2.0)), Monitor(4, (4000.0, 4000.0, 2.0)))
ROUND_S = 5
Path = Callable[[float], tuple[float, float]]


def heard(monitors, paths: dict[Path, float], rounds, rng=None, sd_deg=0.0, first=0, bias_deg=None):
    """Reports of every round from every monitor in range; `paths` gives the frequency of each emitter."""
    reports = []
    for number in range(first, first + rounds):
        for path, hz in paths.items():
            at_s = number * ROUND_S + 1.0
            x_m, y_m = path(at_s)
            for monitor in monitors:
                dx, dy = x_m - monitor.position_m[0], y_m - monitor.position_m[1]
                if math.hypot(dx, dy) <= 5000.0:
                    error = math.radians(rng.normal(0.0, sd_deg) if rng else 0.0)
                    error += math.radians((bias_deg or {}).get(monitor.id, 0.0))
                    azimuth = math.remainder(math.atan2(dy, dx) + error, math.tau)
                    stamp_ns = round(at_s * NS_PER_S)
                    reports.append(BearingReport(monitor.id, stamp_ns, hz, hz + 16e3, 1, 0.02, math.nan, azimuth, 0.9))
    return reports


def standing(x_m: float, y_m: float) -> Path:
    return lambda _: (x_m, y_m)


def walking(x_m: float, y_m: float, vx: float, vy: float) -> Path:
    return lambda at_s: (x_m + vx * at_s, y_m + vy * at_s)


def after(rounds: int) -> int:
    return rounds * ROUND_S * NS_PER_S


def positioned(monitors, paths, rounds=12, **options):
    positioning = CoarsePositioning(monitors, CoarseSettings())
    for number in range(rounds):
        positioning.add(heard(monitors, paths, 1, first=number, **options), after(number + 1))
        situation = positioning.situation(after(number + 1))
    return positioning, situation


def test_one_emitter_is_one_region_new_at_first_and_kept_from_then_on():
    positioning = CoarsePositioning(FOUR, CoarseSettings())
    for number, status in enumerate((Status.NEW, Status.KEPT, Status.KEPT)):
        positioning.add(heard(FOUR, {standing(1000.0, 1500.0): 433e6}, 1, first=number), after(number + 1))
        (region,) = positioning.situation(after(number + 1)).regions
        assert region.status is status
    assert region.centre_m == pytest.approx((1000.0, 1500.0), abs=5.0)
    assert region.monitor_ids == (1, 2, 3, 4)


def test_emitters_of_one_channel_that_three_monitors_hear_are_told_apart_without_ghosts():
    paths = {standing(1000.0, 1500.0): 433e6, standing(3000.0, 2600.0): 433e6}
    _, situation = positioned(FOUR, paths)
    centres = sorted(region.centre_m for region in situation.regions)
    assert len(centres) == 2
    assert centres[0] == pytest.approx((1000.0, 1500.0), abs=20.0)
    assert centres[1] == pytest.approx((3000.0, 2600.0), abs=20.0)
    assert {region.status for region in situation.regions} == {Status.KEPT}


def test_a_pairing_that_two_monitors_cannot_decide_is_flagged_and_not_guessed():
    paths = {standing(1200.0, 1500.0): 433e6, standing(2800.0, 1500.0): 433e6}
    _, situation = positioned(TWO, paths)
    assert {region.status for region in situation.regions} == {Status.AMBIGUOUS}
    assert len(situation.regions) == 4
    assert all(region.neighbour_ids == () for region in situation.regions)


def test_an_ambiguity_is_resolved_by_history():
    first, second = standing(1200.0, 1500.0), standing(2800.0, 1500.0)
    positioning, situation = positioned(TWO, {first: 433e6}, rounds=20)
    (known,) = situation.regions
    for number in range(20, 40):
        positioning.add(heard(TWO, {first: 433e6, second: 433e6}, 1, first=number), after(number + 1))
        situation = positioning.situation(after(number + 1))
    stated = {region.id: region for region in situation.regions if region.status is not Status.AMBIGUOUS}
    assert len(stated) == 2
    assert stated[known.id].centre_m == pytest.approx((1200.0, 1500.0), abs=50.0)


def test_one_missed_report_deletes_nobody_and_silence_ends_in_lost_and_then_nothing():
    paths = {standing(1000.0, 1500.0): 433e6}
    positioning, situation = positioned(FOUR, paths)
    (region,) = situation.regions
    seen = {}
    for later_s in (5, 20, 36, 120, 400):
        regions = positioning.situation(after(12) + later_s * NS_PER_S).regions
        seen[later_s] = [(each.id, each.status) for each in regions]
        assert all(each.radius_m >= region.radius_m for each in regions)
    assert seen[5] == seen[20] == [(region.id, Status.KEPT)]
    assert seen[36] == seen[120] == [(region.id, Status.LOST)]
    assert seen[400] == []


def test_late_reports_are_corrected_by_the_motion_of_the_track():
    path = walking(1000.0, 1500.0, 1.0, 0.0)
    positioning = CoarsePositioning(FOUR, CoarseSettings(azimuth_sd_rad=math.radians(0.4)))
    for report in reversed(heard(FOUR, {path: 433e6}, 12)):
        positioning.add([report], after(12))
    (region,) = positioning.situation(after(12)).regions
    assert region.centre_m == pytest.approx(path(60.0), abs=8.0)


def test_identity_survives_the_crossing_of_paths():
    east, west = walking(1950.0, 2000.0, 1.0, 0.0), walking(2050.0, 2000.0, -1.0, 0.0)
    paths = {east: 433e6, west: 433.1e6}
    positioning = CoarsePositioning(FOUR, CoarseSettings())
    owner = {}
    for number in range(24):
        positioning.add(heard(FOUR, paths, 1, first=number), after(number + 1))
        regions = positioning.situation(after(number + 1)).regions
        owner[number] = {region.frequency_hz > 433.05e6: region.id for region in regions}
    west_of_it, *_ = sorted(regions, key=lambda region: region.centre_m)
    assert west_of_it.id == owner[0][True]
    assert all(each == owner[0] for each in owner.values())


def test_a_constant_bearing_error_of_a_monitor_is_found_and_taken_off():
    rng = np.random.default_rng(5)
    places = rng.uniform(600.0, 3400.0, (12, 2))
    paths = {standing(*place): 433e6 + 25e3 * number for number, place in enumerate(places.tolist())}
    positioning, situation = positioned(FOUR, paths, rounds=30, rng=rng, sd_deg=2.0, bias_deg={2: 3.0})
    bias_deg = {number: math.degrees(bias) for number, bias in positioning.bias_rad.items()}
    assert bias_deg[2] == pytest.approx(3.0, abs=0.7)
    assert max(abs(bias_deg[number]) for number in (1, 3, 4)) < 0.7
    assert len(situation.regions) == 12


def test_true_monitors_are_left_alone():
    rng = np.random.default_rng(6)
    paths = {standing(*place): 433e6 + 25e3 * n for n, place in enumerate(rng.uniform(600.0, 3400.0, (12, 2)).tolist())}
    positioning, _ = positioned(FOUR, paths, rounds=30, rng=rng, sd_deg=2.0)
    assert max(abs(math.degrees(bias)) for bias in positioning.bias_rad.values()) < 0.5


def test_neighbours_are_those_within_communication_range():
    paths = {standing(500.0, 1500.0): 433.0e6, standing(2300.0, 1500.0): 433.1e6, standing(3900.0, 1500.0): 433.2e6}
    _, situation = positioned(FOUR, paths)
    west, middle, east = sorted(situation.regions, key=lambda region: region.centre_m)
    assert west.neighbour_ids == (middle.id,)
    assert set(middle.neighbour_ids) == {west.id, east.id}
    assert east.neighbour_ids == (middle.id,)


def test_with_a_map_a_region_is_a_set_of_gallery_stretches():
    galleries = (
        Gallery("main", ((0.0, 1500.0, 0.0), (4000.0, 1500.0, 0.0)), 4.0, 3.0),
        Gallery("far", ((0.0, 3500.0, 0.0), (4000.0, 3500.0, 0.0)), 4.0, 3.0),
    )
    positioning = CoarsePositioning(FOUR, CoarseSettings(), galleries)
    positioning.add(heard(FOUR, {standing(1000.0, 1500.0): 433e6}, 12), after(12))
    (region,) = positioning.situation(after(12)).regions
    (stretch,) = region.galleries
    name, extent = stretch.split()
    low_m, high_m = map(float, extent.split("-"))
    assert name == "main"
    assert low_m == pytest.approx(1000.0 - region.radius_m, abs=10.0)
    assert high_m == pytest.approx(1000.0 + region.radius_m, abs=10.0)


def test_a_jump_of_the_clock_forgets_reports_and_tracks_and_gives_no_number_twice():
    positioning, situation = positioned(FOUR, {standing(1000.0, 1500.0): 433e6})
    (before,) = situation.regions
    positioning.forget()
    assert positioning.situation(after(12)).regions == ()
    positioning.add(heard(FOUR, {standing(1000.0, 1500.0): 433e6}, 12), after(12))
    (again,) = positioning.situation(after(12)).regions
    assert again.id != before.id


def test_a_crowd_on_one_channel_is_counted_and_costs_no_more_than_a_moment():
    rng = np.random.default_rng(2)
    reports = [
        BearingReport(1 + n % 4, NS_PER_S, 433e6, 433.016e6, 1, 0.02, math.nan, rng.uniform(-3, 3), 0.5)
        for n in range(400)
    ]
    positioning = CoarsePositioning(FOUR, CoarseSettings())
    positioning.add(reports, after(1))
    assert positioning.situation(after(1)).regions == ()
    assert positioning.figures["crowded_channels"] == 1
