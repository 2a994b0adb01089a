"""Turn public recordings into bags with truth, each beside a site folder.

SET is one of the public sets of docs/data.md, which says where to get them; SRC is the folder of the set. Every
recording becomes a bag OUT/NAME with the topics of our drivers and truth/<person>/pose, truth/steps or
truth/link_state; the site folder lies in the bag's (OUT/NAME/site), as mine-loc replay expects it.

  trek1000    TREK1000 ranges, laboratory with Vicon truth and sports hall     trek1000_bielefeld
  hanyang     DW1000 ranges of outdoor runs with RTK truth                     hanyang_outdoor_uwb
  isas        ranges and IMU of a carried stick with Vive truth (ROS 1 bag)    isas_walk_uwb_imu
  ipol        IMU at the lower back with marked heel strikes                   ipol_gait_lowerback
  uwb-cirs    accumulators at labelled placements                              uwb_cirs_2018

Examples:
  mine-loc import isas $MINE_LOC_DATA/isas_walk_uwb_imu build/isas
  mine-loc import trek1000 $MINE_LOC_DATA/trek1000_bielefeld build/trek --recording m1l --recording m2r
  mine-loc replay build/trek/m1l --out build/m1l
  mine-loc evaluate build/m1l --align rigid --apply-time-offset
"""

import argparse
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from mine_loc_bringup.recordings.importers import IMPORTERS, Importer
from mine_loc_core.errors import ConfigurationError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("set", choices=sorted(IMPORTERS), help="which public set")
    parser.add_argument("source", type=Path, metavar="SRC", help="its folder")
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of the bags; made if it is not there")
    parser.add_argument(
        "--recording", action="append", default=[], metavar="NAME", help="only this one; may be given several times"
    )


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 when all recordings are written."""
    importer = IMPORTERS[arguments.set]
    if not arguments.source.is_dir():
        raise ConfigurationError(
            f"{arguments.source}: is no folder; allowed: that of {arguments.set}, published at {importer.source}"
        )
    known = importer.names(arguments.source)
    wanted = arguments.recording or known
    if unknown := [name for name in wanted if name not in known]:
        raise ConfigurationError(f"--recording: {unknown[0]}; allowed: {', '.join(known)}")
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        whole = progress.add_task(arguments.set, total=len(wanted))
        for name in wanted:
            messages = _write(importer, arguments.source, name, arguments.out / name, progress)
            progress.advance(whole)
            print(f"{arguments.out / name}: {messages} messages")
    if importer.alignment:
        print(f"truth is on a clock or in a frame of its own: mine-loc evaluate … {importer.alignment}")
    return 0


def _write(importer: Importer, source: Path, name: str, bag: Path, progress: Progress) -> int:
    from mine_loc_bringup.nodes.recording_bag import message_count, write_recording  # noqa: PLC0415 needs ROS

    recording = importer.load(source, name)
    task = progress.add_task(name, total=message_count(recording))
    written = 0
    for written in write_recording(recording, importer.source, bag):
        if written % 256 == 0:
            progress.update(task, completed=written)
    progress.remove_task(task)
    return written
