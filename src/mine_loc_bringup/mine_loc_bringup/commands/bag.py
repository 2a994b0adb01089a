"""Open what is left of a bag after a crash, a power cut or a broken copy.

`repair` writes what can be read of a bag (a folder, or one of its files; MCAP or sqlite3, of whoever) as a new bag that
every reader opens: whole, indexed, with its metadata. The old one is left as it is. A sound bag is written anew too.

Examples:
  mine-loc bag repair build/shift build/shift_repaired
  mine-loc bag repair broken.mcap build/repaired
"""

import argparse
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from mine_loc_bringup.bags.repair import Repaired, repair
from mine_loc_core.stamps import NS_PER_S


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    actions = parser.add_subparsers(metavar="ACTION", required=True)
    action = actions.add_parser("repair", help="write what can be read of a bag as a new one")
    action.add_argument("bag", type=Path, metavar="BAG", help="folder, or a file .mcap or .db3")
    action.add_argument("out", type=Path, metavar="OUT", help="folder of the new bag")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 where there is a new bag."""
    out: Path = arguments.out
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("reading", total=1.0)
        repaired = repair(arguments.bag, out, lambda share: progress.update(task, completed=share))
    _print(repaired, out)
    return 0


def _print(repaired: Repaired, out: Path) -> None:
    table = Table("file", "messages", "bytes lost", "what was wrong")
    for part in repaired.parts:
        table.add_row(part.path.name, str(part.messages), str(part.lost_bytes), part.problem or "nothing")
    Console().print(table)
    lasts_s = (repaired.last_ns - repaired.first_ns) / NS_PER_S
    print(f"{out}: {repaired.messages} messages over {lasts_s:.1f} s")
