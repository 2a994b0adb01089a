"""The ranging rounds of one tag: which anchors it ranges, and what the chip reports of each exchange."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.mine import LinkGeometry
from mine_loc_sim.range_law import FastTagLinks
from mine_loc_sim.ranging_link import Exchanges, Radios, Ranges, TagLinks
from mine_loc_sim.wearer import Wearer
from mine_loc_uwb.received_power import Reception, Sfd

Reals = NDArray[np.float64]
Indices = NDArray[np.int64]
CHANNEL, PRF_MHZ = 2, 64
_LAW_ENTRIES = 1 << 13
"""Receptions of the range law that are kept: all of one environment, which has some 6000."""


@dataclass(frozen=True, slots=True)
class RoundPlan:
    """`r` rounds of one tag with `k` anchors each."""

    stamp_ns: NDArray[np.int64]  # (r,)
    tag_m: Reals  # (r, 3)
    facing_rad: Reals  # (r,)
    which: Indices  # (r, k), numbers of the anchors, no doubles in a round
    anchor_m: Reals  # (r, k, 3), where they truly hang
    tried: Indices  # (r,), how many of them are near enough to answer: the first ones
    ways: LinkGeometry  # of the r x k links, round by round


@dataclass(frozen=True, slots=True)
class HeardRound:
    """One round as measured; arrays (k,) over the anchors that were tried. A range is NaN where the exchange failed."""

    stamp_ns: int
    tag_m: Reals  # (3,)
    which: Indices
    distance_m: Reals  # truth
    range_m: Reals
    level_bias_m: Reals
    link_class: Indices  # truth, LinkClass
    receptions: tuple[Reception, ...]
    accumulators: NDArray[np.complex64] | None  # (k, 1016)


def shortest_ways(ways: LinkGeometry, candidates: Indices, count: int) -> tuple[Indices, Indices]:
    """Choose up to `count` of the candidates (r, c) of each round, those with the shortest ways.

    Returns their numbers (r, k), nearest first, and how many of them are near enough to answer (r,).
    """
    way_m = (ways.distance_m + ways.detour_m).reshape(candidates.shape)
    best = np.argsort(way_m, axis=1, kind="stable")[:, :count]
    rows = np.arange(len(candidates))[:, None]
    return candidates[rows, best], (way_m[rows, best] <= sc.REACH_M).sum(axis=1)


class TagRadio:
    """A tag's links to all anchors; plans must come in order of time."""

    def __init__(
        self,
        environment: constants.Environment,
        anchors: Radios,
        rng: np.random.Generator,
        *,
        cir: bool,
    ) -> None:
        links = (environment, Radios.draw(1, rng), anchors, Wearer.draw(rng), rng)
        self._links = TagLinks(*links) if cir else FastTagLinks(*links)

    def measure(self, plan: RoundPlan) -> list[HeardRound]:
        """Measure the rounds of a plan."""
        ranges = self._links.measure(plan.tag_m, plan.facing_rad, plan.anchor_m, plan.which, plan.ways)
        receptions = _receptions(ranges)
        rounds = enumerate(zip(plan.stamp_ns.tolist(), plan.tried.tolist(), strict=True))
        return [_heard(plan, number, stamp_ns, tried, ranges, receptions) for number, (stamp_ns, tried) in rounds]


def _heard(
    plan: RoundPlan, number: int, stamp_ns: int, tried: int, ranges: Ranges, receptions: tuple[Reception, ...]
) -> HeardRound:
    first = number * plan.which.shape[1]
    links = slice(first, first + tried)
    return HeardRound(
        stamp_ns,
        plan.tag_m[number],
        plan.which[number, :tried],
        plan.ways.distance_m[links],
        ranges.range_m[links],
        ranges.level_bias_m[links],
        ranges.link_class[links],
        receptions[links],
        None if ranges.exchanges is None else ranges.exchanges.reception.samples[links],
    )


def _receptions(ranges: Ranges) -> tuple[Reception, ...]:
    """Registers of each link; none of a reception that failed."""
    if ranges.exchanges is not None:
        return tuple(_registers(ranges.exchanges, link) for link in range(len(ranges.range_m)))
    symbols = constants.PREAMBLE_COUNT_1024
    amplitude = symbols * 10.0 ** (0.05 * (ranges.first_path_power_dbm + constants.POWER_CONSTANT_DB)) / 3**0.5
    energy = symbols**2 * 10.0 ** (0.1 * (ranges.receive_power_dbm + constants.POWER_CONSTANT_DB)) / 2**17
    columns = (ranges.received.tolist(), np.rint(amplitude).tolist(), np.rint(energy).tolist())
    return tuple(
        _reception(int(first), int(total), symbols) if received else Reception()
        for received, first, total in zip(*columns, strict=True)
    )


@lru_cache(_LAW_ENTRIES)
def _reception(amplitude: int, energy: int, symbols: int) -> Reception:
    """Registers that say no more than the powers."""
    first = min(amplitude, 0xFFFF)
    return Reception(
        first_path_amplitude=(first, first, first),
        receive_power_counts=min(energy, 0xFFFF),
        preamble_count=symbols,
        prf_mhz=PRF_MHZ,
    )


def _registers(exchanges: Exchanges, link: int) -> Reception:
    registers = exchanges.registers
    if not np.isfinite(exchanges.error_m[link]):
        return Reception()
    first, second, third = registers.first_path_amplitude[link].tolist()
    return Reception(
        first_path_index_64=round(float(registers.first_path_index[link]) * 64),
        first_path_amplitude=(min(first, 0xFFFF), min(second, 0xFFFF), min(third, 0xFFFF)),
        noise_std=int(registers.noise_std[link]),
        receive_power_counts=int(registers.cir_power[link]),
        preamble_count=int(registers.rxpacc[link]),
        preamble_count_unsaturated=int(registers.rxpacc_nosat[link]),
        channel=CHANNEL,
        prf_mhz=PRF_MHZ,
        sfd=Sfd.STANDARD_64,
    )
