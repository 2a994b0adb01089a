"""A rosbag2 folder of one or several parts, each whole after every flush and playable alone."""

import contextlib
import os
from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import yaml
from rosbags.rosbag2.metadata import dump_qos_v9

from mine_loc_bringup.bags.mcap_part import McapPart
from mine_loc_bringup.bags.sqlite_part import SqlitePart
from mine_loc_bringup.bags.topic import BagTopic
from mine_loc_core.errors import ConfigurationError

METADATA = "metadata.yaml"
_METADATA_VERSION = 9


class Storage(Enum):
    """The formats of rosbag2."""

    MCAP = "mcap"
    SQLITE3 = "sqlite3"


Part = McapPart | SqlitePart
_PARTS: dict[Storage, type[Part]] = {Storage.MCAP: McapPart, Storage.SQLITE3: SqlitePart}


@dataclass(frozen=True, slots=True)
class SplitLimits:
    """A part that has grown to one of these is followed by another; None = never."""

    size_bytes: int | None = None
    duration_ns: int | None = None


@dataclass(slots=True)
class _Extent:
    """What a part holds."""

    path: Path
    messages: int = 0
    first_ns: int = 2**63 - 1
    last_ns: int = 0

    def take(self, stamp_ns: int) -> None:
        self.messages += 1
        self.first_ns = min(self.first_ns, stamp_ns)
        self.last_ns = max(self.last_ns, stamp_ns)

    @property
    def duration_ns(self) -> int:
        return max(0, self.last_ns - self.first_ns)


@dataclass(slots=True)
class _Known:
    """A topic, its number in the part being written, and what is to be repeated at the head of the next."""

    topic: BagTopic
    number: int
    stored: int = 0
    latched: deque[bytes] = field(default_factory=deque)


