"""docs/results.md from the benches' files: what is shown is in results_page.yaml, how in here. No files, no clock.

A row of a table has `what`, `at` (path in the file of a bench: keys with `/` between, `*` for every key that has the
rest of the path; or a list of paths), and may have `over` (path to divide by), `scale`, `unit`, `spread` (path of a
number, of a pair, or a list of two paths) and `spread_is`, `paper` with its `source` (and `paper_says` where the paper
gives a relation and no figure), `aim`, `better` (lower, higher, within; none where the figure is a setting), `file`
and `command` (else those of its table). A figure of several paths is shown from least to most and judged by its worst.
What no file has is shown as missing.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

MISSING, AIM_MISSED, WORSE = "**missing**", "**aim missed**", "**worse than paper**"
Files = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class BenchRun:
    """How one bench of the run went; `outcome` is `done`, or in plain words why not."""

    name: str
    command: str
    seconds: float
    outcome: str = "done"


@dataclass(frozen=True, slots=True)
class RunFacts:
    """What the page says of the run itself."""

    date: str
    machine: Mapping[str, str]
    data_sets: frozenset[str]
    benches: Sequence[BenchRun]


def page(spec: Mapping[str, Any], files: Files, facts: RunFacts) -> str:
    """Markdown of the whole page."""
    papers = [_section(table, files) for table in spec["papers"]]
    speed = _section(spec["speed"], files)
    peers = [_matrix(table, files) for table in spec["matrices"]]
    judged = "\n".join([*papers, speed])
    missing = judged.count(MISSING) + sum(peer.count(MISSING) for peer in peers)
    missed, worse = judged.count(AIM_MISSED), judged.count(WORSE)
    minutes = sum(bench.seconds for bench in facts.benches) / 60
    head = [
        f"# {spec['title']}",
        "",
        f"Written by `make bench` on {facts.date}: one run of {minutes:.0f} minutes. Commands are typed after",
        "`. ./env.sh`. Aims are the project's own. A row without a verdict is a setting, a rival or shown for",
        "comparison. What falls short of the paper's figure or of the aim says so in bold.",
        "",
        f"Aims missed: {missed}. Worse than the paper: {worse}. Figures missing: {missing}.",
        "",
    ]
    tail = _data(spec["data"], facts.data_sets) + _run(facts)
    return "\n".join([*head, *papers, "## Peers and libraries side by side", "", *peers, speed, *tail]) + "\n"


def figures(node: Any, path: str) -> list[Any]:
    """Values at a path, of every key where it says `*`; empty if there are none."""
    found = [node]
    for key in path.split("/"):
        if key == "":
            continue
        mappings = [each for each in found if isinstance(each, Mapping)]
        found = [v for each in mappings for v in (each.values() if key == "*" else [each[key]] if key in each else [])]
    return found


def _numbers(node: Any, paths: str | Sequence[str]) -> list[float]:
    listed = [paths] if isinstance(paths, str) else paths
    flat = [value for path in listed for value in figures(node, path)]
    flat = [value for each in flat for value in (each if isinstance(each, list) else [each])]
    return [float(value) for value in flat if isinstance(value, int | float) and not math.isnan(value)]


def shown(value: float) -> str:
    """Three significant digits, whole numbers whole."""
    if value == int(value) or abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def _range(values: Sequence[float]) -> str:
    least, most = shown(min(values)), shown(max(values))
    return least if least == most else f"{least} to {most}"


def verdict(values: Sequence[float], row: Mapping[str, Any]) -> str:
    """Against the paper's figure and the aim, by the worst value; empty where the row has no direction."""
    if "better" not in row:
        return ""
    reaches: Callable[[Any], bool] = {
        "lower": lambda bound: max(values) <= bound,
        "higher": lambda bound: min(values) >= bound,
        "within": lambda bound: bound[0] <= min(values) and max(values) <= bound[1],
    }[row["better"]]
    said = []
    if "paper" in row and row["better"] != "within":
        said.append("as good as paper or better" if reaches(row["paper"]) else WORSE)
    if "aim" in row:
        said.append("aim reached" if reaches(row["aim"]) else AIM_MISSED)
    return ", ".join(said)


