"""From site and people to the processes that serve them."""

import itertools
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from mine_loc_bringup.graph import NodeProcess, commands, discovery_environment, expand, node_environment, read_graph
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.parameters import constraints
from mine_loc_core.people import People, load_people
from mine_loc_core.site import Discovery, Monitor, load_site

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "config/example_mine"
SITE = load_site(FOLDER)
PEOPLE = load_people(FOLDER)


def node(name: str, **options) -> NodeProcess:
    return next(process for process in expand(SITE, PEOPLE, FOLDER, **options) if process.name == name)


def test_the_example_mine_needs_a_driver_a_receiver_one_a_worn_n100_one_a_relay_and_one_of_each_else():
    assert [process.name for process in expand(SITE, PEOPLE, FOLDER)] == [
        "dwm1000_driver_portal",
        "dwm1000_driver_junction",
        "los_classifier",
        "uwb_solver",
        "fitter/n100_driver",
        "driver/n100_driver",
        "pdr",
        "synchroniser",
        "fusion",
        "proximity",
        "relay_shuttle_car",
        "markers",
        "coarse",
    ]


def test_the_store_runs_where_the_site_has_a_file_for_it_or_it_is_asked_for(tmp_path):
    assert [process.name for process in expand(SITE, PEOPLE, FOLDER, only=["store"])] == ["store"]
    (tmp_path / "params").mkdir()
    (tmp_path / "params" / "store.yaml").write_text("store:\n  ros__parameters:\n    keep_days: 400.0\n")
    store = next(process for process in expand(SITE, PEOPLE, tmp_path) if process.name == "store")
    assert store.module == "mine_loc_bringup.nodes.store"
    assert store.parameter_file == tmp_path / "params" / "store.yaml"


def test_a_relay_s_node_is_told_which_one_it_is():
    assert node("relay_shuttle_car").parameters == {"site": str(FOLDER), "relay": "shuttle_car"}


def test_a_monitor_with_a_port_has_a_driver_and_a_site_without_monitors_no_coarse_node():
    with_port = replace(SITE, monitors=(Monitor(7, (0.0, 0.0, 2.0), "socket://10.0.0.7:4001", 9600),))
    driver, coarse = (each for each in expand(with_port, PEOPLE, FOLDER) if each.key in {"monitor_driver", "coarse"})
    assert driver.name == "monitor_driver_7"
    assert driver.parameters == {"site": str(FOLDER), "port": "socket://10.0.0.7:4001", "baud": 9600}
    assert coarse.name == "coarse"
    without = expand(replace(SITE, monitors=()), PEOPLE, FOLDER)
    assert not {"monitor_driver", "coarse"} & {process.key for process in without}


def test_a_receiver_s_driver_is_told_its_line():
    assert node("dwm1000_driver_junction").parameters == {
        "site": str(FOLDER),
        "receiver": "junction",
        "port": "socket://192.168.10.13:8234",
        "baud": 115200,
        "format": "mine_loc",
    }


def test_an_n100_s_driver_lives_in_its_person_s_namespace():
    driver = node("fitter/n100_driver")
    assert (driver.namespace, driver.node_name) == ("/fitter", "n100_driver")
    assert driver.parameters["person"] == "fitter"
    assert driver.parameters["port"] == "socket://192.168.10.41:8234"


def test_the_command_runs_the_module_under_its_ros_name():
    assert node("fitter/n100_driver").command == [
        *(sys.executable, "-m", "mine_loc_pdr.nodes.n100_driver", "--ros-args"),
        *("-r", "__node:=n100_driver", "-r", "__ns:=/fitter"),
        *("-p", f'site:="{FOLDER}"', "-p", 'person:="fitter"'),
        *("-p", 'port:="socket://192.168.10.41:8234"', "-p", "baud:=921600"),
    ]


