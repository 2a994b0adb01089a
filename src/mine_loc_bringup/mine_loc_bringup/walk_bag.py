"""The IMU samples of one person from a bag."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.dead_reckoning import ImuSample


def read_walk(bag: Path, person: str) -> Iterator[ImuSample]:
    """Samples of <person>/imu/data in the order recorded.

    Raises ConfigurationError for a bag that cannot be read or has nothing of this person.
    """
    topic = f"/{person}/imu/data"
    try:
        with AnyReader([bag]) as reader:
            connections = [each for each in reader.connections if each.topic == topic]
            if not connections:
                raise ConfigurationError(f"{bag}: no topic {topic}; allowed: a bag with the IMU of {person}")
            for connection, _, raw in reader.messages(connections):
                message: Any = reader.deserialize(raw, connection.msgtype)
                stamp, rate, force = message.header.stamp, message.angular_velocity, message.linear_acceleration
                yield ImuSample(
                    int(stamp.sec) * NS_PER_S + int(stamp.nanosec),
                    (float(rate.x), float(rate.y), float(rate.z)),
                    (float(force.x), float(force.y), float(force.z)),
                )
    except (AnyReaderError, OSError, ValueError, KeyError) as error:
        raise ConfigurationError(f"{bag}: cannot be read as a bag: {error}") from error
