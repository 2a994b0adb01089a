"""How many people one core carries: the node `pdr` in a process of its own, fed by this one at 100 Hz a person.

Recorded walks go to it as sensor_msgs/Imu on a topic a person, evenly spread over time, and a field at 10 Hz. What
counts is the processor time of the node's process, its middleware's threads and its odometry included, against the
samples it says it has taken: one core keeps up with as many streams as it takes in a second of processor time.
"""

import itertools
import struct
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil
from diagnostic_msgs.msg import DiagnosticArray
from mine_loc_interfaces.msg import Step
from pdr_recordings import Recording
from pdr_tracks import samples as samples_of
from pdr_tracks import shipped_detector
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, MagneticField

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))  # how tests start a node and hear of it

from graph.domains import lent_domain
from graph.observer import Observer
from graph.processes import node_command, running
from graph.walker import write_site

from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.stride import PendulumStrideModel

RATE_HZ = 100
PEOPLE = 200
SECONDS = 20
HEIGHT_M = 1.75
_TURNS = 10  # a period of the samples in so many turns, for a tenth of the people each
_FIELD_EVERY = 10  # samples, as n100_driver sends it
_STAMP = struct.Struct("<iI")  # the header's, behind the four bytes that name the encoding
_STAMP_AT = 4


def streams(recordings: Sequence[Recording]) -> dict[str, Any]:
    """Streams of 100 Hz that one core keeps up with: the node, and its pure modules alone."""
    samples = list(itertools.chain.from_iterable(samples_of(recording) for recording in recordings))
    names = [f"w{k:03}" for k in range(PEOPLE)]
    with tempfile.TemporaryDirectory() as folder, lent_domain() as domain:
        people = [{"name": name, "height_m": HEIGHT_M, "n100": {"port": f"/dev/{name}"}} for name in names]
        site = write_site(Path(folder) / "site", [], people)
        command = node_command("mine_loc_pdr.nodes.pdr", {"site": str(site)})
        with running(command, domain, Path(folder) / "pdr.log") as node:
            rows = _fed(psutil.Process(node.process.pid), domain, names, samples)
    return rows | {"pure_modules_streams_per_core_100hz": _pure(samples)}


def _fed(process: psutil.Process, domain: int, names: Sequence[str], samples: Sequence[ImuSample]) -> dict[str, Any]:
    observer = Observer(domain)
    try:
        publishers = [observer.node.create_publisher(Imu, f"/{name}/imu/data", EVENTS) for name in names]
        fields = [observer.node.create_publisher(MagneticField, f"/{name}/imu/mag", EVENTS) for name in names]
        ends = (*publishers, *fields)
        observer.wait_for(lambda: all(p.get_subscription_count() for p in ends), 90.0, "the node's subscriptions")
        observer.listen(Step, "pdr/steps")
        reports = observer.listen(DiagnosticArray, "/diagnostics", 10)
        observer.wait_for(lambda: len(reports) > 3, what="the node to come to rest")
        before, started_s = process.cpu_times(), time.monotonic()
        sent = _publish(publishers, fields, [_encoded(sample) for sample in samples])
        lasted_s, done_s = time.monotonic() - started_s, time.time()
        observer.wait_for(lambda: reports.messages[-1].header.stamp.sec > done_s + 2.0, 120.0, "the last counts")
        after = process.cpu_times()
        taken = sum(observer.value(f"pdr: {name}", "samples") for name in names)
    finally:
        observer.close()
    cpu_s = after.user + after.system - before.user - before.system
    return {
        "streams_per_core_100hz": round(taken / cpu_s / RATE_HZ),
        "microseconds_a_sample": round(1e6 * cpu_s / taken, 1),
        "people": len(names),
        "offered_hz_a_person": round(sent / len(names) / lasted_s, 1),
        "lost_pct": round(100.0 * (1.0 - taken / sent), 3),
    }


def _encoded(sample: ImuSample) -> bytearray:
    imu = Imu()
    imu.header.frame_id = "someone/imu_link"
    imu.angular_velocity.x, imu.angular_velocity.y, imu.angular_velocity.z = sample.rate_rad_s
    imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z = sample.force_m_s2
    return bytearray(serialize_message(imu))


def _publish(publishers: Sequence[Any], fields: Sequence[Any], messages: Sequence[bytearray]) -> int:
    """The recordings to everyone, each from a place of their own on; how many samples of the IMU were sent."""
    field = MagneticField()
    field.header.frame_id, field.magnetic_field.y, field.magnetic_field.z = "someone/imu_link", 3e-5, -4e-5
    field_message = bytearray(serialize_message(field))
    started_ns, started_s = time.time_ns(), time.monotonic()
    apart = len(messages) // len(publishers)
    for period in range(SECONDS * RATE_HZ):
        stamp = divmod(started_ns + period * NS_PER_S // RATE_HZ, NS_PER_S)
        for turn in range(_TURNS):
            time.sleep(max(0.0, started_s + (period + turn / _TURNS) / RATE_HZ - time.monotonic()))
            for k in range(turn, len(publishers), _TURNS):
                message = messages[(period + k * apart) % len(messages)]
                _STAMP.pack_into(message, _STAMP_AT, *stamp)
                publishers[k].publish(bytes(message))
                if (period + k) % _FIELD_EVERY == 0:
                    _STAMP.pack_into(field_message, _STAMP_AT, *stamp)
                    fields[k].publish(bytes(field_message))
    return SECONDS * RATE_HZ * len(publishers)


def _pure(samples: Sequence[ImuSample]) -> int:
    """The same for dead reckoning without node and messages, in this process."""
    taken, cpu_s = 0, 0.0
    for _ in range(3):
        dead_reckoning = PedestrianDeadReckoning(PendulumStrideModel(HEIGHT_M), detector=shipped_detector())
        started_s = time.process_time()
        for sample in samples:
            dead_reckoning.push(sample)
        cpu_s += time.process_time() - started_s
        taken += len(samples)
    return round(taken / cpu_s / RATE_HZ)
