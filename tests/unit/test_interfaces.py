"""The messages: units in every comment, enums that begin with not knowing, the header first."""

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "src" / "mine_loc_interfaces"
FILES = sorted([*FOLDER.glob("msg/*.msg"), *FOLDER.glob("srv/*.srv")])
FIELD = re.compile(r"^(?P<type>[\w/]+)(?P<array>\[[^\]]*\])?\s+(?P<name>[a-z]\w*)\s*(#\s*(?P<comment>.*))?$")
CONSTANT = re.compile(r"^(?P<type>\w+)\s+(?P<name>[A-Z]\w*)\s*=\s*(?P<value>\d+)\s*(#.*)?$")
UNIT = re.compile(r"\[[^\]]+\]")
UNKNOWN_LIKE = re.compile(r"(\w+_)?UNKNOWN|REFUSED_NOT")


def lines(file):
    return [line for line in file.read_text("utf-8").splitlines() if line.strip() and line != "---"]


def fields(file):
    return [match for line in lines(file) if (match := FIELD.match(line))]


@pytest.fixture(params=FILES, ids=lambda file: file.name)
def file(request):
    return request.param


def test_there_are_messages():
    assert len(FILES) > 30


def test_every_line_is_a_comment_a_constant_or_a_field(file):
    assert [
        line for line in lines(file) if not (line.lstrip().startswith("#") or FIELD.match(line) or CONSTANT.match(line))
    ] == []


def test_a_file_begins_by_saying_what_it_is(file):
    assert re.match(r"# [A-Z].{10,}", file.read_text("utf-8"))


def test_every_float_has_a_unit_or_says_what_its_numbers_are(file):
    unexplained = [
        field["name"]
        for field in fields(file)
        if field["type"].startswith("float") and not UNIT.search(field["comment"] or "")
    ]
    assert unexplained == []


def test_every_duration_or_offset_in_integers_names_its_unit(file):
    for field in fields(file):
        if field["name"].endswith("_ns"):
            assert "[ns]" in (field["comment"] or ""), field["name"]


def test_a_header_comes_first(file):
    names = [field["name"] for field in fields(file)]
    assert "header" not in names[1:]


def test_enums_begin_with_not_knowing_and_count_up(file):
    groups, values = [], []
    for line in lines(file):
        constant = CONSTANT.match(line)
        if constant:
            values.append((constant["name"], int(constant["value"])))
        elif values and FIELD.match(line):
            groups.append(values)
            values = []
    assert not values, "constants without the field they are for"
    for group in groups:
        assert UNKNOWN_LIKE.fullmatch(group[0][0]), group
        assert [value for _, value in group] == list(range(len(group)))


def test_sequences_are_bounded(file):
    assert [field["name"] for field in fields(file) if field["array"] == "[]"] == []


def test_every_interface_is_built():
    listed = (FOLDER / "CMakeLists.txt").read_text("utf-8")
    assert [
        file.name for file in FILES if f"{file.parent.name}/{file.name}" not in listed and "GLOB" not in listed
    ] == []
