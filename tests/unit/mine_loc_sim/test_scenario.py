import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import load_people
from mine_loc_core.site import Site, load_site
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.reports import ReportedCir, ReportedRound
from mine_loc_sim.scenario import Block, Frame, Scenario
from mine_loc_sim.scene import MovedAnchor, SceneOptions, anchor_places_m, crew

CONFIG = Path(__file__).parents[3] / "config"
SHORT = SceneOptions(seed=3, seconds=2.0, cir=True)
MINE_MONITORS = ("monitor_1", "monitor_2", "monitor_3")


def scenario(site: str = "example_mine", people: int = 2, options: SceneOptions = SHORT) -> Scenario:
    loaded = load_site(CONFIG / site)
    return Scenario(loaded, crew(loaded, tuple(load_people(CONFIG / site)), people), options)


def of_type(blocks: list[Block], kind: type) -> list[tuple[str, int, Frame]]:
    return [
        (line, stamp_ns, frame)
        for block in blocks
        for line, frames in block.frames.items()
        for stamp_ns, frame in frames
        if isinstance(frame, kind)
    ]


@pytest.fixture(scope="module")
def blocks() -> list[Block]:
    return list(scenario().blocks())


def test_every_line_has_frames_in_order_of_time_and_inside_their_block(blocks: list[Block]):
    for block in blocks:
        assert set(block.frames) == {"portal", "junction", "fitter/n100", "driver/n100", *MINE_MONITORS}
        for frames in block.frames.values():
            stamps = [stamp_ns for stamp_ns, _ in frames]
            assert stamps == sorted(stamps)
            assert all(block.start_ns <= stamp_ns < block.stop_ns for stamp_ns in stamps)


def test_an_n100_alternates_sensors_and_attitude_every_5_ms_of_its_own_clock(blocks: list[Block]):
    frames = [frame for line, _, frame in of_type(blocks, ImuFrame | AhrsFrame) if line == "fitter/n100"]
    assert [type(frame) for frame in frames[:4]] == [ImuFrame, AhrsFrame, ImuFrame, AhrsFrame]
    assert {b.timestamp_us - a.timestamp_us for a, b in itertools.pairwise(frames)} == {sc.N100_PERIOD_US}
    assert len(frames) == pytest.approx(400, abs=1)


def test_each_tag_ranges_ten_times_a_second_and_numbers_its_rounds(blocks: list[Block]):
    rounds = [frame.ranging for _, _, frame in of_type(blocks, ReportedRound)]
    for tag_id in (0x0201, 0x0202):
        numbers = [each.seq for each in rounds if each.tag_id == tag_id]
        assert 17 <= len(numbers) <= 20
        assert numbers == sorted(numbers)


def test_every_accumulator_belongs_to_a_reported_range(blocks: list[Block]):
    reported = {
        (frame.ranging.tag_id, frame.ranging.seq, each.anchor_id): each.range_m
        for _, _, frame in of_type(blocks, ReportedRound)
        for each in frame.ranging.ranges
    }
    windows = [frame.window for _, _, frame in of_type(blocks, ReportedCir)]
    assert windows
    for window in windows:
        assert reported[window.tag_id, window.seq, window.anchor_id] == window.range_m
        assert len(window.in_phase) == 1016


def test_ranges_lie_about_the_true_distance_and_clear_ones_close_to_it(blocks: list[Block]):
    links = [link for block in blocks for link in block.links if link.link_class >= 3]
    assert len(links) > 10
    assert np.nanmedian([abs(link.error_m) for link in links]) < 0.3


def test_truth_of_the_pose_agrees_with_the_true_distances(blocks: list[Block]):
    scene = scenario()
    places = dict(zip([a.id for a in scene.site.anchors], anchor_places_m(scene.site), strict=True))
    for link in blocks[0].links:
        pose = scene.pose(link.person, np.array([link.stamp_ns]))
        distance_m = np.linalg.norm(pose.position_m[0] - places[link.anchor_id])
        assert distance_m == pytest.approx(link.distance_m, abs=1e-6)


def test_a_round_is_reported_once_by_the_receiver_nearest_to_the_tag():
    scene = scenario("gallery_2km", 3)
    blocks = list(scene.blocks())
    seen = [(f.ranging.tag_id, f.ranging.seq) for _, _, f in of_type(blocks, ReportedRound)]
    assert len(seen) == len(set(seen))
    places = dict(zip([a.id for a in scene.site.anchors], anchor_places_m(scene.site), strict=True))
    gateways = {r.name: places[r.anchor_id] for r in scene.site.uwb_receivers if r.anchor_id}
    for line, stamp_ns, frame in of_type(blocks, ReportedRound):
        person = next(p for p in scene.people if p.tag_id == frame.ranging.tag_id)
        tag_m = scene.pose(person.name, np.array([stamp_ns])).position_m[0]
        nearest = min(gateways, key=lambda name: float(np.linalg.norm(gateways[name] - tag_m)))
        assert line == nearest


