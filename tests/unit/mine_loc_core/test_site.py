"""The site file: what it holds, and how each mistake in it is answered."""

import copy
import math
import re
from pathlib import Path

import jsonschema
import pytest
import yaml

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Anchor, Discovery, UwbReceiver, ZoneType, load_site
from mine_loc_core.yaml_schema import read_schema

CONFIG = Path(__file__).parents[3] / "config"
INTERFACES = Path(__file__).parents[3] / "src/mine_loc_interfaces/msg"
GOOD = {
    "schema": 1,
    "name": "hall",
    "dimensions": 2,
    "tag_height_m": 1.0,
    "anchors": [{"id": 1, "position_m": [0, 0, 2]}, {"id": "0x02", "position_m": [9, 0, 2]}],
}


def written(folder: Path, content: object) -> Path:
    (folder / "site.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    return folder


def with_change(path: list, value: object) -> dict:
    content = copy.deepcopy(GOOD)
    place = content
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    return content


def refusal(folder: Path, content: object) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load_site(written(folder, content))
    return str(caught.value)


@pytest.mark.parametrize("folder", [p.parent for p in CONFIG.glob("*/site.yaml")], ids=lambda p: p.name)
def test_every_shipped_site_is_valid_and_named_like_its_folder(folder):
    assert load_site(folder).name == folder.name


def test_the_example_shows_every_section_of_the_schema():
    shown = yaml.safe_load((CONFIG / "example_mine/site.yaml").read_text())
    assert set(shown) == set(read_schema("site")["properties"])


def test_the_trek_lab_has_the_published_anchors():
    places = {anchor.id: anchor.position_m for anchor in load_site(CONFIG / "trek_lab").anchors}
    assert places == {1: (0, 0, 0), 2: (5.77, 0, 0), 3: (5.55, 5.69, 0), 4: (0, 5.65, 0)}


def test_what_is_left_out_takes_its_default(tmp_path):
    site = load_site(written(tmp_path, GOOD))
    assert site.anchors[0] == Anchor(1, "anchor 1", (0, 0, 2), 0, 0)
    assert site.map_frame == "map"
    assert site.discovery == Discovery("localhost", ())
    assert site.galleries == ()


def test_hexadecimal_addresses_are_read():
    assert load_site(CONFIG / "example_mine").anchors[0].id == 0x0101


def test_angles_are_degrees_in_the_file_and_radians_in_memory():
    assert load_site(CONFIG / "example_mine").turn_markers[0].angles_rad == (math.pi / 2, -math.pi / 2, math.pi)


def test_zone_types_are_those_of_the_message():
    text = (INTERFACES / "ZoneEvent.msg").read_text()
    in_message = {
        name: int(value) for name, value in re.findall(r"^uint8 (\w+)=(\d)", text.split("uint8 type")[0], re.M)
    }
    assert {kind.name: kind.value for kind in ZoneType} == {k: v for k, v in in_message.items() if k != "TYPE_UNKNOWN"}


def test_an_anchor_s_serial_line_may_be_a_receiver(tmp_path):
    content = with_change(["uwb_receivers"], [{"name": "a2", "port": "socket://10.0.0.2:8234", "anchor": 2}])
    assert load_site(written(tmp_path, content)).uwb_receivers == (
        UwbReceiver("a2", "socket://10.0.0.2:8234", "auto", 115200, 2),
    )


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (["schema"], 2, "schema: 2 is not allowed; allowed: 1"),
        (["anchors", 1, "id"], "0x01", "anchors[1].id: '0x01' is given twice, first in line 6; allowed: each id once"),
        (
            ["anchors", 1, "id"],
            0,
            "anchors[1].id: 0 is not allowed; allowed: a whole number or text 1 to 18446744073709551615",
        ),
        (["anchors", 1, "id"], 2**64, "anchors[1].id"),
        (["anchors", 1, "id"], "A1", "anchors[1].id: 'A1' is not allowed"),
        (["anchors", 1, "id"], True, "anchors[1].id: True is not allowed"),
        (
            ["anchors", 1, "position_m", 0],
            math.nan,
            "anchors[1].position_m[0]: nan is not allowed; allowed: a finite number",
        ),
        (["anchors", 1, "position_m", 0], math.inf, "anchors[1].position_m[0]: inf is not allowed"),
        (["anchors", 1, "position_m", 0], "9 m", "anchors[1].position_m[0]: '9 m' is not allowed; allowed: a number"),
        (["anchors", 1, "position_m", 0], 50001, "50001 is not allowed; allowed: a number -50000 to 50000 (metres)"),
        (
            ["anchors", 1, "position_m"],
            [1, 2],
            "[1, 2] has 2 entries; allowed: a list of 3 entries (x, y, z in metres)",
        ),
        (["anchors", 1, "position_m"], [0.01, 0, 2], "within 0.05 m of anchors[0]"),
        (
            ["anchors", 1, "position_m"],
            [9000, 0, 2000],
            "no anchor is within 290 m of another; allowed: coordinates in metres",
        ),
        (["anchors", 1, "position_mm"], [9000, 0, 0], "anchors[1].position_mm: no such key; use position_m, in metres"),
        (["dimensions"], 4, "dimensions: 4 is not allowed; allowed: one of 2, 3"),
        (["uwb_receivers"], [{"name": "a", "port": "COM3"}], "uwb_receivers[0].port: 'COM3' is not allowed"),
        (
            ["uwb_receivers"],
            [{"name": "a", "port": "/dev/x", "anchor": 7}],
            "uwb_receivers[0].anchor: 7 is no anchor of this site; allowed: 1, 0x02",
        ),
        (
            ["vehicles"],
            [{"id": "car", "size_m": [1, 1, 1], "anchors": [1, 9]}],
            "vehicles[0].anchors[1]: 9 is no anchor",
        ),
        (
            ["galleries"],
            [{"id": "g", "centre_line_m": [[1, 1, 0], [1, 1, 0]], "width_m": 4, "height_m": 3}],
            "galleries[0].centre_line_m: has length 0",
        ),
        (
            ["zones"],
            [{"id": "z", "type": "key", "polygon_m": [[0, 0], [1, 1], [2, 2]]}],
            "zones[0].polygon_m: has area 0",
        ),
        (
            ["zones"],
            [{"id": "z", "type": "safe", "polygon_m": [[0, 0], [1, 0], [1, 1]]}],
            "one of general, key, restricted",
        ),
        (
            ["turn_markers"],
            [{"id": "t", "position_m": [0, 0, 0], "radius_m": 2, "angles_rad": [1]}],
            "use angles_deg, in degrees",
        ),
        (
            ["discovery"],
            {"range": "world"},
            "discovery.range: 'world' is not allowed; allowed: one of localhost, subnet, off",
        ),
    ],
)
def test_each_mistake_is_one_line_that_names_key_value_and_what_is_allowed(tmp_path, path, value, says):
    message = refusal(tmp_path, with_change(path, value))
    assert says in message
    assert re.match(rf"{re.escape(str(tmp_path))}/site\.yaml:\d+: ", message)


