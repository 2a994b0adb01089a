"""Every free constant of the radio simulation, each with its source or the word "assumed".

Sources by short name:
4a    IEEE 802.15.4a channel model, final report 15-04-0662-02-004a, as tabulated by MathWorks' `uwbChannelConfig`
UM    Decawave DW1000 User Manual
APS   Decawave APS011, sources of error in DW1000 two-way ranging
cirs  Kolakowski, uwb-cirs-2018 (10.5281/zenodo.4742391): figure measured here on its 7934 accumulators
D.1   error statistics of public DW1000 recordings with truth (Fontaine et al. 2023, Stocker et al. 2021, cirs)
P2040 ITU-R P.2040, table of building materials (real permittivity; conductivity c f^d), taken at 4 GHz
"""

from dataclasses import dataclass

from mine_loc_uwb.ranging import LIGHT_IN_AIR_M_PER_S


@dataclass(frozen=True, slots=True)
class ChannelParameters:
    """One column of the final report's tables (4a). `rise_ns` > 0 selects the single soft-onset cluster."""

    name: str
    path_loss_1m_db: float  # antenna attenuation is in it where the report's reference loss holds it
    path_loss_exponent: float
    shadowing_db: float
    nakagami_mean_db: float
    nakagami_sd_db: float
    span_ns: float  # response is cut here: assumed, more than 5 decay constants
    mean_clusters: float = 1.0
    cluster_rate_per_ns: float = 0.0
    cluster_decay_ns: float = 0.0
    cluster_spread_db: float = 0.0
    ray_decay_ns: float = 0.0
    ray_decay_slope: float = 0.0
    first_path_m: float = 0.0  # 0 = the first path fades as the others do
    onset_weight: float = 0.0
    rise_ns: float = 0.0
    soft_decay_ns: float = 0.0


CM7 = ChannelParameters(
    "CM7", 56.7, 1.2, 6.0, 0.36, 1.13, 240.0,
    mean_clusters=4.75, cluster_rate_per_ns=0.0709, cluster_decay_ns=13.47, cluster_spread_db=4.32,
    ray_decay_ns=0.651, ray_decay_slope=0.926, first_path_m=10.0**1.299,
)  # fmt: skip
"""Industrial line of sight (4a)."""

CM8 = ChannelParameters(
    "CM8", 56.7, 2.15, 6.0, 0.30, 1.15, 640.0, onset_weight=1.0, rise_ns=17.35, soft_decay_ns=85.36
)  # fmt: skip
"""Industrial, no line of sight (4a)."""

CM4 = ChannelParameters(
    "CM4", 60.9, 3.07, 3.9, 0.50, 0.25, 160.0, onset_weight=0.86, rise_ns=15.21, soft_decay_ns=11.84
)  # fmt: skip
"""Office, no line of sight (4a; 57.9 dB + 3 dB antennas; onset of Molisch et al., IEEE TAP 54:3151, 2006)."""

# Transmitter and propagation
TRANSMIT_POWER_DBM = -14.3
"""-41.3 dBm/MHz over 499.2 MHz: the legal limit, no antenna gain."""
LIGHT_M_PER_S = LIGHT_IN_AIR_M_PER_S
CARRIER_WAVELENGTH_M = 0.075
"""Channel 2, 3993.6 MHz (UM): the channel of cirs."""

# DW1000 receiver
ACCUMULATOR_TAPS = 1016
"""At PRF 64 MHz (UM 7.2.38); also the length of a preamble symbol, so late energy wraps round."""
PULSE_PERIOD_TAPS = 2.2
"""Raised cosine of full roll-off: 0.02, 0.2, 0.5, 0.82 and 0.99 of its peak at -1, -0.5, 0, 0.5 and 1 taps from half
height; medians over the LOS placements of cirs: 0.05, 0.18, 0.49, 0.82 and 0.98, and nothing above 0.03 before."""
POWER_CONSTANT_DB = 121.74
"""A in the power formulas at PRF 64 MHz (UM 4.7)."""
ACCUMULATOR_LIMIT = 16384.0
"""Accumulation stops as soon as a component reaches it: peaks pile up there, RXPACC falls with level (cirs)."""
PREAMBLE_COUNT_1024 = 998
"""Symbols accumulated of a preamble of 1024 when nothing saturates (cirs)."""
SFD_SYMBOLS = 64
"""Symbols counted besides by RXPACC of an unsaturated reception: standard SFD at 110 kbit/s (UM 7.2.18)."""
NOISE_PER_SYMBOL_COUNTS = 7.7
NOISE_FIGURE_LN_SD = 0.2
"""Rms |z| of noise a square root of symbols; median and spread over receivers (cirs, placements below -88 dBm)."""
SELF_NOISE_RATIO = 0.0045
SELF_NOISE_LN_SD = 0.4
"""Noise floor that grows with the signal, as share of the root of total energy (cirs, placements at the ceiling)."""
NOISE_THRESHOLD_MULTIPLIER = 13.0
"""NTM of LDE_CFG1, default 0x6D (UM 7.2.47)."""
STD_NOISE_SHARE = 0.87
"""STD_NOISE over the standard deviation of |z| before the first path: logged thresholds are this much lower (cirs)."""
SATURATED_THRESHOLD_SHARE = 0.58
"""A saturated reception's threshold is higher by this share of the full preamble count over RXPACC (cirs)."""
SATURATED_THRESHOLD_MOST = 2.3
"""Most that this raises it, at the smallest RXPACC of cirs, 258."""
NOISE_WINDOW_TAPS = (64, 700)
"""Where STD_NOISE is taken: before any first path of cirs; the chip's own window is not published, assumed."""
SEARCH_START_TAP = 720
"""Leading edges are sought from here on: first paths of cirs lie at 719 and later."""
FIRST_PATH_TAPS = (744.0, 752.0)
"""Where the chip puts the first path of a response that peaks at once: p5 to p95 over LOS placements (cirs)."""
PEAK_PULL = 0.35
"""First path moves forward by this share of the peak's delay: placements with late peaks (cirs)."""
SENSITIVITY_DBM = -106.0
"""Weakest reception at 110 kbit/s (DW1000 data sheet); -98 at 6.8 Mbit/s."""
SENSITIVITY_SOFTNESS_DB = 1.0
"""Width of the edge of sensitivity: assumed."""
EARLY_FALSE_PATH_PROBABILITY = 0.005
EARLY_FALSE_PATH_MEAN_M = 4.0
"""Isolated outliers 0.5 to 1 % recommended by D.1; that they are early, and -4 m: Qorvo forum thread 2943."""

