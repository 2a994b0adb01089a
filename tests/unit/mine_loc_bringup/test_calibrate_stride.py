"""mine-loc calibrate-stride: the scale of a person from bags of walks of known length."""

import math
import re
from pathlib import Path

import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu

from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_bringup.main import main
from mine_loc_core.people import load_people
from mine_loc_pdr.stride import PendulumStrideModel

PERIOD_NS = 10_000_000
PEOPLE = "schema: 1\npeople:\n  - {name: ann, height_m: 1.7, n100: {port: /dev/n100}}\n"


def bag_of_a_walk(path: Path, *, seconds: float, person: str = "ann") -> Path:
    """Stand 3 s, walk so long at 1.8 steps a second, stand 1 s."""
    writer = BagWriter(path)
    for k in range(round((seconds + 4.0) * 100)):
        t = k * 0.01 - 3.0
        message = Imu()
        stamp_ns = 10**18 + k * PERIOD_NS
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        phase = 2 * math.pi * 1.8 * t
        message.linear_acceleration.z = 9.80665
        if 0.0 < t < seconds:  # the pelvis bounces once a step, sways and rolls once a stride
            message.linear_acceleration.z += 2.5 * math.sin(phase)
            message.linear_acceleration.y = 1.2 * math.sin(0.5 * phase)
            message.angular_velocity.x = -0.4 * math.cos(0.5 * phase)
        writer.write(f"{person}/imu/data", Imu, stamp_ns, serialize_message(message))
    writer.close()
    return path


@pytest.fixture
def site(tmp_path: Path) -> Path:
    folder = tmp_path / "site"
    folder.mkdir()
    (folder / "people.yaml").write_text(PEOPLE, "utf-8")
    return folder


def test_the_printed_line_gives_the_walk_its_length(tmp_path: Path, site: Path, capfd: pytest.CaptureFixture[str]):
    walk = bag_of_a_walk(tmp_path / "walk", seconds=20.0)
    assert main(["calibrate-stride", "--site", str(site), "--person", "ann", f"{walk}=20"]) == 0
    told = capfd.readouterr().out
    line = re.search(r"stride: \{model: pendulum, k: [\d.]+\}", told)
    assert line is not None
    (site / "people.yaml").write_text(PEOPLE.replace("height_m: 1.7", f"height_m: 1.7, {line[0]}"), "utf-8")
    (ann,) = load_people(site)
    usual_m = PendulumStrideModel(1.7, ann.stride.k).length_m(1.8, 5.0)
    assert 34.5 * usual_m == pytest.approx(20.0, rel=0.02)  # half the first; after the last bounce no strike follows


def test_a_longer_walk_in_as_many_steps_gives_a_greater_scale(
    tmp_path: Path, site: Path, capfd: pytest.CaptureFixture[str]
):
    walk = bag_of_a_walk(tmp_path / "walk", seconds=20.0)
    found = []
    for metres in (20.0, 24.0):
        main(["calibrate-stride", "--site", str(site), "--person", "ann", "--model", "paper_b", f"{walk}={metres}"])
        found.append(float(re.search(r"k = ([\d.]+), standard", capfd.readouterr().out)[1]))
    assert found[1] / found[0] == pytest.approx(1.2, abs=0.01)


def test_what_is_wrong_is_named(tmp_path: Path, site: Path, capfd: pytest.CaptureFixture[str]):
    short = bag_of_a_walk(tmp_path / "short", seconds=3.0)
    other = bag_of_a_walk(tmp_path / "other", seconds=3.0, person="bob")
    for words, says in (
        (["--person", "eve", f"{short}=20"], "--person: eve; allowed: ann"),
        (["--person", "ann", f"{short}=20"], "steps found; allowed"),
        (["--person", "ann", f"{short}"], "BAG=METRES"),
        (["--person", "ann", f"{short}=-3"], "BAG=METRES"),
        (["--person", "ann", f"{other}=20"], "no topic /ann/imu/data"),
        (["--person", "ann", f"{tmp_path / 'none'}=20"], "allowed: a folder of rosbag2 or a .bag file"),
    ):
        assert main(["calibrate-stride", "--site", str(site), *words]) == 2
        assert says in capfd.readouterr().err
