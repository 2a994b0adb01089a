"""Labelled windows of recorded and simulated walks, and mine-loc train-activity on a folder of them."""

import gzip
import itertools
import json
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from mine_loc_bringup.activity import training_set
from mine_loc_bringup.activity.recordings import marks, recorded_windows, recording_names
from mine_loc_bringup.activity.simulated_walks import simulated_windows
from mine_loc_bringup.main import main
from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.activity import ActivityKind
from mine_loc_pdr.activity_features import log_vertical_sd
from mine_loc_pdr.activity_model_file import load_model
from mine_loc_pdr.activity_window import BINS

BEGIN, TURN_BEGIN, TURN_END, END = 600, 1600, 1760, 2760  # samples at 100 Hz


def write_recording(folder: Path, name: str, *, person: int = 1, side: float = 1.0) -> None:
    """Stand 6 s, walk 10 s, turn by 180° in 1.6 s, walk back, with the sensor's X up and its Z backwards."""
    n = np.arange(END + 100)
    up = np.where((n > BEGIN) & (n < END), 2.5 * np.sin(2 * np.pi * 1.8 * n / 100), 0.0)
    turn_rate = np.where((n >= TURN_BEGIN) & (n < TURN_END), side * math.pi / 1.6, 0.0)
    zero = np.zeros(len(n))
    table = np.column_stack([n, 9.80665 + up, zero, zero, turn_rate, zero, zero])
    lines = ["Acquisition frequency: 100 Hz", "PacketCounter Acc_X Acc_Y Acc_Z Gyr_X Gyr_Y Gyr_Z"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in table]
    with gzip.open(folder / f"{name}_lb.txt.gz", "wt") as file:
        file.write("\n".join(lines) + "\n")
    truth = {"Subject": person, "TrialBoundaries": [BEGIN, END], "UTurnBoundaries": [TURN_BEGIN, TURN_END]}
    (folder / f"{name}.json").write_text(json.dumps(truth))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_recording_gives_labelled_windows_whose_turn_has_the_side_it_was_made_to(tmp_path: Path, side: float):
    write_recording(tmp_path, "1-1", person=4, side=side)
    windows = list(recorded_windows(tmp_path, "1-1"))
    assert {each.person for each in windows} == {"recorded 4"}
    for each in windows:
        turn_deg = side * math.degrees(each.window.turn_rad)
        if each.label == ActivityKind.TURNING:
            assert turn_deg > 85.0
        elif each.label != ActivityKind.UNKNOWN:
            assert abs(turn_deg) < 1.0
        assert (log_vertical_sd(each.window) < math.log(0.1)) == (each.label == ActivityKind.STANDING) or each.place < 0
    assert {each.label for each in windows} == set(ActivityKind)


def test_place_nought_is_the_first_window_that_begins_in_the_walk(tmp_path: Path):
    write_recording(tmp_path, "1-1")
    _, walk = marks(tmp_path, "1-1")
    first = next(each for each in recorded_windows(tmp_path, "1-1") if each.place == 0)
    assert first.window.end_ns - 4 * 10**9 == walk.begin_ns
    assert first.label == ActivityKind.STRAIGHT


def test_what_is_no_recording_is_refused_by_name(tmp_path: Path):
    with pytest.raises(ConfigurationError, match="no recordings"):
        recording_names(tmp_path)
    write_recording(tmp_path, "1-1")
    (tmp_path / "1-1.json").write_text('{"Subject": 1, "TrialBoundaries": [1, 2]}')
    with pytest.raises(ConfigurationError, match=r"1-1\.json.*UTurnBoundaries"):
        marks(tmp_path, "1-1")
    write_recording(tmp_path, "1-1")
    (tmp_path / "1-1_lb.txt.gz").write_bytes(b"no gzip")
    with pytest.raises(ConfigurationError, match=r"1-1_lb\.txt\.gz"):
        list(recorded_windows(tmp_path, "1-1"))


def test_a_simulated_walk_has_every_kind_of_window_and_its_turns_are_those_of_the_waist():
    windows = list(simulated_windows(3, 120.0))
    counts = Counter(each.label for each in windows)
    assert min(counts[kind] for kind in ActivityKind if kind != ActivityKind.UNKNOWN) > 10
    for each in windows:
        greatest_deg = math.degrees(float(np.ptp(each.window.heading_rad)))
        if each.decidable and each.label == ActivityKind.TURNING:
            assert greatest_deg > 22.5
        if each.label == ActivityKind.STANDING and each.decidable:
            assert math.exp(log_vertical_sd(each.window)) < 0.45


def test_another_seed_is_another_person_and_the_same_seed_the_same():
    one, same, other = (list(itertools.islice(simulated_windows(seed, 20.0), 40)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one[-1].window.heading_rad, same[-1].window.heading_rad)
    assert not np.array_equal(one[-1].window.heading_rad, other[-1].window.heading_rad)


def test_one_window_a_second_with_a_label_is_taught(tmp_path: Path):
    write_recording(tmp_path, "1-1")
    windows = training_set.of_recordings(tmp_path)
    taught = training_set.taught(windows)
    assert {each.place % (BINS // 4) for each in taught} == {0}
    assert ActivityKind.UNKNOWN not in {each.label for each in taught}
    assert 5 < len(taught) < len(windows) / 4


def test_the_command_writes_a_model_that_knows_turns_with_a_card_of_its_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(training_set, "SIMULATED_PEOPLE", 3)
    monkeypatch.setattr(training_set, "WALKED_S", 60.0)
    folder = tmp_path / "walks"
    folder.mkdir()
    for person in range(1, 4):
        write_recording(folder, f"{person}-1", person=person)
    out = tmp_path / "activity.npz"
    assert main(["train-activity", str(folder), "--out", str(out)]) == 0
    assert "balanced_accuracy" in capsys.readouterr().out
    model, card = load_model(out)
    assert (card["recorded_people"], card["simulated_people"]) == (3, 3)
    assert card["windows"]["turning"] > 3
    for each in recorded_windows(folder, "2-1"):
        if each.label != ActivityKind.UNKNOWN:
            assert model.judge(each.window).kind == each.label


def test_the_command_says_what_is_wrong_with_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(training_set, "SIMULATED_PEOPLE", 0)
    assert main(["train-activity", str(tmp_path), "--out", str(tmp_path / "a.npz")]) == 2
    assert not (tmp_path / "a.npz").exists()
