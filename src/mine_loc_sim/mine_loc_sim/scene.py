"""A scene: who walks where in a site with which devices, drawn from a site, people and a seed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import N100, Person, Stride
from mine_loc_core.site import Anchor, Monitor, Site, UwbReceiver, Vehicle
from mine_loc_sim.bearing_emulator import MonitorErrors
from mine_loc_sim.radio_constants import INDUSTRIAL, Environment
from mine_loc_sim.route import WayPoint

FORMATS = ("mine_loc", "trek1000", "dwm1001_shell")
MOST_PEOPLE = 200


@dataclass(frozen=True, slots=True)
class MovedAnchor:
    """An anchor that hangs elsewhere than the map says, by `shift_m`, from `start_ns` until before `stop_ns`."""

    anchor_id: int
    start_ns: int
    stop_ns: int
    shift_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class SceneOptions:
    """How a scene is made. `routes` gives some people's way-points; the others' are drawn."""

    seed: int = 0
    seconds: float = 600.0
    round_rate_hz: float = 10.0
    cir: bool = False
    tdoa: bool = False
    environment: Environment = INDUSTRIAL
    monitor_errors: MonitorErrors = field(default_factory=MonitorErrors)
    moved_anchors: tuple[MovedAnchor, ...] = ()
    routes: Mapping[str, Sequence[WayPoint]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 1.0 <= self.seconds <= 86_400.0:
            raise ConfigurationError(f"seconds: {self.seconds:g}; allowed: 1 to 86400")
        if not 0.1 <= self.round_rate_hz <= 50.0:
            raise ConfigurationError(f"round_rate_hz: {self.round_rate_hz:g}; allowed: 0.1 to 50")
        if self.seed < 0:
            raise ConfigurationError(f"seed: {self.seed}; allowed: 0 and above")


def line_of(person: Person) -> str:
    """Name of the line of a person's N100."""
    return f"{person.name}/n100"


def monitor_line(monitor: Monitor) -> str:
    """Name of the line of a direction-finding monitor."""
    return f"monitor_{monitor.id}"


def line_names(site: Site, people: Sequence[Person]) -> tuple[str, ...]:
    """Names of all lines of a site and its people."""
    receivers = tuple(receiver.name for receiver in site.uwb_receivers)
    inertial = tuple(line_of(person) for person in people if person.n100)
    return receivers + inertial + tuple(monitor_line(monitor) for monitor in site.monitors)


def line_formats(site: Site, people: Sequence[Person]) -> dict[str, str]:
    """What is spoken on each line: the name of a UWB format, `fdilink` or `mldf`."""
    spoken = {receiver.name: wire_format(receiver) for receiver in site.uwb_receivers}
    spoken |= {line_of(person): "fdilink" for person in people if person.n100}
    return spoken | {monitor_line(monitor): "mldf" for monitor in site.monitors}


def anchor_places_m(site: Site) -> NDArray[np.float64]:
    """Positions of the site's anchors in the map (n, 3); those on vehicles where these stand at first."""
    carriers = {anchor: vehicle for vehicle in site.vehicles for anchor in vehicle.anchor_ids}
    return np.array([_in_map(anchor, carriers.get(anchor.id)) for anchor in site.anchors], float).reshape(-1, 3)


def _in_map(anchor: Anchor, carrier: Vehicle | None) -> tuple[float, float, float]:
    if carrier is None:
        return anchor.position_m
    (x, y, z), cos, sin = anchor.position_m, np.cos(carrier.yaw_rad), np.sin(carrier.yaw_rad)
    east, north, up = carrier.position_m
    return float(east + cos * x - sin * y), float(north + sin * x + cos * y), up + z


def crew(site: Site, people: Sequence[Person], count: int) -> tuple[Person, ...]:
    """Take the first `count` people of a site, and make up further ones with a tag and an N100 each."""
    if not 1 <= count <= MOST_PEOPLE:
        raise ConfigurationError(f"people: {count}; allowed: 1 to {MOST_PEOPLE}")
    known = list(people)[:count]
    names = {person.name for person in people}
    taken = {person.tag_id for person in people} | {anchor.id for anchor in site.anchors} | {0}
    number = 0
    while len(known) < count:
        number += 1
        tag_id = next(tag for tag in range(1, len(taken) + 2) if tag not in taken)
        name = f"walker_{number}"
        if name in names:
            continue
        taken.add(tag_id)
        n100 = N100(f"/dev/{name}", 921_600, (0.0, 0.0, 0.0))
        known.append(Person(name, tag_id, 1.75, n100, Stride(), None))
    return tuple(known)


def reporting_lines(site: Site, tag_id: int) -> tuple[UwbReceiver, ...]:
    """Return the lines over which a tag's rounds can come: its own if it has one, else those of the place."""
    own = tuple(receiver for receiver in site.uwb_receivers if receiver.tag_id == tag_id)
    return own or tuple(receiver for receiver in site.uwb_receivers if not receiver.tag_id)


def check_formats(site: Site) -> None:
    """Refuse what the emulators do not speak or cannot say. Raises ConfigurationError naming receiver and format."""
    for receiver in site.uwb_receivers:
        spoken = wire_format(receiver)
        if spoken not in FORMATS:
            raise ConfigurationError(
                f"uwb_receivers: {receiver.name}: format: {spoken!r} cannot be simulated; allowed: auto, "
                f"{', '.join(FORMATS)}"
            )
        limit = {"mine_loc": 2**64, "trek1000": 9, "dwm1001_shell": 0x10000}[spoken]
        for anchor in site.anchors:
            if anchor.id >= limit:
                raise ConfigurationError(
                    f"uwb_receivers: {receiver.name}: {spoken} cannot name anchor {anchor.id:#x}; "
                    f"allowed: ids below {limit:#x}"
                )
        if spoken == "dwm1001_shell" and not receiver.tag_id:
            raise ConfigurationError(
                f"uwb_receivers: {receiver.name}: {spoken} does not name the tag; allowed: a receiver with `tag`"
            )


def wire_format(receiver: UwbReceiver) -> str:
    """Return the format that the emulator of this receiver speaks: its own, mine_loc where the driver detects it."""
    return "mine_loc" if receiver.format == "auto" else receiver.format
