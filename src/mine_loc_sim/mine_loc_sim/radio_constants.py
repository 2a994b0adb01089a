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
    ray_rate_per_ns: float = 0.0  # 0 = dense, a ray in every delay bin
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
    "CM8", 56.7, 2.15, 6.0, 0.30, 1.15, 800.0, onset_weight=1.0, rise_ns=17.35, soft_decay_ns=85.36
)  # fmt: skip
"""Industrial, no line of sight (4a)."""

CM3 = ChannelParameters(
    "CM3", 38.4, 1.63, 1.9, 0.42, 0.31, 160.0,
    mean_clusters=5.4, cluster_rate_per_ns=0.016, cluster_decay_ns=14.6, cluster_spread_db=3.0,
    ray_decay_ns=6.4, ray_rate_per_ns=1.0 / (0.0184 / 0.19 + 0.9816 / 2.97), first_path_m=10.0**0.3,
)  # fmt: skip
"""Office line of sight (4a; 35.4 dB + 3 dB antennas). Poisson arrivals of the same mean rate stand for the report's
hyper-exponential ray gaps; cluster spread and first-path m are the report's companion code's, assumed there too."""

CM4 = ChannelParameters(
    "CM4", 60.9, 3.07, 3.9, 0.50, 0.25, 160.0, onset_weight=0.86, rise_ns=15.21, soft_decay_ns=11.84
)  # fmt: skip
"""Office, no line of sight (4a; 57.9 dB + 3 dB antennas)."""
