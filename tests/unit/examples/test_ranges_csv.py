"""The example of an importer makes a bag that can be read, with its site."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader

from mine_loc_core.site import load_site

EXAMPLE = Path(__file__).parents[3] / "examples" / "importer" / "ranges_csv.py"


def test_a_survey_in_csv_becomes_a_bag(tmp_path: Path):
    (tmp_path / "anchors.csv").write_text("id,x,y,z\n1,0,0,2\n2,5,0,2\n")
    (tmp_path / "ranges.csv").write_text("time_s,tag,anchor,range_m\n0.0,9,1,2.5\n0.0,9,2,3.5\n0.1,9,1,2.6\n")
    (tmp_path / "truth.csv").write_text("time_s,x,y,z\n0.0,1,1,0\n0.1,1,1.1,0\n")
    files = [str(tmp_path / name) for name in ("anchors.csv", "ranges.csv", "truth.csv", "bag")]
    subprocess.run([sys.executable, str(EXAMPLE), *files], check=True, timeout=50)
    with AnyReader([tmp_path / "bag"]) as reader:
        messages = [(c.topic, reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages()]
    ranges = [[item.range_raw for item in message.ranges] for topic, message in messages if topic == "/uwb/ranges"]
    assert ranges == [[2.5, 3.5], [2.6]]
    y = [message.pose.position.y for topic, message in messages if topic == "/truth/surveyor/pose"]
    assert np.allclose(y, [1.0, 1.1])
    assert [anchor.id for anchor in load_site(tmp_path / "bag" / "site").anchors] == [1, 2]
