"""Parameter files are judged before anything starts."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from mine_loc_bringup.parameter_files import find_parameter_files
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.parameters import parameter


@dataclass(frozen=True)
class SolverKnobs:
    gate: float = parameter(0.99, "share of good ranges that pass", low=0.5, high=0.9999)
    reach: float = parameter(90.0, "longest range", unit="m", low=1.0, high=300.0)
    method: str = parameter("lm", "solver", choices=("lm", "gn"))


NODES = {"solver": (f"{__name__}:SolverKnobs", frozenset({"site", "port"}))}


def written(folder: Path, text: str, name: str = "solver.yaml") -> Path:
    (folder / "params").mkdir()
    (folder / "params" / name).write_text(text)
    return folder


def test_a_site_without_parameter_files_is_content_with_the_defaults(tmp_path):
    assert find_parameter_files(tmp_path, NODES) == {}


@pytest.mark.parametrize("node", ["/**", "solver", "/ns/solver", "ns:\n    solver"])
def test_a_good_file_is_found_however_the_node_is_addressed(tmp_path, node):
    depth = 4 if "\n" in node else 2
    text = f"{node}:\n{' ' * (depth + 2)}ros__parameters:\n{' ' * (depth + 4)}gate: 0.95\n"
    assert find_parameter_files(written(tmp_path, text), NODES) == {"solver": tmp_path / "params/solver.yaml"}


HEAD = "/**:\n  ros__parameters:\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (HEAD + "    gate: 7\n", "solver.yaml:3: gate: 7.0 is not allowed; allowed: 0.5 to 0.9999"),
        (HEAD + "    reach: 90\n", "solver.yaml:3: reach: 90 is a whole number, which ROS refuses here; allowed: 90.0"),
        (HEAD + "    gate: .nan\n", "solver.yaml:3: gate: nan is not allowed"),
        (HEAD + "    gate: high\n", "solver.yaml:3: gate: 'high' is a str, expected float: 0.5 to 0.9999"),
        (
            HEAD + "    gate: 0.9\n    method: newton\n",
            "solver.yaml:4: method: 'newton' is not allowed; allowed: one of lm, gn",
        ),
        (HEAD + "    gait: 0.9\n", "solver.yaml:3: gait: no such parameter; allowed: gate, reach, method"),
        (HEAD + "    port: /dev/x\n", "solver.yaml:3: port: comes from the site or people file"),
        ("gate: 0.9\n", "solver.yaml:1: gate: 0.9 is not allowed; allowed: a mapping, node name → ros__parameters"),
        ("/**:\n  ros__parameters: 3\n", "solver.yaml:2: /**.ros__parameters: 3 is not allowed; allowed: a mapping"),
        ("/**: [", "solver.yaml:1: not valid YAML"),
    ],
)
def test_each_mistake_is_one_line_that_names_file_line_key_and_what_is_allowed(tmp_path, text, says):
    with pytest.raises(ConfigurationError) as caught:
        find_parameter_files(written(tmp_path, text), NODES)
    assert says in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_all_mistakes_are_told(tmp_path):
    with pytest.raises(ConfigurationError) as caught:
        find_parameter_files(written(tmp_path, HEAD + "    gate: 7\n    method: x\n"), NODES)
    assert len(str(caught.value).splitlines()) == 2


def test_a_file_for_no_node_is_refused_with_the_names_there_are(tmp_path):
    with pytest.raises(ConfigurationError, match=r"sovler\.yaml: no node of this name; allowed: solver\.yaml"):
        find_parameter_files(written(tmp_path, HEAD, "sovler.yaml"), NODES)