# Links
SLOW_BIAS_SD_M = 0.05
"""What antenna patterns and mounting add to a link while nobody moves: assumed, half of the 0.10 m that D.1 recommends
for a model without a leading edge, because the spread of the leading edge over links is simulated here."""
SLOW_BIAS_LENGTH_M = 1.0
"""Way over which it fades to 1/e: not measured anywhere, D.1 says to assume 0.5 to 2 m."""
SHADOWING_LENGTH_M = 3.0
"""Correlation way of log-normal shadowing indoors: assumed, of the order of the obstacles."""
CLUSTER_LENGTH_M = 1.0
"""Way over which a link's clusters are redrawn: assumed."""
FADING_LENGTH_M = CARRIER_WAVELENGTH_M / 2.0
"""Way over which a bin's fading is redrawn: first null of the field correlation is near 0.4 wavelengths (Clarke)."""
ANCHOR_OFFSET_SD_M = 0.03
"""Left over after each anchor's antenna delay is calibrated: assumed."""
CLOCK_JITTER_SD_M = 0.015
"""Timestamps of a range besides the leading edge (clock noise over the reply times): assumed, so small that D.1's white
noise of 0.014 to 0.028 m on a fixed link holds both."""
CRYSTAL_OFFSET_SD_PPM = 5.0
"""DWM1000 crystals are trimmed to a few ppm; limit of the standard is 20: assumed."""
CRYSTAL_WANDER_PPM_PER_ROOT_S = 0.01
"""Random walk of the crystal by temperature: assumed."""
ANCHOR_SYNC_SD_S = 0.3e-9
"""TDOA: slowly varying error of an anchor's clock against the reference by wireless synchronisation: assumed."""
ANCHOR_SYNC_TIME_S = 5.0
"""Correlation time of that error: assumed, some synchronisation periods."""


# Matter in the way
@dataclass(frozen=True, slots=True)
class Matter:
    """What a metre of it does to a wave at 4 GHz."""

    loss_db_per_m: float
    surface_loss_db: float
    delay_index: float  # refractive index minus 1: excess way a metre


MATTER = {
    "rock": Matter(98.0, 3.0, 1.29),  # as concrete: assumed
    "concrete": Matter(98.0, 3.0, 1.29),  # P2040: permittivity 5.24, conductivity 0.0462 f^0.7822
    "wood": Matter(24.0, 0.5, 0.41),  # P2040: 1.99, 0.0047 f^1.0718
    "steel": Matter(1e4, 20.0, 0.0),  # opaque
    "water": Matter(700.0, 5.0, 7.7),  # Debye water at 4 GHz: permittivity 76, imaginary part 15
}
BODY_LOSS_DB = (10.0, 20.0)
BODY_DELAY_M = (0.2, 0.6)
"""Loss and excess way behind the wearer's own body, per person uniform between the two (D.4)."""
BODY_DELAY_SD_M = 0.15
"""Spread of that excess way from place to place (D.4)."""
BODY_RADIUS_M = 0.25
"""Another person as a cylinder, with the loss above when crossed in the middle: assumed."""
FURTHER_CORNER_LOSS_DB = 20.0
"""Each corner beyond the first, which CM8's own loss stands for: assumed."""


@dataclass(frozen=True, slots=True)
class Environment:
    """Channels of one kind of place: seen directly, and what arrives round obstacles."""

    clear: ChannelParameters
    scattered: ChannelParameters


INDUSTRIAL = Environment(CM7, CM8)
"""Mines, halls: the channels of paper D."""
OFFICE = Environment(CM7, CM4)
"""Buildings. CM7 stays for clear links: as many of them as of real ones (D.2, 15 to 27 %) have RX-FP above 6 dB, of
office LOS (CM3) half."""
OBSTRUCTED_LOSS_DB = 3.0
"""Link class 2 begins here: half the power, assumed."""
CLEAR_ERROR_M = 0.09
"""Link class 3 ends here: three times the white noise of D.1."""
