"""A small bag of fused poses, truth, verdicts and steps, made of known errors."""

import numpy as np
from geometry_msgs.msg import PoseStamped
from mine_loc_interfaces.msg import MeasurementVerdict, MeasurementVerdictArray, PersonPose, PersonPoseArray, Step
from rclpy.serialization import serialize_message

from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_core.nodes.conversions import to_point, to_time

START_NS = 1_700_000_000 * 10**9
LATENCY_NS = 20_000_000
PERIOD_NS = 100_000_000


def path_m(times_s):
    """Where somebody walks, (n, 2)."""
    return np.column_stack([4 * np.sin(0.5 * times_s) + 0.3 * times_s, 3 * np.cos(0.31 * times_s)])


def pose(person, stamp_ns, place, *, sd_m=0.3, ce95_m=0.75, mode=PersonPose.UWB_ONLY):
    message = PersonPose(person=person, tag_id=1, stamp=to_time(stamp_ns), horizontal_ce95=ce95_m, mode=mode)
    message.pose.pose.position = to_point((*place, 0.0))
    covariance = np.zeros((6, 6))
    covariance[0, 0] = covariance[1, 1] = sd_m**2
    message.pose.covariance = covariance.ravel()
    return message


def write_bag(
    path,
    *,
    people=("ann",),
    seconds=20.0,
    error_m=lambda times_s: np.zeros((len(times_s), 2)),
    modes=lambda times_s: np.full(len(times_s), PersonPose.UWB_ONLY),
    keep=lambda times_s: np.ones(len(times_s), bool),
    truth=True,
    truth_frame="map",
    truth_topic="truth/{}/pose",
    poses=True,
    verdicts=(),
    steps=(),
    true_steps=(),
):
    """Poses at 10 Hz that err by `error_m`, truth at 20 Hz; verdicts are (topic, reason, count)."""
    times_s = np.arange(0.0, seconds, 0.1)
    entries = []
    errors, mode = error_m(times_s), modes(times_s)
    for number in np.flatnonzero(keep(times_s)) if poses else ():
        stamp_ns = START_NS + int(number) * PERIOD_NS
        array = PersonPoseArray()
        array.header.frame_id, array.header.stamp = "map", to_time(stamp_ns)
        place = path_m(times_s)[number] + errors[number]
        array.people = [pose(person, stamp_ns, place, mode=int(mode[number])) for person in people]
        entries.append((stamp_ns + LATENCY_NS, "fused/poses", array))
    truth_s = np.arange(-0.5, seconds + 0.5, 0.05) if truth else ()
    for time_s, place in zip(truth_s, path_m(np.asarray(truth_s)), strict=True):
        for person in people:
            message = PoseStamped()
            stamp_ns = START_NS + round(float(time_s) * 1e9)
            message.header.stamp, message.header.frame_id = to_time(stamp_ns), truth_frame
            message.pose.position = to_point((*place, 0.0))
            entries.append((stamp_ns, truth_topic.format(person), message))
    for topic, reason, count in verdicts:
        verdict = MeasurementVerdict(source=MeasurementVerdict.RANGE, reason=reason)
        entries.append((START_NS, topic, MeasurementVerdictArray(verdicts=[verdict] * count)))
    for topic, strikes_s in (("pdr/steps", steps), ("truth/steps", true_steps)):
        for at_s in strikes_s:
            message = Step(person=people[0])
            message.header.stamp = to_time(START_NS + round(at_s * 1e9))
            entries.append((START_NS + round(at_s * 1e9), topic, message))
    writer = BagWriter(path)
    for at_ns, topic, message in sorted(entries, key=lambda entry: entry[0]):
        writer.write(topic, type(message), at_ns, serialize_message(message))
    writer.close()
    return path
