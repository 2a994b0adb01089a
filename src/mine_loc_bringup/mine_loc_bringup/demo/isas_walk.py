"""The walk `ISAS-Walk1` of isas_walk_uwb_imu (Li, Cao, Hanebeck, RA-L 2023): a carried stick with UWB and an IMU.

Ranges are re-encoded in our binary frame, the IMU (a FLU one) as FDILink 0x40 in the device's FRD axes.
"""

from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from mine_loc_bringup.demo.recording import Recording, Truth, data_file
from mine_loc_core.stamps import NS_PER_S, NS_PER_US
from mine_loc_pdr.fdilink import ImuFrame, encode
from mine_loc_sim.timed_bytes import Arrival
from mine_loc_uwb.ranging import Range, RangingRound
from mine_loc_uwb.wire.mine_loc_frame import encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_ranges

_TAG = 27956


def load() -> Recording:
    """UWB at 15 Hz, IMU at 82 Hz, Vive truth on the recorder's clock and in a frame of its own."""
    rounds: list[tuple[int, bytes]] = []
    imu: list[tuple[int, bytes]] = []
    truth: list[tuple[int, float, float, float]] = []
    with AnyReader([data_file("isas_walk_uwb_imu", "dataset", "ISAS-Walk1.bag")]) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic not in {"/rtls_flares", "/waveshare_sense_hat_b", "/vive/transform/tracker_1_ref"}:
                continue
            message: Any = reader.deserialize(raw, connection.msgtype)
            stamp_ns = message.header.stamp.sec * NS_PER_S + message.header.stamp.nanosec
            if connection.topic == "/rtls_flares":
                rounds.append((stamp_ns, _round(len(rounds), message)))
            elif connection.topic == "/waveshare_sense_hat_b":
                imu.append((stamp_ns, _imu(len(imu), stamp_ns, message)))
            else:
                position = message.transform.translation
                truth.append((stamp_ns, position.x, position.y, position.z))
    start_ns = min(rounds[0][0], imu[0][0])
    table = np.array(truth, dtype=np.float64)
    times_s = np.array([(row[0] - start_ns) / NS_PER_S for row in truth])
    lines = {"rtls": _arrivals(rounds, start_ns), "carrier/n100": _arrivals(imu, start_ns)}
    lasts_s = (max(rounds[-1][0], imu[-1][0]) - start_ns) / NS_PER_S
    truths = [Truth("carrier", times_s, table[:, 1:])]
    return Recording("isas_walk_uwb_imu ISAS-Walk1", "isas_walk", lines, lasts_s, truths)


def _arrivals(items: list[tuple[int, bytes]], start_ns: int) -> list[Arrival]:
    return [(stamp_ns - start_ns, data) for stamp_ns, data in items]


def _round(number: int, message: Any) -> bytes:
    ranges = [
        Range(item.id, item.range if item.ra else np.nan, first_path_power_dbm=item.fpp, receive_power_dbm=item.rxp)
        for item in message.ranges
    ]
    ticks_us = message.t * 1000
    ranging = RangingRound(_TAG, _TAG, number, ticks_us, tuple(ranges), corrected=False)
    return encode_frame(FrameType.RANGES, number % 2**16, encode_ranges(ranging))


def _imu(number: int, stamp_ns: int, message: Any) -> bytes:
    w, a = message.angular_velocity, message.linear_acceleration
    return encode(
        ImuFrame(
            angular_velocity_rad_s=(w.x, -w.y, -w.z),
            specific_force_m_s2=(a.x, -a.y, -a.z),
            magnetic_field_mg=(0.0, 0.0, 0.0),
            temperature_c=25.0,
            pressure_pa=101325.0,
            pressure_temperature_c=25.0,
            timestamp_us=stamp_ns // NS_PER_US % 2**63,
        ),
        number % 256,
    )
