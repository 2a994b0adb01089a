"""A recording of your own as a bag with truth: the least that an importer must do.

    python examples/importer/ranges_csv.py ANCHORS.csv RANGES.csv TRUTH.csv OUT

ANCHORS has columns id, x, y, z; RANGES time_s, tag, anchor, range_m, ranges of one round having the same time; TRUTH
time_s, x, y, z. All in metres and seconds of one clock. Then: mine-loc replay OUT, mine-loc evaluate.
"""

import csv
import itertools
import sys
from pathlib import Path

import numpy as np

from mine_loc_bringup.nodes.recording_bag import write_recording
from mine_loc_bringup.recordings.recording import START_NS, Instant, Recording, TrueTrack, site_content, upright
from mine_loc_uwb.ranging import Range, RangingRound

PERSON, TAG_HEIGHT_M = "surveyor", 1.2


def rows(file: str) -> list[dict[str, float]]:
    """Numbers by column."""
    with Path(file).open(newline="", encoding="utf-8") as stream:
        return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(stream)]


def stamp_ns(row: dict[str, float]) -> int:
    """Integer nanoseconds of ROS time: where a clock begins does not matter, that all share it does."""
    return START_NS + round(row["time_s"] * 1e9)


def recording(anchors_file: str, ranges_file: str, truth_file: str) -> Recording:
    """What our drivers would have published, and the truth beside it."""
    anchors_m = {int(row["id"]): (row["x"], row["y"], row["z"]) for row in rows(anchors_file)}
    rounds = []
    for number, (at_ns, group) in enumerate(itertools.groupby(rows(ranges_file), stamp_ns)):
        measured = list(group)
        tag = int(measured[0]["tag"])
        ranges = tuple(Range(int(row["anchor"]), row["range_m"]) for row in measured)
        # This clock knows the measurement and not its arrival: both are the same instant.
        rounds.append((Instant(at_ns, at_ns), RangingRound(tag, tag, number, None, ranges, corrected=False)))
    truth = rows(truth_file)
    track = TrueTrack(
        PERSON,
        "map",  # or a name of its own, where the truth is not in the frame of the anchors: evaluate --align rigid
        np.array([stamp_ns(row) for row in truth]),
        np.array([(row["x"], row["y"], row["z"]) for row in truth]),
        upright(len(truth)),
    )
    person = {"name": PERSON, "tag_id": rounds[0][1].tag_id, "height_m": 1.75}
    return Recording(
        "survey", site_content("survey", anchors_m, tag_height_m=TAG_HEIGHT_M), [person], rounds, tracks=[track]
    )


if __name__ == "__main__":
    written = list(write_recording(recording(*sys.argv[1:4]), sys.argv[2], Path(sys.argv[4])))
    print(f"{sys.argv[4]}: {len(written)} messages")
