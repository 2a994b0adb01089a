"""The live table of the demonstration: who, where, how sure, line of sight, mode, rates."""

import math
from collections.abc import Iterable

from rich.table import Table

MODES = {
    0: "unknown",
    1: "initialising",
    2: "UWB + PDR",
    3: "UWB only",
    4: "dead reckoning",
    5: "coasting",
    6: "coarse only",
    7: "lost",
}


def people_table(title: str, rows: Iterable[tuple[str, float, float, float, int, float, float]], rates: str) -> Table:
    """A row a person: name, x, y [m], 95 % circle [m], mode, LOS probability (NaN = not judged), output rate [Hz]."""
    table = Table(title=title, caption=rates)
    for heading in ("who", "x [m]", "y [m]", "95 % within [m]", "LOS", "mode", "rate [Hz]"):
        table.add_column(heading, justify="left" if heading in {"who", "mode"} else "right")
    for name, x, y, ce95, mode, los, rate in rows:
        sight = "–" if math.isnan(los) else f"{los:.0%}"
        table.add_row(name, f"{x:.2f}", f"{y:.2f}", f"{ce95:.2f}", sight, MODES.get(mode, "?"), f"{rate:.1f}")
    return table
