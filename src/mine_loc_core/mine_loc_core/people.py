"""The people file `people.yaml`: who wears which tag and which N100, and how they walk.

It may change while the graph runs. The published schema is `schema/people.schema.json`.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.yaml_schema import check_schema, device_id, read_schema, twice
from mine_loc_core.yaml_source import YamlSource, load_yaml, parse_yaml, read_capped, refuse


@dataclass(frozen=True, slots=True)
class N100:
    """A waist-worn IMU: its serial line and how it sits on the body (roll, pitch, yaw in the FLU body frame)."""

    port: str
    baud: int
    mounting_rpy_rad: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Stride:
    """Step-length model: "paper_b" is SL = [0.7 + alpha (H − 1.75) + beta (SF − 1.79) H / 1.75] k; "pendulum" goes by
    the vertical swing of the waist, times k.
    """

    k: float = 1.0
    alpha: float = 0.371
    beta: float = 0.227
    model: str = "pendulum"


@dataclass(frozen=True, slots=True)
class Person:
    """One person. `name` is also the ROS namespace; `tag_id` 0 = wears none; `tag_height_m` None = as the site says.

    `emitter_frequency_hz` is that of the radio which direction-finding monitors hear; None = carries none.
    """

    name: str
    tag_id: int
    height_m: float
    n100: N100 | None
    stride: Stride
    tag_height_m: float | None
    emitter_frequency_hz: float | None = None


@dataclass(frozen=True, slots=True)
class People:
    """All people of a file, found by name or by tag."""

    people: tuple[Person, ...]
    _by_name: Mapping[str, Person] = field(init=False, repr=False, compare=False)
    _by_tag: Mapping[int, Person] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_name", {person.name: person for person in self.people})
        object.__setattr__(self, "_by_tag", {person.tag_id: person for person in self.people if person.tag_id})

    def __iter__(self) -> Iterator[Person]:
        return iter(self.people)

    def __len__(self) -> int:
        return len(self.people)

    def by_name(self, name: str) -> Person | None:
        """The person of this name."""
        return self._by_name.get(name)

    def by_tag(self, tag_id: int) -> Person | None:
        """The person who wears this tag; nobody wears tag 0."""
        return self._by_tag.get(tag_id)


def load_people(folder: Path) -> People:
    """Read and check `people.yaml` in `folder`; raises ConfigurationError with one line a mistake."""
    return _checked(load_yaml(folder / "people.yaml"))


class PeopleFile:
    """`people.yaml`, watched. A bad edit changes nothing but `error`: the last good people stay."""

    def __init__(self, folder: Path) -> None:
        """Read the file; raises ConfigurationError if it is bad at the start."""
        self._file = folder / "people.yaml"
        self._data = read_capped(self._file)
        self.people = _checked(parse_yaml(self._data, self._file))
        self.error: str | None = None

    def poll(self) -> People | None:
        """Look at the file; the new people if they changed and the file is good, else None (and see `error`)."""
        before, self._data = self._data, b""
        try:
            self._data = read_capped(self._file)
            if self._data == before:
                return None
            people = _checked(parse_yaml(self._data, self._file))
        except ConfigurationError as error:
            self.error = str(error)
            return None
        self.error = None
        if people == self.people:
            return None
        self.people = people
        return people


def _checked(source: YamlSource) -> People:
    check_schema(source, read_schema("people"))
    refuse(_contradictions(source))
    return People(tuple(_person(item) for item in source.content["people"]))


def _contradictions(source: YamlSource) -> Iterator[str]:
    yield from twice(source, "people", ("name",))
    yield from twice(source, "people", ("tag_id",), lambda tag: device_id(tag) or None)
    yield from twice(source, "people", ("n100", "port"))
    yield from twice(source, "people", ("emitter_frequency_hz",))


def _person(item: Mapping[str, Any]) -> Person:
    return Person(
        name=item["name"],
        tag_id=device_id(item.get("tag_id", 0)),
        height_m=float(item["height_m"]),
        n100=_n100(item["n100"]) if "n100" in item else None,
        stride=_stride(item.get("stride", {})),
        tag_height_m=float(item["tag_height_m"]) if "tag_height_m" in item else None,
        emitter_frequency_hz=float(item["emitter_frequency_hz"]) if "emitter_frequency_hz" in item else None,
    )


def _stride(item: Mapping[str, Any]) -> Stride:
    """Coefficients of paper B's model choose it, where no model is named."""
    numbers = {name: float(value) for name, value in item.items() if name != "model"}
    return Stride(**numbers, model=item.get("model", "paper_b" if {"alpha", "beta"} & item.keys() else "pendulum"))


def _n100(item: Mapping[str, Any]) -> N100:
    roll, pitch, yaw = (math.radians(angle) for angle in item.get("mounting_rpy_deg", (0, 0, 0)))
    return N100(item["port"], item.get("baud", 921_600), (roll, pitch, yaw))
