"""Parameter files of the nodes (`<site>/params/<node>.yaml`, ROS parameter YAML), judged before anything starts."""

import fnmatch
import importlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.parameters import constraints, from_mapping
from mine_loc_core.yaml_source import KeyPath, YamlSource, load_yaml, refuse

_PARAMETERS = "ros__parameters"


def find_parameter_files(site_folder: Path, nodes: Mapping[str, tuple[str, frozenset[str]]]) -> dict[str, Path]:
    """The checked parameter file of each node that has one.

    `nodes`: key → (parameter class as "module:Class", names that the graph gives and a file must not). Raises
    ConfigurationError with one line a mistake.
    """
    found: dict[str, Path] = {}
    problems: list[str] = []
    for file in sorted((site_folder / "params").glob("*.yaml")):
        if file.stem not in nodes:
            problems.append(f"{file}: no node of this name; allowed: {', '.join(f'{key}.yaml' for key in nodes)}")
            continue
        parameter_class, given = nodes[file.stem]
        try:
            problems += _problems(load_yaml(file), _load_class(parameter_class), given)
        except ConfigurationError as error:
            problems.append(str(error))
        found[file.stem] = file.resolve()
    refuse(problems)
    return found


def read_parameters(file: Path, full_name: str) -> dict[str, Any]:
    """What a checked parameter file says to the node of a full name; later sections win, as in rcl."""
    source = load_yaml(file)
    values: dict[str, Any] = {}
    for path, section in _sections(source, source.content, ()):
        pattern = "/" + "/".join(str(step).strip("/") for step in path[:-1])
        if fnmatch.fnmatchcase(full_name, pattern.replace("/**", "*")):
            values |= section
    return values


def _load_class(path: str) -> type[Any]:
    module, _, name = path.partition(":")
    kind: type[Any] = getattr(importlib.import_module(module), name)
    return kind


def _problems(source: YamlSource, kind: type[Any], given: frozenset[str]) -> Iterator[str]:
    for path, values in _sections(source, source.content, ()):
        for name, value in values.items():
            line = f"{source.file}:{source.lines[*path, name]}"
            if name in given:
                yield f"{line}: {name}: comes from the site or people file; allowed: to leave it out here"
                continue
            try:
                from_mapping(kind, {name: value}, line)
            except ConfigurationError as error:
                yield str(error)
                continue
            if type(value) is int and constraints(kind)[name][0] is float:
                yield f"{line}: {name}: {value} is a whole number, which ROS refuses here; allowed: {float(value)}"


def _sections(source: YamlSource, content: Any, path: KeyPath) -> Iterator[tuple[KeyPath, dict[str, Any]]]:
    """Every mapping under a key `ros__parameters`, however deep the namespaces above it."""
    if not isinstance(content, dict):
        expected = f"node name → {_PARAMETERS} → parameters"
        raise ConfigurationError(source.problem(path, f"{content!r} is not allowed; allowed: a mapping, {expected}"))
    for key, value in content.items():
        here = (*path, key)
        if key == _PARAMETERS and path:
            if not isinstance(value, dict):
                raise ConfigurationError(source.problem(here, f"{value!r} is not allowed; allowed: a mapping"))
            yield here, value
        else:
            yield from _sections(source, value, here)
