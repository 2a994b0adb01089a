"""Faults on demand: what goes wrong on a line or with an anchor during a stretch of a scene.

Written `KIND@START+DURATION[:DEVICE]` with seconds since the beginning. A device is a line (`portal`, `fitter/n100`)
or, for anchors, an anchor's id; without one a fault befalls every line that it can.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_US, to_ns
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame, Vector3
from mine_loc_sim import imu_constants as ic
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.reports import ReportedCir, ReportedRound
from mine_loc_sim.scenario import Frame
from mine_loc_sim.scene import MovedAnchor
from mine_loc_sim.timed_bytes import Arrival, Cable
from mine_loc_uwb.ranging import TdoaBlink

_WRITTEN = re.compile(r"(?P<kind>[a-z_]+)@(?P<start>\d+(?:\.\d+)?)\+(?P<duration>\d+(?:\.\d+)?)(?::(?P<device>\S+))?")
_FORM = "KIND@START+DURATION[:DEVICE], as noise@10+5:portal"


class FaultKind(Enum):
    """Each with what it does."""

    NOISE = "noise"  # random bytes between messages
    TRUNCATION = "truncation"  # messages lose their end
    STALL = "stall"  # a Wi-Fi bridge holds everything back and then sends it at once
    UNPLUG = "unplug"  # the line is gone, and comes back
    FROZEN_ANCHOR = "frozen_anchor"  # an anchor answers with its last range for ever
    MOVED_ANCHOR = "moved_anchor"  # an anchor hangs elsewhere than the map says
    CLOCK_STEP = "clock_step"  # a device's clock jumps ahead, and back at the end
    IMU_SATURATION = "imu_saturation"  # blows beyond the sensors' range


_OF_ANCHORS = {FaultKind.FROZEN_ANCHOR, FaultKind.MOVED_ANCHOR}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault; `device` is a line, an anchor's id in decimal, or None for all lines."""

    kind: FaultKind
    start_ns: int
    stop_ns: int
    device: str | None

    def during(self, stamp_ns: int) -> bool:
        """Whether it lasts at an instant."""
        return self.start_ns <= stamp_ns < self.stop_ns


def parse_fault(text: str, lines: Sequence[str], anchor_ids: Sequence[int]) -> Fault:
    """Read a fault as written on the command line. Raises ConfigurationError that names what is allowed."""
    match = _WRITTEN.fullmatch(text)
    if match is None:
        raise ConfigurationError(f"fault {text!r}: not understood; allowed: {_FORM}")
    kinds = {kind.value: kind for kind in FaultKind}
    if match["kind"] not in kinds:
        raise ConfigurationError(f"fault {text!r}: no such kind; allowed: {', '.join(kinds)}")
    kind, start_s, duration_s = kinds[match["kind"]], float(match["start"]), float(match["duration"])
    if duration_s <= 0.0:
        raise ConfigurationError(f"fault {text!r}: lasts {duration_s:g} s; allowed: above 0")
    if kind in _OF_ANCHORS:
        device: str | None = str(_anchor(text, match["device"], anchor_ids))
    else:
        device = match["device"]
        possible = [line for line in lines if kind is not FaultKind.IMU_SATURATION or "/" in line]
        if device is not None and device not in possible:
            raise ConfigurationError(f"fault {text!r}: no such line; allowed: {', '.join(possible) or 'none here'}")
    return Fault(kind, to_ns(start_s), to_ns(start_s + duration_s), device)


def _anchor(text: str, device: str | None, anchor_ids: Sequence[int]) -> int:
    try:
        anchor_id = int(device or "", 0)
    except ValueError:
        anchor_id = 0
    if anchor_id not in anchor_ids:
        allowed = ", ".join(f"{each:#06x}" for each in anchor_ids)
        raise ConfigurationError(f"fault {text!r}: needs an anchor of the site; allowed after a colon: {allowed}")
    return anchor_id


def moved_anchors(faults: Iterable[Fault]) -> tuple[MovedAnchor, ...]:
    """Faults that are true of the place and so belong into the scene's options."""
    return tuple(
        MovedAnchor(int(fault.device or 0), fault.start_ns, fault.stop_ns, sc.MOVED_M)
        for fault in faults
        if fault.kind is FaultKind.MOVED_ANCHOR
    )


