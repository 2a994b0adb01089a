"""Stopping: a node within a second, the graph within two, at any moment, without a word of trouble."""

import contextlib
import signal

import psutil
import pytest
from graph.live_graph import NODES, live_graph, write_live_site
from graph.processes import node_command, running, up_command
from graph.walker import live_walker

pytestmark = pytest.mark.graph


def commands(folder) -> dict[str, list[str]]:
    site = write_live_site(folder)
    uwb = {"site": site, "receiver": "gate", "port": folder / "uwb", "format": "mine_loc"}
    imu = {"site": site, "person": "walker", "port": folder / "n100"}
    return {
        "dwm1000_driver": node_command("mine_loc_uwb.nodes.dwm1000_driver", uwb),
        "uwb_solver": node_command("mine_loc_uwb.nodes.uwb_solver", {"site": site}),
        "walker/n100_driver": node_command("mine_loc_pdr.nodes.n100_driver", imu, "/walker"),
        "pdr": node_command("mine_loc_pdr.nodes.pdr", {"site": site}),
        "synchroniser": node_command("mine_loc_fusion.nodes.synchroniser", {"site": site}),
        "fusion": node_command("mine_loc_fusion.nodes.fusion", {"site": site}),
        "proximity": node_command("mine_loc_fusion.nodes.proximity", {"site": site}),
        "markers": node_command("mine_loc_fusion.nodes.markers", {"site": site}),
    }


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_every_node_stops_within_a_second(number, tmp_path, domain, observer):
    with live_walker(tmp_path), contextlib.ExitStack() as stack:
        runs = {
            name: stack.enter_context(running(command, domain, tmp_path / f"{name.replace('/', '_')}.log"))
            for name, command in commands(tmp_path).items()
        }
        observer.wait_for(
            lambda: {name for name in runs if observer.level(f"{name}: callbacks") == 0} == set(runs), what="every node"
        )
        took_s = {name: run.stop(number) for name, run in runs.items()}
        assert {name: run.process.returncode for name, run in runs.items()} == dict.fromkeys(runs, 0)
        assert {name: s for name, s in took_s.items() if s >= 1.0} == {}
        assert {name: run.output for name, run in runs.items() if "Traceback" in run.output} == {}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_graph_stops_within_two_seconds_and_leaves_nobody_behind(number, tmp_path):
    with live_graph(tmp_path) as graph:
        children = psutil.Process(graph.up.process.pid).children()
        assert len(children) == len(NODES)
        took_s = graph.up.stop(number)
        assert graph.up.process.returncode == 0
        assert took_s < 2.0
        assert [child for child in children if child.is_running()] == []
        assert graph.up.output.count("] stopped, exit status 0") == len(NODES)


def test_the_graph_stops_within_two_seconds_while_it_is_starting(tmp_path, domain, observer):
    with running(up_command(write_live_site(tmp_path)), domain, tmp_path / "up.log") as up:
        observer.wait_for(lambda: "[markers] started" in up.output)
        took_s = up.stop(signal.SIGINT)
        assert up.process.returncode == 0
        assert took_s < 2.0
        assert up.output.count("] stopped") == len(NODES)
        assert "Traceback" not in up.output
        assert "Interrupt" not in up.output
