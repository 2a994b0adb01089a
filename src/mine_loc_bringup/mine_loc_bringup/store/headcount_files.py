"""Head counts for people and programs: a table, CSV, and steps over time."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from mine_loc_bringup.store.moments import moment_text
from mine_loc_bringup.store.queries import HeadCount


def counts_table(counts: Sequence[HeadCount]) -> Table:
    """A line a period, a column an area."""
    names = _areas(counts)
    table = Table("from (UTC)", *names)
    heads = {(count.stamp_ns, count.area): str(count.people) for count in counts}
    for stamp_ns in sorted({count.stamp_ns for count in counts}):
        table.add_row(moment_text(stamp_ns), *(heads.get((stamp_ns, name), "0") for name in names))
    return table


def write_csv(file: Path, counts: Sequence[HeadCount], periods_ns: Sequence[int]) -> None:
    """A row each area and period, those without anybody among them."""
    heads = {(count.stamp_ns, count.area): count.people for count in counts}
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(("from", "stamp_ns", "area", "people"))
        for stamp_ns in periods_ns:
            for name in _areas(counts):
                writer.writerow((moment_text(stamp_ns), stamp_ns, name, heads.get((stamp_ns, name), 0)))


def write_plot(file: Path, counts: Sequence[HeadCount], periods_ns: Sequence[int]) -> None:
    """Steps over time, one line an area."""
    import matplotlib as mpl  # noqa: PLC0415 slow

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    heads = {(count.stamp_ns, count.area): count.people for count in counts}
    times = np.array(periods_ns, dtype="datetime64[ns]")
    figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
    for name in _areas(counts):
        axes.step(times, [heads.get((stamp_ns, name), 0) for stamp_ns in periods_ns], where="post", label=name)
    axes.set(xlabel="time (UTC)", ylabel="people")
    if counts:
        axes.legend()
    figure.autofmt_xdate()
    figure.savefig(file, dpi=120)
    plt.close(figure)


def _areas(counts: Sequence[HeadCount]) -> list[str]:
    return sorted({count.area for count in counts})
