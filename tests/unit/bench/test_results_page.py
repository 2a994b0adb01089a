"""The page of results: figures, spreads and verdicts from made-up files; what is missing is named, not hidden."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest
import yaml

BENCH = Path(__file__).parents[3] / "bench"


def module(name):
    spec = importlib.util.spec_from_file_location(name, BENCH / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[name] = loaded
    spec.loader.exec_module(loaded)
    return loaded


results_page = module("results_page")
bench_all = module("all")

SPEC = {
    "title": "Results",
    "papers": [
        {
            "title": "Paper X",
            "file": "x",
            "command": "python bench/x.py",
            "spread_is": "sd over 3 seeds",
            "rows": [
                {
                    "what": "good",
                    "paper": 0.5,
                    "source": "X table 1",
                    "unit": "m",
                    "at": "good/mean",
                    "spread": "good/sd",
                }
                | {"better": "lower", "aim": 0.3},
                {"what": "bad", "paper": 0.9, "source": "X table 2", "at": "bad", "better": "higher", "aim": 0.95},
                {
                    "what": "beyond the paper only",
                    "paper": 0.5,
                    "source": "X",
                    "at": "middle",
                    "better": "lower",
                    "aim": 0.3,
                },
                {"what": "band", "at": "counts/*/share", "better": "within", "aim": [0.9, 0.97]},
                {"what": "setting", "paper": 2.0, "source": "X", "at": "setting"},
                {
                    "what": "absent",
                    "paper": 1.0,
                    "source": "X",
                    "at": "not/there",
                    "spread": "nor/this",
                    "better": "lower",
                },
                {"what": "quotient", "at": "bad", "over": "setting", "scale": 10},
            ],
        }
    ],
    "matrices": [
        {
            "title": "Rivals",
            "file": "x",
            "command": "python bench/x.py",
            "rows": ["us", "them", "nobody"],
            "columns": {"error": "rivals/{row}/error", "time": "rivals/{row}/time"},
        }
    ],
    "speed": {"title": "Speed", "file": "y", "command": "python bench/y.py", "rows": [{"what": "rate", "at": "rate"}]},
    "data": {"walks": "people", "drives": "cars"},
}
FILES = {
    "x": {
        "good": {"mean": 0.25, "sd": 0.0123},
        "bad": 0.8,
        "middle": 0.4,
        "setting": 1.9,
        "counts": {"10": {"share": 0.93}, "20": {"share": 0.98}},
        "rivals": {"us": {"error": 0.123, "time": 5.0}, "them": {"error": 0.4, "time": float("nan")}},
    }
}
FACTS = results_page.RunFacts(
    "2026-01-02",
    {"cores": "2"},
    frozenset({"walks"}),
    [
        results_page.BenchRun("x", "python bench/x.py", 60.0),
        results_page.BenchRun("y", "python bench/y.py", 120.0, "failed with status 1"),
    ],
)


@pytest.fixture(scope="module")
def text():
    return results_page.page(SPEC, FILES, FACTS)


def cells(text, first):
    line = next(line for line in text.splitlines() if line.startswith(f"| {first}"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_a_row_has_the_papers_figure_the_aim_ours_its_spread_the_verdict_and_the_command(text):
    assert cells(text, "good") == [
        "good [m]",
        "0.5 (X table 1)",
        "≤ 0.3",
        "0.250",
        "± 0.0123 (sd over 3 seeds)",
        "as good as paper or better, aim reached",
        "`python bench/x.py`",
    ]


def test_what_misses_the_paper_and_the_aim_says_so_in_bold(text):
    assert cells(text, "bad")[5] == "**worse than paper**, **aim missed**"
    assert cells(text, "beyond")[5] == "as good as paper or better, **aim missed**"


def test_several_values_are_judged_by_their_worst(text):
    assert cells(text, "band")[3] == "0.930 to 0.980"
    assert cells(text, "band")[5] == "**aim missed**"


def test_a_setting_is_not_judged(text):
    assert cells(text, "setting")[3:6] == ["1.90", "", ""]


def test_a_quotient_is_scaled_once(text):
    assert cells(text, "quotient")[3] == results_page.shown(10 * 0.8 / 1.9)


def test_missing_figures_and_spreads_are_named_and_not_judged(text):
    assert cells(text, "absent")[3:6] == ["**missing**", "**missing**", ""]
    assert cells(text, "rate")[3] == "**missing**", "the file of a bench that failed"


def test_rivals_stand_side_by_side_and_undefined_is_not_missing(text):
    assert cells(text, "us")[1:] == ["0.123", "5"]
    assert cells(text, "them")[1:] == ["0.400", "–"]
    assert cells(text, "nobody")[1:] == ["**missing**", "**missing**"]


def test_the_head_counts_what_fell_short(text):
    assert "Aims missed: 3. Worse than the paper: 1. Figures missing: 5." in text


def test_date_length_machine_data_and_failed_benches_are_on_the_page(text):
    assert "on 2026-01-02: one run of 3 minutes" in text
    assert "* cores: 2" in text
    assert cells(text, "walks")[2] == "yes"
    assert cells(text, "drives")[2] == "**missing**"
    assert cells(text, "y |")[3] == "**failed with status 1**"


def spec_of_the_page():
    return yaml.safe_load((BENCH / "results_page.yaml").read_text("utf-8"))


def test_the_real_page_without_any_file_names_every_figure_as_missing():
    spec = spec_of_the_page()
    rows = [row for table in [*spec["papers"], spec["speed"]] for row in table["rows"]]
    cells_of_matrices = sum(len(table["rows"]) * len(table["columns"]) for table in spec["matrices"])
    expected = len(rows) + sum("spread" in row for row in rows) + cells_of_matrices
    assert f"Figures missing: {expected}." in results_page.page(spec, {}, FACTS)


def test_every_row_of_the_real_page_names_a_bench_that_is_run_and_a_source_for_each_papers_figure():
    spec, benches = spec_of_the_page(), {bench.name for bench in bench_all.BENCHES}
    for table in [*spec["papers"], *spec["matrices"], spec["speed"]]:
        for row in table["rows"]:
            merged = table | (row if isinstance(row, dict) else {})
            assert merged["file"] in benches
            assert merged["command"].startswith(f"python bench/{merged['file']}.py")
            assert ("paper" in merged) == ("source" in merged)


def test_the_benches_exist():
    assert all((BENCH / f"{bench.name}.py").exists() for bench in bench_all.BENCHES)


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A folder with benches of our own in place of the real one."""
    monkeypatch.setattr(bench_all, "HERE", tmp_path)
    monkeypatch.setattr(bench_all, "ROOT", tmp_path)
    monkeypatch.setattr(bench_all, "RESULTS", tmp_path / "results")
    (tmp_path / "results").mkdir()

    def run(body, limit_minutes=1.0):
        (tmp_path / "b.py").write_text(body, "utf-8")
        return bench_all.run(bench_all.Bench("b", limit_minutes), bench_all.time.monotonic() + 100.0, tmp_path / "log")

    return run


def test_a_bench_that_writes_its_file_is_done(fake):
    assert fake("open('results/b.json', 'w').write('{}')").outcome == "done"


def test_a_bench_that_fails_says_nothing_or_takes_too_long_is_told_apart(fake):
    assert fake("raise SystemExit(3)").outcome == "failed with status 3"
    assert fake("pass").outcome == "ran, but wrote nothing"
    assert fake("import time; time.sleep(60)", limit_minutes=0.005).outcome.startswith("stopped at its limit")


def test_files_of_earlier_runs_are_put_aside(tmp_path):
    file = tmp_path / "x.json"
    file.write_text(json.dumps({"old": 1}), "utf-8")
    bench_all.put_aside(file)
    assert not file.exists()
    assert json.loads((tmp_path / "earlier" / "x.json").read_text("utf-8")) == {"old": 1}