def test_the_line_is_that_of_the_key(tmp_path):
    (tmp_path / "site.yaml").write_text("schema: 1\nname: x\ndimensions: 2\ntag_height_m: high\n")
    with pytest.raises(ConfigurationError, match=r"site\.yaml:4: tag_height_m: 'high'"):
        load_site(tmp_path)


def test_anchors_that_a_vehicle_carries_are_placed_in_its_own_frame(tmp_path):
    content = with_change(["vehicles"], [{"id": "car", "size_m": [4, 2, 2], "anchors": [2]}])
    content["anchors"][1]["position_m"] = [0, 0, 2]
    assert load_site(written(tmp_path, content)).vehicles[0].anchor_ids == (2,)


def test_discovery_off_needs_no_quotes(tmp_path):
    (written(tmp_path, GOOD) / "site.yaml").open("a").write("discovery:\n  range: off\n")
    assert load_site(tmp_path).discovery.range == "off"


@pytest.mark.parametrize("name", ["site", "people"])
def test_the_documentation_names_every_key_of_the_schema(name):
    documentation = (CONFIG.parent / "docs/site-files.md").read_text()
    schema = read_schema(name)
    objects = [schema, *schema["$defs"].values(), *schema["$defs"].get("person", {}).get("properties", {}).values()]
    keys = {key for part in objects for key in part.get("properties", {})}
    assert len(keys) > 10
    assert [key for key in sorted(keys) if f"`{key}`" not in documentation] == []


@pytest.mark.parametrize("name", ["site", "people"])
def test_the_published_schemas_are_valid_schemas(name):
    jsonschema.Draft202012Validator.check_schema(read_schema(name))


def test_a_line_whose_format_names_no_tag_may_be_given_one(tmp_path):
    content = with_change(
        ["uwb_receivers"], [{"name": "t", "port": "/dev/ttyACM0", "format": "dwm1001_shell", "tag": 7}]
    )
    assert load_site(written(tmp_path, content)).uwb_receivers[0].tag_id == 7
