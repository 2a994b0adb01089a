"""Impulse responses of the IEEE 802.15.4a channel model (final report 15-04-0662-02-004a), drawn many at a time.

The mean power of a response (its clusters) and its small-scale fading are drawn apart, because a walking tag sees the
fading change within half a wavelength and the clusters only within a metre or so.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim.radio_constants import ChannelParameters

Floats = NDArray[np.float32]
Taps = NDArray[np.complex64]

TAP_NS = 1e3 / (2.0 * 499.2)
"""DW1000 accumulator tap, 1.0016 ns (DW1000 User Manual 7.2.38)."""
FINE_PER_TAP = 3
"""Delay bins per tap, 1/3 ns: six per pulse; the receiver places them between taps without a grid."""
BIN_NS = TAP_NS / FINE_PER_TAP
_LEAST_NAKAGAMI_M = 0.5


def without_clusters(parameters: ChannelParameters) -> ChannelParameters:
    """The same environment with one cluster: mines show no path clustering (IEEE TAP 56:540, 2008)."""
    return dataclasses.replace(parameters, mean_clusters=1.0, name=parameters.name + " single cluster")


def bin_count(parameters: ChannelParameters) -> int:
    """Number of delay bins of a response."""
    return round(parameters.span_ns / BIN_NS)


def power_delay_profile(parameters: ChannelParameters, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw `count` profiles of mean power.

    Returns (power, m): mean power of each delay bin, shape (count, bins), sum 1 a row, and the Nakagami shape of each
    bin, same shape.
    """
    bins = bin_count(parameters)
    delay_ns = (np.arange(bins) * BIN_NS).astype(np.float32)
    shape_db = rng.standard_normal((count, bins), np.float32) * parameters.nakagami_sd_db + parameters.nakagami_mean_db
    m = np.maximum(10.0 ** (0.1 * shape_db), _LEAST_NAKAGAMI_M).astype(np.float32)
    if parameters.rise_ns > 0.0:
        soft = _soft_onset(parameters, delay_ns)
        return np.broadcast_to(soft / soft.sum(), (count, bins)).copy(), m
    power = _clusters(parameters, delay_ns, m, rng)
    return (power / power.sum(axis=1, keepdims=True)).astype(np.float32), m


def _soft_onset(parameters: ChannelParameters, delay_ns: Floats) -> Floats:
    onset = 1.0 - parameters.onset_weight * np.exp(-delay_ns / parameters.rise_ns)
    return np.asarray(onset * np.exp(-delay_ns / parameters.soft_decay_ns), np.float32)


def _clusters(parameters: ChannelParameters, delay_ns: Floats, m: Floats, rng: np.random.Generator) -> Floats:
    """Sum of Poisson clusters, final report's Saleh-Valenzuela form; sets `m` of the first path of each cluster."""
    count = len(m)
    clusters = (
        np.maximum(1, rng.poisson(parameters.mean_clusters, count))
        if parameters.mean_clusters > 1.0
        else np.ones(count, int)
    )
    most = int(clusters.max())
    gaps_ns = rng.exponential(1.0 / parameters.cluster_rate_per_ns, (count, most))
    gaps_ns[:, 0] = 0.0
    first_bin = np.floor(np.cumsum(gaps_ns, axis=1) / BIN_NS).astype(int)
    spread_db = parameters.cluster_spread_db * rng.standard_normal((count, most))
    power = np.zeros_like(m)
    rows = np.arange(count)
    for cluster in range(most):
        live = rows[(cluster < clusters) & (first_bin[:, cluster] < len(delay_ns))]
        start_ns = first_bin[live, cluster, None] * BIN_NS
        decay_ns = parameters.ray_decay_slope * start_ns + parameters.ray_decay_ns
        energy = 10.0 ** (0.1 * spread_db[live, cluster, None]) * np.exp(-start_ns / parameters.cluster_decay_ns)
        since_ns = delay_ns - start_ns.astype(np.float32)
        rays = (energy / decay_ns).astype(np.float32) * np.exp(-np.maximum(since_ns, 0.0) / decay_ns.astype(np.float32))
        power[live] += np.where(since_ns > -0.5 * BIN_NS, rays, np.float32(0.0))
        if parameters.first_path_m > 0.0:
            m[live, first_bin[live, cluster]] = parameters.first_path_m
    return power


def fade(power: Floats, m: Floats, rng: np.random.Generator) -> Taps:
    """Draw complex bin amplitudes: |a|^2 ~ Gamma(shape m, mean `power`), phase uniform; any shape."""
    energy = rng.standard_gamma(m, dtype=np.float32) * (power / m)
    phase = rng.random(m.shape, np.float32) * np.float32(2.0 * np.pi)
    amplitude = np.sqrt(energy)
    taps = np.empty(m.shape, np.complex64)
    taps.real = amplitude * np.cos(phase)
    taps.imag = amplitude * np.sin(phase)
    return taps


def draw_responses(parameters: ChannelParameters, count: int, rng: np.random.Generator) -> Taps:
    """Draw `count` impulse responses of total energy 1, shape (count, bins), bins `BIN_NS` apart."""
    taps = fade(*power_delay_profile(parameters, count, rng), rng)
    taps /= np.linalg.norm(taps, axis=1, keepdims=True)
    return taps


def path_loss_db(parameters: ChannelParameters, distance_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median path loss; distances below 0.1 m count as 0.1 m. Shadowing is the link's, since it varies with place."""
    return parameters.path_loss_1m_db + 10.0 * parameters.path_loss_exponent * np.log10(np.maximum(distance_m, 0.1))


def delay_statistics(taps: Taps, spacing_ns: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean excess delay and RMS delay spread [ns] of responses of shape (n, bins), both of shape (n,)."""
    energy = np.abs(taps).astype(np.float64) ** 2
    delay_ns = np.arange(taps.shape[1]) * spacing_ns
    total = energy.sum(axis=1)
    mean_ns = energy @ delay_ns / total
    return mean_ns, np.sqrt(np.maximum(energy @ delay_ns**2 / total - mean_ns**2, 0.0))
