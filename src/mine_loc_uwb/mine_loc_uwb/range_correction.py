"""Correction of ranges in stages: antenna delay, bias by received power, polynomial of links without line of sight.

Each stage takes what the one before has left. Paper A applies the polynomial to links without line of sight only; a
classifier knows these with a probability p. Their law is the polynomial and that of the others the identity, so what is
expected of a link is p times the one and 1 - p times the other: p times the polynomial's correction is subtracted. What
stays unknown goes into the variance (law of total variance): the polynomial's residuals with p, and p (1 - p) times the
square of the correction in doubt.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_uwb.power_bias import NO_POWER_BIAS, PowerBias
from mine_loc_uwb.range_polynomial import RangePolynomial

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedRanges:
    """Arrays of the ranges' shape: `range_m` = raw range - `bias_m`; `added_variance_m2` on top of white noise."""

    range_m: Array
    bias_m: Array
    added_variance_m2: Array


@dataclass(frozen=True, slots=True)
class RangeCorrection:
    """All that is known of a site's ranges. The default corrects nothing."""

    antenna_offset_m: float = 0.0
    """Common to all links of the site, subtracted; what one anchor adds to it is its `range_offset_m` in site.yaml."""
    power_bias: PowerBias = NO_POWER_BIAS
    nlos: RangePolynomial | None = None
    stamp_latency_s: float = 0.0
    """Instant of measurement = stamp - this. Applied by who stamps, not here."""

    def correct(
        self,
        raw_range_m: Array,
        receive_power_dbm: Array,
        nlos_probability: Array,
        anchor_offset_m: Array | float = 0.0,
    ) -> CorrectedRanges:
        """Correct ranges as reported, any shape, all of one shape.

        receive_power_dbm: as reported, NaN = not, then its stage is passed over; nlos_probability: 0..1 that there is
        no line of sight, NaN = not judged, taken for line of sight; anchor_offset_m: each anchor's `range_offset_m`.
        A NaN range stays NaN in `range_m`.
        """
        bias_m = self.antenna_offset_m + anchor_offset_m + self.power_bias.at_reported_power_m(receive_power_dbm)
        if self.nlos is None:
            return CorrectedRanges(raw_range_m - bias_m, bias_m, np.zeros(np.shape(raw_range_m)))
        probability = np.clip(np.nan_to_num(nlos_probability, nan=0.0), 0.0, 1.0)
        clear_m = raw_range_m - bias_m
        correction_m = self.nlos.correction_m(clear_m)
        uncorrected_m = self.nlos.excess_m(clear_m) - correction_m
        left_m2 = self.nlos.residual_sd_m**2 + uncorrected_m**2
        variance_m2 = probability * left_m2 + probability * (1.0 - probability) * correction_m**2
        bias_m = bias_m + np.where(probability > 0.0, probability * correction_m, 0.0)
        return CorrectedRanges(raw_range_m - bias_m, bias_m, np.where(np.isfinite(variance_m2), variance_m2, 0.0))
