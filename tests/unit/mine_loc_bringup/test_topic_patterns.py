"""Topics by pattern, and which topics of a bag are inputs of the graph."""

import re
from pathlib import Path

import pytest

from mine_loc_bringup.bags.graph_topics import played_by_default
from mine_loc_bringup.bags.patterns import TopicPatterns, split_list
from mine_loc_core.errors import ConfigurationError

TOPICS_PAGE = Path(__file__).parents[3] / "docs" / "topics.md"
OF_DEVICES = {"dwm1000_driver_<receiver>", "<person>/n100_driver", "monitor_driver_<monitor>"}


@pytest.mark.parametrize(
    ("include", "exclude", "topic", "admitted"),
    [
        ("", "", "/uwb/ranges", True),
        ("", "", "/_hidden", False),
        ("", "", "/ann/_hidden/x", False),
        ("uwb/ranges", "", "/uwb/ranges", True),
        ("uwb/ranges", "", "/section_2/uwb/ranges", True),
        ("/uwb/ranges", "", "/section_2/uwb/ranges", False),
        ("ranges", "", "/uwb/tag_ranges", False),
        ("*/imu/data", "", "/ann/imu/data", True),
        ("uwb/*", "", "/uwb/ranges/raw", False),
        ("uwb/**", "", "/uwb/ranges/raw", True),
        ("**", "", "/anything/at/all", True),
        ("uwb/*, fused/*", "uwb/cir", "/fused/poses", True),
        ("uwb/*", "uwb/cir", "/uwb/cir", False),
        ("_hidden", "", "/_hidden", True),
    ],
)
def test_patterns(include, exclude, topic, admitted):
    assert TopicPatterns.of(split_list(include), split_list(exclude)).admits(topic) is admitted


@pytest.mark.parametrize("pattern", ["a b", "uwb//ranges", "uwb/", "/", "[a-z]", "a?"])
def test_what_no_topic_can_be_called_is_refused(pattern):
    with pytest.raises(ConfigurationError, match=r"topic pattern .*; allowed: words"):
        TopicPatterns.of([pattern], [])


def documented():
    """Topic, publishers of each row of the table of topics."""
    rows = re.findall(r"^\| `([^`]+)` \| `[\w/]+` \|.*$", TOPICS_PAGE.read_text("utf-8"), re.MULTILINE)
    lines = [line for line in TOPICS_PAGE.read_text("utf-8").splitlines() if line.startswith("| `") and "/" in line]
    for line in lines:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 7 and cells[0].strip("`") in rows:
            yield cells[0].strip("`"), set(re.findall(r"`([^`]+)`", cells[5]))


def test_the_topics_of_devices_are_played_and_those_of_the_graph_are_not():
    names = dict(documented())
    assert len(names) > 25
    full = {name: "/" + re.sub(r"<\w+>", "ann", name).lstrip("/") for name in names}
    played = played_by_default(full.values())
    for name, publishers in names.items():
        from_a_device = bool(publishers & OF_DEVICES)
        assert (full[name] in played) == from_a_device, name


def test_what_comes_from_outside_is_played_in_every_namespace():
    outside = {"/vehicles/shuttle/pose", "/truth/ann/pose", "/section_2/uwb/ranges", "/coarse/bearings"}
    made = {"/section_2/fused/poses", "/clock", "/diagnostics", "/rosout", "/tf", "/ann/pdr/transition_event"}
    assert played_by_default(outside | made) == outside


def test_link_states_are_an_input_where_the_accumulators_are_not_in_the_bag():
    assert played_by_default({"/uwb/link_state", "/uwb/ranges"}) == {"/uwb/link_state", "/uwb/ranges"}
    assert played_by_default({"/uwb/link_state", "/uwb/cir"}) == {"/uwb/cir"}
    assert played_by_default({"/truth/link_state", "/uwb/cir"}) == {"/truth/link_state", "/uwb/cir"}
