"""Messages of one serial line, stamped and with the ids that the line itself stands for."""

from dataclasses import dataclass, replace

from mine_loc_interfaces.msg import CirFrameArray, TdoaArray, UwbRangeArray

from mine_loc_core.stamps import NS_PER_S
from mine_loc_uwb.device_stamps import DeviceStamps
from mine_loc_uwb.nodes.messages import to_cir_array, to_range_array, to_tdoa_array
from mine_loc_uwb.ranging import RangingRound, TdoaBlink
from mine_loc_uwb.window_gatherer import Gathered
from mine_loc_uwb.wire.decoder import Decoder

_FRAME = "uwb_tag_link"


@dataclass(frozen=True, slots=True)
class LineIds:
    """Tag and reporter of a line where its wire format names none, 0 = not known either."""

    tag_id: int = 0
    reporter_id: int = 0


def stamped_message(
    message: Gathered, decoder: Decoder, stamps: DeviceStamps, arrival_ns: int, ids: LineIds, range_sd_m: float
) -> UwbRangeArray | TdoaArray | CirFrameArray | None:
    """The ROS message of what `decoder` found in bytes that arrived at `arrival_ns`; None for what is not published."""
    if isinstance(message, RangingRound):
        message = _named(message, ids)
        key = (message.reporter_id, message.tag_id)
        stamp = stamps.stamp(key, decoder, message.device_ticks, arrival_ns)
        seq = stamps.number(key, decoder, message.seq)
        stamps.remember_round(message.tag_id, seq, stamp)
        return to_range_array(message, seq, stamp, _FRAME, decoder.tick_period_s * NS_PER_S, range_sd_m)
    if isinstance(message, TdoaBlink):
        key = (message.reference_anchor_id,)
        stamp = stamps.stamp(key, decoder, message.device_ticks, arrival_ns)
        seq = stamps.number((*key, message.tag_id), decoder, message.seq)
        return to_tdoa_array(message, seq, stamp, _FRAME)
    if isinstance(message, tuple):
        # The stamp of its round: by it, what is judged of an accumulator joins the epoch of that round.
        first = message[0]
        stamp = stamps.stamp_of_round(first.tag_id, first.seq)
        if stamp is None:
            stamp = stamps.stamp((first.anchor_id, first.tag_id), decoder, first.device_ticks, arrival_ns)
        return to_cir_array(message, stamp, _FRAME)
    return None


def _named(message: RangingRound, ids: LineIds) -> RangingRound:
    if message.tag_id and message.reporter_id:
        return message
    return replace(message, tag_id=message.tag_id or ids.tag_id, reporter_id=message.reporter_id or ids.reporter_id)
