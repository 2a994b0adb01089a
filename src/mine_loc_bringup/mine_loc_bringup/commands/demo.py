"""Play a recording as bytes into serial lines and run the whole live graph on it, with a report against truth.

A public recording is used where MINE_LOC_DATA names the folder of recordings (RECORDING=m1l, a TREK1000 tag in a
laboratory with Vicon truth, or isas_walk1, UWB and IMU on a stick with Vive truth); without it, or with --site, people
in a mine are simulated. Results go to build/demo: report.json, track.png, and the bag of the run.

Examples:
  mine-loc demo
  mine-loc demo --recording isas_walk1 --seconds 30
  mine-loc demo --site config/gallery_2km --people 5
"""

import argparse
import asyncio
import json
import math
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console as Terminal
from rich.live import Live
from rich.table import Table

from mine_loc_bringup.console import Console
from mine_loc_bringup.demo import generated, isas_walk, trek_lab
from mine_loc_bringup.demo.playback import Playback
from mine_loc_bringup.demo.report import PersonReport, person_report, plot, together
from mine_loc_bringup.demo.table import people_table
from mine_loc_bringup.evaluation.track import Track
from mine_loc_bringup.graph import commands, expand, node_environment
from mine_loc_bringup.recordings.public_data import DATA_VARIABLE
from mine_loc_bringup.site_folder import write_site_folder
from mine_loc_bringup.supervisor import Event, EventKind, Supervisor
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import Site, load_site
from mine_loc_sim.serial_lines import Player, PseudoSerial