def _aim(row: Mapping[str, Any]) -> str:
    if "aim" not in row:
        return ""
    if row["better"] == "within":
        return f"{row['aim'][0]} to {row['aim'][1]}"
    return f"{'≤' if row['better'] == 'lower' else '≥'} {row['aim']}"


def _row(row: Mapping[str, Any], files: Files) -> str:
    file, scale = files.get(row["file"], {}), row.get("scale", 1.0)
    values = [scale * value for value in _numbers(file, row["at"])]
    if "over" in row:
        divisors = _numbers(file, row["over"])
        values = [value / divisor for value in values for divisor in divisors if divisor]
    paper = f"{row.get('paper_says', row.get('paper'))} ({row['source']})" if "paper" in row else ""
    unit = f" [{row['unit']}]" if "unit" in row else ""
    ours, judged = (_range(values), verdict(values, row)) if values else (MISSING, "")
    cells = (row["what"] + unit, paper, _aim(row), ours, _spread(row, file, scale), judged, f"`{row['command']}`")
    return f"| {' | '.join(cells)} |"


def _spread(row: Mapping[str, Any], file: Mapping[str, Any], scale: float) -> str:
    if "spread" not in row:
        return ""
    values = [scale * value for value in _numbers(file, row["spread"])]
    if not values:
        return MISSING
    is_interval = "%" in row["spread_is"] or row["spread_is"].startswith("sd")
    return f"{'± ' if is_interval and len(values) == 1 else ''}{_range(values)} ({row['spread_is']})"


def _section(table: Mapping[str, Any], files: Files) -> str:
    shared = {key: table[key] for key in ("file", "command", "spread_is") if key in table}
    head = "| | paper | aim | ours | spread | verdict | command |\n|---|---|---|---|---|---|---|"
    rows = [_row(shared | row, files) for row in table["rows"]]
    about = [table["about"].strip(), ""] if "about" in table else []
    return "\n".join([f"## {table['title']}", "", *about, head, *rows, ""])


def _matrix(table: Mapping[str, Any], files: Files) -> str:
    """Rows and columns of numbers; a number that its bench calls undefined is a dash, one that is absent is missing."""
    columns, file = table["columns"], files.get(table["file"], {})
    lines = [f"| | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for row in table["rows"]:
        cells = []
        for path in columns.values():
            found = figures(file, path.replace("{row}", row))
            value = _number(found[0]) if found else None
            cells.append(MISSING if value is None else "–" if math.isnan(value) else shown(value))
        lines.append(f"| {table.get('names', {}).get(row, row)} | {' | '.join(cells)} |")
    about = [table["about"].strip(), ""] if "about" in table else []
    return "\n".join([f"### {table['title']}", "", *about, *lines, "", f"Command: `{table['command']}`", ""])


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _data(described: Mapping[str, str], there: frozenset[str]) -> list[str]:
    lines = ["## Data", "", "| set (`docs/data.md`) | what of | in MINE_LOC_DATA |", "|---|---|---|"]
    lines += [f"| {name} | {what} | {'yes' if name in there else MISSING} |" for name, what in described.items()]
    return [*lines, "", "Everything else is simulated, with the seeds that the benches name.", ""]


def _run(facts: RunFacts) -> list[str]:
    lines = ["## Machine and run", "", *(f"* {name}: {value}" for name, value in facts.machine.items()), ""]
    lines += ["| bench | command | minutes | outcome |", "|---|---|---|---|"]
    for bench in facts.benches:
        outcome = bench.outcome if bench.outcome == "done" else f"**{bench.outcome}**"
        lines.append(f"| {bench.name} | `{bench.command}` | {bench.seconds / 60:.1f} | {outcome} |")
    return lines
