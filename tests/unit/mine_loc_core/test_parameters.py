"""Parameters: what is allowed is checked before anything starts, and a refusal says what is allowed."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.parameters import Constraint, constraints, from_mapping, parameter


@dataclass(frozen=True)
class Sample:
    gate: float = parameter(0.99, "share that passes", unit="1", low=0.5, high=0.999)
    period_s: float = parameter(1.0, "period", unit="s", low=0.1)
    count: int = parameter(3, "how many", low=1, high=10)
    free: int = parameter(0, "any number")
    method: str = parameter("fast", "how", choices=("fast", "slow"))
    enabled: bool = parameter(True, "whether")


def test_what_is_not_given_has_its_default():
    assert from_mapping(Sample, {}) == Sample()


def test_good_values_are_taken_and_whole_numbers_become_floats_where_a_float_is_due():
    made = from_mapping(Sample, {"period_s": 2, "count": 10, "method": "slow", "enabled": False})
    assert made == Sample(period_s=2.0, count=10, method="slow", enabled=False)
    assert isinstance(made.period_s, float)


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("gate", 0.4, "0.5 to 0.999"),
        ("gate", math.nan, "0.5 to 0.999"),
        ("period_s", 0.0, "0.1 to inf s"),
        ("count", 0, "1 to 10"),
        ("count", 11, "1 to 10"),
        ("count", 2.0, "1 to 10"),
        ("count", True, "1 to 10"),
        ("free", 2**63, "any value of its type"),
        ("method", "quick", "one of fast, slow"),
        ("method", 3, "one of fast, slow"),
        ("enabled", 1, "any value of its type"),
        ("period_s", True, "0.1 to inf s"),
        ("period_s", "1.0", "0.1 to inf s"),
        ("period_s", None, "0.1 to inf s"),
    ],
)
def test_a_refusal_names_place_key_value_and_what_is_allowed(key, value, allowed):
    with pytest.raises(ConfigurationError) as error:
        from_mapping(Sample, {key: value}, "params/x.yaml")
    text = str(error.value)
    assert text.startswith(f"params/x.yaml: {key}: {value!r}")
    assert text.endswith(f": {allowed}")


def test_an_unknown_key_is_refused_with_those_that_exist():
    with pytest.raises(ConfigurationError, match="gait: no such parameter; allowed: gate, period_s"):
        from_mapping(Sample, {"gait": 1.0})


@given(
    key=st.sampled_from(["gate", "period_s", "count", "free", "method", "enabled"]),
    value=st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.integers()),
)
@example(key="period_s", value=10**400)
@example(key="gate", value=-(10**400))
def test_any_value_is_either_taken_within_its_limits_or_refused(key, value):
    kind, _, constraint = constraints(Sample)[key]
    try:
        made = getattr(from_mapping(Sample, {key: value}), key)
    except ConfigurationError:
        return
    assert type(made) is kind
    assert made == value
    assert constraint.admits(made)


def test_constraints_lists_each_parameter_with_type_default_and_constraint():
    assert constraints(Sample)["count"] == (int, 3, Constraint("how many", low=1, high=10))
