"""Two-way ranges of one tag: what its way through the mine, the channel and two DW1000 make of a distance.

Nothing here draws a range error from a table: it is where the leading edge was found in an accumulator against where
the direct path lay, plus what stays while nobody moves. `range_law.py` gives the same without accumulators.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.channel_15_4a import FINE_PER_TAP
from mine_loc_sim.dw1000_accumulator import (
    Receiver,
    Reception,
    accumulate,
    band_limit,
    pulse_peak,
    taps_to_m,
)
from mine_loc_sim.gauss_markov import GaussMarkov
from mine_loc_sim.leading_edge import ReceiveRegisters, detect, read_registers
from mine_loc_sim.link_channel import LinkChannel, Obstruction, ResponseBatch
from mine_loc_sim.mine import LinkGeometry
from mine_loc_sim.radio_constants import Environment
from mine_loc_sim.range_bias import edge_lead_m, level_bias_m
from mine_loc_sim.wearer import Wearer, body_process
from mine_loc_uwb.received_power import reported_level_dbm

Reals = NDArray[np.float64]
Indices = NDArray[np.int64]
_UNUSED_LINK_M = 1e6


class LinkClass(IntEnum):
    """Paper A's four environments for one link; the numbers of mine_loc_interfaces/LinkState."""

    NO_DIRECT_PATH = 1
    OBSTRUCTED = 2
    CLEAR = 3
    CLEAR_DISTURBED = 4


@dataclass(frozen=True, slots=True)
class Radios:
    """What is the radio's own on `n` radios: noise, and what the calibration of its antenna delay has left over."""

    receiver: Receiver
    offset_m: Reals

    @staticmethod
    def draw(count: int, rng: np.random.Generator) -> "Radios":
        """Draw radios."""
        return Radios(Receiver.draw(count, rng), constants.ANCHOR_OFFSET_SD_M * rng.standard_normal(count))


@dataclass(frozen=True, slots=True)
class Exchanges:
    """`n` two-way exchanges as detected, before biases; all arrays (n,)."""

    error_m: Reals  # of the range, by detection alone; NaN = lost
    link_class: NDArray[np.int64]  # truth, LinkClass
    level_dbm: Reals  # true received level
    registers: ReceiveRegisters  # of the reception at the tag
    reception: Reception  # its accumulators


@dataclass(frozen=True, slots=True)
class Ranges:
    """Ranges over `n` links; all arrays (n,)."""

    received: NDArray[np.bool_]
    range_m: Reals  # as the radio reports it, bias by level included; NaN = lost
    level_bias_m: Reals  # the part of it that APS011 knows
    link_class: NDArray[np.int64]  # truth, LinkClass
    receive_power_dbm: Reals
    first_path_power_dbm: Reals
    exchanges: Exchanges | None  # with accumulators; None from `range_law.py`


def exchange(
    batch: ResponseBatch, loss_db: Reals, tag: Receiver, anchor: Receiver, rng: np.random.Generator
) -> Exchanges:
    """Receive `n` responses at both ends and time them.

    The range's error is the mean of both ends', since each carries half of a symmetric exchange.
    """
    count = len(loss_db)
    spectrum = band_limit(batch.taps)
    peak_delay_taps = np.abs(batch.taps).argmax(axis=1) / FINE_PER_TAP
    at_tag = accumulate(spectrum, peak_delay_taps, batch.level_dbm, tag, rng)
    at_anchor = accumulate(spectrum, peak_delay_taps, batch.level_dbm, anchor, rng)
    registers = read_registers(at_tag)
    tag_m = taps_to_m(registers.first_path_index - at_tag.direct_index)
    anchor_m = taps_to_m(detect(at_anchor) - at_anchor.direct_index)
    error_m = 0.5 * (tag_m + anchor_m) + edge_lead_m() + constants.CLOCK_JITTER_SD_M * rng.standard_normal(count)
    margin = (batch.level_dbm - constants.SENSITIVITY_DBM) / constants.SENSITIVITY_SOFTNESS_DB
    lost = rng.random(count) > 1.0 / (1.0 + np.exp(-np.clip(margin, -50.0, 50.0)))
    error_m[lost] = np.nan
    return Exchanges(
        error_m, _classify(batch, loss_db, at_tag, registers, tag_m + edge_lead_m()), batch.level_dbm, registers, at_tag
    )


def early_false_paths_m(count: int, rng: np.random.Generator) -> Reals:
    """How much too short isolated ranges are, mostly 0: noise taken for a path at the anchor, unseen at the tag."""
    false_path = rng.random(count) < constants.EARLY_FALSE_PATH_PROBABILITY
    return np.where(false_path, rng.exponential(constants.EARLY_FALSE_PATH_MEAN_M, count), 0.0)


