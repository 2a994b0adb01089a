"""Bags of other people: topics renamed, fields found by name or by rule, what is not known said so."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mine_loc_bringup.message_types import workspace_types
from mine_loc_bringup.topic_mapping import TopicMapping, adapt, load_topic_mapping
from mine_loc_core.errors import ConfigurationError

ROUND = "mine_loc_interfaces/msg/UwbRangeArray"
STAMP = SimpleNamespace(sec=12, nanosec=34)
FOREIGN = SimpleNamespace(
    header=SimpleNamespace(stamp=STAMP, frame_id="stick", seq=9),
    found=[SimpleNamespace(id=7, mm=4250, good=True), SimpleNamespace(id=8, mm=99_999, good=False)],
)
RULES = {
    "header": "header",
    "tag_id": {"value": 513},
    "ranges": {
        "each": "found",
        "where": "good",
        "fields": {"anchor_id": "id", "range": {"from": "mm", "scale": 0.001, "offset": -0.25}},
    },
}


def serialised(message: object, name: str) -> object:
    """What a reader gets of it."""
    types = workspace_types()
    return types.deserialize_cdr(types.serialize_cdr(message, name), name)


def test_rules_make_a_round_of_another_project_s_message():
    array = serialised(adapt(FOREIGN, ROUND, workspace_types(), RULES), ROUND)
    assert (array.header.stamp.sec, array.header.frame_id, array.tag_id) == (12, "stick", 513)
    assert [(item.anchor_id, item.range) for item in array.ranges] == [(7, pytest.approx(4.0))]


def test_what_is_not_known_is_nan_and_a_variance_is_zero():
    item = serialised(adapt(FOREIGN, ROUND, workspace_types(), RULES), ROUND).ranges[0]
    assert math.isnan(item.range_raw)
    assert math.isnan(item.los_probability)
    assert (item.range_variance, item.los_state) == (0.0, 0)


def test_a_message_with_one_measurement_is_a_round_of_one_stamped_by_the_recorder():
    rules = {
        "header": {"fields": {"stamp": {"log_time": True}}},
        "ranges": {"each": ".", "fields": {"anchor_id": "peer", "range": "metres"}},
    }
    single = SimpleNamespace(peer=3, metres=1.5)
    array = serialised(adapt(single, ROUND, workspace_types(), rules, 5_000_000_007), ROUND)
    assert (array.header.stamp.sec, array.header.stamp.nanosec) == (5, 7)
    assert [(item.anchor_id, item.range) for item in array.ranges] == [(3, 1.5)]


def test_without_rules_fields_go_by_name_and_an_older_definition_leaves_the_new_ones_unset():
    vector = SimpleNamespace(x=1.0, y=2.0, z=3.0)
    older = SimpleNamespace(
        header=FOREIGN.header, angular_velocity=vector, linear_acceleration=vector, orientation_covariance=range(9)
    )
    imu = serialised(adapt(older, "sensor_msgs/msg/Imu", workspace_types()), "sensor_msgs/msg/Imu")
    assert imu.linear_acceleration.z == 3.0
    assert imu.orientation_covariance.tolist() == list(range(9))
    assert math.isnan(imu.orientation.w)
    assert not np.any(imu.angular_velocity_covariance)


def test_a_path_that_is_not_there_is_an_error():
    with pytest.raises(AttributeError, match="nothing"):
        adapt(FOREIGN, ROUND, workspace_types(), {"tag_id": "nothing"})


def test_topics_are_renamed_and_others_keep_their_names():
    mapping = TopicMapping({"/imu": {"topic": "ann/imu/data"}, "/u": {"topic": "uwb/ranges", "type": ROUND}})
    assert mapping.target("/imu", "sensor_msgs/msg/Imu") == ("/ann/imu/data", "sensor_msgs/msg/Imu")
    assert mapping.target("/u", "x/msg/Y") == ("/uwb/ranges", ROUND)
    assert mapping.target("/other", "x/msg/Y") == ("/other", "x/msg/Y")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("schema: 1\ntopics: {/a: {topik: b}}", r"topics./a.topik: no such key; did you mean topic\?"),
        (
            "schema: 1\ntopics: {/a: {topic: b, fields: {x: 3}}}",
            "topics./a.fields.x: 3 is not allowed; allowed: .*path",
        ),
        ("schema: 1\ntopics: {}", "topics: .* is not allowed"),
        ("schema: 2\ntopics: {/a: {topic: b}}", "schema: 2 is not allowed; allowed: 1"),
    ],
)
def test_a_bad_mapping_is_refused_with_its_line(text, says, tmp_path):
    file = tmp_path / "map.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=says):
        load_topic_mapping(file)
