"""isas_walk_uwb_imu (Li, Cao, Hanebeck, RA-L 2023): ROS 1 bags of a carried stick with UWB, an IMU and Vive truth."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError

from mine_loc_bringup.recordings.public_data import refused, required
from mine_loc_bringup.recordings.recording import NO_FIELD, Instant, Recording, TrueTrack, Vector3, site_content
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_pdr.fdilink import Quaternion
from mine_loc_pdr.n100_stream import ImuMeasurement
from mine_loc_uwb.ranging import Range, RangingRound

PERSON = "carrier"
TAG_HEIGHT_M = 1.2
"""Assumed: how high the stick was carried is not told."""
_RANGES, _IMU, _TRUTH = "/rtls_flares", "/waveshare_sense_hat_b", "/vive/transform/tracker_1_ref"
_EXPECTED = f"a ROS 1 bag ISAS-Walk*.bag with {_RANGES}, {_IMU} and {_TRUTH}"


@dataclass(slots=True)
class Walk:
    """What a bag holds, in order of arrival. The IMU reports forward-left-up, without a magnetometer."""

    anchors_m: dict[int, Vector3] = field(default_factory=dict)
    rounds: list[tuple[Instant, RangingRound]] = field(default_factory=list)
    imu: list[tuple[int, ImuMeasurement]] = field(default_factory=list)
    truth: list[tuple[int, Vector3, Quaternion]] = field(default_factory=list)
    """Stamps, places and orientations (w, x, y, z), in the frame of the lighthouses."""


def names(folder: Path) -> list[str]:
    """Of all recordings, such as `ISAS-Walk1`. Raises ConfigurationError if there are none."""
    found = sorted(path.stem for path in (folder / "dataset").glob("ISAS-Walk*.bag"))
    if not found:
        raise refused(folder, "no dataset/ISAS-Walk*.bag", "the folder of SFUISE with its data set")
    return found


def read_walk(path: Path) -> Walk:
    """Read a bag. Raises ConfigurationError for what is none or lacks a topic."""
    walk = Walk()
    take = {_RANGES: _take_round, _IMU: _take_imu, _TRUTH: _take_truth}
    try:
        with AnyReader([required(path, _EXPECTED)]) as reader:
            wanted = [each for each in reader.connections if each.topic in take]
            if missing := sorted(set(take) - {each.topic for each in wanted}):
                raise refused(path, f"no topic {missing[0]}", _EXPECTED)
            for connection, arrival_ns, raw in reader.messages(wanted):
                message: Any = reader.deserialize(raw, connection.msgtype)
                stamp_ns = to_stamp_ns(message.header.stamp)
                take[connection.topic](walk, Instant(stamp_ns, max(stamp_ns, arrival_ns)), message)
    except (AnyReaderError, OSError, ValueError, KeyError) as error:
        raise refused(path, f"cannot be read as a bag ({error})", _EXPECTED) from None
    return walk


def load(folder: Path, name: str) -> Recording:
    """One recording; the truth is in a frame of its own."""
    walk = read_walk(folder / "dataset" / f"{name}.bag")
    stamps_ns, places_m, orientations = (np.array(column) for column in zip(*walk.truth, strict=True))
    stamp_ns, rising = np.unique(stamps_ns, return_index=True)
    carrier = {
        "name": PERSON,
        "tag_id": walk.rounds[0][1].tag_id,
        "height_m": 1.75,
        "n100": {"port": f"/dev/null/{PERSON}/n100"},
    }
    return Recording(
        name,
        site_content("isas_walk", walk.anchors_m, tag_height_m=TAG_HEIGHT_M),
        [carrier],
        walk.rounds,
        imu={PERSON: walk.imu},
        tracks=[TrueTrack(PERSON, "vive", stamp_ns, places_m[rising], orientations[rising])],
    )


def _take_round(walk: Walk, at: Instant, message: Any) -> None:
    ranges = [
        Range(item.id, item.range if item.ra else np.nan, first_path_power_dbm=item.fpp, receive_power_dbm=item.rxp)
        for item in message.ranges
    ]
    for item in message.ranges:
        place = (round(item.pos.x, 3), round(item.pos.y, 3), round(item.pos.z, 3))
        walk.anchors_m.setdefault(int(item.id), place)
    number, ticks_us = len(walk.rounds), message.t * 1000
    walk.rounds.append((at, RangingRound(message.id, message.id, number, ticks_us, tuple(ranges), corrected=False)))


def _take_imu(walk: Walk, at: Instant, message: Any) -> None:
    w, a = message.angular_velocity, message.linear_acceleration
    sample = ImuMeasurement(at.stamp_ns, (w.x, w.y, w.z), (a.x, a.y, a.z), NO_FIELD, None, None)
    walk.imu.append((at.arrival_ns, sample))


def _take_truth(walk: Walk, at: Instant, message: Any) -> None:
    p, q = message.transform.translation, message.transform.rotation
    walk.truth.append((at.stamp_ns, (p.x, p.y, p.z), (q.w, q.x, q.y, q.z)))
