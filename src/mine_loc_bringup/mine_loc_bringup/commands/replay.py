"""Play a bag again: into a new bag, as fast as the nodes work, or --live into the running graph, with /clock.

With --out the nodes that the bag can drive run on it without middleware, the same to the byte each time, and what they
publish goes, with the bag's truth/*, into OUT. The site is the folder site/ in the bag's folder or beside it, else
--site. --map reads bags of other people, --set changes a parameter for this replay: docs/replay.md.

Live, the messages are published as they were recorded, with the quality of service they had, while /clock tells the
bag's time; run the graph beside it with `mine-loc up --sim-time`. By default that plays what came into the graph
(devices, vehicles, truth) and nothing that the graph makes of it (uwb/pose, pdr/*, sync/*, fused/*, /tf …);
docs/bags.md has the rule, --topics overrides it. Space pauses and goes on, in a terminal; elsewhere the service
player/pause does.

Patterns are those of `mine-loc record`. A loop sets /clock back, on which the nodes begin anew.

Examples:
  mine-loc replay build/shift --out build/replayed
  mine-loc replay build/shift --out build/ekf --set fusion.method=ekf
  mine-loc replay walk.bag --out build/walk --site config/isas_walk --map examples/replay/isas_walk.yaml
  mine-loc up --site config/example_mine --sim-time --only uwb_solver pdr synchroniser fusion
  mine-loc replay build/shift --live
  mine-loc replay build/shift --live --rate 5 --start 120
  mine-loc replay build/shift --live --loop --topics uwb/ranges "*/imu/*"
  mine-loc replay build/shift --live --topics "**"             everything, as it was heard
"""

import argparse
import contextlib
import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

from mine_loc_bringup.graph import join_graph, parameter_words
from mine_loc_core.errors import ConfigurationError

_POLL_S = 0.2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("bag", metavar="BAG", help="folder of the bag, or one of its files")
    add("--live", action="store_true", help="publish into the running graph")
    add("--out", type=Path, metavar="OUT", help="folder of the new bag, without --live")
    add("--topics", nargs="+", default=[], metavar="PATTERN", help="play these")
    add("--exclude", nargs="+", default=[], metavar="PATTERN", help="leave these out")
    add("--rate", type=float, default=1.0, metavar="X", help="seconds of the bag that pass in one (default 1)")
    add("--start", type=float, default=0.0, metavar="S", help="begin so long after the bag's beginning")
    add("--loop", action="store_true", help="begin again at the end, until Ctrl-C")
    add("--site", type=Path, metavar="FOLDER", help="site of the replay; live: find nodes on other hosts as it says")
    add("--paused", action="store_true", help="begin paused")
    add("--map", type=Path, metavar="FILE", help="with --out: what the bag's topics and fields are called here")
    add("--set", action="append", default=[], metavar="NODE.PARAMETER=VALUE", help="with --out: a parameter")
    add("--json", type=Path, metavar="FILE", help="with --out: write nodes, counts of messages, faults and speed")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 after the whole bag, 1 if a node raised an exception, 2 for what the user can mend."""
    if arguments.live:
        _refuse(arguments, "--out", "--map", "--set", "--json")
        return _live(arguments)
    _refuse(arguments, "--topics", "--exclude", "--loop", "--paused")
    if not arguments.out:
        raise ConfigurationError(f"{arguments.bag}: allowed: --out OUT for a new bag, or --live for the running graph")
    return _offline(arguments)


def _refuse(arguments: argparse.Namespace, *options: str) -> None:
    """Options that the other way of replaying has."""
    other = "without --live" if arguments.live else "with --live"
    for option in options:
        if value := getattr(arguments, option[2:]):
            shown = option if value is True else f"{option}: {value}"
            raise ConfigurationError(f"{shown}; allowed: {other}")


def _offline(arguments: argparse.Namespace) -> int:
    from mine_loc_bringup.offline_run import replay_offline  # noqa: PLC0415 slow

    run = replay_offline(
        Path(arguments.bag), arguments.out, site=arguments.site, mapping=arguments.map, changes=arguments.set
    )
    print(f"{arguments.out}: {sum(run.published.values())} messages of {', '.join(run.nodes)}")
    print(f"{run.bag_s:.1f} s in {run.took_s:.1f} s, {run.speed:.0f} times real time")
    for where, count in run.faults.items():
        print(f"exception in {where}: {count} times", file=sys.stderr)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(run.to_json(), "utf-8")
        print(f"written: {arguments.json}")
    return 1 if run.faults else 0


def _live(arguments: argparse.Namespace) -> int:
    join_graph(arguments.site)
    from mine_loc_bringup.nodes.player import Player, play  # noqa: PLC0415 only here ROS is needed

    parameters: dict[str, object] = {
        "bag": arguments.bag,
        "topics": ",".join(arguments.topics),
        "exclude": ",".join(arguments.exclude),
        "rate": arguments.rate,
        "start_offset_s": arguments.start,
        "loop": arguments.loop,
        "paused": arguments.paused,
    }
    words = ["--ros-args", *parameter_words(parameters)]
    players: list[Player] = []

    def toggle() -> None:
        for player in players:
            player.toggle_pause()

    with _on_space(toggle):
        return play(words, players)


@contextlib.contextmanager
def _on_space(action: Callable[[], object]) -> Iterator[None]:
    """Do something whenever the space bar is hit, if this is a terminal."""
    if not sys.stdin.isatty():
        yield
        return
    before = termios.tcgetattr(sys.stdin)
    over = threading.Event()

    def listen() -> None:
        with contextlib.suppress(OSError):  # the terminal was closed
            while not over.is_set():
                if select.select([sys.stdin], [], [], _POLL_S)[0]:
                    key = os.read(sys.stdin.fileno(), 1)
                    if not key:
                        return
                    if key == b" ":
                        action()

    listener = threading.Thread(target=listen, daemon=True, name="keyboard")
    try:
        tty.setcbreak(sys.stdin)
        listener.start()
        yield
    finally:
        over.set()
        listener.join(2 * _POLL_S)
        with contextlib.suppress(termios.error):
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
