"""All nodes of one kind in one process, as people.yaml asks for them.

    python -m mine_loc_bringup.nodes.together n100_driver --site FOLDER [--sim-time] [--only NODE …]

Each driver of an N100 is woken 100 times a second. In a process of its own it finds the caches cold and takes
160 MB; together they take a fifth of the CPU (docs/live.md).
"""

import argparse
import contextlib
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from rclpy.experimental import EventsExecutor

from mine_loc_bringup.graph import NodeProcess, expand
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.nodes.node_base import node_class
from mine_loc_core.nodes.ros_host import RosHost, ros, spin_some
from mine_loc_core.people import People, PeopleFile
from mine_loc_core.site import load_site

_POLL_S = 1.0


class Together:
    """Nodes that come and go; one whose configuration is impossible says why, and the others go on."""

    def __init__(self) -> None:
        self._executor = EventsExecutor()
        self._hosts: dict[str, tuple[NodeProcess, RosHost]] = {}

    def serve(self, wanted: Mapping[str, NodeProcess]) -> None:
        """Start what is new, stop what is gone; what has changed is stopped and started."""
        for name, (node, host) in list(self._hosts.items()):
            if wanted.get(name) != node:
                del self._hosts[name]
                host.node.leave_active()
                self._executor.remove_node(host)
                host.destroy_node()
                print(f"{name} stopped")
        for name, node in wanted.items():
            if name not in self._hosts:
                self._start(name, node)

    def _start(self, name: str, node: NodeProcess) -> None:
        try:
            host = RosHost(node_class(node.module), node.ros_arguments)
        except ConfigurationError as error:
            print(error, file=sys.stderr)
            return
        self._hosts[name] = node, host
        self._executor.add_node(host)
        if host.node.parameters.autostart and host.start():
            print(f"{name} started")

    def work(self) -> None:
        """Let the nodes work for a while."""
        spin_some(self._executor)


def run(key: str, folder: Path, *, use_sim_time: bool, only: Sequence[str]) -> int:
    """Serve until SIGINT or SIGTERM. Exit status 2 when site, people or parameter files are bad at the start."""
    try:
        site, file = load_site(folder), PeopleFile(folder)

        def wanted(people: People) -> dict[str, NodeProcess]:
            nodes = expand(site, people, folder, use_sim_time=use_sim_time, only=only)
            return {node.name: node for node in nodes if node.key == key}

        first = wanted(file.people)
    except ConfigurationError as error:
        print(error, file=sys.stderr)
        return 2
    with ros([]) as stopping:
        together = Together()
        together.serve(first)
        looked_s = time.monotonic()
        while not stopping.is_set():
            together.work()
            if time.monotonic() - looked_s > _POLL_S:
                looked_s = time.monotonic()
                if (people := file.poll()) is not None:
                    with contextlib.suppress(ConfigurationError):  # `mine-loc up` tells it, and nothing changes
                        together.serve(wanted(people))
        together.serve({})
    return 0


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("key", help="kind of node, as in graph.yaml")
    parser.add_argument("--site", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--sim-time", action="store_true", help="use the time of /clock")
    parser.add_argument("--only", nargs="+", default=[], metavar="NODE", help="of these nodes alone")
    arguments = parser.parse_args()
    return run(arguments.key, arguments.site, use_sim_time=arguments.sim_time, only=arguments.only)


if __name__ == "__main__":
    sys.exit(main())
