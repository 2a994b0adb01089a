"""A recording of others as a bag: the topics that our drivers would have published, and the truth beside them."""

import heapq
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_bringup.nodes.cdr import to_cdr
from mine_loc_bringup.nodes.truth_messages import to_true_link, to_true_pose, to_true_step
from mine_loc_bringup.recordings.recording import Instant, Recording
from mine_loc_bringup.recordings.site_files import write_site
from mine_loc_core.device_clock import DeviceStamp, SyncState
from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.nodes.messages import Covariances, to_header, to_imu, to_magnetic_field
from mine_loc_pdr.parameters import N100DriverParameters
from mine_loc_uwb.nodes.messages import to_cir_array, to_range_array
from mine_loc_uwb.parameters import Dwm1000DriverParameters

_FRAME = "uwb_tag_link"
_NS_PER_TICK = 1.0  # `Range.ticks_offset` of a recording
Entry = tuple[int, str, Any]


def write_recording(recording: Recording, source: str, bag: Path) -> Iterator[int]:
    """Write a new bag with its site folder, which takes its place when it is whole; `source`: where it comes from.

    Messages are logged on arrival; yields after each how many there are. Raises ConfigurationError where `bag` is
    there already, and for a recording that no site file can describe.
    """
    if bag.exists():
        raise ConfigurationError(f"{bag}: is there already; allowed: a new folder")
    bag.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="unfinished_", dir=bag.parent) as folder:
        unfinished = Path(folder, bag.name)
        yield from _write_messages(recording, unfinished)
        write_site(recording, source, unfinished / "site")
        unfinished.rename(bag)


def _write_messages(recording: Recording, path: Path) -> Iterator[int]:
    writer = BagWriter(path)
    try:
        streams = [_rounds(recording), _accumulators(recording), *_imu(recording), *_truth(recording)]
        for number, (arrival_ns, topic, message) in enumerate(heapq.merge(*streams, key=lambda entry: entry[0])):
            writer.write(topic, type(message), arrival_ns, to_cdr(message, type(message)))
            yield number + 1
    finally:
        writer.close()


def message_count(recording: Recording) -> int:
    """About how many messages a recording becomes."""
    samples = 2 * sum(map(len, recording.imu.values()))
    truth = sum(len(track.stamp_ns) for track in recording.tracks) + len(recording.steps) + len(recording.links)
    return len(recording.rounds) + len(recording.accumulators) + samples + truth


def _rounds(recording: Recording) -> Iterator[Entry]:
    sd_m = Dwm1000DriverParameters().range_sd_m
    for number, (at, ranging) in enumerate(recording.rounds):
        seq = number if ranging.seq is None else ranging.seq
        yield at.arrival_ns, "uwb/ranges", to_range_array(ranging, seq, _stamp(at), _FRAME, _NS_PER_TICK, sd_m)


def _accumulators(recording: Recording) -> Iterator[Entry]:
    for at, window in recording.accumulators:
        yield at.arrival_ns, "uwb/cir", to_cir_array([window], _stamp(at), _FRAME)


def _stamp(at: Instant) -> DeviceStamp:
    return DeviceStamp(at.stamp_ns, 0, 0.0, SyncState.UNKNOWN)


def _imu(recording: Recording) -> Iterator[Iterator[Entry]]:
    covariances = Covariances.of(N100DriverParameters())

    def entries(person: str) -> Iterator[Entry]:
        for arrival_ns, sample in recording.imu[person]:
            header = to_header(sample, person)
            yield arrival_ns, f"{person}/imu/data", to_imu(sample, header, covariances)
            if math.isfinite(sample.field_t[0]):
                yield arrival_ns, f"{person}/imu/mag", to_magnetic_field(sample, header, covariances)

    yield from map(entries, recording.imu)


def _truth(recording: Recording) -> Iterator[Iterator[Entry]]:
    for track in recording.tracks:
        rows = zip(track.stamp_ns.tolist(), track.position_m.tolist(), track.orientation_wxyz.tolist(), strict=True)
        topic = f"truth/{track.person}/pose"
        yield ((row[0], topic, to_true_pose(row[0], frame, *row[1:])) for frame in [track.frame] for row in rows)
    yield ((s.stamp_ns, "truth/steps", to_true_step(s.person, s.stamp_ns)) for s in recording.steps)
    yield (
        (link.stamp_ns, "truth/link_state", to_true_link(link.stamp_ns, link.tag_id, link.anchor_id, link.allowed))
        for link in recording.links
    )
