"""The walk `ISAS-Walk1` of isas_walk_uwb_imu (Li, Cao, Hanebeck, RA-L 2023): a carried stick with UWB and an IMU.

Ranges are re-encoded in our binary frame, the IMU (a FLU one) as FDILink 0x40 in the device's FRD axes.
"""

import numpy as np

from mine_loc_bringup.demo.playback import Playback, Truth
from mine_loc_bringup.recordings.isas import PERSON, read_walk
from mine_loc_bringup.recordings.public_data import data_file
from mine_loc_core.stamps import NS_PER_S, NS_PER_US
from mine_loc_pdr.fdilink import ImuFrame, encode
from mine_loc_pdr.n100_stream import ImuMeasurement
from mine_loc_sim.timed_bytes import Arrival
from mine_loc_uwb.wire.mine_loc_frame import encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_ranges


def load() -> Playback:
    """UWB at 15 Hz, IMU at 82 Hz, Vive truth on the recorder's clock and in a frame of its own."""
    walk = read_walk(data_file("isas_walk_uwb_imu", "dataset", "ISAS-Walk1.bag"))
    start_ns = min(walk.rounds[0][0].stamp_ns, walk.imu[0][1].stamp_ns)
    rounds: list[Arrival] = [
        (at.stamp_ns - start_ns, encode_frame(FrameType.RANGES, number % 2**16, encode_ranges(ranging)))
        for number, (at, ranging) in enumerate(walk.rounds)
    ]
    imu: list[Arrival] = [
        (sample.stamp_ns - start_ns, _imu(number, sample)) for number, (_, sample) in enumerate(walk.imu)
    ]
    times_s = np.array([(row[0] - start_ns) / NS_PER_S for row in walk.truth])
    truths = [Truth(PERSON, times_s, np.array([row[1] for row in walk.truth]))]
    lasts_s = max(rounds[-1][0], imu[-1][0]) / NS_PER_S
    return Playback(
        "isas_walk_uwb_imu ISAS-Walk1", "isas_walk", {"rtls": rounds, f"{PERSON}/n100": imu}, lasts_s, truths
    )


def _imu(number: int, sample: ImuMeasurement) -> bytes:
    w, a = sample.rate_rad_s, sample.force_m_s2
    return encode(
        ImuFrame(
            angular_velocity_rad_s=(w[0], -w[1], -w[2]),
            specific_force_m_s2=(a[0], -a[1], -a[2]),
            magnetic_field_mg=(0.0, 0.0, 0.0),
            temperature_c=25.0,
            pressure_pa=101325.0,
            pressure_temperature_c=25.0,
            timestamp_us=sample.stamp_ns // NS_PER_US % 2**63,
        ),
        number % 256,
    )
