"""YAML with line numbers, and schema violations in plain words."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.yaml_schema import check_schema
from mine_loc_core.yaml_source import MAX_BYTES, load_yaml, parse_yaml

FILE = Path("a.yaml")


def parse(text: str):
    return parse_yaml(text.encode(), FILE)


def refusal(text: str, schema: dict | None = None) -> str:
    with pytest.raises(ConfigurationError) as caught:
        check_schema(parse(text), schema or {})
    return str(caught.value)


def test_every_key_and_entry_knows_its_line():
    source = parse("a: 1\nb:\n  - x: 2\n  - {y: 3}\n")
    assert source.content == {"a": 1, "b": [{"x": 2}, {"y": 3}]}
    assert source.lines == {(): 1, ("a",): 1, ("b",): 2, ("b", 0): 3, ("b", 0, "x"): 3, ("b", 1): 4, ("b", 1, "y"): 4}


def test_a_problem_names_file_line_and_key():
    source = parse("b:\n  - x: 2\n")
    assert source.problem(("b", 0, "x"), "is odd") == "a.yaml:2: b[0].x: is odd"


def test_a_problem_of_a_missing_key_stands_at_its_parent():
    assert parse("b:\n  - x: 2\n").problem(("b", 0, "z"), "is missing") == "a.yaml:2: b[0].z: is missing"


@pytest.mark.parametrize(
    ("text", "value"),
    [("off", "off"), ("no", "no"), ("true", True), ("1e-3", 1e-3), ("0x022E", 0x22E), ("012", 12), ("1:30", "1:30")],
)
def test_scalars_follow_yaml_1_2(text, value):
    assert parse(f"a: {text}").content == {"a": value}


def test_infinity_and_nan_are_read_as_numbers():
    content = parse("a: -.inf\nb: .NaN\n").content
    assert content["a"] == float("-inf")
    assert content["b"] != content["b"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: 1\na: 2\n", "a.yaml:2: a: the key is given twice, first in line 1"),
        ("a: &x 1\nb: *x\n", "a.yaml:2: not valid YAML: alias *x is not supported"),
        ("a: [1,\n", "a.yaml:2: not valid YAML"),
        ("a:\n\t- 1\n", "a.yaml:2: not valid YAML"),
        ("[" * 40, "a.yaml:1: not valid YAML: nested more than 32 deep"),
        ("", "a.yaml:1: the file is empty"),
        (
            "a: !!python/object:os.system x\n",
            "a.yaml:1: a: 'x' cannot be read as tag:yaml.org,2002:python/object:os.system",
        ),
        ("a: !!int x\n", "a.yaml:1: a: 'x' cannot be read"),
        ("? [1]\n: 2\n", "a key must be text"),
        ("a: 1\n---\nb: 2\n", "not valid YAML"),
        ("a: \x00", "not valid YAML"),
    ],
)
def test_what_is_no_acceptable_yaml_is_refused_with_its_line(text, says):
    assert says in refusal(text)


def test_bytes_that_are_no_utf8_are_refused_with_their_line():
    with pytest.raises(ConfigurationError, match=r"a\.yaml:2: not UTF-8"):
        parse_yaml(b"a: 1\nb: \xff\n", FILE)


def test_a_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(ConfigurationError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load_yaml(tmp_path / "nowhere.yaml")


def test_an_oversized_file_is_refused(tmp_path):
    (tmp_path / "big.yaml").write_bytes(b"#" * (MAX_BYTES + 1))
    with pytest.raises(ConfigurationError, match="larger than 4 MiB"):
        load_yaml(tmp_path / "big.yaml")


@given(st.binary(max_size=200))
def test_hostile_bytes_raise_nothing_but_configuration_errors(data):
    with contextlib.suppress(ConfigurationError):
        assert parse_yaml(data, FILE).lines[()] >= 1


NUMBER = {"type": "number", "minimum": 0, "maximum": 9, "description": "metres"}
LENGTH = {"type": "object", "additionalProperties": False, "required": ["size_m"], "properties": {"size_m": NUMBER}}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("size_m: 10", "a.yaml:1: size_m: 10 is not allowed; allowed: a number 0 to 9 (metres)"),
        ("size_m: ten", "a.yaml:1: size_m: 'ten' is not allowed; allowed: a number 0 to 9 (metres)"),
        ("size_m: .nan", "a.yaml:1: size_m: nan is not allowed; allowed: a finite number"),
        ("size_m: 1\nsize_mm: 1", "a.yaml:2: size_mm: no such key; use size_m, in metres"),
        ("size_m: 1\nsize: 1", "a.yaml:2: size: no such key; use size_m, in metres"),
        ("size_m: 1\nsiez_m: 1", "a.yaml:2: siez_m: no such key; did you mean size_m? allowed: size_m"),
        ("size_m: 1\nzzz: 1", "a.yaml:2: zzz: no such key; allowed: size_m"),
        ("{}", "a.yaml:1: size_m: the key is missing"),
        ("[]", "a.yaml:1: [] is not allowed; allowed: a mapping"),
    ],
)
def test_schema_violations_are_told_in_plain_words(text, says):
    assert says in refusal(text, LENGTH)


def test_all_violations_are_told_in_the_order_of_the_file():
    assert [line.split(":")[1] for line in refusal("zzz: 1\nyyy: 2\nsize_m: 11", LENGTH).splitlines()] == [
        "1",
        "2",
        "3",
    ]


def test_a_flood_of_violations_is_cut_short():
    lines = refusal("\n".join(f"k{i}: 1" for i in range(100)), LENGTH).splitlines()
    assert len(lines) == 21
    assert lines[-1] == "… and 81 more"


def test_text_with_a_line_break_is_refused():
    assert "plain text" in refusal('a: "x\\ny"', {"properties": {"a": {"type": "string"}}})