def _classify(
    batch: ResponseBatch, loss_db: Reals, reception: Reception, registers: ReceiveRegisters, error_m: Reals
) -> NDArray[np.int64]:
    """Class of each link from what is in the way and what stands in the accumulator."""
    direct_dbm = reported_level_dbm(batch.level_dbm) + batch.direct_level_dbm - batch.level_dbm
    direct_counts = pulse_peak() * reception.symbols * 10.0 ** (0.05 * (direct_dbm + constants.POWER_CONSTANT_DB))
    disturbed = ~(np.abs(error_m) <= constants.CLEAR_ERROR_M)
    kind = np.where(disturbed, LinkClass.CLEAR_DISTURBED, LinkClass.CLEAR)
    kind = np.where(loss_db > constants.OBSTRUCTED_LOSS_DB, LinkClass.OBSTRUCTED, kind)
    return np.asarray(np.where(direct_counts < registers.threshold, LinkClass.NO_DIRECT_PATH, kind))


class Whereabouts:
    """Remembers where both ends of `count` links were when they were last used."""

    def __init__(self, count: int) -> None:
        self._last_m = np.full((count, 6), _UNUSED_LINK_M)

    def moved(self, tag_m: Reals, anchor_m: Reals, which: Indices) -> Reals:
        """Way of both ends [m] since last use, (r, k); tag_m: (r, 3), anchor_m: (r, k, 3), which: (r, k)."""
        ends = np.concatenate([np.broadcast_to(tag_m[:, None], anchor_m.shape), anchor_m], axis=2).reshape(-1, 6)
        links, latest = which.ravel(), dict[int, int]()
        before = np.empty(len(links), int)
        for number, link in enumerate(links.tolist()):
            before[number] = latest.get(link, -1)
            latest[link] = number
        change = (ends - np.where(before[:, None] < 0, self._last_m[links], ends[before])) ** 2
        self._last_m[list(latest)] = ends[list(latest.values())]
        moved_m = np.sqrt(change[:, :3].sum(axis=1)) + np.sqrt(change[:, 3:].sum(axis=1))
        return np.asarray(moved_m.reshape(which.shape))


class TagLinks:
    """State of the links between one tag and `count` anchors.

    Calls must come in order of time. Same state of `rng` and same calls, same results.
    """

    def __init__(
        self, environment: Environment, tag: Radios, anchors: Radios, wearer: Wearer, rng: np.random.Generator
    ) -> None:
        count = len(anchors.offset_m)
        self._tag, self._anchors, self._wearer, self._rng = tag, anchors, wearer, rng
        self._channel = LinkChannel(environment, count, rng)
        self._bias = GaussMarkov(count, constants.SLOW_BIAS_LENGTH_M, rng)
        self._body = body_process(count, rng)
        self._whereabouts = Whereabouts(count)

    def measure(self, tag_m: Reals, facing_rad: Reals, anchor_m: Reals, which: Indices, ways: LinkGeometry) -> Ranges:
        """Range in `r` rounds with `k` anchors each; some 10 rounds at a time run fastest.

        tag_m: (r, 3) map, m; facing_rad: (r,) yaw of the wearer, ENU; anchor_m: (r, k, 3) of anchors `which` (r, k), no
        doubles in a round; ways: geometry of the r x k links. Returns r x k ranges, round by round.
        """
        moved_m = self._whereabouts.moved(tag_m, anchor_m, which)
        body = self._wearer.shadow(off_facing(tag_m, facing_rad, anchor_m), self._body.walk(which, moved_m))
        way = obstruction(ways, *body)
        batch = self._channel.respond(which, moved_m, way)
        links = which.ravel()
        found = exchange(batch, way.loss_db, _pick(self._tag, links * 0), _pick(self._anchors, links), self._rng)
        slow_m = constants.SLOW_BIAS_SD_M * self._bias.walk(which, moved_m)
        slow_m += self._anchors.offset_m[links] + self._tag.offset_m[0]
        by_level_m = level_bias_m(found.level_dbm)
        false_m = early_false_paths_m(len(links), self._rng)
        range_m = way.distance_m + slow_m + by_level_m + found.error_m - false_m
        powers = found.registers.receive_power_dbm, found.registers.first_path_power_dbm
        return Ranges(np.isfinite(range_m), range_m, by_level_m, found.link_class, *powers, found)


def off_facing(tag_m: Reals, facing_rad: Reals, anchor_m: Reals) -> Reals:
    """Angle [rad] between where the wearer faces, (r,), and anchors (r, k, 3); (r x k,), any number of turns."""
    toward = anchor_m - tag_m[:, None]
    return np.asarray((np.arctan2(toward[..., 1], toward[..., 0]) - facing_rad[:, None]).ravel())


def obstruction(ways: LinkGeometry, body_loss_db: Reals, body_delay_m: Reals) -> Obstruction:
    """Put mine geometry and the wearer's body together."""
    return Obstruction(
        distance_m=ways.distance_m,
        loss_db=ways.loss_db + body_loss_db,
        delay_m=ways.delay_m + body_delay_m,
        detour_m=ways.detour_m,
        further_loss_db=constants.FURTHER_CORNER_LOSS_DB * np.maximum(ways.corners - 1, 0),
        sealed=ways.rock_m > 0.0,
    )


def _pick(radios: Radios, which: Indices) -> Receiver:
    return Receiver(radios.receiver.thermal_counts[which], radios.receiver.self_noise[which])
