"""Made-up walks for the tests of activities: a steady bounce, and headings that turn as told."""

import math

import numpy as np

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.activity_window import BIN_NS, BINS, ActivityWindow, WindowStream

G = 9.80665
START_NS = 1_700_000_000 * NS_PER_S


def samples(turns_deg, *, bounce_m_s2=2.0, rate_hz=100, start_ns=START_NS):
    """(stamp, heading, force) of one second for each entry, in which the heading changes by so many degrees."""
    period_ns = NS_PER_S // rate_hz
    heading = 0.0
    for second, turn_deg in enumerate(turns_deg):
        for k in range(rate_hz):
            t_s = second + k / rate_hz
            up = G + bounce_m_s2 * math.sin(2 * math.pi * 1.8 * t_s)
            yield start_ns + (second * rate_hz + k) * period_ns, math.remainder(heading, math.tau), (0.0, 0.0, up)
            heading += math.radians(turn_deg) / rate_hz


def windows(turns_deg, *, hop_ns=NS_PER_S, **how):
    stream = WindowStream(hop_ns)
    return [w for sample in samples(turns_deg, **how) if (w := stream.push(*sample)) is not None]


def window(turn_deg, *, begin_s=1.5, lasts_s=1.0, sd_m_s2=1.4, swing_deg=0.0):
    """A window in which the person turns by so much; the waist swings once to either side in every second."""
    t_s = np.arange(BINS + 1) * BIN_NS / NS_PER_S
    heading = np.radians(turn_deg) * np.clip((t_s - begin_s) / lasts_s, 0.0, 1.0)
    heading += np.radians(swing_deg) * np.sin(2 * np.pi * t_s)
    return ActivityWindow(START_NS, heading - heading[0], np.zeros(BINS), np.full(BINS, sd_m_s2**2))


def late(sample, by_ms):
    stamp_ns, *rest = sample
    return stamp_ns + by_ms * NS_PER_MS, *rest
