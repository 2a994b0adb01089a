"""A simulated scene as a bag: what the drivers make of the bytes, and the truth, without a running graph.

The bytes go through the drivers' own decoders, stamps and conversions, so losses and faults leave the same traces.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from mine_loc_interfaces.msg import CirFrameArray, TdoaArray, UwbRangeArray

from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_bringup.nodes.cdr import to_cdr
from mine_loc_bringup.nodes.truth_messages import to_true_link, to_true_pose, to_true_step
from mine_loc_coarse.bearing_stream import BearingStream
from mine_loc_coarse.nodes.messages import to_bearing_arrays
from mine_loc_coarse.parameters import MonitorDriverParameters
from mine_loc_core.device_clock import DeviceClock
from mine_loc_core.people import Person
from mine_loc_core.site import UwbReceiver
from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.n100_stream import N100Stream
from mine_loc_pdr.nodes.messages import Covariances, to_header, to_imu, to_magnetic_field
from mine_loc_pdr.parameters import N100DriverParameters
from mine_loc_sim.byte_streams import line_emitters
from mine_loc_sim.faults import Fault
from mine_loc_sim.scenario import Scenario, TrueLink
from mine_loc_sim.scene import line_of, monitor_line, wire_format
from mine_loc_sim.timed_bytes import Arrival, Cable
from mine_loc_sim.walker import TrueStep
from mine_loc_uwb.device_stamps import DeviceStamps
from mine_loc_uwb.nodes.line_messages import LineIds, stamped_message
from mine_loc_uwb.parameters import Dwm1000DriverParameters
from mine_loc_uwb.window_gatherer import WindowGatherer
from mine_loc_uwb.wire.detect import make_decoder

START_NS = 1_700_000_000 * NS_PER_S
"""ROS time of the scene's beginning, always the same so that the same seed gives the same bag."""

_TRUTH_PERIOD_NS = NS_PER_S // 50
_TOPICS = {UwbRangeArray: "uwb/ranges", TdoaArray: "uwb/tdoa", CirFrameArray: "uwb/cir"}
Entry = tuple[int, str, Any]


def write_bag(scenario: Scenario, faults: Sequence[Fault], path: Path) -> Iterator[tuple[int, int]]:
    """Play a scenario into a new bag; yields after each block the scene's time [ns] and the messages just written."""
    writer = BagWriter(path)
    emitters = line_emitters(scenario, faults)
    drivers = _drivers(scenario)
    steps = {person.name: list(scenario.steps(person.name)) for person in scenario.people}
    try:
        for block in scenario.blocks():
            entries = [
                entry
                for line, driver in drivers.items()
                for arrival in emitters[line].emit(block.frames[line], block.stop_ns)
                for entry in driver.entries(arrival)
            ]
            entries += _truth_poses(scenario, block.start_ns, block.stop_ns)
            entries += [_truth_link(scenario, link) for link in block.links]
            for name, left in steps.items():
                while left and left[0].stamp_ns < block.stop_ns:
                    entries.append(_truth_step(name, left.pop(0)))
            entries.sort(key=lambda entry: entry[0])
            for at_ns, topic, message in entries:
                writer.write(topic, type(message), START_NS + at_ns, to_cdr(message, type(message)))
            yield block.stop_ns, len(entries)
    finally:
        writer.close()


class _Driver(Protocol):
    def entries(self, arrival: Arrival) -> Iterator[Entry]:
        """Messages that the driver of a line publishes on an arrival."""


class _UwbDriver:
    def __init__(self, receiver: UwbReceiver) -> None:
        self._decoder = make_decoder(wire_format(receiver))
        self._gatherer = WindowGatherer()
        self._parameters = Dwm1000DriverParameters()
        self._stamps = DeviceStamps(latency_ns=0, trust_device_clock=self._parameters.trust_device_clock)
        self._ids = LineIds(receiver.tag_id, receiver.anchor_id or 0)

    def entries(self, arrival: Arrival) -> Iterator[Entry]:
        at_ns, what = arrival
        if isinstance(what, Cable):
            self._decoder.reset()
            self._gatherer.reset()
            self._stamps.forget()
            return
        sd_m = self._parameters.range_sd_m
        for found in self._decoder.feed(what):
            for gathered in self._gatherer.take(found):
                message = stamped_message(gathered, self._decoder, self._stamps, START_NS + at_ns, self._ids, sd_m)
                if message is not None:
                    yield at_ns, _TOPICS[type(message)], message


class _MonitorDriver:
    def __init__(self) -> None:
        self._stream = BearingStream()
        self._variance_rad2 = math.radians(MonitorDriverParameters().azimuth_sd_deg) ** 2

    def entries(self, arrival: Arrival) -> Iterator[Entry]:
        at_ns, what = arrival
        if isinstance(what, Cable):
            self._stream.reconnected()
            return
        for message in to_bearing_arrays(self._stream.feed(START_NS + at_ns, what), self._variance_rad2):
            yield at_ns, "coarse/bearings", message


class _N100Driver:
    def __init__(self, person: Person) -> None:
        self._person = person.name
        self._covariances = Covariances.of(N100DriverParameters())
        self._stream = N100Stream(DeviceClock(1e-6, 64))

    def entries(self, arrival: Arrival) -> Iterator[Entry]:
        at_ns, what = arrival
        if isinstance(what, Cable):
            self._stream.reconnected()
            return
        for measurement in self._stream.feed(START_NS + at_ns, what):
            header = to_header(measurement, self._person)
            yield at_ns, f"{self._person}/imu/data", to_imu(measurement, header, self._covariances)
            field = to_magnetic_field(measurement, header, self._covariances)
            yield at_ns, f"{self._person}/imu/mag", field


def _drivers(scenario: Scenario) -> dict[str, _Driver]:
    drivers: dict[str, _Driver] = {receiver.name: _UwbDriver(receiver) for receiver in scenario.site.uwb_receivers}
    drivers |= {monitor_line(monitor): _MonitorDriver() for monitor in scenario.site.monitors}
    return drivers | {line_of(person): _N100Driver(person) for person in scenario.people if person.n100}


def _truth_poses(scenario: Scenario, start_ns: int, stop_ns: int) -> Iterator[Entry]:
    stamps = np.arange(start_ns, stop_ns, _TRUTH_PERIOD_NS)
    for person in scenario.people:
        pose = scenario.pose(person.name, stamps)
        rows = zip(stamps.tolist(), pose.position_m.tolist(), pose.orientation_wxyz.tolist(), strict=True)
        for stamp_ns, position_m, (w, x, y, z) in rows:
            message = to_true_pose(START_NS + stamp_ns, scenario.site.map_frame, position_m, (w, x, y, z))
            yield stamp_ns, f"truth/{person.name}/pose", message


def _truth_step(person: str, step: TrueStep) -> Entry:
    message = to_true_step(
        person,
        START_NS + step.stamp_ns,
        length_m=step.length_m,
        heading_rad=step.heading_rad,
        position_m=step.position_m,
    )
    return step.stamp_ns, "truth/steps", message


def _truth_link(scenario: Scenario, link: TrueLink) -> Entry:
    person = next(each for each in scenario.people if each.name == link.person)
    allowed = [link.link_class == each for each in range(1, 5)]
    message = to_true_link(START_NS + link.stamp_ns, person.tag_id, link.anchor_id, allowed)
    return link.stamp_ns, "truth/link_state", message