def test_only_anchors_within_reach_are_ranged():
    links = [link for block in scenario("gallery_2km", 3).blocks() for link in block.links]
    assert links
    assert max(link.distance_m for link in links) < sc.REACH_M + 5.0


def test_rounds_are_lost_now_and_then_and_their_numbers_with_them():
    scene = scenario("vehicle", 3, SceneOptions(seed=1, seconds=12.0, cir=True, round_rate_hz=50.0))
    tag = [f.ranging.seq for _, _, f in of_type(list(scene.blocks()), ReportedRound) if f.ranging.tag_id == 0x0601]
    gaps = sum(b - a - 1 for a, b in itertools.pairwise(tag))
    assert 1 <= gaps <= 3 * sc.LOST_ROUND_SHARE * len(tag)


def test_another_seed_gives_another_scene():
    one, other = (next(scenario(options=replace(SHORT, seed=seed)).blocks()) for seed in (1, 2))
    assert all(list(one.frames[line]) != list(other.frames[line]) for line in one.frames if len(one.frames[line]))


def test_a_moved_anchor_changes_true_distances_only_while_it_is_moved():
    away = MovedAnchor(0x0503, 1_000_000_000, 2_000_000_000, (3.0, 0.0, 0.0))
    still = list(scenario("vehicle", 1).blocks())
    moved = list(scenario("vehicle", 1, replace(SHORT, moved_anchors=(away,))).blocks())

    def distances(blocks: list[Block], start_s: int) -> list[float]:
        return [link.distance_m for link in blocks[start_s].links if link.anchor_id == 0x0503]

    assert distances(still, 0) == distances(moved, 0)
    assert distances(moved, 1)
    assert distances(still, 1) != distances(moved, 1)


def test_a_site_without_anchors_still_has_inertial_sensors_and_monitors():
    frames = next(scenario("field_15km").blocks()).frames
    assert set(frames) == {"scout/n100", "medic/n100", *(f"monitor_{number}" for number in range(1, 9))}
    assert all(len(frames[line]) > 100 for line in ("scout/n100", "medic/n100"))


def test_monitors_measure_where_people_are_at_the_stamp():
    played = scenario("field_15km", 3, SceneOptions(seed=3, seconds=30.0))
    bearings = [bearing for block in played.blocks() for bearing in block.bearings]
    places = {monitor.id: monitor.position_m for monitor in played.site.monitors}
    assert {bearing.emitter for bearing in bearings} == {"scout", "medic", "walker_1"}
    for bearing in bearings:
        x_m, y_m, _ = played.pose(bearing.emitter, np.array([bearing.stamp_ns])).position_m[0]
        east_m, north_m = x_m - places[bearing.monitor_id][0], y_m - places[bearing.monitor_id][1]
        assert bearing.azimuth_rad == pytest.approx(np.arctan2(north_m, east_m), abs=1e-9)
        assert bearing.distance_m == pytest.approx(np.hypot(east_m, north_m))


def test_more_people_than_a_site_has_are_made_up_with_tags_of_their_own():
    site = load_site(CONFIG / "example_mine")
    people = crew(site, tuple(load_people(CONFIG / "example_mine")), 6)
    assert [p.name for p in people] == ["fitter", "driver", "visitor", "walker_1", "walker_2", "walker_3"]
    ids = [p.tag_id for p in people] + [a.id for a in site.anchors]
    assert len(ids) == len(set(ids))
    assert all(p.n100 for p in people[3:])


def with_format(site: Site, spoken: str, tag_id: int = 0) -> Site:
    receivers = tuple(replace(r, format=spoken, tag_id=tag_id) for r in site.uwb_receivers)
    return replace(site, uwb_receivers=receivers)


@pytest.mark.parametrize(
    ("site", "message"),
    [
        (with_format(load_site(CONFIG / "example_mine"), "nlink"), "'nlink' cannot be simulated; allowed"),
        (with_format(load_site(CONFIG / "example_mine"), "trek1000"), "trek1000 cannot name anchor 0x101"),
        (with_format(load_site(CONFIG / "example_mine"), "dwm1001_shell"), "does not name the tag"),
        (Site("empty", "map", 2, 1.0), "nowhere to walk"),
    ],
)
def test_what_cannot_be_simulated_is_refused(site: Site, message: str):
    with pytest.raises(ConfigurationError, match=message):
        Scenario(site, tuple(load_people(CONFIG / "example_mine")), SHORT)


@pytest.mark.parametrize("bad", [{"seconds": 0.5}, {"round_rate_hz": 100.0}, {"seed": -1}])
def test_impossible_options_are_refused_by_name(bad: dict[str, float]):
    with pytest.raises(ConfigurationError, match=next(iter(bad))):
        SceneOptions(**bad)  # type: ignore[arg-type]
