"""The declarative node graph: from `graph.yaml`, a site and its people to the processes that serve them."""

import functools
import json
import operator
import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import yaml

from mine_loc_bringup.parameter_files import find_parameter_files
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import People
from mine_loc_core.site import Discovery, Site, load_site

_FAST_DDS_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_TOGETHER = "mine_loc_bringup.nodes.together"
_REFERENCE = re.compile(r"\{([a-z0-9_.]+)\}")


@dataclass(frozen=True, slots=True)
class NodeSpec:
    """One entry of `graph.yaml`; see the head of that file."""

    key: str
    package: str
    per: Literal[
        "site",
        "site_with_params",
        "person_with_n100",
        "uwb_receiver",
        "relay",
        "monitor_with_port",
        "site_with_monitors",
    ]
    parameter_class: str
    name: str
    namespace: str = "/"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    driven_by: Sequence[str] = ()
    together: bool = False


@dataclass(frozen=True, slots=True)
class NodeProcess:
    """One node as it is to run."""

    key: str
    module: str
    node_name: str
    namespace: str
    parameters: Mapping[str, Any]
    parameter_file: Path | None

    @property
    def name(self) -> str:
        """Fully qualified node name without the leading slash; unique in the graph."""
        return f"{self.namespace}/{self.node_name}".lstrip("/")

    @property
    def ros_arguments(self) -> list[str]:
        """Name, namespace and parameters. Values come after the file, so they win over it."""
        words = ["--ros-args", "-r", f"__node:={self.node_name}", "-r", f"__ns:={self.namespace}"]
        if self.parameter_file:
            words += ["--params-file", str(self.parameter_file)]
        return words + parameter_words(self.parameters)

    @property
    def command(self) -> list[str]:
        """What to execute where there is no ROS launch."""
        return [sys.executable, "-m", self.module, *self.ros_arguments]


def parameter_words(parameters: Mapping[str, Any]) -> list[str]:
    """ROS arguments that set parameters; values as JSON, which the YAML parser of rcl reads with the right type."""
    return [
        word
        for name, value in parameters.items()
        for word in ("-p", f"{name}:={json.dumps(value, ensure_ascii=False)}")
    ]


@functools.cache
def read_graph() -> tuple[NodeSpec, ...]:
    """The nodes of `graph.yaml`, in its order."""
    entries = yaml.safe_load((resources.files("mine_loc_bringup") / "graph.yaml").read_text("utf-8"))
    return tuple(
        NodeSpec(key=key, parameter_class=entry.pop("class"), name=entry.pop("name", key), **entry)
        for key, entry in entries.items()
    )


def expand(
    site: Site, people: People, site_folder: Path, *, use_sim_time: bool = False, only: Collection[str] = ()
) -> list[NodeProcess]:
    """The processes that serve this site and these people.

    `only` keeps the nodes of these keys or full names. Raises ConfigurationError for a bad parameter file (in the
    site's folder `params/`) or an unknown name in `only`.
    """
    graph = read_graph()
    files = find_parameter_files(site_folder, {spec.key: (spec.parameter_class, _given(spec)) for spec in graph})
    common: dict[str, Any] = {"site": str(site_folder.resolve())}
    if use_sim_time:
        common["use_sim_time"] = True
    processes = [
        NodeProcess(
            key=spec.key,
            module=f"{spec.package}.nodes.{spec.key}",
            node_name=_fill(spec.name, scope),
            namespace=_fill(spec.namespace, scope),
            parameters=common | {name: _fill(value, scope) for name, value in spec.parameters.items()},
            parameter_file=files.get(spec.key),
        )
        for spec in graph
        if spec.per != "site_with_params" or spec.key in files or spec.key in only
        for scope in _scopes(spec, site, people)
    ]
    allowed = dict.fromkeys([spec.key for spec in graph] + [process.name for process in processes])
    for name in only:
        if name not in allowed:
            raise ConfigurationError(f"--only: {name}: no such node here; allowed: {', '.join(allowed)}")
    return [process for process in processes if not only or process.key in only or process.name in only]


def commands(nodes: Iterable[NodeProcess], only: Collection[str] = ()) -> dict[str, list[str]]:
    """What to execute, by the name of the process: one a node, but one for all nodes of a kind that is `together`.

    That one follows people.yaml by itself (nodes/together.py), within `only` as `expand` was given it.
    """
    together = {spec.key for spec in read_graph() if spec.together}
    found: dict[str, list[str]] = {}
    for node in nodes:
        if node.key in together:
            words = ["--sim-time"] if node.parameters.get("use_sim_time") else []
            words += ["--only", *only] if only else []
            found[node.key] = [sys.executable, "-m", _TOGETHER, node.key, "--site", node.parameters["site"], *words]
        else:
            found[node.name] = node.command
    return found


def discovery_environment(discovery: Discovery) -> dict[str, str]:
    """Environment variables that hold ROS 2's discovery to what the site file says, and make it quick.

    A Fast DDS profile that the user has set already is kept.
    """
    quick = str(resources.files("mine_loc_bringup") / "fast_discovery.xml")
    return {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": discovery.range.upper(),
        "ROS_STATIC_PEERS": ";".join(discovery.peers),
        _FAST_DDS_PROFILES: os.environ.get(_FAST_DDS_PROFILES, quick),
    }


def join_graph(site_folder: Path | None) -> None:
    """Let this process find the nodes of a site as they find one another, before it imports ROS.

    Without a site folder, discovery reaches as far as the environment says. Raises ConfigurationError for a bad site.
    """
    quick = discovery_environment(load_site(site_folder).discovery if site_folder else Discovery())
    os.environ.update(quick if site_folder else {_FAST_DDS_PROFILES: quick[_FAST_DDS_PROFILES]})


def node_environment(discovery: Discovery) -> dict[str, str]:
    """Environment variables of every node: those of discovery, and one thread a node for products of small matrices.

    OpenBLAS shares out even a product with one row, and then waits for its threads.
    """
    return {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"} | discovery_environment(discovery)


def _given(spec: NodeSpec) -> frozenset[str]:
    return frozenset(spec.parameters) | {"site", "use_sim_time"}


def _scopes(spec: NodeSpec, site: Site, people: People) -> Iterator[dict[str, Any]]:
    if spec.per in {"site", "site_with_params"}:
        yield {"site": site}
    elif spec.per == "uwb_receiver":
        yield from ({"site": site, "receiver": receiver} for receiver in site.uwb_receivers)
    elif spec.per == "relay":
        yield from ({"site": site, "relay": relay} for relay in site.relays)
    elif spec.per == "monitor_with_port":
        yield from ({"site": site, "monitor": monitor} for monitor in site.monitors if monitor.port)
    elif spec.per == "site_with_monitors":
        yield from ({"site": site} for _ in site.monitors[:1])
    else:
        yield from ({"site": site, "person": person} for person in people if person.n100)


def _fill(template: Any, scope: Mapping[str, Any]) -> Any:
    """Put values in place of `{object.attribute}`; a template that is one reference keeps the value's type."""
    if not isinstance(template, str):
        return template

    def value(path: str) -> Any:
        head, _, rest = path.partition(".")
        return operator.attrgetter(rest)(scope[head])

    if whole := _REFERENCE.fullmatch(template):
        return value(whole[1])
    return _REFERENCE.sub(lambda match: str(value(match[1])), template)
