"""Measures as a table to read: a row a measure, a column a person, all together last."""

from collections.abc import Mapping

from rich.markup import escape
from rich.table import Column, Table

from mine_loc_bringup.evaluation.evaluation import Evaluation
from mine_loc_bringup.evaluation.measures import Measures

_MOST_PEOPLE = 5
_ROWS: Mapping[str, str] = {
    "horizontal_mean_m": "horizontal mean [m]",
    "rmse_m": "RMSE [m]",
    "median_m": "median [m]",
    "third_quartile_m": "third quartile [m]",
    "ce95_m": "CE95 [m]",
    "max_m": "max [m]",
    "claimed_ce95_m": "claimed 95 % circle, median [m]",
    "claimed_ce95_holds": "claimed 95 % circle holds",
    "nees_mean": "NEES, mean",
    "availability": "availability",
    "availability_measured": "availability, measured",
    "first_output_s": "first output after [s]",
    "longest_gap_s": "longest gap [s]",
    "latency_p50_ms": "latency median [ms]",
    "latency_p99_ms": "latency p99 [ms]",
    "time_offset_s": "truth fits best at stamp + [s]",
    "step_count_error": "step count error",
    "outputs": "outputs",
    "scored": "outputs with truth",
    "not_finite": "outputs not finite",
    "backward_stamps": "stamps that went back",
}
_INTERVAL_BELOW = {"claimed_ce95_holds": ("claimed_ce95_holds", "… with 95 %"), "nees_mean": ("nees", "… if honest")}


def measures_table(found: Evaluation, title: str) -> Table:
    """At most five people have columns of their own."""
    shown = dict(list(found.people.items())[:_MOST_PEOPLE])
    columns = shown | ({"together": found.together} if len(found.people) > 1 else {})
    hidden = len(found.people) - len(shown)
    return columns_table(columns, title, f"and {hidden} people more, see --json" if hidden else None)


def columns_table(columns: Mapping[str, Measures], title: str, caption: str | None = None) -> Table:
    """A column of measures for each name; measures that nobody has are left out."""
    table = Table(Column(no_wrap=True), *columns, title=title, caption=caption)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, heading in _ROWS.items():
        cells = [_cell(each, name) for each in columns.values()]
        if any(cells):
            table.add_row(escape(heading), *map(escape, cells))
        if any(cells) and name in _INTERVAL_BELOW:
            stem, below = _INTERVAL_BELOW[name]
            table.add_row(below, *[_interval(each, stem) for each in columns.values()])
    for mode in sorted({mode for each in columns.values() for mode in each.modes}):
        table.add_row(f"mode {mode}", *[f"{each.modes.get(mode, 0.0):.1%}" for each in columns.values()])
    return table


def verdict_table(found: Evaluation) -> Table:
    """What became of measurements, by topic, kind and reason."""
    table = Table("verdicts", "kind", "reason", "count")
    for topic, sources in sorted(found.verdicts.items()):
        for source, reasons in sorted(sources.items()):
            for reason, count in reasons.most_common():
                table.add_row(topic, source, reason, str(count))
    return table


def _cell(measures: Measures, name: str) -> str:
    value = getattr(measures, name)
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.3f}"


def _interval(measures: Measures, name: str) -> str:
    low, high = (getattr(measures, f"{name}_{end}") for end in ("low", "high"))
    return "" if low is None else f"{low:.2f} to {high:.2f}"
