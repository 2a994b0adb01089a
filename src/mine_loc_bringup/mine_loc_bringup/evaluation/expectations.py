"""Bounds on an evaluation, from a file: what a build must reach to pass.

The file is judged by the published schema `expectations.schema.json`; `docs/evaluate.md` has an example.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mine_loc_bringup.evaluation.evaluation import Evaluation
from mine_loc_bringup.evaluation.measures import Measures
from mine_loc_core.yaml_schema import check_schema, read_schema
from mine_loc_core.yaml_source import KeyPath, YamlSource, load_yaml, refuse

EVERYBODY = "*"


@dataclass(frozen=True, slots=True)
class Bound:
    """Least and most that a figure may be; None = as it likes."""

    least: float | None
    most: float | None

    def holds(self, value: float | None) -> bool:
        """Whether a figure is within; one that was not measured is not."""
        if value is None:
            return False
        return (self.least is None or value >= self.least) and (self.most is None or value <= self.most)

    def __str__(self) -> str:
        words = [] if self.least is None else [f"at least {self.least:g}"]
        return ", ".join(words if self.most is None else [*words, f"at most {self.most:g}"])


@dataclass(frozen=True, slots=True)
class Check:
    """One bound held against one figure: `place` is where it stands, as `people.ann`, `value` None = not measured."""

    place: str
    name: str
    bound: Bound
    value: float | None

    @property
    def passed(self) -> bool:
        """Whether the bound holds."""
        return self.bound.holds(self.value)

    def __str__(self) -> str:
        found = "not measured" if self.value is None else f"{self.value:.6g}"
        return f"{self.place}.{self.name} is {found}, expected: {self.bound}"


def load_expectations(file: Path) -> Mapping[str, Any]:
    """Read and check a file of bounds; raises ConfigurationError with one line a mistake."""
    source = load_yaml(file)
    check_schema(source, read_schema("expectations"))
    refuse(_contradictions(source, source.content, ()))
    content: Mapping[str, Any] = source.content
    return content


def checks(expected: Mapping[str, Any], found: Evaluation) -> Iterator[Check]:
    """Every bound, held against what was found. Bounds on somebody who is not there do not hold."""
    for name, bounds in expected.get("people", {}).items():
        wanted = [*found.people] or [name] if name == EVERYBODY else [name]
        for person in wanted:
            yield from _person_checks(f"people.{person}", bounds, found.people.get(person))
    if "together" in expected:
        yield from _person_checks("together", expected["together"], found.together)
    for topic, bounds in expected.get("verdicts", {}).items():
        counts: Counter[str] = sum(found.verdicts.get(topic, {}).values(), Counter())
        for reason, limits in bounds.items():
            yield Check(f"verdicts.{topic}", reason, _bound(limits), counts[reason])
    for name, bounds in expected.get("diagnostics", {}).items():
        for key, limits in bounds.items():
            yield Check(f"diagnostics.{name}", key, _bound(limits), found.counters.get(name, {}).get(key))


def _person_checks(place: str, bounds: Mapping[str, Any], found: Measures | None) -> Iterator[Check]:
    for name, limits in bounds.items():
        if name != "modes":
            yield Check(place, name, _bound(limits), None if found is None else getattr(found, name))
            continue
        for mode, of_mode in limits.items():
            share = None if found is None or not found.modes else found.modes.get(mode, 0.0)
            yield Check(f"{place}.modes", mode, _bound(of_mode), share)


def _bound(limits: Mapping[str, float]) -> Bound:
    return Bound(limits.get("min"), limits.get("max"))


def _contradictions(source: YamlSource, content: Any, path: KeyPath) -> Iterator[str]:
    if not isinstance(content, dict):
        return
    low, high = content.get("min"), content.get("max")
    if isinstance(low, int | float) and isinstance(high, int | float) and low > high:
        yield source.problem(path, f"min {low} is above max {high}; allowed: at most that")
    for key, item in content.items():
        yield from _contradictions(source, item, (*path, key))
