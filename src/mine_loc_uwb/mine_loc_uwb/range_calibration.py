"""All stages of a range correction from labelled pairs, and how well they do on pairs they have not seen."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.antenna_delay import fit_offset_m
from mine_loc_uwb.polynomial_fit import Loss, fit_polynomial, fold_of_groups
from mine_loc_uwb.power_bias import NO_POWER_BIAS, PowerBias, aps011, measured_table
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.range_pairs import RangePairs

Array = npt.NDArray[np.float64]
PowerChoice = Literal["auto", "none", "aps011", "table"]
_FOLDS = 5


@dataclass(frozen=True, slots=True)
class CalibrationOptions:
    """What is fitted and how."""

    power_bias: PowerChoice = "auto"
    bandwidth_mhz: int = 500
    prf_mhz: int = 64
    loss: Loss = "absolute"
    max_degree: int = 6
    stamp_latency_s: float = 0.0


@dataclass(frozen=True, slots=True)
class RangeError:
    """Range errors of one kind of link [m]."""

    pairs: int
    mean_m: float
    mean_absolute_m: float
    rmse_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The correction, and errors by label ("LOS", "NLOS") before it, after it, and after one that had not seen them."""

    correction: RangeCorrection
    before: dict[str, RangeError]
    after: dict[str, RangeError]
    held_out: dict[str, RangeError]


def calibrate(pairs: RangePairs, options: CalibrationOptions, *, folds: int = _FOLDS) -> Calibration:
    """Fit antenna delay and power bias to the pairs in line of sight and the polynomial to the others.

    Held-out errors come from the whole procedure, choices included, repeated without the groups that are judged. Raises
    ConfigurationError when there is nothing to fit, or too few pairs without line of sight for a polynomial.
    """
    if not len(pairs):
        raise ConfigurationError("pairs: none; allowed: at least some with both ranges")
    correction = fit_correction(pairs, options)
    names, group = np.unique(pairs.group, return_inverse=True)
    fold = fold_of_groups(len(names), folds)[group]
    unseen_m = np.full(len(pairs), np.nan)
    for each in np.unique(fold) if len(names) > 1 else ():
        try:
            other = fit_correction(pairs.only(fold != each), options)
        except ConfigurationError:
            continue  # too few are left without this fold: its pairs are not judged
        unseen_m[fold == each] = corrected_m(other, pairs.only(fold == each))
    return Calibration(
        correction,
        errors_by_label(pairs, pairs.measured_m),
        errors_by_label(pairs, corrected_m(correction, pairs)),
        errors_by_label(pairs, unseen_m),
    )


def fit_correction(pairs: RangePairs, options: CalibrationOptions) -> RangeCorrection:
    """The stages alone."""
    clear, hidden = pairs.only(~pairs.nlos), pairs.only(pairs.nlos)
    power_bias = _power_bias(clear, options)
    offset_m = fit_offset_m(clear.measured_m - clear.true_m - power_bias.at_reported_power_m(clear.receive_power_dbm))
    first = RangeCorrection(offset_m, power_bias, None, options.stamp_latency_s)
    if not len(hidden):
        return first
    left_m = corrected_m(first, hidden)
    fit = fit_polynomial(left_m, hidden.true_m, hidden.group, loss=options.loss, max_degree=options.max_degree)
    return RangeCorrection(offset_m, power_bias, fit.polynomial, options.stamp_latency_s)


def corrected_m(correction: RangeCorrection, pairs: RangePairs) -> Array:
    """Ranges (n,) corrected as the labels say."""
    return correction.correct(pairs.measured_m, pairs.receive_power_dbm, pairs.nlos.astype(np.float64)).range_m


def errors_by_label(pairs: RangePairs, range_m: Array) -> dict[str, RangeError]:
    """Errors of ranges (n,) against the pairs' truth; NaN ranges are left out, labels without any too."""
    kinds = {"LOS": ~pairs.nlos, "NLOS": pairs.nlos}
    found = {}
    for label, kind in kinds.items():
        error_m = (range_m - pairs.true_m)[kind & np.isfinite(range_m)]
        if len(error_m):
            rmse_m = float(np.sqrt(np.mean(error_m**2)))
            found[label] = RangeError(len(error_m), float(error_m.mean()), float(np.abs(error_m).mean()), rmse_m)
    return found


def _power_bias(clear: RangePairs, options: CalibrationOptions) -> PowerBias:
    """The law that is asked for, or with "auto" the one that leaves held-out clear ranges the least mean error."""
    error_m = clear.measured_m - clear.true_m
    if options.power_bias != "auto":
        return _law(options.power_bias, clear.receive_power_dbm, error_m, options)
    names, group = np.unique(clear.group, return_inverse=True)
    if len(names) < 2 or not np.isfinite(clear.receive_power_dbm).any():
        return NO_POWER_BIAS
    fold = fold_of_groups(len(names), _FOLDS)[group]
    kinds: tuple[PowerChoice, ...] = ("none", "aps011", "table")
    losses = [_held_out_loss(kind, clear.receive_power_dbm, error_m, fold, options) for kind in kinds]
    return _law(kinds[int(np.argmin(losses))], clear.receive_power_dbm, error_m, options)


def _held_out_loss(
    kind: PowerChoice,
    power_dbm: Array,
    error_m: Array,
    fold: npt.NDArray[np.int64],
    options: CalibrationOptions,
) -> float:
    left_m = np.empty(len(error_m))
    for each in np.unique(fold):
        out = fold == each
        law = _law(kind, power_dbm[~out], error_m[~out], options)
        offset_m = fit_offset_m(error_m[~out] - law.at_reported_power_m(power_dbm[~out]))
        left_m[out] = error_m[out] - law.at_reported_power_m(power_dbm[out]) - offset_m
    return float(np.mean(np.abs(left_m)))


def _law(kind: PowerChoice, power_dbm: Array, error_m: Array, options: CalibrationOptions) -> PowerBias:
    if kind == "aps011":
        return aps011(options.bandwidth_mhz, options.prf_mhz)
    return measured_table(power_dbm, error_m) if kind == "table" else NO_POWER_BIAS
