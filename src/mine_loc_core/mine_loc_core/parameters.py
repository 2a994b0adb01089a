"""Parameters of a node as a frozen dataclass: type, unit, range and description in one place, checked without ROS.

    @dataclass(frozen=True)
    class SolverParameters:
        gate: float = parameter(0.99, "probability that a good range passes", unit="1", low=0.5, high=0.9999)

A node declares them with their descriptors (`mine_loc_core.nodes.node_base`), `mine-loc up` checks parameter files
against them before anything starts.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, get_type_hints

from mine_loc_core.errors import ConfigurationError

P = TypeVar("P")
_KEY = "mine_loc_parameter"


@dataclass(frozen=True)
class Constraint:
    """What a parameter may be: `low` <= value <= `high`, or one of `choices`."""

    description: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: Sequence[str] = ()
    read_only: bool = False

    def allowed(self) -> str:
        """Say in words what is allowed."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.low is None and self.high is None:
            return "any value of its type"
        low = "-inf" if self.low is None else f"{self.low:.9g}"
        high = "inf" if self.high is None else f"{self.high:.9g}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{low} to {high}{unit}".rstrip()

    def admits(self, value: Any) -> bool:
        """Whether a value of the right type lies within the constraint (NaN and more than ROS's 64 bits never do)."""
        if self.choices:
            return value in self.choices
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            return False
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            if math.isnan(value):
                return False
            return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)
        return True


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
    read_only: bool = False,
) -> Any:
    """A dataclass field that is a parameter; see Constraint."""
    constraint = Constraint(description, unit, low, high, choices, read_only)
    return dataclasses.field(default=default, metadata={_KEY: constraint})


def constraints(kind: type) -> dict[str, tuple[type, Any, Constraint]]:
    """Name → (type, default, constraint) of every parameter of a parameter dataclass."""
    hints = get_type_hints(kind)
    return {
        f.name: (hints[f.name], f.default, f.metadata[_KEY]) for f in dataclasses.fields(kind) if _KEY in f.metadata
    }


def from_mapping(kind: type[P], values: Mapping[str, Any], where: str = "parameters") -> P:
    """Build a parameter dataclass from plain values.

    Raises ConfigurationError that names `where`, the key, the value and what is allowed, for an unknown key, a wrong
    type or a value out of range.
    """
    known = constraints(kind)
    for name in values:
        if name not in known:
            raise ConfigurationError(f"{where}: {name}: no such parameter; allowed: {', '.join(known)}")
    return kind(
        **{name: _checked(f"{where}: {name}", value, known[name][0], known[name][2]) for name, value in values.items()}
    )


def _checked(where: str, value: Any, kind: type, constraint: Constraint) -> Any:
    if kind is float and isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63:
        value = float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise ConfigurationError(
            f"{where}: {value!r} is a {type(value).__name__}, expected {kind.__name__}: {constraint.allowed()}"
        )
    if not constraint.admits(value):
        raise ConfigurationError(f"{where}: {value!r} is not allowed; allowed: {constraint.allowed()}")
    return value


@dataclass(frozen=True)
class NodeParameters:
    """What every node takes."""

    site: str = parameter("", "folder that holds site.yaml and people.yaml", read_only=True)
    autostart: bool = parameter(
        True, "configure and activate at start; false leaves it to a lifecycle manager", read_only=True
    )
