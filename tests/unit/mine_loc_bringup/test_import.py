"""mine-loc import: public recordings become bags in our topics, and what is missing or wrong is named."""

import gzip
import hashlib
import itertools
import json
import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader

from mine_loc_bringup.los.recordings import read_folder
from mine_loc_bringup.main import main
from mine_loc_bringup.nodes.labelled_bag import read_bag as read_labelled
from mine_loc_bringup.range_pairs_bag import read_bag as read_pairs
from mine_loc_bringup.recordings.uwb_cirs import unwrapped_s
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site

CONFIG = Path(__file__).parents[3] / "config"


def stamp_ns(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def read(bag: Path) -> dict[str, list]:
    """(log time, message) by topic."""
    found: dict[str, list] = {}
    with AnyReader([bag]) as reader:
        for connection, at_ns, raw in reader.messages():
            found.setdefault(connection.topic, []).append((at_ns, reader.deserialize(raw, connection.msgtype)))
    return found


def imported(which: str, source: Path, out: Path, name: str) -> tuple[dict[str, list], Path]:
    """Import one recording; what is in the bag, and its folder, whose site files are good and whose stamps are sane."""
    assert main(["import", which, str(source), str(out), "--recording", name]) == 0
    bag = out / name
    assert [path.name for path in out.iterdir()] == [name]
    load_site(bag / "site")
    load_people(bag / "site")
    found = read(bag)
    for messages in found.values():
        assert all(stamp_ns(message) <= at_ns for at_ns, message in messages)
        assert all(a[0] <= b[0] for a, b in itertools.pairwise(messages))
    return found, bag


def public(name: str) -> Path:
    folder = Path(os.environ.get("MINE_LOC_DATA", ""), name)
    if not os.environ.get("MINE_LOC_DATA") or not folder.is_dir():
        pytest.skip(f"MINE_LOC_DATA names no folder with {name}")
    return folder


def trek_folder(tmp_path: Path, text: str) -> Path:
    logs = tmp_path / "exp_data" / "UWB_data_Ranges"
    logs.mkdir(parents=True)
    (logs / "output_range_uwb_4vba2.txt").write_text(text)
    return tmp_path


def test_a_trek1000_log_becomes_rounds_with_labelled_links(tmp_path):
    source = trek_folder(tmp_path / "in", "120000100 0 5000 4000 0 3000\n120000200 0 5010 4010 4020 3010\n")
    found, bag = imported("trek1000", source, tmp_path / "out", "4vba2")
    (first_ns, first), (second_ns, _) = found["/uwb/ranges"]
    assert second_ns - first_ns == 100_000_000
    assert (first.tag_id, first.reporter_id) == (1, 1)
    assert [item.anchor_id for item in first.ranges] == [1, 2, 3, 4]
    assert [item.range_raw for item in first.ranges] == pytest.approx([5.0, 4.0, np.nan, 3.0], nan_ok=True)
    blocked = {message.anchor_id: message.class_probability.tolist() for _, message in found["/truth/link_state"]}
    assert blocked == {3: [0, 1, 0, 0], **{key: [0, 0, 0.5, 0.5] for key in (1, 2, 4)}}
    places = {anchor.id: anchor.position_m for anchor in load_site(CONFIG / "trek_lab").anchors}
    assert {anchor.id: anchor.position_m for anchor in load_site(bag / "site").anchors} == places


def test_nothing_is_left_of_an_import_that_fails_and_nothing_is_written_over(tmp_path, capsys):
    source = trek_folder(tmp_path / "in", "no numbers\n")
    words = ["import", "trek1000", str(source), str(tmp_path / "out")]
    assert main(words) == 2
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert "output_range_uwb_4vba2.txt" in line
    assert "allowed: rows of HHMMSSmmm" in line
    assert not (tmp_path / "out").exists()
    (source / "exp_data" / "UWB_data_Ranges" / "output_range_uwb_4vba2.txt").write_text("120000100 0 5000 1 1 1\n")
    assert main(words) == 0
    assert main(words) == 2
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("which", "missing"),
    [
        ("trek1000", "output_range_uwb"),
        ("hanyang", "Dynamic_measurements/LOS"),
        ("isas", "ISAS-Walk"),
        ("ipol", "NAME_lb.txt"),
        ("uwb-cirs", "frames.csv"),
    ],
)
def test_a_folder_without_the_set_is_refused_by_what_is_missing(tmp_path, capsys, which, missing):
    assert main(["import", which, str(tmp_path), str(tmp_path / "out")]) == 2
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.startswith(str(tmp_path))
    assert missing in line
    assert main(["import", which, str(tmp_path / "nowhere"), str(tmp_path / "out")]) == 2
    assert "published at https://" in capsys.readouterr().err


