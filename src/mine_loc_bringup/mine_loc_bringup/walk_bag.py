"""The IMU samples of one person from a bag."""

from collections.abc import Iterator
from pathlib import Path

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.dead_reckoning import ImuSample
from mine_loc_pdr.sensor_cdr import imu_sample


def read_walk(bag: Path, person: str) -> Iterator[ImuSample]:
    """Samples of <person>/imu/data in the order recorded.

    Raises ConfigurationError for a bag that cannot be read or has nothing of this person.
    """
    topic = f"/{person}/imu/data"
    with open_bag(bag) as messages:
        if topic not in messages.topics:
            raise ConfigurationError(f"{bag}: no topic {topic}; allowed: a bag with the IMU of {person}")
        for message in messages.read({topic}):
            yield imu_sample(message.data)