_RECORDINGS: dict[str, Callable[[], Playback]] = {
    "m1l": trek_lab.load,
    "isas_walk1": isas_walk.load,
}
_SIMULATED = "generated"
_SIMULATED_SITE = "laboratory"
_START_DEADLINE_S = 30.0
_DRAW_PERIOD_S = 0.25
_READY_PERIOD_S = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("--recording", choices=[*_RECORDINGS, _SIMULATED, ""], default="", help="what to play")
    parser.add_argument("--site", type=Path, metavar="FOLDER", help="simulate people at this site")
    parser.add_argument("--people", type=int, default=3, metavar="N", help="so many of them (default 3)")
    parser.add_argument("--seed", type=int, default=1, help="of the simulation (default 1)")
    parser.add_argument("--seconds", type=float, default=60.0, help="play at most so long (default 60)")
    parser.add_argument("--sites", type=Path, default=Path("config"), help="folder of the shipped sites")
    parser.add_argument("--out", type=Path, default=Path("build/demo"), help="folder of the results")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 if every person was positioned, 1 if not, 2 for what the user can mend."""
    if not 2.0 <= arguments.seconds <= 3600.0:
        raise ConfigurationError(f"--seconds: {arguments.seconds:g}: allowed: 2 to 3600")
    recording = _recording(arguments)
    os.environ.setdefault("ROS_DOMAIN_ID", "42")  # beside a mine's own graph, not in it
    demo = _Demo(recording, arguments)
    return asyncio.run(demo.run())


def _recording(arguments: argparse.Namespace) -> Playback:
    name = arguments.recording
    if arguments.site and name not in {"", _SIMULATED}:
        raise ConfigurationError(
            f"--site: {arguments.site} is simulated; allowed: not together with --recording {name}"
        )
    if not name and not arguments.site:
        name = "m1l" if os.environ.get(DATA_VARIABLE) else _SIMULATED
    if name in _RECORDINGS:
        return _RECORDINGS[name]()
    site = arguments.site or arguments.sites / _SIMULATED_SITE
    print(f"simulating {arguments.people} people at {site}", file=sys.stderr)
    return generated.load(site, arguments.people, arguments.seconds, arguments.seed)


class _Demo:
    def __init__(self, recording: Playback, arguments: argparse.Namespace) -> None:
        self._recording = recording
        self._seconds = arguments.seconds
        self._out: Path = arguments.out.resolve()
        shutil.rmtree(self._out, ignore_errors=True)
        self._out.mkdir(parents=True)
        self._lines = {name: PseudoSerial(self._out / "ports" / name.replace("/", "_")) for name in recording.lines}
        self._folder = self._out / "site"
        ports = {name: line.address for name, line in self._lines.items()}
        write_site_folder(arguments.sites / recording.site, self._folder, ports, recording.people)
        self._log = (self._out / "nodes.log").open("w")
        self._console = Console(self._log)
        self._events: list[tuple[float, Event]] = []

    async def run(self) -> int:
        from mine_loc_bringup.nodes.demo_watch import DemoWatch  # noqa: PLC0415 only here ROS is needed

        site, people = load_site(self._folder), PeopleFile(self._folder).people
        nodes = expand(site, people, self._folder)
        self._watch = DemoWatch([person.name for person in people], self._out / "bag")
        supervisor = Supervisor(node_environment(site.discovery), self._on_event, self._console.line)
        self._players = [Player(self._lines[name], arrivals) for name, arrivals in self._recording.lines.items()]
        interrupted = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, interrupted.set)
        try:
            await supervisor.set_commands(commands(nodes))
            if not await self._until_ready(len(nodes), interrupted):
                return 1
            await self._play(interrupted)
        finally:
            for player in self._players:
                player.stop()
            await supervisor.stop()
            self._watch.close()
            self._log.close()
        return self._report(site, supervisor)

    def _on_event(self, event: Event) -> None:
        self._console.event(event)
        self._events.append((time.monotonic(), event))

    async def _until_ready(self, nodes: int, interrupted: asyncio.Event) -> bool:
        """Wait until every node has reported twice, which leaves them a second to find each other.

        Bytes sent to a port that nobody has opened are lost.
        """
        deadline_s = time.monotonic() + _START_DEADLINE_S
        ready: list[str] = []
        while time.monotonic() < deadline_s and not interrupted.is_set():
            await asyncio.sleep(_READY_PERIOD_S)
            ready = sorted(name for name, count in list(self._watch.watched.reports.items()) if count > 1)
            if len(ready) >= nodes:
                return True
        print(f"only {ready} of {nodes} nodes report; see {self._out / 'nodes.log'}", file=sys.stderr)
        return False

    async def _play(self, interrupted: asyncio.Event) -> None:
        self._started_s, self._started_ns = time.monotonic(), time.time_ns()
        for player in self._players:
            player.start(self._started_s)
        self._ends_s = min(self._seconds, self._recording.lasts_s)
        terminal = Terminal()
        with Live(self._table(), console=terminal, auto_refresh=False, transient=not terminal.is_terminal) as live:
            while (left_s := self._started_s + self._ends_s - time.monotonic()) > 0 and not interrupted.is_set():
                await asyncio.sleep(min(left_s, _DRAW_PERIOD_S))
                if terminal.is_terminal:
                    live.update(self._table(), refresh=True)
        self._ends_s = min(self._ends_s, time.monotonic() - self._started_s)

    def _table(self) -> Table:
        watched = self._watch.watched
        rows = [
            (
                name,
                last.x_m,
                last.y_m,
                last.ce95_m,
                last.mode,
                last.los_fraction,
                watched.rate_hz(f"people/{name}/pose"),
            )
            for name, outputs in watched.outputs.items()
            if outputs and (last := outputs[-1])
        ]
        played_s = time.monotonic() - self._started_s
        title = f"{self._recording.source}: {played_s:.0f} of {self._ends_s:.0f} s"
        rates = ", ".join(
            f"{topic} {watched.rate_hz(topic):.1f} Hz" for topic in ("uwb/ranges", "sync/epochs", "pdr/steps")
        )
        return people_table(title, rows, rates)

    def _track(self, person: str) -> Track:
        outputs = [o for o in self._watch.watched.outputs.get(person, []) if o.received_ns >= self._started_ns]
        covariance = [((xx, xy), (xy, yy)) for xx, xy, yy in (o.covariance_m2 for o in outputs)]
        return Track(
            stamp_ns=np.array([o.stamp_ns for o in outputs], np.int64),
            logged_ns=np.array([o.received_ns for o in outputs], np.int64),
            position_m=np.array([(o.x_m, o.y_m) for o in outputs], np.float64).reshape(-1, 2),
            covariance_m2=np.array(covariance, np.float64).reshape(-1, 2, 2),
            ce95_m=np.array([o.ce95_m for o in outputs], np.float64),
            modes=np.array([o.mode for o in outputs], np.int64),
        )

    def _report(self, site: Site, supervisor: Supervisor) -> int:
        reports: list[PersonReport] = []
        missing: list[str] = []
        for truth in self._recording.truths:
            try:
                reports.append(
                    person_report(truth.person, self._track(truth.person), truth, self._started_ns, self._ends_s)
                )
            except ValueError as error:
                missing.append(str(error))
        receivers = {receiver.name for receiver in site.uwb_receivers}
        lines = zip(self._players, self._recording.lines, strict=True)
        played = sum(player.played for player, name in lines if name in receivers)
        died = [(at_s, e) for at_s, e in self._events if e.kind in {EventKind.DIED, EventKind.FAILED}]
        report = {
            "source": self._recording.source,
            "seconds": self._ends_s,
            **(together(reports) if reports else {"availability": 0.0}),
            "rounds_played": played,
            "rounds_received": sum(self._watch.watched.rounds.values()),
            "restarts": dict(supervisor.restarts),
            "died": [{"node": e.name, "at_s": round(at_s - self._started_s, 2)} for at_s, e in died],
            "people": {r.name: r.figures for r in reports},
            "missing": missing,
        }
        (self._out / "report.json").write_text(json.dumps(report, indent=2) + "\n", "utf-8")
        if reports:
            anchors_m = np.array([anchor.position_m for anchor in site.anchors])
            plot(reports, anchors_m, str(report["source"]), self._out / "track.png")
        _print_report(report, reports, self._out)
        return 1 if missing else 0


def _print_report(report: dict[str, object], reports: Sequence[PersonReport], out: Path) -> None:
    print(f"\n{report['source']}, {report['seconds']:.1f} s")
    for name in ("availability", "horizontal_mean_m", "rmse_m", "median_m", "third_quartile_m", "ce95_m", "max_m"):
        if isinstance(value := report.get(name), float) and math.isfinite(value):
            print(f"  {name:20} {value:.3f}")
    print(f"  {'latency p50, p99':20} {report.get('latency_p50_ms')} ms, {report.get('latency_p99_ms')} ms")
    print(f"  {'rounds':20} {report['rounds_received']} received of {report['rounds_played']} played")
    for item in reports:
        print(f"  {item.name}: truth aligned by {item.figures['alignment']}")
        print(f"  {item.name}: gaps over half a second: {item.figures['gaps_over_half_a_second'] or 'none'}")
    print(f"  nodes that died: {report['died'] or 'none'}")
    for line in report["missing"]:  # type: ignore[attr-defined]
        print(f"  {line}")
    print(f"written: {out / 'report.json'}, {out / 'track.png'}, {out / 'bag'}")
