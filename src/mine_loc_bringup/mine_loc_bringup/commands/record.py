"""Record topics into a bag until Ctrl-C.

Topics are found as they appear, in any namespace, and recorded as they come, with their types and what their
publishers offer. A crash or a power cut costs the last second at most; `mine-loc bag repair` opens what is left. While
the disk is full messages wait, and are dropped and counted when the queue is full too. docs/bags.md says more.

In a pattern * stands for anything but a slash, ** for anything; uwb/ranges is that topic in whatever namespace,
/uwb/ranges only this one. Without patterns everything is recorded, which makes nodes publish what they otherwise keep
to themselves (accumulators, verdicts).

Exit status 1 where not all that came was recorded.

Examples:
  mine-loc record                                              everything, into mine_loc_<date>_<time>
  mine-loc record build/shift --exclude uwb/cir /rosout        all but accumulators and logs
  mine-loc record build/inputs --topics "uwb/*" "*/imu/*"      what the drivers publish
  mine-loc record build/day --split-size 500 --split-duration 600
"""

import argparse
from pathlib import Path

from mine_loc_bringup.graph import join_graph, parameter_words


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("bag", nargs="?", metavar="OUT", help="folder of the new bag; %%H and the like stand for the time")
    add("--topics", nargs="+", default=[], metavar="PATTERN", help="record these only")
    add("--exclude", nargs="+", default=[], metavar="PATTERN", help="leave these out")
    add("--storage", choices=("mcap", "sqlite3"), default="mcap", help="format (default mcap)")
    add("--split-size", type=float, default=0.0, metavar="MB", help="begin a new part when one has grown to this")
    add("--split-duration", type=float, default=0.0, metavar="S", help="begin a new part when one is this long")
    add("--site", type=Path, metavar="FOLDER", help="find nodes on other hosts as this site.yaml says")
    add("--sim-time", action="store_true", help="use the time of /clock")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 where all that came was recorded."""
    join_graph(arguments.site)
    from mine_loc_bringup.nodes.recorder import record  # noqa: PLC0415 only here ROS is needed

    parameters: dict[str, object] = {
        "topics": ",".join(arguments.topics),
        "exclude": ",".join(arguments.exclude),
        "storage": arguments.storage,
        "split_size_mb": arguments.split_size,
        "split_duration_s": arguments.split_duration,
        "use_sim_time": arguments.sim_time,
    }
    if arguments.bag:
        parameters["bag"] = arguments.bag
    return record(["--ros-args", *parameter_words(parameters)])
