"""mine-loc train-steps on a folder of marked walks."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from mine_loc_bringup.main import main
from mine_loc_bringup.step_recordings import marked_walks
from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.step_model_file import load_step_model

BEGIN, END = 600, 1800  # samples at 100 Hz


def write_recording(folder: Path, name: str, person: int = 1) -> None:
    """Stand 6 s and walk 12 s at two steps a second, with the sensor's X up and its Z backwards."""
    n = np.arange(END + 300)
    phase = np.where((n > BEGIN) & (n < END), 2 * np.pi * 2.0 * (n - BEGIN) / 100, 0.0)
    zero = np.zeros(len(n))
    columns = [n, 9.80665 + 2.5 * np.sin(phase), 1.2 * np.sin(phase / 2), zero, zero, zero, 0.4 * np.sin(phase / 2)]
    lines = ["Acquisition frequency: 100 Hz", "PacketCounter Acc_X Acc_Y Acc_Z Gyr_X Gyr_Y Gyr_Z"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in np.column_stack(columns)]
    with gzip.open(folder / f"{name}_lb.txt.gz", "wt") as file:
        file.write("\n".join(lines) + "\n")
    strikes = [[k - 20, k] for k in range(BEGIN + 6, END, 50)]
    truth = {
        "Subject": person,
        "Trial": 1,
        "Height": "170",
        "TrialBoundaries": [BEGIN, END],
        "UTurnBoundaries": [1100, 1200],
    }
    feet = {"LeftFootEvents": strikes[::2], "RightFootEvents": strikes[1::2]}
    (folder / f"{name}.json").write_text(json.dumps(truth | feet))


def test_a_recording_is_motion_with_its_strikes_at_the_peaks_of_it(tmp_path: Path):
    write_recording(tmp_path, "4-1", person=4)
    ((person, motion),) = marked_walks(tmp_path)
    assert person == 4
    assert len(motion.strikes_s) == 24
    assert np.diff(motion.strikes_s) == pytest.approx(0.5)
    frames = np.round((motion.strikes_s + 0.065) / 0.02).astype(int)  # an eighth of a second after the rise: the peak
    assert motion.frames[frames[2:-2], 0].min() > 2.0
    assert motion.strikes_s[-1] < motion.end_s < motion.strikes_s[-1] + 1.1


def test_a_model_is_written_that_loads_and_says_what_it_learnt_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    write_recording(tmp_path, "1-1")
    write_recording(tmp_path, "2-1", person=2)
    out = tmp_path / "models" / "steps.npz"
    assert main(["train-steps", str(tmp_path), "--out", str(out), "--rounds", "2", "--seed", "3"]) == 0
    assert "48 steps of 2 people" in capsys.readouterr().out
    _, card = load_step_model(out)
    assert (card["recorded_people"], card["walks"], card["seed"], card["rounds"]) == (2, 2, 3, 2)


def test_a_folder_without_recordings_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["train-steps", str(tmp_path), "--out", str(tmp_path / "a.npz")]) == 2
    assert "no trials" in capsys.readouterr().err


def test_a_recording_without_strikes_is_refused_by_its_name(tmp_path: Path):
    write_recording(tmp_path, "1-1")
    truth = json.loads((tmp_path / "1-1.json").read_text())
    (tmp_path / "1-1.json").write_text(json.dumps({key: truth[key] for key in ("Subject", "TrialBoundaries")}))
    with pytest.raises(ConfigurationError, match=r"1-1\.json.*LeftFootEvents"):
        list(marked_walks(tmp_path))
