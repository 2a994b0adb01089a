"""The frames of a scene as the bytes that arrive over each serial line, and when."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.monitor_protocol import encode_report
from mine_loc_core.site import Point3, Site, UwbReceiver
from mine_loc_pdr import fdilink
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.faults import Fault, LineFaults
from mine_loc_sim.reports import ReportedCir, ReportedRound
from mine_loc_sim.scenario import Frame, Scenario, Timed
from mine_loc_sim.scene import line_formats, wire_format
from mine_loc_sim.timed_bytes import Arrival
from mine_loc_uwb.ranging import RangingRound, TdoaBlink
from mine_loc_uwb.wire.dwm1001_shell import encode_lec
from mine_loc_uwb.wire.mine_loc_frame import encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_cir, encode_ranges, encode_tdoa
from mine_loc_uwb.wire.trek1000 import encode_round

Encode = Callable[[Frame], bytes]
_FAULT_SEED = 1 << 32  # keeps the line's own randomness apart from the scene's
_TREK_SLOTS = 4


def byte_blocks(scenario: Scenario, faults: Sequence[Fault] = ()) -> Iterator[Mapping[str, Sequence[Arrival]]]:
    """Play a scenario as what arrives over each line, block by block, each line's arrivals in order.

    Same scenario and faults, same bytes. Anchors are moved by the scenario itself, see `faults.moved_anchors`.
    """
    emitters = line_emitters(scenario, faults)
    for block in scenario.blocks():
        yield {line: list(emitters[line].emit(block.frames[line], block.stop_ns)) for line in scenario.lines}


def line_emitters(scenario: Scenario, faults: Sequence[Fault] = ()) -> dict[str, "LineEmitter"]:
    """Return the emitter of each line of a scenario."""
    receivers = {receiver.name: receiver for receiver in scenario.site.uwb_receivers}
    formats = line_formats(scenario.site, scenario.people)
    seeds = np.random.SeedSequence([_FAULT_SEED, scenario.options.seed]).spawn(len(scenario.lines))
    emitters = {}
    for line, seed in zip(scenario.lines, seeds, strict=True):
        rng = np.random.default_rng(seed)
        encode: Encode
        if formats[line] == "fdilink":
            encode, delay = N100Encoder(), (sc.N100_DELAY_NS, sc.N100_JITTER_NS)
        elif formats[line] == "mldf":
            encode, delay = encode_bearing, (0, 0)  # the emulator has delayed its reports itself
        else:
            encode, delay = uwb_encoder(receivers[line], scenario.site), (sc.UWB_DELAY_NS, sc.UWB_JITTER_NS)
        emitters[line] = LineEmitter(encode, delay, LineFaults(line, faults, rng), rng)
    return emitters


class LineEmitter:
    """One device's line: encodes frames, delays and damages them."""

    def __init__(self, encode: Encode, delay_ns: tuple[int, int], faults: LineFaults, rng: np.random.Generator) -> None:
        self._encode = encode
        self._delay_ns, self._jitter_ns = delay_ns
        self._faults = faults
        self._rng = rng
        self._last_ns = 0

    def emit(self, frames: Collection[Timed], stop_ns: int) -> Iterator[Arrival]:
        """Yield what arrives of frames that were measured in order, all before `stop_ns`."""
        jitter_ns = self._rng.exponential(self._jitter_ns, len(frames)).astype(np.int64).tolist()
        for (stamp_ns, frame), late_ns in zip(frames, jitter_ns, strict=True):
            self._last_ns = max(self._last_ns, stamp_ns + self._delay_ns + late_ns)
            yield from self._faults.of_bytes(self._last_ns, self._encode(self._faults.of_frame(stamp_ns, frame)))
        if stop_ns > self._last_ns:
            yield from self._faults.until(stop_ns)


def uwb_encoder(receiver: UwbReceiver, site: Site) -> Encode:
    """Return the encoder of a receiver's format, which `scene.check_formats` has found fit."""
    spoken = wire_format(receiver)
    if spoken == "trek1000":
        return TrekEncoder(_TREK_SLOTS if max(anchor.id for anchor in site.anchors) <= _TREK_SLOTS else 2 * _TREK_SLOTS)
    if spoken == "dwm1001_shell":
        return LecEncoder({anchor.id: anchor.position_m for anchor in site.anchors})
    return MineLocEncoder()


class MineLocEncoder:
    """Our own frames; one number counts all of a line."""

    def __init__(self) -> None:
        self._number = 0

    def __call__(self, frame: Frame) -> bytes:
        """Encode a round, blink or accumulator."""
        if isinstance(frame, ReportedRound):
            kind, payload = FrameType.RANGES, encode_ranges(frame.ranging, frame.heard.receptions)
        elif isinstance(frame, TdoaBlink):
            kind, payload = FrameType.TDOA, encode_tdoa(frame)
        elif isinstance(frame, ReportedCir):
            registers = frame.reception
            kind = FrameType.CIR
            payload = encode_cir(
                frame.window, preamble_count_unsaturated=registers.preamble_count_unsaturated, sfd=registers.sfd
            )
        else:
            raise TypeError(f"{type(frame).__name__} does not go over a UWB line")
        self._number = (self._number + 1) % 2**16
        return encode_frame(kind, self._number, payload)


class TrekEncoder:
    """`mc` lines of a TREK1000 or of a clone with 8 anchors: corrected by level, stamped in milliseconds."""

    def __init__(self, slots: int) -> None:
        self._slots = slots
        self._count = 0

    def __call__(self, frame: Frame) -> bytes:
        """Encode a round."""
        self._count = (self._count + 1) % 2**16
        ranging = corrected(frame)
        ranging = replace(ranging, device_ticks=(ranging.device_ticks or 0) // 1000 % 2**32)
        by_anchor = ranging.reporter_id != ranging.tag_id
        return encode_round(ranging, range_count=self._count, anchor_reports=by_anchor, slots=self._slots)


class LecEncoder:
    """The `lec` stream of a DWM1001 tag, which knows where the anchors hang by the map."""

    def __init__(self, anchor_positions_m: Mapping[int, Point3]) -> None:
        self._anchor_positions_m = anchor_positions_m

    def __call__(self, frame: Frame) -> bytes:
        """Encode a round."""
        return encode_lec(corrected(frame), self._anchor_positions_m)


class N100Encoder:
    """FDILink; one serial number counts both kinds of frame."""

    def __init__(self) -> None:
        self._serial = -1

    def __call__(self, frame: Frame) -> bytes:
        """Encode 0x40 or 0x41."""
        if not isinstance(frame, ImuFrame | AhrsFrame):
            raise TypeError(f"{type(frame).__name__} does not come from an N100")
        self._serial = (self._serial + 1) % 256
        return fdilink.encode(frame, self._serial)


def encode_bearing(frame: Frame) -> bytes:
    """Encode a monitor's report."""
    if not isinstance(frame, BearingReport):
        raise TypeError(f"{type(frame).__name__} does not come from a monitor")
    return encode_report(frame)


def corrected(frame: Frame) -> RangingRound:
    """Return a round as firmware reports it that takes off the bias by level itself (APS011)."""
    if not isinstance(frame, ReportedRound):
        raise TypeError(f"{type(frame).__name__} is no round; this format carries nothing else")
    biases_m = frame.heard.level_bias_m.tolist()
    pairs = zip(frame.ranging.ranges, biases_m, strict=True)
    ranges = tuple(replace(measured, range_m=measured.range_m - bias_m) for measured, bias_m in pairs)
    return replace(frame.ranging, ranges=ranges, corrected=True)
