"""The impulse response of a link as its ends move: clear, weakened, or only round the corner.

What is in the way takes the early part of the clear response, all that arrives before the shortest way round could:
it is weakened and delayed by the matter it crosses. Later paths pass the obstacle, unless rock closes the section off.
The field behind obstacles (CM8, CM4) comes on top, delayed by the way round. A first path that is weak but present, one
that is lost under the noise and a slow onset all follow from this one sum.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.channel_15_4a import (
    BIN_NS,
    FINE_PER_TAP,
    Floats,
    Taps,
    fade,
    path_loss_db,
    power_delay_profile,
)
from mine_loc_sim.gauss_markov import GaussMarkov
from mine_loc_sim.radio_constants import ChannelParameters, Environment

Reals = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Obstruction:
    """What the waves of `n` links meet; arrays (n,). Mine geometry and the wearer's body."""

    distance_m: Reals
    loss_db: Reals  # 0 = clear
    delay_m: Reals
    detour_m: Reals  # inf = no way round
    further_loss_db: Reals  # on the way round, beyond what the scattered channel stands for
    sealed: NDArray[np.bool_]  # rock: nothing of the clear response passes by


@dataclass(frozen=True, slots=True)
class ResponseBatch:
    """Composed responses: (n, bins) in root milliwatts, delay 0 = straight way in air."""

    taps: Taps
    level_dbm: Reals
    direct_level_dbm: Reals  # of the first tap's worth of the wave that goes straight through


class FadingChannel:
    """Responses of `count` links in one kind of channel, redrawn bin by bin and cluster by cluster as links move."""

    def __init__(self, parameters: ChannelParameters, count: int, rng: np.random.Generator) -> None:
        self._parameters = parameters
        self._rng = rng
        self._power, self._m = power_delay_profile(parameters, count, rng)
        self._taps = fade(self._power, self._m, rng)
        self._shadowing = GaussMarkov(count, constants.SHADOWING_LENGTH_M, rng)

    def advance(self, which: Indices, moved_m: Reals) -> tuple[Taps, Reals]:
        """Move links `which` (k,); returns responses of energy 1 (k, bins) and their shadowing [dB] (k,)."""
        renew = which[self._rng.random(len(which)) < -np.expm1(-moved_m / constants.CLUSTER_LENGTH_M)]
        if len(renew):
            self._power[renew], self._m[renew] = power_delay_profile(self._parameters, len(renew), self._rng)
            self._taps[renew] = fade(self._power[renew], self._m[renew], self._rng)
        moving = which[moved_m > 0.0]
        if len(moving):
            share = -np.expm1(-moved_m[moved_m > 0.0] / constants.FADING_LENGTH_M)
            changed = self._rng.random((len(moving), self._taps.shape[1]), np.float32) < share[:, None]
            fresh = fade(self._power[moving], self._m[moving], self._rng)
            self._taps[moving] = np.where(changed, fresh, self._taps[moving])
        taps = self._taps[which]
        taps /= np.linalg.norm(taps, axis=1, keepdims=True)
        return taps, self._parameters.shadowing_db * self._shadowing.advance(which, moved_m)


class LinkChannel:
    """Channels of `count` links."""

    def __init__(self, environment: Environment, count: int, rng: np.random.Generator) -> None:
        self._environment = environment
        self._clear = FadingChannel(environment.clear, count, rng)
        self._scattered = FadingChannel(environment.scattered, count, rng)

    def respond(self, which: Indices, moved_m: Reals, way: Obstruction) -> ResponseBatch:
        """Move links `which` (r, k), no doubles in a row, by (r, k) metres, row by row, and compose r x k responses."""
        taps, shadowing_db = _walk(self._clear, which, moved_m, np.ones(which.shape, bool))
        level_dbm = constants.TRANSMIT_POWER_DBM - path_loss_db(self._environment.clear, way.distance_m) - shadowing_db
        taps *= _root_mw(level_dbm)
        direct_dbm = _level_dbm(taps[:, :FINE_PER_TAP]) - way.loss_db
        taps = np.pad(taps, ((0, 0), (0, _LONGEST_DETOUR_BINS)))
        blocked = np.flatnonzero(way.loss_db > 0.0)
        taps[blocked] = _past_obstacle(taps[blocked], select(way, blocked))
        hidden = (way.detour_m > 0.0) & np.isfinite(way.detour_m)
        if hidden.any():
            scattered = self._scatter(which, moved_m, way, hidden)
            taps = np.pad(taps, ((0, 0), (0, max(scattered.shape[1] - taps.shape[1], 0))))
            taps[hidden, : scattered.shape[1]] += scattered
        return ResponseBatch(taps, _level_dbm(taps), direct_dbm)

    def _scatter(self, which: Indices, moved_m: Reals, way: Obstruction, hidden: NDArray[np.bool_]) -> Taps:
        """Return what comes round the obstacle or the corner to the `h` hidden links, (h, bins)."""
        taps, shadowing_db = _walk(self._scattered, which, moved_m, hidden.reshape(which.shape))
        seen = select(way, hidden)
        loss_db = path_loss_db(self._environment.scattered, seen.distance_m + seen.detour_m) + seen.further_loss_db
        taps *= _root_mw(constants.TRANSMIT_POWER_DBM - loss_db - shadowing_db)
        return _delayed(taps, _bins(seen.detour_m), taps.shape[1] + _LONGEST_DETOUR_BINS)


