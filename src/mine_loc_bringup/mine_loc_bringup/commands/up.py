"""Run the node graph of a site until Ctrl-C.

One process a node, and one for the drivers of all N100s. A process that dies is restarted, first after 0.1 s, then with
growing delays up to 10 s. people.yaml may be edited meanwhile: drivers of new people start, those of others stop; a bad
edit is reported and changes nothing. Discovery of other ROS 2 nodes stays on this host unless site.yaml says otherwise.

Examples:
  mine-loc up --site config/example_mine
  mine-loc up --site config/example_mine --only uwb_solver fusion
  mine-loc up --site config/example_mine --only fitter/n100_driver
  mine-loc up --site config/example_mine --sim-time      the clock comes from /clock
"""

import argparse
import asyncio
import signal
from collections.abc import Callable
from pathlib import Path

from mine_loc_bringup.console import Console
from mine_loc_bringup.graph import commands, expand, node_environment
from mine_loc_bringup.supervisor import Event, EventKind, Supervisor
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import People, PeopleFile
from mine_loc_core.site import load_site

_POLL_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "--site", type=Path, required=True, metavar="FOLDER", help="folder of site.yaml and people.yaml"
    )
    parser.add_argument("--sim-time", action="store_true", help="use the time of /clock")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NODE", help="run these nodes alone, by kind or full name"
    )


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 if every node stopped when asked, 1 if one had to be killed."""
    return asyncio.run(_run(arguments))


async def _run(arguments: argparse.Namespace) -> int:
    folder: Path = arguments.site
    site, people_file = load_site(folder), PeopleFile(folder)

    def serve(people: People) -> dict[str, list[str]]:
        nodes = expand(site, people, folder, use_sim_time=arguments.sim_time, only=arguments.only)
        return commands(nodes, arguments.only)

    console = Console()
    killed: list[str] = []

    def on_event(event: Event) -> None:
        console.event(event)
        if event.kind is EventKind.KILLED:
            killed.append(event.name)

    wanted = serve(people_file.people)
    supervisor = Supervisor(node_environment(site.discovery), on_event, console.line)
    stop = _stop_on_signals()
    await supervisor.set_commands(wanted)
    following = asyncio.create_task(_follow(people_file, serve, supervisor, console))
    await asyncio.wait({asyncio.create_task(stop.wait()), following}, return_when=asyncio.FIRST_COMPLETED)
    following.cancel()
    await supervisor.stop()
    return 1 if killed else 0


def _stop_on_signals() -> asyncio.Event:
    stop = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, stop.set)
    return stop


async def _follow(
    people_file: PeopleFile,
    serve: Callable[[People], dict[str, list[str]]],
    supervisor: Supervisor,
    console: Console,
) -> None:
    """Let the running nodes follow people.yaml."""
    told: str | None = None
    while True:
        await asyncio.sleep(_POLL_S)
        people = people_file.poll()
        problem = people_file.error
        try:
            if people is not None:
                await supervisor.set_commands(serve(people))
        except ConfigurationError as error:
            problem = str(error)
        if problem and problem != told:
            console.trouble(f"{problem}\nThe people stay as they were.")
        told = problem
