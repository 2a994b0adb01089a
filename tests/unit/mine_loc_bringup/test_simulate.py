import dataclasses
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from mine_loc_bringup.main import main
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site

CONFIG = Path(__file__).parents[3] / "config"
VEHICLE = str(CONFIG / "vehicle")
QUICK = ["simulate", "--site", VEHICLE, "--people", "2", "--cir", "--round-rate", "2"]


def test_playing_writes_a_site_that_points_to_its_lines_and_people(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    assert main([*QUICK, "--seconds", "1", "--speed", "50", "--out", str(tmp_path)]) == 0
    told = capfd.readouterr().out
    assert f"mine-loc up --site {tmp_path / 'site'}" in told
    site, people = load_site(tmp_path / "site"), load_people(tmp_path / "site")
    assert site.uwb_receivers[0].port == str(tmp_path / "ports" / "vehicle")
    assert [person.name for person in people] == ["spotter", "helper"]
    spotter = people.by_name("spotter")
    assert spotter is not None
    assert spotter.n100 is not None
    assert spotter.n100.port == str(tmp_path / "ports" / "spotter_n100")


def test_with_tcp_the_lines_are_ports_of_this_host(tmp_path: Path):
    assert main([*QUICK, "--tcp", "--seconds", "1", "--speed", "50", "--out", str(tmp_path)]) == 0
    assert load_site(tmp_path / "site").uwb_receivers[0].port.startswith("socket://127.0.0.1:")


def test_a_site_with_monitors_has_a_line_of_each(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    field = ["simulate", "--site", str(CONFIG / "field_15km"), "--people", "3", "--seconds", "1", "--speed", "50"]
    assert main([*field, "--tcp", "--out", str(tmp_path)]) == 0
    told = capfd.readouterr().out
    for monitor in range(1, 9):
        assert re.search(rf"monitor_{monitor}\b.*\bmldf\b.*socket://127\.0\.0\.1:\d+", told)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--fault", "fire@1+1"], "no such kind"),
        (["--speed", "0"], "--speed: 0; allowed"),
        (["--seconds", "0"], "seconds: 0; allowed"),
        (["--people", "0"], "people: 0; allowed"),
    ],
)
def test_what_is_wrong_is_told_and_nothing_starts(
    words: list[str], told: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    assert main([*QUICK, *words, "--out", str(tmp_path / "out")]) == 2
    assert told in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


def plain(value: Any) -> Any:
    """A message as nested tuples that compare; the padding between its fields on the wire is arbitrary."""
    if dataclasses.is_dataclass(value):
        return tuple(plain(getattr(value, field.name)) for field in dataclasses.fields(value))
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, list):
        return tuple(plain(each) for each in value)
    return repr(value)


def written(folder: Path, *words: str) -> dict[str, list[tuple[int, Any]]]:
    """Messages of a bag by topic, made in a process of its own as a user would."""
    command = [sys.executable, "-m", "mine_loc_bringup.main", *QUICK, "--seconds", "2", "--bag", str(folder), *words]
    subprocess.run(command, check=True, capture_output=True, timeout=50)
    topics: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([folder]) as reader:
        for connection, stamp_ns, raw in reader.messages():
            message = plain(reader.deserialize(raw, connection.msgtype))
            topics.setdefault(connection.topic, []).append((stamp_ns, message))
    return topics


def test_a_bag_holds_what_the_drivers_would_publish_and_the_truth_the_same_each_time(tmp_path: Path):
    first, again = written(tmp_path / "one"), written(tmp_path / "two")
    assert set(first) == {
        "/uwb/ranges",
        "/uwb/cir",
        "/spotter/imu/data",
        "/spotter/imu/mag",
        "/truth/spotter/pose",
        "/truth/helper/pose",
        "/truth/link_state",
    } | ({"/truth/steps"} & set(first))
    assert len(first["/truth/spotter/pose"]) == 100
    assert len(first["/spotter/imu/data"]) == pytest.approx(200, abs=2)
    assert 6 <= len(first["/uwb/ranges"]) <= 8
    assert first == again


def test_an_existing_bag_is_not_written_over(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    assert main([*QUICK, "--bag", str(tmp_path)]) == 2
    assert "is there already" in capfd.readouterr().err
