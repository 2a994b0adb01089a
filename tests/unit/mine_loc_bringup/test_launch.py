"""The launch file for a full ROS 2, run against stand-ins: launch and launch_ros are not on PyPI."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from mine_loc_bringup.graph import expand, node_environment
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "config/example_mine"


class Recorded(SimpleNamespace):
    def __init__(self, *positional, **named) -> None:
        super().__init__(positional=positional, **named)


class LaunchConfiguration:
    def __init__(self, name: str) -> None:
        self.name = name

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]


@pytest.fixture
def launch_file(monkeypatch):
    stand_ins = {
        "launch": {"LaunchContext": dict, "LaunchDescription": Recorded},
        "launch.actions": {"DeclareLaunchArgument": Recorded, "OpaqueFunction": Recorded},
        "launch.substitutions": {"LaunchConfiguration": LaunchConfiguration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Recorded},
    }
    for name, content in stand_ins.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location(
        "launch_file", ROOT / "src/mine_loc_bringup/launch/mine_loc.launch.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_declares_site_and_sim_time_and_starts_the_nodes(launch_file):
    site, sim_time, start = launch_file.generate_launch_description().positional[0]
    assert [site.positional, sim_time.positional] == [("site",), ("sim_time",)]
    assert not hasattr(site, "default_value")
    assert start.function is launch_file.start_nodes


@pytest.mark.parametrize("sim_time", ["true", "false"])
def test_its_nodes_are_those_of_the_graph(launch_file, sim_time):
    site = load_site(FOLDER)
    wanted = expand(site, load_people(FOLDER), FOLDER, use_sim_time=sim_time == "true")
    nodes = launch_file.start_nodes({"site": str(FOLDER), "sim_time": sim_time})
    assert [
        ([n.executable, *n.arguments], n.name, n.namespace, n.parameters, n.additional_env, n.respawn) for n in nodes
    ] == [
        (w.command[:3], w.node_name, w.namespace, [w.parameters], node_environment(site.discovery), True)
        for w in wanted
    ]
