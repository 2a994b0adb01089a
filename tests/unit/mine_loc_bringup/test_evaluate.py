"""mine-loc evaluate on small bags whose errors are known."""

import json
import re
import shutil
import xml.etree.ElementTree as ET
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import yaml
from evaluated_bag import path_m, write_bag
from geometry_msgs.msg import TransformStamped
from mine_loc_interfaces.msg import MeasurementVerdict, PersonPose
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_bringup.evaluation.expectations import load_expectations
from mine_loc_bringup.evaluation.measures import Measures
from mine_loc_bringup.main import main
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.verdicts import Reason
from mine_loc_core.yaml_schema import read_schema
from mine_loc_fusion.mode import Mode

GATE, FROZEN = MeasurementVerdict.GATE, MeasurementVerdict.FROZEN


def off(x_m, y_m):
    return lambda times_s: np.tile([x_m, y_m], (len(times_s), 1))


def figures(tmp_path: Path, *words: str) -> dict:
    assert main(["evaluate", *words, "--json", str(tmp_path / "figures.json")]) == 0
    return json.loads((tmp_path / "figures.json").read_text())


def judged(tmp_path: Path, bag: Path, expected: dict, *words: str) -> int:
    (tmp_path / "expected.yaml").write_text(yaml.safe_dump({"schema": 1} | expected))
    return main(["evaluate", str(bag), "--expect", str(tmp_path / "expected.yaml"), *words])


def refusal(capsys, *words: str) -> str:
    assert main(["evaluate", *words]) == 2
    text = capsys.readouterr().err.strip().splitlines()
    return text[-1]


def test_measures_modes_and_verdicts_of_a_bag(tmp_path):
    bag = write_bag(
        tmp_path / "bag",
        people=("ann", "bob"),
        error_m=off(0.3, 0.4),
        modes=lambda times_s: np.where(times_s < 5.0, PersonPose.COASTING, PersonPose.UWB_ONLY),
        verdicts=[("fused/verdicts", GATE, 3), ("uwb/verdicts", FROZEN, 2), ("uwb/verdicts", FROZEN, 1)],
    )
    found = figures(tmp_path, str(bag))
    assert set(found["people"]) == {"ann", "bob"}
    for one in (found["people"]["ann"], found["together"]):
        assert one["horizontal_mean_m"] == pytest.approx(0.5, abs=1e-3)
        assert one["nees_mean"] == pytest.approx(0.25 / 0.09, rel=0.01)
        assert one["claimed_ce95_holds"] == 1.0
        assert one["latency_p50_ms"] == pytest.approx(20.0)
        assert one["modes"] == {"COASTING": pytest.approx(0.25, abs=0.02), "UWB_ONLY": pytest.approx(0.75, abs=0.02)}
    assert found["people"]["ann"]["time_offset_s"] == pytest.approx(0.0, abs=0.3)
    assert found["people"]["ann"]["alignment"]["time_offset_s"] == 0.0
    assert found["verdicts"] == {"fused": {"RANGE": {"GATE": 3}}, "uwb": {"RANGE": {"FROZEN": 3}}}


def test_plots_are_written(tmp_path):
    bag = write_bag(tmp_path / "bag")
    assert main(["evaluate", str(bag), "--plot", str(tmp_path / "plots")]) == 0
    names = {file.name for file in (tmp_path / "plots").iterdir() if file.read_bytes().startswith(b"\x89PNG")}
    assert names == {"track.png", "error_over_time.png", "error_cdf.png"}


EXPECTED = {
    "people": {"*": {"horizontal_mean_m": {"max": 0.6}, "modes": {"UWB_ONLY": {"min": 0.9}}}},
    "together": {"availability": {"min": 0.99}},
    "verdicts": {"fused": {"GATE": {"min": 1, "max": 3}}},
}


def test_bounds_that_hold_pass_and_are_told_to_the_build_server(tmp_path):
    bag = write_bag(tmp_path / "bag", error_m=off(0.3, 0.4), verdicts=[("fused/verdicts", GATE, 3)])
    assert judged(tmp_path, bag, EXPECTED, "--junit", str(tmp_path / "junit.xml")) == 0
    suites = ET.parse(tmp_path / "junit.xml").getroot()
    assert (suites.get("tests"), suites.get("failures")) == ("4", "0")
    cases = {(case.get("classname"), case.get("name")) for case in suites.iter("testcase")}
    assert ("people.ann", "horizontal_mean_m at most 0.6") in cases
    assert ("verdicts.fused", "GATE at least 1, at most 3") in cases


