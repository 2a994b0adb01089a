"""Count heads in each zone, gallery and chamber over time, from the database of the node store.

A count is taken at the end of each period, by everybody's last fix in it; the lost are not counted.

TIME is ISO 8601 with a zone; URL as in `mine-loc who --help`.

Examples:
  mine-loc headcount --from 2025-11-26T06:00+01:00 --to 2025-11-26T14:00+01:00
  mine-loc headcount --from 2025-11-26T06:00Z --to 2025-11-26T14:00Z --step 3600 --zone face
  mine-loc headcount --from 2025-11-26T06:00Z --to 2025-11-26T14:00Z --csv build/heads.csv --plot build/heads.png
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mine_loc_core.errors import ConfigurationError

_MOST_PERIODS = 100_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--from", dest="since", required=True, metavar="TIME", help="from this instant")
    add("--to", dest="until", required=True, metavar="TIME", help="to this one")
    add("--step", type=float, default=600.0, metavar="S", help="length of a period (default 600 s)")
    add("--zone", metavar="Z", help="only this zone, gallery or chamber")
    add("--database", default="", metavar="URL", help="the store")
    add("--csv", type=Path, metavar="FILE", help="write the counts")
    add("--plot", type=Path, metavar="FILE", help="draw them")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0; 2 for what the user can mend."""
    from rich.console import Console  # noqa: PLC0415 slow

    from mine_loc_bringup.store import headcount_files  # noqa: PLC0415
    from mine_loc_bringup.store.database import asked  # noqa: PLC0415
    from mine_loc_bringup.store.moments import parse_period  # noqa: PLC0415
    from mine_loc_bringup.store.queries import head_counts  # noqa: PLC0415

    since_ns, until_ns = parse_period(arguments.since, arguments.until)
    least_s = max(1.0, (until_ns - since_ns) / 1e9 / _MOST_PERIODS)
    if not least_s <= arguments.step <= 1e9:
        raise ConfigurationError(f"--step: {arguments.step:g} s is not allowed; allowed: {least_s:.6g} s to 1e9 s")
    with asked(arguments.database) as connection:
        counts = head_counts(connection, since_ns, until_ns, arguments.step, arguments.zone)
    writers: Sequence[tuple[Path | None, Any]] = (
        (arguments.csv, headcount_files.write_csv),
        (arguments.plot, headcount_files.write_plot),
    )
    for file, write in writers:
        if file:
            file.parent.mkdir(parents=True, exist_ok=True)
            write(file, counts, range(since_ns, until_ns, round(arguments.step * 1e9)))
            print(f"written: {file}")
    if not (arguments.csv or arguments.plot):
        Console().print(headcount_files.counts_table(counts) if counts else "nobody was in any area")
    return 0
