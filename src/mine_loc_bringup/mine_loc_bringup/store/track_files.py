"""A track for people and programs: stretches as a table, rows as CSV, lines as GeoJSON and as a plot."""

import csv
import json
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from mine_loc_bringup.store.moments import moment_text
from mine_loc_bringup.store.queries import TrackPoint
from mine_loc_core.stamps import to_ns, to_s

_GAP_S = 10.0


def lines(points: Sequence[TrackPoint]) -> Iterator[list[TrackPoint]]:
    """The stretches over which the person was positioned without a gap."""
    line: list[TrackPoint] = []
    for point in points:
        gap = line and point.stamp_ns - line[-1].stamp_ns > to_ns(_GAP_S + line[-1].span_s)
        if line and (gap or not point.placed):
            yield line
            line = []
        if point.placed:
            line.append(point)
    if line:
        yield line


def write_csv(file: Path, person: str, points: Sequence[TrackPoint]) -> None:
    """Every row."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(("person", "time", "stamp_ns", "x_m", "y_m", "z_m", "ce95_m", "mode", "areas", "span_s"))
        for p in points:
            where = (p.x_m, p.y_m, p.z_m, p.ce95_m, p.mode.name, " ".join(p.areas), p.span_s)
            writer.writerow((person, moment_text(p.stamp_ns), p.stamp_ns, *where))


def write_geojson(file: Path, person: str, points: Sequence[TrackPoint]) -> None:
    """A LineString each stretch, a Point where it has one row; properties hold each vertex's time and 95 % circle."""
    features = [_feature(person, line) for line in lines(points)]
    content = {"type": "FeatureCollection", "coordinates_are": "metres east and north in the map", "features": features}
    file.write_text(json.dumps(content, allow_nan=False) + "\n", "utf-8")


def _feature(person: str, line: Sequence[TrackPoint]) -> dict[str, Any]:
    coordinates = [[p.x_m, p.y_m, *([] if p.z_m is None else [p.z_m])] for p in line]
    geometry: dict[str, Any] = {"type": "LineString", "coordinates": coordinates}
    if len(line) == 1:
        geometry = {"type": "Point", "coordinates": coordinates[0]}
    times = [moment_text(p.stamp_ns) for p in line]
    properties = {"person": person, "times": times, "ce95_m": [p.ce95_m for p in line]}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def write_plot(file: Path, person: str, points: Sequence[TrackPoint]) -> None:
    """The lines on the map."""
    import matplotlib as mpl  # noqa: PLC0415 slow

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(figsize=(8, 6), layout="constrained")
    for line in lines(points):
        where_m = np.array([(p.x_m, p.y_m) for p in line], dtype=float)
        axes.plot(*where_m.T, ".-", linewidth=1.0, markersize=2.0, color="tab:blue")
        axes.plot(*where_m[:1].T, "o", color="tab:green")
        axes.plot(*where_m[-1:].T, "s", color="tab:red")
    axes.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
    axes.set_title(f"{person}, {moment_text(points[0].stamp_ns)} to {moment_text(points[-1].stamp_ns)}")
    figure.savefig(file, dpi=120)
    plt.close(figure)


def stretches_table(person: str, points: Sequence[TrackPoint]) -> Table:
    """When the person was in which areas; LOST where nobody can say."""
    table = Table("from", "to", "for, s", "place", title=person)
    for place, group in groupby(points, lambda p: (", ".join(p.areas) or "–") if p.placed else "[bold red]LOST[/]"):
        run = list(group)
        start_ns, end_ns = run[0].stamp_ns, run[-1].stamp_ns
        table.add_row(moment_text(start_ns), moment_text(end_ns), f"{to_s(end_ns - start_ns):.1f}", place)
    return table
