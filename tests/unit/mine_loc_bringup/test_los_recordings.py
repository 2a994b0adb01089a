"""Labelled recordings from a folder, an eWINE-style CSV and a simulated bag; the commands that train and score."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mine_loc_bringup.los.recordings import read_recording
from mine_loc_bringup.los.train import clear, fit, resume_folder
from mine_loc_bringup.main import main
from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.labelled_frames import training_set
from mine_loc_uwb.los_model_file import load_model
from mine_loc_uwb.los_training import TrainingOptions

QUICK = TrainingOptions(steps=10, check_every=5, batch=16, inner_folds=2)


def write_folder(folder: Path, *, placements: int = 8, frames: int = 6, drop: str = "", cir=None) -> Path:
    """LOS placements are strong and peak at once, NLOS ones are weak and peak late."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(1)
    rows, accumulators = [], []
    for place in range(placements):
        for _ in range(frames):
            samples = 30.0 * rng.standard_normal((1016, 2))
            samples[746 if place % 2 == 0 else 755, 0] += 12_000
            samples[746, 0] += 2_000
            accumulators.append(samples.astype(np.int16))
            level = -80.0 if place % 2 == 0 else -88.0
            row = {"label": "NLOS" if place % 2 else "LOS", "config": place, "fp_idx": 745.0, "psc": 400}
            rows.append(row | {"rsl_dbm": level, "fsl_dbm": level - 4, "dist_m": 4.0})
    columns = [name for name in rows[0] if name != drop]
    lines = [",".join(columns)] + [",".join(str(row[name]) for name in columns) for row in rows]
    (folder / "frames.csv").write_text("\n".join(lines) + "\n")
    np.savez(folder / "cir_iq.npz", cir=np.array(accumulators) if cir is None else cir)
    return folder


def test_a_folder_is_read_with_what_it_has(tmp_path):
    found = read_recording(write_folder(tmp_path / "a", drop="dist_m"))
    assert found.frames.samples.shape == (48, 1016, 2)
    assert found.allowed[0].tolist() == [False, False, True, True]
    assert found.allowed[-1].tolist() == [True, True, False, False]
    assert np.isnan(found.frames.range_m).all()
    assert np.unique(found.placement).tolist() == list(range(8))


@pytest.mark.parametrize("missing", ["label", "config", "fp_idx", "psc"])
def test_a_column_that_is_needed_is_named(tmp_path, missing):
    with pytest.raises(ConfigurationError, match=f"no column {missing}"):
        read_recording(write_folder(tmp_path / "a", drop=missing))


@pytest.mark.parametrize(
    "cir", [np.zeros((3, 8, 2), np.int16), np.zeros((48, 8, 2)), np.array([{"a": 1}] * 48, object)]
)
def test_accumulators_of_another_shape_or_pickled_are_refused(tmp_path, cir):
    with pytest.raises(ConfigurationError, match="cir"):
        read_recording(write_folder(tmp_path / "a", cir=cir))


def test_what_is_no_recording_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="no labelled recording; allowed: a folder"):
        read_recording(tmp_path)


def test_an_ewine_style_csv_is_read(tmp_path):
    path = tmp_path / "e.csv"
    names = ["NLOS", "RANGE", "FP_IDX", "STDEV_NOISE", "RXPACC", "CH", *(f"CIR{number}" for number in range(1016))]
    values = [1, 6.5, 749, 60, 1024, 2, *(9000 if number == 750 else 50 for number in range(1016))]
    path.write_text(",".join(names) + "\n" + ",".join(map(str, values)) + "\n")
    found = read_recording(path)
    assert found.frames.samples[0, 750].tolist() == [9000, 0]
    assert (found.frames.range_m[0], found.frames.noise_std[0], found.frames.symbols[0]) == (6.5, 60.0, 1024.0)
    assert found.allowed.tolist() == [[True, True, False, False]]
    assert len(training_set([found])[0].input) == 1


