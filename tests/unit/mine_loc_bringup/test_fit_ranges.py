import json
from pathlib import Path

import numpy as np
import pytest

from mine_loc_bringup.main import main
from mine_loc_bringup.range_pairs_csv import read_csv
from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.range_correction_file import load_range_correction

LABORATORY = Path(__file__).parents[3] / "config" / "laboratory"


def survey(folder: Path) -> Path:
    """20 places of each label, 20 ranges each: antenna delay 0.3 m, NLOS 1 m more."""
    rng = np.random.default_rng(1)
    lines = ["measured_m,true_m,label,receive_power_dbm,group"]
    for place in range(40):
        label, true_m = ("LOS", "NLOS")[place % 2], 2.0 + place
        for _ in range(20):
            measured_m = true_m + 0.3 + (place % 2) + rng.normal(0.0, 0.03)
            lines.append(f"{measured_m:.3f},{true_m},{label},{rng.normal(-85.0, 2.0):.1f},place {place}")
    file = folder / "survey.csv"
    file.write_text("\n".join(lines) + "\n", "utf-8")
    return file


def test_a_survey_becomes_a_file_that_corrects_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    out, figures = tmp_path / "site" / "ranges.yaml", tmp_path / "ranges.json"
    words = ["fit-ranges", str(survey(tmp_path)), "--out", str(out), "--date", "2026-03-01", "--json", str(figures)]
    assert main([*words, "--plot", str(tmp_path / "ranges.png")]) == 0
    told = capfd.readouterr().out
    assert "held out" in told
    assert "+64 ticks" in told
    assert "date: '2026-03-01'" in out.read_text("utf-8")
    correction = load_range_correction(out)
    assert correction.antenna_offset_m == pytest.approx(0.3, abs=0.01)
    places = np.array([10.3, 21.3])
    found = correction.correct(places, np.full(2, np.nan), np.array([0.0, 1.0]))
    assert found.range_m == pytest.approx([10.0, 20.0], abs=0.05)
    numbers = json.loads(figures.read_text("utf-8"))
    assert numbers["before"]["NLOS"]["mean_m"] == pytest.approx(1.3, abs=0.01)
    assert numbers["held_out"]["LOS"]["mean_absolute_m"] < 0.05
    assert (tmp_path / "ranges.png").stat().st_size > 10_000


def test_several_files_are_fitted_together(tmp_path: Path):
    lines = survey(tmp_path).read_text("utf-8").splitlines()
    for label in ("LOS", "NLOS"):
        rows = [line for line in lines[1:] if line.split(",")[2] == label]
        (tmp_path / f"{label}.csv").write_text("\n".join([lines[0], *rows]), "utf-8")
    both, one = tmp_path / "both.yaml", tmp_path / "one.yaml"
    main(["fit-ranges", str(tmp_path / "LOS.csv"), str(tmp_path / "NLOS.csv"), "--out", str(both)])
    main(["fit-ranges", str(tmp_path / "survey.csv"), "--out", str(one)])
    nlos = [load_range_correction(file).nlos for file in (both, one)]
    assert nlos[0] is not None
    assert nlos[1] is not None
    assert nlos[0].true_range_m(np.array([20.0])) == pytest.approx(nlos[1].true_range_m(np.array([20.0])), abs=0.02)


def test_columns_that_are_absent_have_their_defaults_and_failed_ranges_are_left_out(tmp_path: Path):
    file = tmp_path / "pairs.csv"
    file.write_text("true_m,measured_m,receive_power_dbm\n2,2.5,-inf\n2,nan,-80\n4,,-81\n6,6.5,-82\n", "utf-8")
    pairs = read_csv(file)
    assert pairs.measured_m.tolist() == [2.5, 6.5]
    assert pairs.nlos.all()
    assert np.isnan(pairs.receive_power_dbm[0])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("measured_m,label\n2,LOS\n", ":1: column true_m is missing among ['measured_m', 'label']; allowed:"),
        ("measured_m,true_m,label\n2,2,LOS\n2,2,clear\n", ":3: label: 'clear'; allowed: LOS or NLOS"),
        ("measured_m,true_m\n2,2\ntwo,2\n", ":3: measured_m: 'two'; allowed: a number from -200 to 1000"),
        ("measured_m,true_m\n2500,2\n", ":2: measured_m: 2500; allowed: -200 to 1000"),
        ("measured_m,true_m\n2,nan\n", ":2: true_m: 'nan'; allowed: 0 to 1000"),
        ("measured_m,true_m,receive_power_dbm\n2,2,85\n", ":2: receive_power_dbm: 85; allowed: -200 to 50"),
        ("measured_m,true_m\nnan,2\n", "no row with a measured range"),
        ("", "column measured_m is missing"),
    ],
)
def test_a_mistake_in_a_file_is_told_with_line_column_value_and_what_is_allowed(tmp_path: Path, text: str, told: str):
    file = tmp_path / "pairs.csv"
    file.write_text(text, "utf-8")
    with pytest.raises(ConfigurationError) as refusal:
        read_csv(file)
    assert told in str(refusal.value)
    assert str(file) in str(refusal.value)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nowhere.csv"], "nowhere.csv: cannot be read"),
        (["{folder}"], "--site: missing, but"),
        (["{survey}", "--date", "yesterday"], "--date: 'yesterday'; allowed"),
        (["{survey}", "--max-degree", "11"], "--max-degree: 11; allowed: 1 to 10"),
    ],
)
def test_what_cannot_be_fitted_is_told_and_nothing_is_written(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], words: list[str], told: str
):
    names = {"folder": tmp_path, "survey": survey(tmp_path)}
    out = tmp_path / "out.yaml"
    assert main(["fit-ranges", *(word.format(**names) for word in words), "--out", str(out)]) == 2
    assert told in capfd.readouterr().err
    assert not out.exists()


def test_a_simulated_bag_needs_no_survey(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    bag, out, figures = tmp_path / "walk", tmp_path / "ranges.yaml", tmp_path / "ranges.json"
    site = ["--site", str(LABORATORY)]
    assert main(["simulate", *site, "--people", "2", "--seconds", "20", "--bag", str(bag)]) == 0
    assert main(["fit-ranges", str(bag), *site, "--out", str(out), "--json", str(figures)]) == 0
    assert "stamps" in capfd.readouterr().out
    numbers = json.loads(figures.read_text("utf-8"))
    assert numbers["before"]["LOS"]["pairs"] > 150
    assert numbers["before"]["NLOS"]["mean_absolute_m"] > numbers["held_out"]["NLOS"]["mean_absolute_m"]
    assert load_range_correction(out).nlos is not None


def test_a_bag_of_other_people_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    bag = tmp_path / "walk"
    main(["simulate", "--site", str(LABORATORY), "--people", "1", "--seconds", "2", "--bag", str(bag)])
    other = str(LABORATORY.parent / "vehicle")
    assert main(["fit-ranges", str(bag), "--site", other, "--out", str(tmp_path / "out.yaml")]) == 2
    assert "no pair of measured and true range; allowed: a bag with uwb/ranges" in capfd.readouterr().err
