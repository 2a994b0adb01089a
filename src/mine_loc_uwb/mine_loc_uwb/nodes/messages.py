"""Decoded radio messages to ROS messages."""

import math
from collections.abc import Sequence

from mine_loc_interfaces.msg import CirFrame, CirFrameArray, TdoaArray, TdoaDifference, UwbRange, UwbRangeArray

from mine_loc_core.device_clock import DeviceStamp
from mine_loc_core.nodes.conversions import to_time
from mine_loc_uwb.ranging import DW1000_TAP_S, CirWindow, Range, RangingRound, TdoaBlink
from mine_loc_uwb.received_power import los_probability_from_powers


def to_range_array(
    message: RangingRound, seq: int, stamp: DeviceStamp, frame_id: str, tick_ns: float, range_sd_m: float
) -> UwbRangeArray:
    """One ranging round."""
    array = UwbRangeArray(
        tag_id=message.tag_id,
        reporter_id=message.reporter_id,
        seq=seq,
        device_ticks=message.device_ticks or 0,
        clock_offset_ns=stamp.offset_ns,
        skew_ppm=stamp.skew_ppm,
        sync_state=int(stamp.state),
    )
    array.header.stamp = to_time(stamp.stamp_ns)
    array.header.frame_id = frame_id
    array.ranges = [_to_range(item, tick_ns, range_sd_m) for item in message.ranges[:64]]
    return array


def _to_range(item: Range, tick_ns: float, range_sd_m: float) -> UwbRange:
    los = los_probability_from_powers(item.first_path_power_dbm, item.receive_power_dbm)
    return UwbRange(
        anchor_id=item.anchor_id,
        stamp_offset_ns=round(item.ticks_offset * tick_ns),
        range_raw=item.range_m,
        range=item.range_m,
        range_variance=range_sd_m**2,
        first_path_power=item.first_path_power_dbm,
        receive_power=item.receive_power_dbm,
        first_path_index=item.first_path_index,
        clock_offset_ppm=item.clock_offset_ppm,
        los_probability=los,
        los_state=_los_state(los),
    )


def _los_state(probability: float) -> int:
    if math.isnan(probability):
        return UwbRange.LOS_UNKNOWN
    if probability > 0.8:
        return UwbRange.LOS
    return UwbRange.NLOS if probability < 0.2 else UwbRange.AMBIGUOUS


def to_tdoa_array(message: TdoaBlink, seq: int, stamp: DeviceStamp, frame_id: str) -> TdoaArray:
    """One blink."""
    array = TdoaArray(
        tag_id=message.tag_id,
        seq=seq,
        device_ticks=message.device_ticks,
        reference_receive_power=message.reference_receive_power_dbm,
    )
    array.header.stamp = to_time(stamp.stamp_ns)
    array.header.frame_id = frame_id
    array.differences = [
        TdoaDifference(
            anchor_id=item.anchor_id,
            reference_anchor_id=message.reference_anchor_id,
            range_difference=item.range_difference_m,
            receive_power=item.receive_power_dbm,
            first_path_power=item.first_path_power_dbm,
        )
        for item in message.differences[:64]
    ]
    return array


def to_cir_array(windows: Sequence[CirWindow], stamp: DeviceStamp, frame_id: str) -> CirFrameArray:
    """At most 64 windows of one tag and round."""
    array = CirFrameArray()
    array.header.stamp = to_time(stamp.stamp_ns)
    array.header.frame_id = frame_id
    array.frames = [_to_cir_frame(window) for window in windows]
    for frame in array.frames:
        frame.header = array.header
    return array


def _to_cir_frame(message: CirWindow) -> CirFrame:
    frame = CirFrame(
        tag_id=message.tag_id,
        anchor_id=message.anchor_id,
        range_seq=message.seq,
        device_ticks=message.device_ticks,
        range=message.range_m,
        first_path_index=message.first_path_index,
        start_index=message.start_index,
        sample_period=DW1000_TAP_S,
        preamble_count=message.preamble_count,
        noise_std=message.noise_std,
        first_path_power=message.first_path_power_dbm,
        receive_power=message.receive_power_dbm,
        channel=message.channel,
        prf_mhz=message.prf_mhz,
    )
    frame.first_path_amplitude = message.first_path_amplitude
    frame.in_phase.frombytes(message.in_phase.tobytes())
    frame.quadrature.frombytes(message.quadrature.tobytes())
    return frame
