"""Types of recorded topics: found where they are installed, and refused where a publisher means another by the name."""

import pytest
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.type_hash import TypeHash

from mine_loc_bringup.bags.message_definitions import MessageDefinitions
from mine_loc_bringup.message_types import message_class
from mine_loc_bringup.nodes.recorder import check_version
from mine_loc_core.errors import ConfigurationError

POSES = "mine_loc_interfaces/msg/PersonPoseArray"


def told(text):
    return TopicEndpointInfo(topic_type_hash=TypeHash(version=1, value=bytes.fromhex(text.removeprefix("RIHS01_"))))


def test_a_definition_holds_all_that_a_type_nests_and_its_own_version_is_taken():
    text, text_hash = MessageDefinitions().find(POSES)
    assert "MSG: mine_loc_interfaces/PersonPose" in text
    assert "MSG: geometry_msgs/PoseWithCovariance" in text
    check_version(POSES, text_hash, [told(text_hash), TopicEndpointInfo()])


def test_another_version_is_refused():
    _, text_hash = MessageDefinitions().find(POSES)
    with pytest.raises(ConfigurationError, match="PersonPoseArray: published in another version; allowed: the one"):
        check_version(POSES, text_hash, [told(text_hash), told("RIHS01_" + 32 * "ab")])


@pytest.mark.parametrize("msgtype", ["absent_msgs/msg/Thing", "std_msgs/msg/Thing", "nonsense", "os/msg/path"])
def test_what_is_not_installed_is_refused_by_name(msgtype):
    with pytest.raises(ConfigurationError, match=f"{msgtype}: its definition is not installed"):
        MessageDefinitions().find(msgtype)
    with pytest.raises(ConfigurationError, match=f"{msgtype}: not installed here"):
        message_class(msgtype)
