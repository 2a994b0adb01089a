"""What cannot run says why in one line that names file or node, key and what is allowed, and ends with status 2."""

from pathlib import Path

import pytest
import yaml
from graph.processes import node_command, running, up_command
from graph.walker import ANCHORS, WALKER_TAG, person, write_site

pytestmark = pytest.mark.graph

NODES = {
    "dwm1000_driver": "mine_loc_uwb.nodes.dwm1000_driver",
    "uwb_solver": "mine_loc_uwb.nodes.uwb_solver",
    "n100_driver": "mine_loc_pdr.nodes.n100_driver",
    "pdr": "mine_loc_pdr.nodes.pdr",
    "synchroniser": "mine_loc_fusion.nodes.synchroniser",
    "fusion": "mine_loc_fusion.nodes.fusion",
    "proximity": "mine_loc_fusion.nodes.proximity",
    "relay": "mine_loc_fusion.nodes.relay",
}


@pytest.fixture
def site(tmp_path) -> Path:
    receivers: list[dict[str, object]] = [
        {"name": "gate", "port": str(tmp_path / "none"), "format": "auto", "anchor": 1}
    ]
    return write_site(tmp_path / "site", receivers, [person("walker", WALKER_TAG)])


def words_of(command: list[str], domain: int, log: Path) -> list[str]:
    """The lines a command writes before it ends with status 2."""
    with running(command, domain, log) as run:
        assert run.ends() == 2, run.output
        return run.output.splitlines()


@pytest.mark.parametrize(
    ("node", "key", "value", "allowed"),
    [
        ("dwm1000_driver", "range_sd_m", "-1", "0.001 to 10 m"),
        ("dwm1000_driver", "range_sd_m", "-1.0", "0.001 to 10 m"),
        ("dwm1000_driver", "format", "morse", "trek1000"),
        ("uwb_solver", "method", "guessing", "one of robust_tracker, least_squares, weighted_lm"),
        ("uwb_solver", "tdoa_method", "guessing", "one of robust_tracker"),
        ("uwb_solver", "frame", "nowhere", "map"),
        ("uwb_solver", "nlos_share", "1.5", "0.01 to 0.95"),
        ("uwb_solver", "gate", "0.5", "0.9 to 0.9999999"),
        ("uwb_solver", "max_range_m", ".nan", "1 to 1000 m"),
        ("n100_driver", "baud", "fast", ""),
        ("pdr", "odometry_rate", "0.0", "Hz"),
        ("synchroniser", "history_s", "1000.0", "0.1 to 30 s"),
        ("fusion", "method", "guess", "mine_loc, los_weighted"),
        ("proximity", "valid_for_s", "60.0", "0.1 to 5 s"),
        ("proximity", "danger_leave", "0.5", "below danger_enter"),
        ("relay", "relay", "nobody", "no relay of this site"),
    ],
)
def test_an_impossible_parameter_is_refused_in_one_line(node, key, value, allowed, site, domain, tmp_path):
    command = node_command(NODES[node], {"site": site, key: value})
    (line,) = words_of(command, domain, tmp_path / "log")
    assert node in line
    assert key in line
    assert "allowed" in line
    assert allowed in line


def edited(site: Path, edit: object) -> None:
    content = yaml.safe_load((site / "site.yaml").read_text())
    edit(content)
    (site / "site.yaml").write_text(yaml.safe_dump(content))


BAD_SITES = {
    "unknown anchor id": (lambda c: c["uwb_receivers"][0].update(anchor=99), "anchor", "99", "allowed"),
    "duplicate id": (lambda c: c["anchors"][1].update(id=1), "id", "1", "anchors[1]"),
    "NaN coordinate": (
        lambda c: c["anchors"][2].update(position_m=[0.0, float("nan"), 2.0]),
        "position_m",
        "nan",
        "allowed",
    ),
    "wrong unit": (
        lambda c: c["anchors"][2].update(position_mm=c["anchors"][2].pop("position_m")),
        "position_mm",
        "",
        "use position_m, in metres",
    ),
}


@pytest.mark.parametrize("mistake", BAD_SITES)
@pytest.mark.parametrize("command", ["mine-loc up", "uwb_solver"])
def test_a_bad_site_file_is_refused_naming_file_line_and_key(mistake, command, site, domain, tmp_path):
    edit, key, value, allowed = BAD_SITES[mistake]
    edited(site, edit)
    words = up_command(site) if command == "mine-loc up" else node_command(NODES[command], {"site": site})
    lines = words_of(words, domain, tmp_path / "log")
    telling = [line for line in lines if f"{site / 'site.yaml'}:" in line]
    assert telling
    assert len(telling) <= 2  # a wrong key is also a missing right one
    assert any(key in line and value in line.lower() and allowed in line for line in telling)
    assert not any("Traceback" in line for line in lines)


@pytest.mark.parametrize("node", ["uwb_solver", "pdr", "synchroniser", "fusion"])
def test_a_site_folder_that_is_not_there_is_named(node, domain, tmp_path):
    (line,) = words_of(node_command(NODES[node], {"site": tmp_path / "nowhere"}), domain, tmp_path / "log")
    assert str(tmp_path / "nowhere") in line


def test_mine_loc_up_refuses_a_bad_parameter_file_before_anything_starts(site, domain, tmp_path):
    (site / "params").mkdir()
    (site / "params" / "uwb_solver.yaml").write_text("uwb_solver:\n  ros__parameters:\n    max_gdop: -3.0\n")
    (line,) = words_of(up_command(site), domain, tmp_path / "log")
    assert "uwb_solver.yaml:3" in line
    assert "max_gdop" in line
    assert "1 to 1000" in line


def test_all_anchors_of_the_good_site_are_accepted(site, domain, tmp_path, observer):
    """The counterpart: the site that the others spoil is good."""
    assert len(ANCHORS) == 5
    with running(node_command(NODES["uwb_solver"], {"site": site}), domain, tmp_path / "log"):
        observer.wait_for(lambda: observer.level("uwb_solver: solver") == 0)
