"""Learn a range law from accumulators; writes the one that ships, of INDUSTRIAL.

python -m mine_loc_sim.range_law_learning --out src/mine_loc_sim/mine_loc_sim/range_law_industrial.npz
"""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.link_channel import LinkChannel, Obstruction
from mine_loc_sim.radio_constants import INDUSTRIAL, Environment
from mine_loc_sim.range_table import DETOUR_M, DISTANCE_M, ENTRIES, LOSS_DB, RangeLaw, write_law
from mine_loc_sim.ranging_link import Exchanges, Indices, Radios, Reals, exchange

_REPEATED = 8
_FADED_MOVE_M = 4.0 * constants.FADING_LENGTH_M


def learn_law(environment: Environment) -> RangeLaw:
    """Simulate the table of an environment, which takes some seconds; always the same."""
    way, rng = grid(), np.random.default_rng(15)
    cells = len(way.distance_m)
    channel, every = LinkChannel(environment, cells, rng), np.arange(cells)
    draws, again, faded = [], [], []
    for entry in range(ENTRIES):
        draws.append(receive(channel, every, 1e3, way, rng))
        if entry < _REPEATED:
            again.append(receive(channel, every, 0.0, way, rng).error_m)
            faded.append(receive(channel, every, _FADED_MOVE_M, way, rng).error_m)
    error_m = np.stack([draw.error_m for draw in draws], axis=1)
    order = np.argsort(error_m, axis=1)

    def sorted_entries(values: Iterable[NDArray[Any]]) -> NDArray[Any]:
        return np.take_along_axis(np.stack(list(values), axis=1), order, axis=1)

    return RangeLaw(
        error_m=np.take_along_axis(error_m, order, axis=1),
        link_class=sorted_entries(draw.link_class for draw in draws),
        level_dbm=sorted_entries(draw.level_dbm for draw in draws),
        receive_power_dbm=sorted_entries(draw.registers.receive_power_dbm for draw in draws),
        first_path_power_dbm=sorted_entries(draw.registers.first_path_power_dbm for draw in draws),
        white_sd_m=_white_sd(error_m[:, :_REPEATED] - np.stack(again, axis=1)),
        detour_m=way.detour_m,
        kept=_rank_correlation(error_m[:, :_REPEATED], np.stack(faded, axis=1)),
    )


def receive(
    channel: LinkChannel, every: Indices, moved_m: float, way: Obstruction, rng: np.random.Generator
) -> Exchanges:
    """Move all links (n,) by `moved_m` and exchange once over each, between radios drawn anew."""
    batch = channel.respond(every[None], np.full((1, len(every)), moved_m), way)
    radios = [Radios.draw(len(every), rng).receiver for _ in range(2)]
    return exchange(batch, way.loss_db, radios[0], radios[1], rng)


def _white_sd(difference_m: Reals) -> Reals:
    """Robust standard deviation (cells,) of one of two values with differences (cells, k), over all distances."""
    by_kind = np.abs(difference_m).reshape(len(DISTANCE_M), -1, difference_m.shape[1])
    middle = np.nanmedian(by_kind, axis=(0, 2)) * 1.4826 / np.sqrt(2.0)
    return np.tile(middle, len(DISTANCE_M))


def _rank_correlation(first: Reals, second: Reals) -> float:
    """Median over cells (n, k) of Spearman's correlation, 0..1."""
    both = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    ranks = [np.argsort(np.argsort(values[both], axis=1), axis=1) for values in (first, second)]
    centred = [rank - rank.mean(axis=1, keepdims=True) for rank in ranks]
    return float(np.clip(np.mean(centred[0] * centred[1]) / np.mean(centred[0] ** 2), 0.0, 1.0))


def grid() -> Obstruction:
    """One link a cell of the table."""
    rows = []
    for distance_m in DISTANCE_M:
        rows.append((distance_m, 0.0, 0.0, False))
        rows += [(distance_m, loss_db, detour_m, False) for loss_db in LOSS_DB for detour_m in DETOUR_M]
        rows += [(distance_m, 300.0, max(detour_m, 0.05), True) for detour_m in DETOUR_M]
    distance_m, loss_db, detour_m, sealed = np.array(rows).T
    return Obstruction(distance_m, loss_db, np.zeros(len(rows)), detour_m, np.zeros(len(rows)), sealed > 0.0)


def main() -> None:
    """Learn and write the law that ships."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="file to write")
    with parser.parse_args().out.open("wb") as file:
        write_law(learn_law(INDUSTRIAL), file)


if __name__ == "__main__":
    main()