def test_frames_that_cannot_be_read_are_counted_and_left_out(tmp_path):
    folder = write_folder(tmp_path / "a")
    lines = (folder / "frames.csv").read_text().splitlines()
    lines[1] = lines[1].replace("745.0", "")
    (folder / "frames.csv").write_text("\n".join(lines) + "\n")
    data, refused = training_set([read_recording(folder)])
    assert (len(data.input), dict(refused)) == (47, {"no_first_path": 1})


def test_an_interrupted_run_goes_on_with_the_folds_that_are_finished(tmp_path):
    data, _ = training_set([read_recording(write_folder(tmp_path / "a"))])
    folder = resume_folder(tmp_path / "m.safetensors", {"seed": 1})
    steps: list[int] = []

    def interrupted(count: int) -> None:
        steps.append(count)
        if len(steps) == 15:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(data, QUICK, 1, None, resume=folder, progress=interrupted)
    assert [path.name for path in folder.glob("*.npz")] == ["fold_0.npz"]
    resumed: list[int] = []
    network, chosen = fit(data, QUICK, 1, None, resume=folder, progress=resumed.append)
    assert resumed[0] == QUICK.steps  # the finished fold, at once
    straight, _ = fit(data, QUICK, 1, None)
    assert all((a == b).all() for a, b in zip(network.parameters(), straight.parameters(), strict=True))
    assert chosen.steps in (5, 10)
    assert resume_folder(tmp_path / "m.safetensors", {"seed": 2}) == folder
    assert list(folder.glob("*.npz")) == []
    clear(folder)


def test_the_commands_train_and_score(tmp_path, capfd):
    folder, model, report = write_folder(tmp_path / "a"), tmp_path / "m.safetensors", tmp_path / "r.json"
    assert main(["train-los", str(folder), "--out", str(model), "--no-simulated"]) == 0
    _, card = load_model(model)
    assert (card["data"], card["frames"], card["placements"]) == (["a"], 48, 8)
    assert not model.with_name("m.safetensors.partial").exists()
    assert main(["evaluate-los", str(folder), "--model", str(model), "--json", str(report)]) == 0
    assert "trained on this recording" in capfd.readouterr().out
    found = json.loads(report.read_text())
    assert found["trained_on_this"] is True
    assert found["balanced_accuracy"] > 0.9
    assert set(found["placements"]) == {str(place) for place in range(8)}
    assert report.with_suffix(".png").read_bytes()[:4] == b"\x89PNG"


def test_too_few_placements_are_refused(tmp_path, capfd):
    folder = write_folder(tmp_path / "a", placements=2)
    assert main(["train-los", str(folder), "--out", str(tmp_path / "m")]) == 2
    assert "too few placements; allowed: 3 or more LOS ones" in capfd.readouterr().err


def test_a_simulated_bag_is_a_labelled_recording(tmp_path):
    pytest.importorskip("rclpy")
    bag = tmp_path / "bag"
    command = [sys.executable, "-m", "mine_loc_bringup.main", "simulate", "--site", "config/vehicle", "--people", "2"]
    command += ["--cir", "--seconds", "2", "--bag", str(bag)]
    subprocess.run(command, check=True, capture_output=True, timeout=50, cwd=Path(__file__).parents[3])
    found = read_recording(bag)
    assert len(found.frames) > 50
    assert (found.allowed.sum(axis=1) == 1).all()
    assert np.isfinite(found.frames.range_m).all()
    assert len(training_set([found])[0].input) == len(found.frames)


@pytest.mark.data
def test_the_public_recording_has_27_placements_and_every_frame_can_be_read():
    folder = os.environ.get("MINE_LOC_DATA")
    if folder is None:
        pytest.skip("MINE_LOC_DATA is not set")
    data, refused = training_set([read_recording(Path(folder) / "uwb_cirs_2018")])
    assert (len(data.input), len(np.unique(data.placement)), dict(refused)) == (7934, 27, {})
    assert data.allowed.sum(axis=0).tolist() == [2654, 3071, 2209, 2209]
