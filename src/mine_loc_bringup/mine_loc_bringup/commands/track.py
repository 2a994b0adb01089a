"""Tell which way a person went, from the database of the node store.

Without a choice of format a summary is printed: stretches by area, with times. --csv and --geojson write every row;
the coordinates are those of the site's map [m], east and north, not degrees. A line ends where the person was LOST or
not heard of for more than 10 s (or the minute that a thinned row stands for), and begins anew.

TIME is ISO 8601 with a zone; URL as in `mine-loc who --help`.

Examples:
  mine-loc track fitter --from 2025-11-26T06:00+01:00 --to 2025-11-26T14:00+01:00
  mine-loc track fitter --from 2025-11-26T06:00Z --to 2025-11-26T14:00Z --csv build/fitter.csv
  mine-loc track fitter --from 2025-11-26T06:00Z --to 2025-11-26T14:00Z --geojson build/fitter.geojson
  mine-loc track fitter --from 2025-11-26T06:00Z --to 2025-11-26T14:00Z --plot build/fitter.png
"""

import argparse
from pathlib import Path

from mine_loc_core.errors import ConfigurationError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("person", metavar="PERSON", help="a name of people.yaml")
    add("--from", dest="since", required=True, metavar="TIME", help="from this instant")
    add("--to", dest="until", required=True, metavar="TIME", help="to this one")
    add("--database", default="", metavar="URL", help="the store")
    add("--csv", type=Path, metavar="FILE", help="write every row")
    add("--geojson", type=Path, metavar="FILE", help="write lines")
    add("--plot", type=Path, metavar="FILE", help="draw them")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0; 2 for what the user can mend."""
    from rich.console import Console  # noqa: PLC0415 slow

    from mine_loc_bringup.store import track_files  # noqa: PLC0415
    from mine_loc_bringup.store.database import asked  # noqa: PLC0415
    from mine_loc_bringup.store.moments import parse_period  # noqa: PLC0415
    from mine_loc_bringup.store.queries import track  # noqa: PLC0415

    since_ns, until_ns = parse_period(arguments.since, arguments.until)
    with asked(arguments.database) as connection:
        points = list(track(connection, arguments.person, since_ns, until_ns))
    if not points:
        raise ConfigurationError(
            f"{arguments.person}: no row from {arguments.since} to {arguments.until}; allowed: a time that has some"
        )
    for file, write in (
        (arguments.csv, track_files.write_csv),
        (arguments.geojson, track_files.write_geojson),
        (arguments.plot, track_files.write_plot),
    ):
        if file:
            file.parent.mkdir(parents=True, exist_ok=True)
            write(file, arguments.person, points)
            print(f"written: {file}")
    if not (arguments.csv or arguments.geojson or arguments.plot):
        Console().print(track_files.stretches_table(arguments.person, points))
    return 0
