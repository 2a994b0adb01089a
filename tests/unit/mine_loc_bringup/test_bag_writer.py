"""Bags: what was written is read back the same, by a reader that is not ours."""

from geometry_msgs.msg import PoseWithCovarianceStamped
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader

from mine_loc_bringup.bag_writer import BagWriter


def test_messages_of_this_project_and_of_ros_are_read_back(tmp_path):
    array = PersonPoseArray(instance="one", people=[PersonPose(person="ann", tag_id=7, horizontal_ce95=0.5)])
    array.people[0].pose.pose.position.x = 12.5
    pose = PoseWithCovarianceStamped()
    pose.header.frame_id = "map"
    writer = BagWriter(tmp_path / "bag")
    writer.write("fused/poses", PersonPoseArray, 1_000, serialize_message(array))
    writer.write("/people/ann/pose", PoseWithCovarianceStamped, 2_000, serialize_message(pose))
    writer.write("fused/poses", PersonPoseArray, 3_000, serialize_message(PersonPoseArray()))
    writer.close()
    with AnyReader([tmp_path / "bag"]) as reader:
        read = [(c.topic, stamp, reader.deserialize(raw, c.msgtype)) for c, stamp, raw in reader.messages()]
    assert [(topic, stamp) for topic, stamp, _ in read] == [
        ("/fused/poses", 1_000),
        ("/people/ann/pose", 2_000),
        ("/fused/poses", 3_000),
    ]
    person = read[0][2].people[0]
    assert (read[0][2].instance, person.person, person.tag_id, person.pose.pose.position.x) == ("one", "ann", 7, 12.5)
    assert read[1][2].header.frame_id == "map"
    assert read[2][2].people == []
