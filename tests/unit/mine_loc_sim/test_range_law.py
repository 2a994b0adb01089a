"""The range law that ships against receptions simulated anew."""

import io
from dataclasses import replace

import numpy as np
import pytest

from mine_loc_sim.link_channel import LinkChannel
from mine_loc_sim.radio_constants import INDUSTRIAL
from mine_loc_sim.range_law import range_law
from mine_loc_sim.range_law_learning import grid, receive
from mine_loc_sim.range_table import RangeLaw, read_law, write_law
from mine_loc_sim.ranging_link import Exchanges

DRAWS = 6


@pytest.fixture(scope="module")
def fresh() -> list[Exchanges]:
    """One reception a cell of the table, several times over."""
    way, rng = grid(), np.random.default_rng(99)
    cells = np.arange(len(way.distance_m))
    channel = LinkChannel(INDUSTRIAL, len(cells), rng)
    return [receive(channel, cells, 1e3, way, rng) for _ in range(DRAWS)]


def ranks(law: RangeLaw, fresh: list[Exchanges]) -> np.ndarray:
    """Where fresh errors fall among those of their cell, 0..1: uniform if both are of one law; ties in the middle."""
    shares = []
    for draw in fresh:
        both = np.isfinite(draw.error_m) & np.isfinite(law.error_m).all(axis=1)
        table, error_m = law.error_m[both], draw.error_m[both, None]
        shares.append((table < error_m).mean(axis=1) + 0.5 * (table == error_m).mean(axis=1))
    return np.concatenate(shares)


def test_fresh_errors_fall_evenly_among_those_of_the_shipped_law(fresh):
    share = ranks(range_law(INDUSTRIAL), fresh)
    assert len(share) > 400
    assert np.histogram(share, 4, (0.0, 1.0))[0] / len(share) == pytest.approx(0.25, abs=0.07)


def test_a_law_that_is_off_by_a_decimetre_would_be_noticed(fresh):
    law = range_law(INDUSTRIAL)
    share = ranks(replace(law, error_m=law.error_m + 0.1), fresh)
    assert np.mean(share < 0.25) > 0.35


def test_the_shipped_law_loses_as_much_and_hears_as_loud_as_the_accumulators(fresh):
    law = range_law(INDUSTRIAL)
    lost = np.mean([np.isnan(draw.error_m) for draw in fresh])
    assert np.isnan(law.error_m).mean() == pytest.approx(lost, abs=0.03)
    level_dbm = np.mean([draw.level_dbm for draw in fresh])
    assert law.level_dbm.mean() == pytest.approx(level_dbm, abs=0.5)
    classes = [
        np.bincount(each.ravel(), minlength=5) / each.size
        for each in (law.link_class, np.array([d.link_class for d in fresh]))
    ]
    assert classes[0] == pytest.approx(classes[1], abs=0.04)


def test_a_law_comes_back_from_its_file():
    law = range_law(INDUSTRIAL)
    file = io.BytesIO()
    write_law(law, file)
    file.seek(0)
    again = read_law(file)
    assert again.kept == law.kept
    for name in ("error_m", "link_class", "level_dbm", "receive_power_dbm", "white_sd_m", "detour_m"):
        assert np.array_equal(getattr(again, name), getattr(law, name), equal_nan=True), name