def test_an_unknown_recording_and_files_of_the_wrong_kind_are_named(tmp_path, capsys):
    source = trek_folder(tmp_path / "trek", "120000100 0 5000 4000 1 3000\n")
    assert main(["import", "trek1000", str(source), str(tmp_path / "out"), "--recording", "m9"]) == 2
    assert "allowed: 4vba2" in capsys.readouterr().err
    gait = tmp_path / "gait"
    gait.mkdir()
    (gait / "1-1.json").write_text(json.dumps({"Subject": 1}))
    (gait / "1-1_lb.txt.gz").write_bytes(gzip.compress(b"rate\nheading\n1 2 3\n"))
    assert main(["import", "ipol", str(gait), str(tmp_path / "out")]) == 2
    assert "TrialBoundaries" in capsys.readouterr().err
    bags = tmp_path / "isas" / "dataset"
    bags.mkdir(parents=True)
    (bags / "ISAS-Walk7.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    assert main(["import", "isas", str(tmp_path / "isas"), str(tmp_path / "out")]) == 2
    assert "ISAS-Walk7.bag" in capsys.readouterr().err


def test_a_receivers_time_is_unwrapped():
    assert unwrapped_s([17.0, 17.2, 0.1, 0.5]) == pytest.approx(
        [0.0, 0.2, 0.2 + 0.1 + 17.207401 - 17.2, 0.7074], abs=1e-4
    )


@pytest.mark.data
def test_the_public_files_are_those_of_the_published_hashes():
    root = public("trek1000_bielefeld").parent
    lines = (Path(__file__).parents[3] / "docs" / "data.sha256").read_text().splitlines()
    known = {name: digest for digest, name in (line.split("  ") for line in lines)}
    here = {name: hashlib.sha256((root / name).read_bytes()).hexdigest() for name in known if (root / name).is_file()}
    assert len(here) > 200
    assert here.items() <= known.items()


@pytest.mark.data
def test_trek1000_has_the_ranges_of_the_log_and_the_track_of_vicon(tmp_path):
    found, bag = imported("trek1000", public("trek1000_bielefeld"), tmp_path, "m2r")
    assert len(found["/uwb/ranges"]) == 690
    assert len(found["/truth/walker/pose"]) == 12520
    assert found["/truth/walker/pose"][0][1].header.frame_id == "vicon"
    begins_s = (found["/uwb/ranges"][0][0] - found["/truth/walker/pose"][0][0]) / 1e9
    assert 0.0 < begins_s < 10.0  # so near that the offset is within the search of mine-loc evaluate
    assert load_people(bag / "site").by_tag(1).name == "walker"


@pytest.mark.data
def test_hanyang_has_whole_rounds_whose_stamps_are_late_by_what_is_known(tmp_path):
    found, bag = imported("hanyang", public("hanyang_outdoor_uwb"), tmp_path, "LOS_B3")
    rounds = [message for _, message in found["/uwb/ranges"]]
    assert sum(len(message.ranges) for message in rounds) == 1538 + 1687 + 1691 + 1729
    assert Counter(len(message.ranges) for message in rounds)[4] > 0.5 * len(rounds)
    assert all(abs(item.stamp_offset_ns) < 50_000_000 for message in rounds for item in message.ranges)
    pairs, latencies = read_pairs(bag, bag / "site")
    assert 0.12 < latencies[0].latency_s < 0.25
    assert abs(np.median(pairs.measured_m - pairs.true_m)) < 0.3


@pytest.mark.data
def test_isas_is_read_from_its_ros_1_bag(tmp_path):
    found, bag = imported("isas", public("isas_walk_uwb_imu"), tmp_path, "ISAS-Walk1")
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/uwb/ranges": 970,
        "/carrier/imu/data": 4839,
        "/truth/carrier/pose": 3168,
    }
    valid = sum(np.isfinite(item.range_raw) for _, message in found["/uwb/ranges"] for item in message.ranges)
    assert valid == 4266
    force = [message.linear_acceleration for _, message in found["/carrier/imu/data"]]
    assert np.mean([each.z for each in force]) == pytest.approx(9.8, abs=0.3)
    expected = {anchor.id: anchor.position_m for anchor in load_site(CONFIG / "isas_walk").anchors}
    assert {anchor.id: anchor.position_m for anchor in load_site(bag / "site").anchors} == expected


@pytest.mark.data
def test_ipol_has_samples_field_and_marked_steps(tmp_path):
    found, bag = imported("ipol", public("ipol_gait_lowerback"), tmp_path, "1-1")
    assert len(found["/truth/steps"]) == 35
    samples = [message for _, message in found["/walker/imu/data"]]
    up = np.mean([message.linear_acceleration.z for message in samples])
    assert 7.0 < up < 10.0
    field = [message.magnetic_field for _, message in found["/walker/imu/mag"]]
    assert len(field) == len(samples)
    assert np.mean([np.hypot(np.hypot(each.x, each.y), each.z) for each in field]) == pytest.approx(45e-6, abs=15e-6)
    assert load_people(bag / "site").by_name("walker").height_m == 1.75


@pytest.mark.data
def test_uwb_cirs_read_from_the_bag_are_those_of_the_folder(tmp_path):
    source = public("uwb_cirs_2018")
    found, bag = imported("uwb-cirs", source, tmp_path, "placement6")
    from_bag, everything = read_labelled(bag), read_folder(source)
    ours = everything.take(np.flatnonzero(everything.placement == 6))
    assert (from_bag.frames.samples == ours.frames.samples).all()
    assert (from_bag.allowed == ours.allowed).all()
    for name in ("first_path_index", "symbols", "receive_power_dbm", "range_m", "channel"):
        assert getattr(from_bag.frames, name) == pytest.approx(getattr(ours.frames, name), rel=1e-6, nan_ok=True)
    rounds = {message.seq: message for _, message in found["/uwb/ranges"]}
    judged = [frame for _, array in found["/uwb/cir"] for frame in array.frames if frame.range_seq in rounds]
    assert len(judged) > len(rounds) > 40
    assert all(rounds[message.range_seq].ranges[0].range_raw == message.range for message in judged)
    site = yaml.safe_load((bag / "site" / "site.yaml").read_text())
    assert site["anchors"][0]["position_m"] == [7.87, 5.61, 0.0]
