"""Parameters of this package's nodes."""

from dataclasses import dataclass

from mine_loc_core.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class RecorderParameters(NodeParameters):
    """What is recorded, and how."""

    bag: str = parameter(
        "mine_loc_%Y-%m-%d_%H-%M-%S",
        "folder of the new bag; % and a letter stand for parts of the time, as in date(1)",
        read_only=True,
    )
    topics: str = parameter(
        "", "patterns of topics, with commas between; empty = all but hidden ones (docs/bags.md)", read_only=True
    )
    exclude: str = parameter("", "patterns of topics that are left out", read_only=True)
    storage: str = parameter("mcap", "format of the bag", choices=("mcap", "sqlite3"), read_only=True)
    split_size_mb: float = parameter(
        0.0, "a part that has grown to this is followed by another; 0 = never", unit="MB", low=0.0, high=1e6,
        read_only=True,
    )  # fmt: skip
    split_duration_s: float = parameter(
        0.0, "a part that is this long is followed by another; 0 = never", unit="s", low=0.0, high=1e6, read_only=True
    )
    queue_mb: float = parameter(
        64.0, "messages that wait for the disk; further ones are dropped", unit="MB", low=1.0, high=4096.0,
        read_only=True,
    )  # fmt: skip


@dataclass(frozen=True)
class PlayerParameters(NodeParameters):
    """What is played, and how."""

    bag: str = parameter("", "the bag: a folder, or one of its files", read_only=True)
    topics: str = parameter(
        "", "patterns of topics, with commas between; empty = the inputs of the graph (docs/bags.md)", read_only=True
    )
    exclude: str = parameter("", "patterns of topics that are left out", read_only=True)
    rate: float = parameter(1.0, "bag time that passes in a second", unit="1", low=0.01, high=100.0)
    start_offset_s: float = parameter(0.0, "begin so long after the bag's beginning", unit="s", low=0.0, high=1e6,
                                      read_only=True)  # fmt: skip
    loop: bool = parameter(False, "begin again at the end")
    paused: bool = parameter(False, "wait for the service to begin", read_only=True)