class BagFolder:
    """A bag being written, by one thread.

    Everything is in memory until `flush`. `flush`, `split` and `close` raise OSError where the disk takes no more;
    what was flushed before is safe, nothing is forgotten, and they may be called again.
    """

    def __init__(self, path: Path, storage: Storage = Storage.MCAP, limits: SplitLimits | None = None) -> None:
        """Make the folder and its first part. Raises ConfigurationError where that is impossible."""
        self.path = path
        self._storage = storage
        self._limits = limits or SplitLimits()
        self._topics: dict[str, _Known] = {}
        self._extents: list[_Extent] = []
        self._split_due = False  # a split began that the disk did not let end
        self._ended = False  # the part is complete, and the next not begun
        self._headless = False  # nothing is in the part yet, not even what is latched
        self.messages = 0
        """Messages taken, without those repeated at the heads of parts."""
        try:
            path.mkdir(parents=True)
            self._part = self._open_part()
        except FileExistsError:
            raise ConfigurationError(f"{path}: is there already; allowed: a new name") from None
        except OSError as error:
            raise ConfigurationError(f"{path}: {error.strerror}; allowed: a folder that can be written") from None

    @property
    def parts(self) -> int:
        """Parts so far."""
        return len(self._extents)

    @property
    def topics(self) -> int:
        """Topics declared."""
        return len(self._topics)

    @property
    def pending_bytes(self) -> int:
        """Bytes that `flush` would write."""
        return self._part.pending_bytes

    def add_topic(self, topic: BagTopic) -> bool:
        """Declare a topic before its messages; False where one of its name has another type."""
        known = self._topics.get(topic.name)
        if known is None:
            latched: deque[bytes] = deque(maxlen=topic.latched_depth)
            known = self._topics[topic.name] = _Known(topic, self._part.add_topic(topic), latched=latched)
        return known.topic.msgtype == topic.msgtype

    def write(self, topic: str, stamp_ns: int, data: bytes | memoryview) -> None:
        """Take a serialised message of a declared topic."""
        if self._headless:
            self._repeat_latched(stamp_ns)
        known = self._topics[topic]
        self.messages += 1
        if known.topic.latched_depth:
            kept = bytes(data)
            if kept not in known.latched:
                known.latched.append(kept)
        self._append(known, stamp_ns, data)

    def flush(self) -> None:
        """See what is pending on the disk, and begin a part if this one is full."""
        self._part.flush()
        limits, extent = self._limits, self._extents[-1]
        full = limits.size_bytes is not None and self._part.size_bytes >= limits.size_bytes
        long = limits.duration_ns is not None and extent.duration_ns >= limits.duration_ns
        if self._split_due or (extent.messages and (full or long)):
            self.split()

    def split(self) -> None:
        """End this part and begin another, which will have the latched messages at its head."""
        self._split_due = True
        self._end_part()
        self._part = self._open_part()
        self._split_due, self._ended, self._headless = False, False, True
        for known in self._topics.values():
            known.number = self._part.add_topic(known.topic)

    def close(self) -> None:
        """End the bag; nothing can be written afterwards."""
        self._end_part()
        self._write_metadata()

    def abandon(self) -> None:
        """Let go of the bag as it is: what was flushed can be opened by `repair`."""
        self._part.abandon()

    def _end_part(self) -> None:
        if not self._ended:
            self._part.close()
            self._ended = True

    def _repeat_latched(self, stamp_ns: int) -> None:
        self._headless = False
        for known in self._topics.values():
            for data in known.latched:
                self._append(known, stamp_ns, data)

    def _append(self, known: _Known, stamp_ns: int, data: bytes | memoryview) -> None:
        self._part.append(known.number, stamp_ns, data)
        self._extents[-1].take(stamp_ns)
        known.stored += 1

    def _open_part(self) -> Part:
        kind = _PARTS[self._storage]
        path = self.path / f"{self.path.name}_{len(self._extents)}{kind.suffix}"
        try:
            part = kind(path)
            _sync_folder(self.path)
        except OSError:
            with contextlib.suppress(OSError):
                path.unlink()
            raise
        self._extents.append(_Extent(path))
        return part

    def _write_metadata(self) -> None:
        filled = [extent for extent in self._extents if extent.messages]
        first_ns = min((extent.first_ns for extent in filled), default=0)
        last_ns = max((extent.last_ns for extent in filled), default=0)
        information: dict[str, Any] = {
            "version": _METADATA_VERSION,
            "storage_identifier": self._storage.value,
            "duration": {"nanoseconds": last_ns - first_ns},
            "starting_time": {"nanoseconds_since_epoch": first_ns},
            "message_count": sum(extent.messages for extent in self._extents),
            "topics_with_message_count": [_topic_entry(known) for known in self._topics.values()],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [extent.path.name for extent in self._extents],
            "files": [_file_entry(extent) for extent in self._extents],
            "custom_data": None,
            "ros_distro": "jazzy",
        }
        new = self.path / f"{METADATA}.new"
        with new.open("w", encoding="utf-8") as file:
            yaml.safe_dump({"rosbag2_bagfile_information": information}, file, sort_keys=False)
            file.flush()
            os.fsync(file.fileno())
        new.replace(self.path / METADATA)
        _sync_folder(self.path)


def _topic_entry(known: _Known) -> dict[str, Any]:
    topic = known.topic
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.msgtype,
            "serialization_format": topic.encoding,
            "offered_qos_profiles": dump_qos_v9(list(topic.qos)),
            "type_description_hash": topic.type_hash,
        },
        "message_count": known.stored,
    }


def _file_entry(extent: _Extent) -> dict[str, Any]:
    return {
        "path": extent.path.name,
        "starting_time": {"nanoseconds_since_epoch": extent.first_ns if extent.messages else 0},
        "duration": {"nanoseconds": extent.duration_ns if extent.messages else 0},
        "message_count": extent.messages,
    }


def _sync_folder(path: Path) -> None:
    """See new names in a folder on the disk."""
    folder = os.open(path, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
