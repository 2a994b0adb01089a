"""Tell who was where at an instant, from the database of the node store.

Each line says when the fix was made, how old it is at the instant asked for, and how sure: the radius that holds the
person with a probability of 95 %. LOST means that nobody can say where the person was; the place beside it is where
they were last known to be. Whoever was not heard of in the day before the instant is not listed.

TIME is ISO 8601 with a zone. URL is sqlite:///FILE or postgresql://USER@HOST/DATABASE; without one, it is
$MINE_LOC_DATABASE, or the file that the node store writes to when it is told nothing else.

Examples:
  mine-loc who --at 2025-11-26T15:10+01:00
  mine-loc who --at 2025-11-26T15:10+01:00 --zone main              a zone, gallery or chamber of site.yaml
  mine-loc who --at 2025-11-26T14:10Z --database postgresql://reader@mine/positions --json build/who.json
"""

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--at", required=True, metavar="TIME", help="the instant")
    add("--zone", metavar="Z", help="only who was, or was last known, in this zone, gallery or chamber")
    add("--max-age", type=float, default=10.0, metavar="S", help="whose fix is older is LOST (default 10 s)")
    add("--database", default="", metavar="URL", help="the store")
    add("--json", type=Path, metavar="FILE", help="write it there as well")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0; 2 for what the user can mend."""
    from rich.console import Console  # noqa: PLC0415 slow
    from rich.table import Table  # noqa: PLC0415

    from mine_loc_bringup.store.database import asked  # noqa: PLC0415
    from mine_loc_bringup.store.moments import moment_text, parse_moment  # noqa: PLC0415
    from mine_loc_bringup.store.queries import who  # noqa: PLC0415

    at_ns = parse_moment(arguments.at, "--at")
    with asked(arguments.database) as connection:
        fixes = who(connection, at_ns, arguments.max_age, arguments.zone)
    table = Table("person", "", "place", "x, m", "y, m", "95 %, m", "fix at", "age, s", title=moment_text(at_ns))
    for fix in fixes:
        state = "[bold red]LOST[/]" if fix.lost else fix.mode.name
        place = f"{'last in ' if fix.lost and fix.areas else ''}{', '.join(fix.areas) or '–'}"
        numbers = (_number(value) for value in (fix.x_m, fix.y_m, fix.ce95_m))
        table.add_row(fix.person, state, place, *numbers, moment_text(fix.stamp_ns), f"{fix.age_s:.1f}")
    Console().print(table if fixes else f"{moment_text(at_ns)}: nobody")
    if arguments.json:
        rows: list[dict[str, Any]] = [asdict(fix) | {"mode": fix.mode.name} for fix in fixes]
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"at_ns": at_ns, "people": rows}, indent=2, allow_nan=False) + "\n")
    return 0


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
