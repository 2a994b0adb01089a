"""What the radio measured: the messages every wire format decodes to.

Ids are unsigned 64-bit, 0 = not named on the wire (invalid as an anchor). Powers are in dBm, NaN where the device does
not report them. Ticks count the device clock of the decoder (`tick_period_s`, `counter_bits`).
"""

from dataclasses import dataclass
from math import nan

import numpy as np
import numpy.typing as npt

DW1000_TAP_S = 1.0 / (2 * 499.2e6)
"""Sample period of the DW1000 accumulator, 1.0016 ns (DW1000 User Manual, register file 0x25)."""

LIGHT_IN_AIR_M_PER_S = 299_702_547.0
"""As Decawave uses it (DW1000 User Manual)."""

DW1000_MAX_TAPS = 1016
"""Accumulator length at PRF 64 MHz; 992 at 16 MHz."""


@dataclass(frozen=True, slots=True)
class Range:
    """One range of a ranging round. `range_m` is NaN when the exchange was tried and failed."""

    anchor_id: int
    range_m: float
    first_path_power_dbm: float = nan
    receive_power_dbm: float = nan
    first_path_index: float = nan
    """Position of the first path in the accumulator [taps]."""
    clock_offset_ppm: float = nan
    """Carrier clock offset of the anchor against the tag, positive = the anchor's clock is faster."""
    ticks_offset: int = 0
    """Instant of this exchange minus `device_ticks` of the round [ticks]."""


@dataclass(frozen=True, slots=True)
class DevicePosition:
    """A position computed inside the device; carried for comparison, never fused."""

    tag_id: int
    x_m: float
    y_m: float
    z_m: float
    quality_percent: int


@dataclass(frozen=True, slots=True)
class RangingRound:
    """All ranges one tag measured in one round."""

    tag_id: int
    reporter_id: int
    """Unit on whose serial line the round came, 0 = unknown."""
    seq: int | None
    """Round counter of the device, wrapping at 2**`seq_bits` of the decoder; None = it has none."""
    device_ticks: int | None
    ranges: tuple[Range, ...]
    corrected: bool
    """The firmware has already subtracted the range bias."""
    device_position: DevicePosition | None = None


@dataclass(frozen=True, slots=True)
class AnchorRange:
    """Distance between two anchors; an id is 0 where the wire does not name the anchor."""

    first_anchor_id: int
    second_anchor_id: int
    range_m: float


@dataclass(frozen=True, slots=True)
class AnchorRanging:
    """Distances the anchors measured among themselves."""

    reporter_id: int
    seq: int | None
    device_ticks: int | None
    ranges: tuple[AnchorRange, ...]


@dataclass(frozen=True, slots=True)
class TdoaDifference:
    """Distance to `anchor_id` minus distance to the reference anchor; NaN = invalid."""

    anchor_id: int
    range_difference_m: float
    receive_power_dbm: float = nan
    first_path_power_dbm: float = nan


@dataclass(frozen=True, slots=True)
class TdoaBlink:
    """All range differences of one blink of one tag; `device_ticks` is the clock of the reference anchor."""

    tag_id: int
    seq: int
    device_ticks: int
    reference_anchor_id: int
    reference_receive_power_dbm: float
    differences: tuple[TdoaDifference, ...]


@dataclass(frozen=True, slots=True, eq=False)
class CirWindow:
    """A window of the DW1000 accumulator, or all of it. `in_phase` and `quadrature` are int16 of shape (taps,)."""

    tag_id: int
    anchor_id: int
    seq: int
    """`seq` of the round this reception belongs to."""
    device_ticks: int
    range_m: float
    first_path_index: float
    """Position of the first path in the whole accumulator [taps], NaN = none."""
    start_index: int
    """Position of the window's first sample in the whole accumulator."""
    preamble_count: int
    """RXPACC; 0 = not reported."""
    noise_std: float
    """STD_NOISE [counts], NaN = not reported."""
    first_path_amplitude: tuple[int, int, int]
    receive_power_counts: int
    """CIR_PWR."""
    channel: int
    prf_mhz: int
    in_phase: npt.NDArray[np.int16]
    quadrature: npt.NDArray[np.int16]
    first_path_power_dbm: float = nan
    receive_power_dbm: float = nan


Message = RangingRound | AnchorRanging | DevicePosition | TdoaBlink | CirWindow
