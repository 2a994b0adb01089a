"""Plots of an evaluation: tracks over truth, error over time, and its cumulative distribution."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from mine_loc_bringup.evaluation.measures import Compared

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

_MOST_NAMES = 12


Drawing = Callable[[Axes], None]


def write_plots(compared: Sequence[Compared], title: str, folder: Path) -> list[Path]:
    """Write `track.png`, `error_over_time.png` and `error_cdf.png`; the files."""
    drawings = {"track": draw_tracks, "error_over_time": draw_error_over_time, "error_cdf": draw_error_cdf}
    files = [folder / f"{name}.png" for name in drawings]
    for file, draw in zip(files, drawings.values(), strict=True):
        save_figure([functools.partial(draw, compared=compared)], title, file)
    return files


def save_figure(drawings: Sequence[Drawing], title: str, file: Path) -> None:
    """Drawings side by side in one file."""
    size_in = (6.5 * len(drawings) if len(drawings) > 1 else 9.0, 5.5)
    figure, axes = plt.subplots(1, len(drawings), figsize=size_in, layout="constrained", squeeze=False)
    for draw, place in zip(drawings, axes[0], strict=True):
        draw(place)
    figure.suptitle(title)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def draw_tracks(axes: Axes, compared: Sequence[Compared]) -> None:
    """From above, the truth wide and grey below."""
    for number, each in enumerate(compared):
        axes.plot(*each.truth_m.T, color="0.6", linewidth=3, label=None if number else "truth")
        axes.plot(*each.track.position_m.T, color=f"C{number}", linewidth=1, label=each.person)
    axes.set(xlabel="x [m]", ylabel="y [m]", title="track over truth", aspect="equal")
    _finish(axes, compared)


def draw_error_over_time(axes: Axes, compared: Sequence[Compared]) -> None:
    """With the claimed 95 % circle."""
    for number, each in enumerate(compared):
        error_m = np.where(each.scored, each.distance_m, np.nan)
        axes.plot(each.times_s, error_m, color=f"C{number}", label=f"{each.person}: error")
        axes.plot(each.times_s, each.track.ce95_m, color=f"C{number}", linestyle=":", label="claimed 95 % circle")
    axes.set(xlabel="time [s]", ylabel="horizontal [m]", title="error over time", ylim=(0, None))
    _finish(axes, compared)


def draw_error_cdf(axes: Axes, compared: Sequence[Compared]) -> None:
    """Share of the outputs whose error is no larger."""
    for number, each in enumerate(compared):
        error_m = np.sort(each.distance_m[each.scored])
        share = np.arange(1, len(error_m) + 1) / max(len(error_m), 1)
        axes.step(error_m, share, where="post", color=f"C{number}", label=each.person)
    axes.axhline(0.95, color="0.6", linewidth=1)
    axes.set(xlabel="horizontal error [m]", ylabel="share of outputs", title="error distribution", ylim=(0, 1))
    axes.set_xlim(left=0.0)
    _finish(axes, compared)


def _finish(axes: Axes, compared: Sequence[Compared]) -> None:
    axes.grid(alpha=0.3)
    if 0 < len(compared) <= _MOST_NAMES:
        axes.legend(fontsize="small")