def test_all_n100s_share_a_process_that_is_told_what_it_serves_and_all_else_has_its_own():
    nodes = expand(SITE, PEOPLE, FOLDER, use_sim_time=True)
    found = commands(nodes)
    drivers = {node.name for node in nodes if node.key == "n100_driver"}
    assert len(drivers) == 2
    assert found.keys() == {node.name for node in nodes} - drivers | {"n100_driver"}
    assert found["fusion"] == node("fusion", use_sim_time=True).command
    words = [sys.executable, "-m", "mine_loc_bringup.nodes.together", "n100_driver", "--site", str(FOLDER)]
    assert found["n100_driver"] == [*words, "--sim-time"]
    one = ["driver/n100_driver"]
    assert commands(expand(SITE, PEOPLE, FOLDER, only=one), one) == {"n100_driver": [*words, "--only", *one]}


def test_values_of_parameters_keep_their_type_on_the_way_through_yaml():
    given = {"a": "off", "b": 1, "c": 1.0, "d": True, "e": "*: &ü😀", "f": "7"}
    command = NodeProcess("k", "m", "n", "/", given, None).command
    words = [word for flag, word in itertools.pairwise(command) if flag == "-p"]
    read = {name: yaml.safe_load(value) for name, _, value in (word.partition(":=") for word in words)}
    assert read == given
    assert [type(value) for value in read.values()] == [type(value) for value in given.values()]


def test_a_parameter_file_comes_before_what_the_graph_gives_so_that_the_graph_wins():
    command = NodeProcess("k", "m", "n", "/", {"site": "s"}, Path("p.yaml")).command
    assert command.index("--params-file") + 1 == command.index("p.yaml") < command.index("-p")


def test_simulated_time_is_passed_to_every_node_when_asked_for():
    assert all(p.parameters["use_sim_time"] is True for p in expand(SITE, PEOPLE, FOLDER, use_sim_time=True))
    assert not any("use_sim_time" in p.parameters for p in expand(SITE, PEOPLE, FOLDER))


def test_nodes_are_picked_by_kind_or_by_full_name():
    picked = expand(SITE, PEOPLE, FOLDER, only=["dwm1000_driver", "driver/n100_driver"])
    assert [p.name for p in picked] == ["dwm1000_driver_portal", "dwm1000_driver_junction", "driver/n100_driver"]


def test_a_kind_without_anyone_to_serve_is_still_a_kind():
    assert expand(SITE, People(()), FOLDER, only=["n100_driver"]) == []


def test_an_unknown_node_is_refused_with_those_there_are():
    with pytest.raises(
        ConfigurationError, match=r"--only: n200: no such node here; allowed: dwm1000_driver, .*fitter/n100"
    ):
        expand(SITE, PEOPLE, FOLDER, only=["n200"])


def test_every_package_of_the_graph_is_one_of_ours():
    assert all((ROOT / "src" / spec.package / "package.xml").is_file() for spec in read_graph())


@pytest.mark.parametrize(
    ("discovery", "range_", "peers"),
    [
        (Discovery(), "LOCALHOST", ""),
        (Discovery("subnet", ("10.0.0.2", "gate.mine")), "SUBNET", "10.0.0.2;gate.mine"),
        (Discovery("off"), "OFF", ""),
    ],
)
def test_discovery_is_what_the_site_says(discovery, range_, peers):
    environment = discovery_environment(discovery)
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == range_
    assert environment["ROS_STATIC_PEERS"] == peers


def test_discovery_is_quick_unless_the_user_has_a_profile(monkeypatch):
    variable = "FASTRTPS_DEFAULT_PROFILES_FILE"
    monkeypatch.delenv(variable, raising=False)
    assert Path(discovery_environment(Discovery())[variable]).is_file()
    monkeypatch.setenv(variable, "/etc/own.xml")
    assert discovery_environment(Discovery())[variable] == "/etc/own.xml"


def test_a_node_multiplies_small_matrices_with_one_thread():
    environment = node_environment(Discovery())
    assert environment["OPENBLAS_NUM_THREADS"] == environment["OMP_NUM_THREADS"] == "1"
    assert discovery_environment(Discovery()).items() <= environment.items()


@pytest.mark.parametrize("spec", read_graph(), ids=lambda spec: spec.key)
def test_a_node_takes_every_parameter_that_the_graph_gives_it(spec):
    module, _, name = spec.parameter_class.partition(":")
    taken = constraints(getattr(pytest.importorskip(module), name))
    assert set(spec.parameters) | {"site"} <= set(taken)
