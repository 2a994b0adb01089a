"""One run of the live graph, as `mine-loc up` starts it, on streams played into pseudo-terminals."""

import asyncio
import os
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil
from live_feeder import Fed, Feeder, port_of
from live_streams import SITE, Streams
from live_watch import Seen, Watch

from mine_loc_bringup.graph import NodeProcess, commands, expand, node_environment
from mine_loc_bringup.site_folder import write_site_folder
from mine_loc_bringup.supervisor import Event, EventKind, Supervisor
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import load_site

_START_DEADLINE_S = 240.0
_SETTLE_S = 2.0


@dataclass(frozen=True, slots=True)
class Usage:
    """What a kind of node took while the streams were played: share of one core and memory, of all together."""

    processes: int
    cpu_share: float
    rss_mb: float


@dataclass(frozen=True, slots=True)
class Run:
    """What was fed and what was seen of it."""

    fed: Fed
    seen: Seen
    usage: Mapping[str, Usage]
    feeding_share: float
    watching_share: float


class GraphError(RuntimeError):
    """The graph did not come up, or a node died."""


def run(streams: Streams, warm_up_s: float, *, stages: bool = False) -> Run:
    """Play the streams into a fresh graph; load is measured from `warm_up_s` on."""
    with tempfile.TemporaryDirectory(prefix="mine_loc_live_") as scratch:
        return asyncio.run(_Live(streams, Path(scratch), warm_up_s, stages=stages).run())


class _Live:
    def __init__(self, streams: Streams, scratch: Path, warm_up_s: float, *, stages: bool) -> None:
        self._warm_up_s = warm_up_s
        self._streams, self._scratch, self._stages = streams, scratch, stages
        self._pids: dict[str, int] = {}
        self._died: list[str] = []
        self._log = (scratch / "nodes.log").open("w")

    async def run(self) -> Run:
        feeder = Feeder(self._streams, self._scratch / "ports")
        watch = Watch(stages=self._stages)
        nodes, supervisor = self._graph()
        try:
            await supervisor.set_commands(commands(nodes))
            await self._until_ready(watch, len(nodes))
            return await self._measure(feeder, watch, {node.name: node.key for node in nodes})
        finally:
            feeder.kill()
            watch.kill()
            await supervisor.stop()
            self._log.close()

    def _graph(self) -> tuple[list[NodeProcess], Supervisor]:
        folder = self._scratch / "site"
        ports = {line: str(port_of(self._scratch / "ports", line)) for line in self._streams.lines}
        write_site_folder(SITE, folder, ports, self._streams.people)
        site = load_site(folder)
        nodes = expand(site, PeopleFile(folder).people, folder)
        supervisor = Supervisor(node_environment(site.discovery), self._on_event, self._on_line)
        return nodes, supervisor

    def _on_event(self, event: Event) -> None:
        if event.kind is EventKind.STARTED and event.pid is not None:
            self._pids[event.name] = event.pid
        elif event.kind in {EventKind.DIED, EventKind.FAILED}:
            self._died.append(event.name)

    def _on_line(self, name: str, line: str) -> None:
        self._log.write(f"{name}: {line}\n")

    async def _until_ready(self, watch: Watch, nodes: int) -> None:
        deadline_s = time.monotonic() + _START_DEADLINE_S
        while (reporting := watch.reporting()) < nodes:
            if self._died or time.monotonic() > deadline_s:
                self._log.flush()
                last = (self._scratch / "nodes.log").read_text()[-2000:]
                raise GraphError(f"{reporting} of {nodes} nodes report; died: {self._died}\n{last}")
            await asyncio.sleep(0.5)
        await asyncio.sleep(_SETTLE_S)

    async def _measure(self, feeder: Feeder, watch: Watch, kind_of: Mapping[str, str]) -> Run:
        processes = {name: psutil.Process(pid) for name, pid in self._pids.items()}
        watching = psutil.Process(watch.pid)
        watch.begin()
        feeder.start()
        await asyncio.sleep(self._warm_up_s)
        before = {name: _cpu_s(process) for name, process in processes.items()}
        watched_s, began_s = _cpu_s(watching), time.monotonic()
        fed = await asyncio.to_thread(feeder.finish)
        lasted_s = time.monotonic() - began_s
        await asyncio.sleep(1.0)
        if self._died:
            raise GraphError(f"died: {self._died}")
        of_kind: dict[str, list[str]] = {}
        for name in processes:
            of_kind.setdefault(kind_of.get(name, name), []).append(name)  # what is together has the name of its kind
        usage = {
            kind: Usage(
                processes=len(names),
                cpu_share=sum((_cpu_s(processes[name]) - before[name]) / lasted_s for name in names),
                rss_mb=sum(processes[name].memory_info().rss / 1e6 for name in names),
            )
            for kind, names in of_kind.items()
        }
        watching_share = (_cpu_s(watching) - watched_s) / lasted_s
        return Run(fed, watch.finish(), usage, fed.cpu_s / self._streams.seconds, watching_share)


def _cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def two_cores() -> None:
    """Hold this process and all it starts to two cores."""
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])