class LineFaults:
    """The faults of one line: some change what its device measures, others what arrives of its bytes."""

    def __init__(self, line: str, faults: Iterable[Fault], rng: np.random.Generator) -> None:
        self._faults = [fault for fault in faults if fault.device in {None, line} or fault.kind in _OF_ANCHORS]
        self._rng = rng
        self._held: list[Arrival] = []
        self._frozen_m: dict[tuple[int, int], float] = {}
        self._unplugged = False

    def of_frame(self, stamp_ns: int, frame: Frame) -> Frame:
        """What the device measures instead of `frame`."""
        for fault in self._faults:
            if fault.kind is FaultKind.FROZEN_ANCHOR and isinstance(frame, ReportedRound):
                frame = self._freeze(fault, stamp_ns, frame)
            elif fault.kind is FaultKind.CLOCK_STEP and fault.during(stamp_ns):
                frame = _stepped(frame)
            elif fault.kind is FaultKind.IMU_SATURATION and fault.during(stamp_ns) and isinstance(frame, ImuFrame):
                frame = _saturated(frame)
        return frame

    def of_bytes(self, arrival_ns: int, data: bytes) -> Iterator[Arrival]:
        """What arrives in place of `data`; arrivals must come in order, and so do the answers."""
        yield from self.until(arrival_ns)
        kinds = {fault.kind for fault in self._faults if fault.during(arrival_ns)}
        if FaultKind.UNPLUG in kinds:
            if not self._unplugged:
                self._unplugged = True
                yield arrival_ns, Cable.UNPLUGGED
            return
        if FaultKind.TRUNCATION in kinds and self._rng.random() < sc.TRUNCATED_SHARE:
            data = data[: int(self._rng.integers(1, len(data)))]
        if FaultKind.NOISE in kinds and self._rng.random() < sc.NOISE_SHARE:
            data = self._rng.bytes(int(self._rng.integers(*sc.NOISE_BYTES))) + data
        if FaultKind.STALL in kinds:
            self._held.append((arrival_ns, data))
        else:
            yield arrival_ns, data

    def until(self, arrival_ns: int) -> Iterator[Arrival]:
        """What happens before an instant of itself: a stall or a gap that ends."""
        ended = [fault for fault in self._faults if fault.stop_ns <= arrival_ns]
        if self._held and not any(f.kind is FaultKind.STALL and f.during(arrival_ns) for f in self._faults):
            end_ns = max(fault.stop_ns for fault in ended if fault.kind is FaultKind.STALL)
            held, self._held = self._held, []
            yield end_ns, b"".join(data for _, data in held if isinstance(data, bytes))
        if self._unplugged and not any(f.kind is FaultKind.UNPLUG and f.during(arrival_ns) for f in self._faults):
            self._unplugged = False
            yield max(fault.stop_ns for fault in ended if fault.kind is FaultKind.UNPLUG), Cable.PLUGGED_IN

    def _freeze(self, fault: Fault, stamp_ns: int, frame: ReportedRound) -> ReportedRound:
        anchor_id, tag_id, ranges = int(fault.device or 0), frame.ranging.tag_id, []
        for measured in frame.ranging.ranges:
            if measured.anchor_id == anchor_id and fault.during(stamp_ns):
                kept_m = self._frozen_m.setdefault((anchor_id, tag_id), measured.range_m)
                ranges.append(replace(measured, range_m=kept_m))
                continue
            if measured.anchor_id == anchor_id and not np.isnan(measured.range_m):
                self._frozen_m[anchor_id, tag_id] = measured.range_m
            ranges.append(measured)
        return replace(frame, ranging=replace(frame.ranging, ranges=tuple(ranges)))


def _stepped(frame: Frame) -> Frame:
    if isinstance(frame, ImuFrame | AhrsFrame):
        return replace(frame, timestamp_us=frame.timestamp_us + sc.CLOCK_STEP_US)
    if isinstance(frame, BearingReport):
        return replace(frame, stamp_ns=frame.stamp_ns + sc.CLOCK_STEP_US * NS_PER_US)
    if isinstance(frame, TdoaBlink):
        return replace(frame, device_ticks=frame.device_ticks + sc.CLOCK_STEP_US)
    if isinstance(frame, ReportedCir):
        return replace(frame, window=replace(frame.window, device_ticks=frame.window.device_ticks + sc.CLOCK_STEP_US))
    ticks = (frame.ranging.device_ticks or 0) + sc.CLOCK_STEP_US
    return replace(frame, ranging=replace(frame.ranging, device_ticks=ticks))


def _saturated(frame: ImuFrame) -> ImuFrame:
    return replace(
        frame,
        angular_velocity_rad_s=_cut(frame.angular_velocity_rad_s, ic.GYRO.limit),
        specific_force_m_s2=_cut(frame.specific_force_m_s2, ic.ACCEL.limit),
    )


def _cut(values: Vector3, limit: float) -> Vector3:
    x, y, z = np.clip(sc.SATURATION_GAIN * np.array(values), -limit, limit).astype(np.float32).tolist()
    return x, y, z
