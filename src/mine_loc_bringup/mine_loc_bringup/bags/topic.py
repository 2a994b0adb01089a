"""What a bag says of a topic, whatever the storage."""

from dataclasses import dataclass

import yaml
from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import dump_qos_v9


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic with the definition of its type (ros2msg text with all nested types) and what its publishers offered.

    The last `latched_depth` messages of a latched topic are repeated at the head of each part, so that each can be
    played alone; 0 = not latched.
    """

    name: str
    msgtype: str
    definition: str
    type_hash: str = ""
    qos: tuple[Qos, ...] = ()
    latched_depth: int = 0
    encoding: str = "cdr"
    definition_encoding: str = "ros2msg"

    @property
    def qos_text(self) -> str:
        """The profiles as rosbag2 writes them into its storages."""
        return yaml.safe_dump(dump_qos_v9(list(self.qos)), sort_keys=False) if self.qos else ""
