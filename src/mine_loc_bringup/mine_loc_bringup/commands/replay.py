"""Play a bag again: --live into the running graph, with /clock.

Live, the messages are published as they were recorded, with the quality of service they had, while /clock tells the
bag's time; run the graph beside it with `mine-loc up --sim-time`. By default that plays what came into the graph
(devices, vehicles, truth) and nothing that the graph makes of it (uwb/pose, pdr/*, sync/*, fused/*, /tf …);
docs/bags.md has the rule, --topics overrides it. Space pauses and goes on, in a terminal; elsewhere the service
player/pause does.

Patterns are those of `mine-loc record`. A loop sets /clock back, on which the nodes begin anew.

Examples:
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
    add("--site", type=Path, metavar="FOLDER", help="find nodes on other hosts as this site.yaml says")
    add("--paused", action="store_true", help="begin paused")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 after the whole bag."""
    if arguments.live:
        return _live(arguments)
    raise ConfigurationError(f"{arguments.bag}: replay without the graph is not in this version; allowed: --live")


def _live(arguments: argparse.Namespace) -> int:
    join_graph(arguments.site)
    from mine_loc_bringup.nodes.player import Player, play  # noqa: PLC0415 only here ROS is needed

    if arguments.out:
        raise ConfigurationError(
            f"--out: {arguments.out}; allowed: without --live; mine-loc record writes bags of the graph"
        )
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
