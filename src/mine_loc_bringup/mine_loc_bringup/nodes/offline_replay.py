"""A bag through the nodes of the graph without middleware: as fast as they work, and the same each time.

Messages are handed over in the order and at the times of their recording, which are those of their arrival: so what was
late or in wrong order is so again. Nodes take no time; only the waits that they are built of (a synchroniser's for link
states, a classifier's for the rest of a round, a timer's) pass, in the bag's time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from mine_loc_bringup.bag_messages import BagMessage
from mine_loc_bringup.graph import NodeProcess, expand, read_graph
from mine_loc_bringup.message_types import type_name
from mine_loc_bringup.nodes.offline_host import Letter, OfflineGraph, OfflineHost, Sink
from mine_loc_bringup.virtual_time import VirtualTime
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.nodes.node_base import node_class
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site

_TRUTH = "/truth/*"
Changes = Mapping[str, Mapping[str, Any]]
"""Node → parameter → value, before what files say."""


class OfflineReplay:
    """The nodes that a bag can drive, at one site.

    Raises ConfigurationError for bad site files, for a bag that drives none of the nodes, and for a topic of another
    type than the nodes speak.
    """

    def __init__(
        self, topics: Mapping[str, str], site_folder: Path, start_ns: int, sink: Sink, changes: Changes | None = None
    ) -> None:
        self._sink = sink
        self._time = VirtualTime(start_ns)
        self._graph = OfflineGraph(self._time, sink)
        processes = _driven(topics, site_folder, changes or {})
        self._hosts = [OfflineHost(node_class(process.module), process, self._graph) for process in processes]
        for host in self._hosts:
            host.configure()
        for host in self._hosts:
            host.activate()
        self.fed = {
            topic for topic in topics if topic in self._graph.subscriptions and topic not in self._graph.published
        }
        self.copied = {topic for topic in topics if fnmatchcase(topic, _TRUTH)}
        self._kinds = {topic: self._graph.subscriptions[topic][0].kind for topic in self.fed}
        for topic, kind in self._kinds.items():
            if topics[topic] != type_name(kind):
                raise ConfigurationError(f"{topic}: is a {topics[topic]}; allowed: {type_name(kind)}")

    @property
    def nodes(self) -> list[str]:
        """Names of the nodes that run."""
        return [host.node_name for host in self._hosts]

    @property
    def faults(self) -> dict[str, int]:
        """Exceptions of the nodes by where; there are none in a replay that can be believed."""
        return {f"{host.node_name}: {where}": n for host in self._hosts for where, n in host.node.faults.items()}

    def take(self, message: BagMessage) -> None:
        """Let the bag's time pass until a message, and hand it over."""
        jumped_ns = self._time.advance(message.log_ns)
        if jumped_ns:
            for host in self._hosts:
                host.node.announce_jump(jumped_ns)
        if message.topic in self.copied:
            self._sink.write(message.topic, message.type_name, message.log_ns, message.data)
        if message.topic in self.fed:
            self._graph.hand_over(message.topic, Letter(self._kinds[message.topic], data=message.data))

    def close(self) -> None:
        """Deactivate the nodes."""
        for host in self._hosts:
            host.node.leave_active()


def _driven(topics: Mapping[str, str], site_folder: Path, changes: Changes) -> Sequence[NodeProcess]:
    """Nodes of the graph one of whose driving topics the bag has."""
    site, people = load_site(site_folder), load_people(site_folder)
    patterns = {spec.key: spec.driven_by for spec in read_graph()}
    processes = [
        process
        for process in expand(site, people, site_folder)
        if any(fnmatchcase(topic, pattern) for pattern in patterns[process.key] for topic in topics)
    ]
    if not processes:
        wanted = sorted({pattern for each in patterns.values() for pattern in each})
        raise ConfigurationError(
            f"nothing to replay in topics {', '.join(topics) or 'none'}; allowed: one of {', '.join(wanted)}"
        )
    for key in changes:
        if key not in {process.key for process in processes}:
            names = ", ".join(process.key for process in processes)
            raise ConfigurationError(f"--set {key}: not a node of this replay; allowed: {names}")
    return [replace(each, parameters={**each.parameters, **changes.get(each.key, {})}) for each in processes]
