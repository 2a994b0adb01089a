"""Which areas people are in, and when they enter and leave them."""

from stored_walks import pose

from mine_loc_bringup.store.alarm_changes import AlarmChanges
from mine_loc_bringup.store.areas import AreaWatch
from mine_loc_bringup.store.records import Alarm, Pose, RangeRound, ZoneEvent
from mine_loc_core.site import Chamber, Gallery, Site, Zone, ZoneType
from mine_loc_fusion.mode import Mode

SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
SITE = Site(
    "made_up", "map", 2, 1.0,
    galleries=(Gallery("main", ((20.0, 5.0, 0.0), (60.0, 5.0, 0.0)), 4.0, 3.0),),
    chambers=(Chamber("hall", ((40.0, 0.0), (60.0, 0.0), (60.0, 10.0), (40.0, 10.0)), 0.0, 3.0),),
    zones=(
        Zone("face", "Face", ZoneType.RESTRICTED, SQUARE),
        Zone("round_car", "Car", ZoneType.HAZARD_NEAR, (), vehicle="car", danger_m=2.0),
    ),
)  # fmt: skip


def walked(*places, watch=None):
    """Areas of each pose, and (second, area, event, dwell) of each event; a place is x or a mode."""
    watch = watch or AreaWatch(SITE, 0.5)
    poses = [
        pose(at_s, mode=place) if isinstance(place, Mode) else pose(at_s, x_m=place, y_m=5.0) for at_s, place in places
    ]
    arranged = watch.arrange(poses)
    start_ns = pose(0).stamp_ns
    events = [
        ((row.stamp_ns - start_ns) / 1e9, row.area, row.event, row.dwell_s)
        for row in arranged
        if isinstance(row, ZoneEvent)
    ]
    return [row.areas for row in arranged if isinstance(row, Pose)], events


def test_zones_galleries_and_chambers_are_areas_but_not_what_a_vehicle_carries():
    assert AreaWatch(SITE, 0.5).names == ("face", "hall", "main")
    assert walked((0, 5.0), (1, 15.0), (2, 30.0), (3, 50.0))[0] == [("face",), (), ("main",), ("hall", "main")]


def test_an_area_is_entered_at_its_border_and_left_beyond_the_margin():
    areas, events = walked((0, 10.3), (1, 9.9), (2, 10.3), (3, 9.8), (4, 10.49), (5, 10.6), (6, 10.3))
    assert areas == [(), ("face",), ("face",), ("face",), ("face",), (), ()]
    assert events == [(1.0, "face", "enter", None), (5.0, "face", "leave", 4.0)]


def test_hysteresis_goes_on_from_batch_to_batch():
    watch = AreaWatch(SITE, 0.5)
    walked((0, 5.0), watch=watch)
    assert walked((1, 10.3), watch=watch) == ([("face",)], [])


def test_whoever_is_lost_has_not_left_but_is_nowhere():
    areas, events = walked((0, 5.0), (1, Mode.LOST), (2, 5.0))
    assert areas == [("face",), (), ("face",)]
    assert events == [
        (0.0, "face", "enter", None),
        (1.0, "face", "lost", 1.0),
        (2.0, "face", "enter", None),
    ]


def test_after_a_silence_or_a_jump_back_nobody_knows_how_the_area_was_left():
    assert walked((0, 5.0), (3, 5.0), (14, 30.0))[1] == [
        (0.0, "face", "enter", None),
        (3.0, "face", "lost", 3.0),
        (14.0, "main", "enter", None),
    ]
    assert walked((9, 5.0), (1, 5.0))[1] == [
        (9.0, "face", "enter", None),
        (9.0, "face", "lost", 0.0),
        (1.0, "face", "enter", None),
    ]


def test_other_rows_and_places_without_areas_pass_through():
    rows = [RangeRound(1, 2, 3, 4, None, None, None), pose(0)]
    assert AreaWatch(Site("bare", "map", 2, 1.0), 0.5).arrange(rows) == rows
    assert AreaWatch(SITE, 0.5).arrange(rows[:1]) == rows[:1]


def alarm(stamp_ns, level, *, latched=False, probability=0.5):
    return Alarm(stamp_ns, "fitter", "car", level, latched, probability, 1.0)


def test_of_repeated_alarms_only_changes_are_kept():
    changes = AlarmChanges()
    assert changes.take(1, [alarm(1, 2)]) == [alarm(1, 2)]
    assert changes.take(2, [alarm(2, 2, probability=0.9)]) == []
    assert changes.take(3, [alarm(3, 3, latched=True)]) == [alarm(3, 3, latched=True)]
    assert changes.take(4, []) == [Alarm(4, "fitter", "car", 1, False, None, None)]
    assert changes.take(5, []) == []
