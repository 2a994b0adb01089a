"""who, track and headcount as users call them."""

import csv
import json

import pytest
from stored_walks import made_store, pose

from mine_loc_bringup.main import main
from mine_loc_bringup.store.moments import moment_text, parse_moment, parse_period
from mine_loc_core.errors import ConfigurationError
from mine_loc_fusion.mode import Mode

FROM, TO = "2023-11-14T22:13:20Z", "2023-11-14T23:15:00+01:00"  # 0 s and 100 s after START_NS
PERIOD = ["--from", FROM, "--to", TO]


@pytest.fixture(autouse=True)
def database(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    url = f"sqlite:///{tmp_path / 'store.db'}"
    monkeypatch.setenv("MINE_LOC_DATABASE", url)
    with made_store(url, tmp_path / "spool") as store:
        walk = [pose(n, x_m=float(n), areas=("main",)) for n in range(5)]
        later = [pose(30 + n, x_m=30.0 + n, areas=("face", "main")) for n in range(5)]
        store.keep([*walk, *later, pose(35, mode=Mode.LOST), pose(33, "miner", areas=("face",))])
    return url


def test_who_lists_place_age_and_certainty_and_says_lost(capsys, tmp_path):
    file = tmp_path / "out" / "who.json"
    assert main(["who", "--at", "2023-11-14T22:13:56Z", "--json", str(file)]) == 0
    miner, fitter = (line for line in capsys.readouterr().out.splitlines() if "miner" in line or "fitter" in line)
    assert "UWB_PDR" in miner
    assert "3.0" in miner
    assert "LOST" in fitter
    assert "last in face, main" in fitter
    people = json.loads(file.read_text())["people"]
    assert [(p["person"], p["lost"], p["age_s"], p["mode"]) for p in people] == [
        ("miner", False, 3.0, "UWB_PDR"), ("fitter", True, 2.0, "LOST"),
    ]  # fmt: skip


def test_who_was_in_a_zone(capsys):
    assert main(["who", "--at", "2023-11-14T22:13:22.5Z", "--zone", "main"]) == 0
    shown = capsys.readouterr().out
    assert "fitter" in shown
    assert "0.5" in shown
    assert main(["who", "--at", "2023-11-14T22:13:22Z", "--zone", "face"]) == 0
    assert "nobody" in capsys.readouterr().out


def test_a_track_breaks_where_nobody_knows(tmp_path, capsys):
    out = [tmp_path / f"track.{kind}" for kind in ("csv", "geojson", "png")]
    words = [
        word for kind, file in zip(("--csv", "--geojson", "--plot"), out, strict=True) for word in (kind, str(file))
    ]
    assert main(["track", "fitter", *PERIOD, *words]) == 0
    rows = list(csv.DictReader(out[0].open()))
    assert len(rows) == 11
    assert (rows[0]["time"], rows[0]["x_m"], rows[0]["areas"]) == ("2023-11-14T22:13:20.000Z", "0.0", "main")
    features = json.loads(out[1].read_text())["features"]
    assert [len(feature["geometry"]["coordinates"]) for feature in features] == [5, 5]
    assert features[1]["geometry"]["coordinates"][0] == [30.0, 2.0, 1.0]
    assert out[2].read_bytes().startswith(b"\x89PNG")
    assert main(["track", "fitter", *PERIOD]) == 0
    assert [word in capsys.readouterr().out for word in ("face, main",)] == [True]


def test_heads_over_time(tmp_path, capsys):
    out = tmp_path / "heads.csv"
    words = ["headcount", "--from", FROM, "--to", "2023-11-14T22:13:55Z", "--step", "5"]
    assert main([*words, "--csv", str(out), "--plot", str(tmp_path / "heads.png")]) == 0
    counts = {(row["from"], row["area"]): int(row["people"]) for row in csv.DictReader(out.open())}
    assert counts["2023-11-14T22:13:20.000Z", "main"] == 1
    assert counts["2023-11-14T22:13:30.000Z", "main"] == 0
    assert counts["2023-11-14T22:13:50.000Z", "face"] == 2
    assert (tmp_path / "heads.png").read_bytes().startswith(b"\x89PNG")
    assert main(words) == 0
    assert "face" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["who", "--at", "noon"], "--at: 'noon' is no instant; allowed: ISO 8601"),
        (["who", "--at", "2023-11-14T22:13"], "--at: '2023-11-14T22:13' has no time zone"),
        (["who", "--at", FROM, "--zone", "hall"], "--zone: hall: nobody ever was in it; allowed: face, main"),
        (["who", "--at", FROM, "--database", "sqlite:///missing.db"], "missing.db: no such file"),
        (["who", "--at", FROM, "--database", "postgresql://127.0.0.1:1/x"], "onnection"),
        (["track", "nobody", *PERIOD], "'nobody': nobody of this name is in the store; allowed: fitter, miner"),
        (["track", "fitter", "--from", TO, "--to", FROM], "--to: "),
        (["track", "fitter", "--from", TO, "--to", "2024-01-01T00:00Z"], "no row from"),
        (["headcount", *PERIOD, "--step", "0"], "--step: 0 s is not allowed; allowed: 1 s to 1e9 s"),
    ],
)
def test_what_the_user_can_mend_is_one_line(words, said, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_file_that_is_no_store_is_refused(tmp_path, capsys):
    for content in (b"", b"something else that is no database" * 100):
        (tmp_path / "other.db").write_bytes(content)
        assert main(["who", "--at", FROM, "--database", f"sqlite:///{tmp_path / 'other.db'}"]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_instants_keep_their_zone_and_microseconds():
    assert parse_moment("1970-01-01T01:00:00.000001+01:00", "x") == 1000
    assert parse_moment("1969-12-31T23:59:59Z", "x") == -1_000_000_000
    assert moment_text(1_700_000_000_123_456_789) == "2023-11-14T22:13:20.123Z"
    with pytest.raises(ConfigurationError, match="is not after"):
        parse_period(FROM, FROM)