@pytest.mark.parametrize(
    ("change", "failing"),
    [
        ({"error_m": off(0.6, 0.4)}, "people.ann.horizontal_mean_m"),
        ({"verdicts": []}, "verdicts.fused.GATE"),
        ({"verdicts": [("fused/verdicts", GATE, 4)]}, "verdicts.fused.GATE"),
        ({"verdicts": [("uwb/verdicts", GATE, 3)]}, "verdicts.fused.GATE"),
        ({"modes": lambda t: np.full(len(t), PersonPose.COASTING)}, "people.ann.modes.UWB_ONLY"),
        ({"keep": lambda t: (t < 5.0) | (t > 10.0)}, "together.availability"),
        ({"truth": False}, "people.ann.horizontal_mean_m"),
    ],
)
def test_a_bound_that_does_not_hold_fails_alone(tmp_path, capsys, change, failing):
    bag = write_bag(
        tmp_path / "bag", **({"error_m": off(0.3, 0.4), "verdicts": [("fused/verdicts", GATE, 3)]} | change)
    )
    assert judged(tmp_path, bag, EXPECTED, "--junit", str(tmp_path / "junit.xml")) == 1
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("FAILED")]
    assert failing in line
    suites = ET.parse(tmp_path / "junit.xml").getroot()
    (failed,) = [case for case in suites.iter("testcase") if case.find("failure") is not None]
    assert f"{failed.get('classname')}.{failed.get('name')}".startswith(failing)
    assert suites.get("failures") == "1"


def test_bounds_on_somebody_who_is_not_there_do_not_hold(tmp_path):
    bag = write_bag(tmp_path / "bag")
    assert judged(tmp_path, bag, {"people": {"bob": {"outputs": {"min": 0}}}}) == 1
    assert judged(tmp_path, bag, {"people": {"bob": {"modes": {"LOST": {"max": 1}}}}}) == 1


@pytest.mark.parametrize(
    ("expected", "key", "allowed"),
    [
        (
            {"people": {"*": {"horizontal_mean_mm": {"max": 1}}}},
            "horizontal_mean_mm",
            "use horizontal_mean_m, in metres",
        ),
        ({"people": {"*": {"rmse_m": {"min": 2, "max": 1}}}}, "people.*.rmse_m", "above max 1"),
        ({"people": {"*": {"rmse_m": {}}}}, "people.*.rmse_m", "min, max or both"),
        ({"verdicts": {"fused": {"GATES": {"min": 1}}}}, "verdicts.fused.GATES", "did you mean GATE"),
        ({"verdicts": {"pdr": {}}}, "verdicts.pdr", "fused, uwb"),
        ({"together": {"modes": {"ASLEEP": {"min": 1}}}}, "together.modes.ASLEEP", "UWB_PDR"),
        ({"together": {"rmse_m": {"max": "far"}}}, "together.rmse_m.max", "a number"),
    ],
)
def test_a_bad_file_of_bounds_names_line_key_and_what_is_allowed(tmp_path, capsys, expected, key, allowed):
    assert judged(tmp_path, tmp_path / "nowhere", expected) == 2
    line = capsys.readouterr().err.splitlines()[0]
    assert line.startswith(f"{tmp_path / 'expected.yaml'}:")
    assert key in line
    assert allowed in line


def test_the_example_of_the_docs_is_a_good_file(tmp_path):
    text = (Path(__file__).parents[3] / "docs" / "evaluate.md").read_text("utf-8")
    (example,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "bounds.yaml").write_text(example, "utf-8")
    assert set(load_expectations(tmp_path / "bounds.yaml")["people"]) == {"*", "fitter"}


def test_the_docs_explain_every_measure():
    text = (Path(__file__).parents[3] / "docs" / "evaluate.md").read_text("utf-8")
    ends = ("claimed_ce95_holds_low", "claimed_ce95_holds_high")
    assert [field.name for field in fields(Measures) if field.name not in ends and f"`{field.name}`" not in text] == []


def test_the_schema_knows_every_measure_mode_and_reason():
    definitions = read_schema("expectations")["$defs"]
    assert list(definitions["measures"]["properties"]) == [field.name for field in fields(Measures)]
    assert list(definitions["modes"]["properties"]) == [mode.name for mode in Mode]
    assert list(definitions["reasons"]["properties"]) == [reason.name for reason in Reason]


def test_truth_may_lie_in_another_bag_on_another_topic_of_another_type(tmp_path):
    bag = write_bag(tmp_path / "bag", error_m=off(0.3, 0.4), truth=False)
    writer = BagWriter(tmp_path / "survey")
    for time_s in np.arange(0.0, 20.0, 0.05):
        message = TransformStamped()
        at_ns = 1_700_000_000 * 10**9 + round(float(time_s) * 1e9)
        message.header.stamp, message.header.frame_id = to_time(at_ns), "map"
        place = path_m(np.array([time_s]))[0]
        message.transform.translation.x, message.transform.translation.y = place.tolist()
        writer.write("total_station/ann", TransformStamped, at_ns, serialize_message(message))
    writer.close()
    for topic in ("/total_station/ann", "total_station/<person>"):
        found = figures(tmp_path, str(bag), "--truth-bag", str(tmp_path / "survey"), "--truth", topic)
        assert found["people"]["ann"]["rmse_m"] == pytest.approx(0.5, abs=1e-3)


