"""Estimators side by side on one bag, in one command."""

import json
from pathlib import Path

from mine_loc_bringup.main import main as mine_loc

WALK = Path(__file__).parents[2] / "replay" / "walk" / "bag"


def test_every_method_is_judged_on_the_same_bag(tmp_path, capsys):
    figures = tmp_path / "figures.json"
    words = [
        "compare",
        str(WALK),
        "--methods",
        "mine_loc",
        "ekf",
        "--out",
        str(tmp_path / "out"),
        "--json",
        str(figures),
    ]
    assert mine_loc(words) == 0
    found = json.loads(figures.read_text("utf-8"))
    assert set(found) == {"mine_loc", "ekf"}
    assert found["mine_loc"]["horizontal_mean_m"] < found["ekf"]["horizontal_mean_m"]
    table = capsys.readouterr().out
    assert "mine_loc" in table
    assert "CE95" in table


def test_the_bag_itself_is_not_made_anew(capsys):
    assert mine_loc(["compare", str(WALK), "--out", str(WALK.parent)]) == 2
    assert "holds the bag" in capsys.readouterr().err
    assert (WALK / "metadata.yaml").is_file()
