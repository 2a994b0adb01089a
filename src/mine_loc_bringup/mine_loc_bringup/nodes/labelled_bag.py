"""Labelled accumulators from a bag: `uwb/cir`, and `truth/link_state` or another topic of LinkState as labels."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mine_loc_interfaces.msg import CirFrameArray, LinkState
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import Reader, ReaderError

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_uwb.cir_frames import concatenate
from mine_loc_uwb.labelled_frames import LabelledFrames
from mine_loc_uwb.nodes.cir_messages import tap_count, to_cir_frames

_CIR, _LABELS = "/uwb/cir", "/truth/link_state"
_TOLERANCE_NS = 50_000_000
_MOST_FRAMES = 500_000
_BATCH = 1024


def read_bag(path: Path) -> LabelledFrames:
    """Read frames whose link has a label within 50 ms; every link of tag and anchor is a placement.

    A label allows the classes to which it gives any probability.

    Raises ConfigurationError for a bag without frames or labels, or with windows of different widths.
    """
    labels = _labels(path)
    kept, classes = [], []
    widths = set()
    for message in (frame for array in _messages(path, _CIR, CirFrameArray) for frame in array.frames):
        known = labels.get((message.tag_id, message.anchor_id))
        found = _nearest(known, to_stamp_ns(message.header.stamp))
        if found and len(kept) < _MOST_FRAMES:
            kept.append(message)
            classes.append(found)
            widths.add(tap_count(message))
    if not kept or len(widths) > 1:
        raise ConfigurationError(
            f"{path}: {len(kept)} labelled frames of {len(widths)} widths; allowed: {_CIR} with labels on {_LABELS}, "
            "all windows of one width"
        )
    links = [(message.tag_id, message.anchor_id) for message in kept]
    numbers = {link: number for number, link in enumerate(dict.fromkeys(links))}
    return LabelledFrames(
        frames=concatenate([to_cir_frames(kept[first : first + _BATCH]) for first in range(0, len(kept), _BATCH)]),
        allowed=np.array(classes)[:, None] >> np.arange(4) & 1 > 0,
        placement=np.array([numbers[link] for link in links]),
        links=links,
        stamp_ns=np.array([to_stamp_ns(message.header.stamp) for message in kept]),
    )


def _labels(path: Path) -> dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]:
    """Stamps and allowed classes (a bit each) of each link, in order of time."""
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for message in _messages(path, _LABELS, LinkState):
        if message.most_likely_class:
            allowed = sum(1 << bit for bit, share in enumerate(message.class_probability) if share > 0.0)
            row = (to_stamp_ns(message.header.stamp), allowed)
            found.setdefault((message.tag_id, message.anchor_id), []).append(row)
    columns = {link: np.array(sorted(rows)) for link, rows in found.items()}
    return {link: (rows[:, 0], rows[:, 1]) for link, rows in columns.items()}


def _nearest(known: tuple[np.ndarray, np.ndarray] | None, stamp_ns: int) -> int:
    """Allowed classes of the label nearest in time, 0 = none is near."""
    if known is None:
        return 0
    stamps, classes = known
    after = int(np.searchsorted(stamps, stamp_ns))
    near = [number for number in (after - 1, after) if 0 <= number < len(stamps)]
    best = min(near, key=lambda number: abs(int(stamps[number]) - stamp_ns))
    return int(classes[best]) if abs(int(stamps[best]) - stamp_ns) <= _TOLERANCE_NS else 0


def _messages(path: Path, topic: str, kind: type) -> Iterator[Any]:
    try:
        with Reader(path) as reader:
            wanted = [connection for connection in reader.connections if connection.topic == topic]
            if not wanted:
                raise ConfigurationError(f"{path}: no topic {topic}; allowed: a bag that has it")
            for _, _, data in reader.messages(connections=wanted):
                yield deserialize_message(bytes(data), kind)
    except ReaderError as error:
        raise ConfigurationError(f"{path}: {error}; allowed: a rosbag2 bag") from None