def test_a_time_offset_and_a_frame_are_removed_only_on_request(tmp_path):
    late = write_bag(tmp_path / "bag", error_m=lambda t: path_m(t - 0.3) - path_m(t) + np.array([5.0, 0.0]))
    asis = figures(tmp_path, str(late))["people"]["ann"]
    rigid = figures(tmp_path, str(late), "--align", "rigid")["people"]["ann"]
    both = figures(tmp_path, str(late), "--align", "rigid", "--apply-time-offset")["people"]["ann"]
    assert asis["rmse_m"] > 4.0
    assert rigid["time_offset_s"] == both["time_offset_s"] == pytest.approx(-0.3, abs=0.01)
    assert both["rmse_m"] < 0.02 < 0.2 < rigid["rmse_m"] < 1.0
    assert (rigid["alignment"]["time_offset_s"], both["alignment"]["time_offset_s"]) == (0.0, both["time_offset_s"])


def test_steps_alone_are_evaluated_without_poses(tmp_path):
    strikes = np.arange(1.0, 11.0, 0.5)
    bag = write_bag(tmp_path / "bag", poses=False, truth=False, steps=[*strikes[1:], 15.0], true_steps=strikes)
    one = figures(tmp_path, str(bag))["people"]["ann"]
    assert (one["steps_true"], one["steps_found"], one["step_count_error"]) == (20, 19, pytest.approx(-0.05))
    assert one["horizontal_mean_m"] is None


def test_outputs_are_due_from_the_first_measurement_on(tmp_path):
    late = lambda times_s: times_s >= 10.0  # noqa: E731
    unmeasured = write_bag(tmp_path / "bag", keep=late)
    assert figures(tmp_path, str(unmeasured))["people"]["ann"]["availability"] == pytest.approx(1.0, abs=0.01)
    measured = write_bag(tmp_path / "measured", keep=late, steps=[0.0])  # which is where measurements end, too
    one = figures(tmp_path, str(measured))["people"]["ann"]
    assert one["availability"] == pytest.approx(0.5, abs=0.01)
    assert one["first_output_s"] == pytest.approx(10.02)


def test_an_sqlite_bag_of_another_writer_reads_the_same(tmp_path):
    bag = write_bag(tmp_path / "bag", error_m=off(0.3, 0.4))
    with (
        AnyReader([bag]) as reader,
        Writer(tmp_path / "sqlite", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer,
    ):
        copies = {
            each.id: writer.add_connection(each.topic, each.msgtype, typestore=reader.typestore)
            for each in reader.connections
        }
        for connection, at_ns, raw in reader.messages():
            writer.write(copies[connection.id], at_ns, raw)
    ours, theirs = (figures(tmp_path, str(each)) for each in (bag, tmp_path / "sqlite"))
    assert ours["people"] == theirs["people"]


def test_what_cannot_be_evaluated_is_one_clear_line(tmp_path, capsys):
    bag = write_bag(tmp_path / "bag")
    assert "no topic /fused/poses" in refusal(capsys, str(write_bag(tmp_path / "truth_only", poses=False)))
    assert str(tmp_path / "nowhere") in refusal(capsys, str(tmp_path / "nowhere"))
    assert "/truth/ann/pose" in refusal(capsys, str(bag), "--truth", "/survey")
    assert "no topic survey/<person>" in refusal(capsys, str(bag), "--truth", "survey/<person>")
    assert "no place" in refusal(capsys, str(bag), "--truth", "/fused/poses")
    assert "allowed: with --expect" in refusal(capsys, str(bag), "--junit", "x.xml")
    two = write_bag(tmp_path / "two", people=("ann", "bob"))
    assert "one topic for 2 people" in refusal(capsys, str(two), "--truth", "/truth/ann/pose")


def test_a_topic_of_the_wrong_type_is_named(tmp_path, capsys):
    writer = BagWriter(tmp_path / "bag")
    writer.write("fused/poses", TransformStamped, 1, serialize_message(TransformStamped()))
    writer.close()
    line = refusal(capsys, str(tmp_path / "bag"))
    assert "/fused/poses is of type geometry_msgs/msg/TransformStamped" in line
    assert "PersonPoseArray" in line


@pytest.mark.parametrize("keep", [0, 8, 200, 5000])
def test_a_truncated_bag_is_refused_by_name(tmp_path, capsys, keep):
    bag = write_bag(tmp_path / "whole")
    shutil.copytree(bag, tmp_path / "cut")
    (file,) = (tmp_path / "cut").glob("*.mcap")
    file.write_bytes(file.read_bytes()[:keep])
    assert str(tmp_path / "cut") in refusal(capsys, str(tmp_path / "cut"))