def _walk(channel: FadingChannel, which: Indices, moved_m: Reals, used: NDArray[np.bool_]) -> tuple[Taps, Reals]:
    """Advance a channel over rows (r, k) where `used`; returns the used links' responses and shadowing in order."""
    rows = [channel.advance(which[row, used[row]], moved_m[row, used[row]]) for row in np.flatnonzero(used.any(axis=1))]
    return np.concatenate([taps for taps, _ in rows]), np.concatenate([shadowing_db for _, shadowing_db in rows])


def _past_obstacle(direct: Taps, way: Obstruction) -> Taps:
    """What is left of clear responses (k, bins): through the obstacle, over its edge, and past it.

    Waves of excess way s leave the straight way by less than an ellipse with semi-minor axis ~ sqrt(s); an obstacle
    round which the way is longer by D hides those with s < D wholly, of the others the share 2/pi asin sqrt(D/s).
    """
    round_bins = np.maximum(_bins(way.detour_m), FINE_PER_TAP)[:, None]
    age = np.maximum(np.arange(direct.shape[1]), round_bins)
    seen = np.sqrt(1.0 - np.arcsin(np.sqrt(round_bins / age)) * (2.0 / np.pi)) * ~way.sealed[:, None]
    early = (direct * (np.arange(direct.shape[1]) < round_bins))[:, :-_LONGEST_DETOUR_BINS]
    past = direct * seen.astype(np.float32)
    past += _delayed(early * _root_mw(-way.loss_db), _bins(way.delay_m), direct.shape[1])
    edge_db = np.where(way.sealed | (way.detour_m <= 0.0), 300.0, knife_edge_loss_db(way.detour_m))
    past += _delayed(early[:, :FINE_PER_TAP] * _root_mw(-edge_db), _bins(way.detour_m), direct.shape[1])
    return past


def knife_edge_loss_db(detour_m: Reals) -> Reals:
    """Diffraction over one edge by excess way (ITU-R P.526, eq. 31: nu = 2 sqrt(detour / wavelength))."""
    nu = 2.0 * np.sqrt(np.where(np.isfinite(detour_m), detour_m, 1e6) / constants.CARRIER_WAVELENGTH_M) - 0.1
    return np.asarray(6.9 + 20.0 * np.log10(np.sqrt(nu**2 + 1.0) + nu))


def select(way: Obstruction, which: NDArray[Any]) -> Obstruction:
    """Only the links `which`."""
    return Obstruction(*(getattr(way, field.name)[which] for field in fields(way)))


_LONGEST_DETOUR_BINS = 300
"""30 m: energy that comes later still is put there; it is past the accumulator's first-path search in any case."""


def _bins(way_m: Reals) -> Indices:
    late = np.rint(way_m / (constants.LIGHT_M_PER_S * BIN_NS * 1e-9))
    return np.asarray(np.clip(late, 0, _LONGEST_DETOUR_BINS).astype(int))


def _delayed(taps: Taps, bins: Indices, width: int) -> Taps:
    """Shift each row of (n, b) by its own number of bins into (n, width)."""
    shifted = np.zeros((len(taps), width), np.complex64)
    columns = bins[:, None] + np.arange(taps.shape[1])
    np.put_along_axis(shifted, columns, taps, axis=1)
    return shifted


def _root_mw(level_dbm: Reals) -> Floats:
    return (10.0 ** (0.05 * level_dbm)).astype(np.float32)[:, None]


def _level_dbm(taps: Taps) -> Reals:
    energy = (taps.real.astype(np.float64) ** 2 + taps.imag.astype(np.float64) ** 2).sum(axis=1)
    return np.asarray(10.0 * np.log10(np.maximum(energy, 1e-30)))
