"""The whole graph on a site of one walker (tag and N100) and one visitor (tag alone), as `mine-loc up` runs it."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from graph.domains import lent_domain
from graph.observer import Observer
from graph.processes import Running, running, up_command
from graph.walker import VISITOR_TAG, WALKER_TAG, LiveWalker, live_walker, person, write_site

NODES = (
    "dwm1000_driver_gate",
    "los_classifier",
    "uwb_solver",
    "n100_driver",
    "pdr",
    "synchroniser",
    "fusion",
    "proximity",
    "markers",
)


@dataclass(frozen=True)
class LiveGraph:
    """The processes, the walker they position, and an observer."""

    folder: Path
    up: Running
    walker: LiveWalker
    observer: Observer


def write_live_site(folder: Path) -> Path:
    receivers: list[dict[str, object]] = [{"name": "gate", "port": str(folder / "uwb"), "format": "mine_loc"}]
    people = [person("walker", WALKER_TAG, folder / "n100"), person("visitor", VISITOR_TAG)]
    return write_site(folder / "site", receivers, people)


@contextlib.contextmanager
def live_graph(folder: Path) -> Iterator[LiveGraph]:
    with lent_domain() as domain, live_walker(folder) as walker:
        observer = Observer(domain)
        try:
            with running(up_command(write_live_site(folder)), domain, folder / "up.log") as up:
                observer.wait_for(lambda: _reporting(observer) >= set(NODES), what="every node")
                yield LiveGraph(folder, up, walker, observer)
        finally:
            observer.close()


def _reporting(observer: Observer) -> set[str]:
    """Names, without namespace, of the nodes heard on /diagnostics."""
    return {name.split(":")[0].rpartition("/")[2] for name in observer.status}
