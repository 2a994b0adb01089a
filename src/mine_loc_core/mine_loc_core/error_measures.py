"""Positioning error in the words of ISO/IEC 18305."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class HorizontalError:
    """Statistics of the horizontal distance between estimate and truth [m]; CE95 is its 95 % quantile."""

    count: int
    mean_m: float
    rmse_m: float
    median_m: float
    third_quartile_m: float
    ce95_m: float
    max_m: float


def horizontal_error(errors_m: Array) -> HorizontalError:
    """Statistics of errors (n, 2) or of distances (n,). Raises ValueError when there are none or one is not finite."""
    distances = np.linalg.norm(errors_m, axis=1) if errors_m.ndim == 2 else np.asarray(errors_m)
    if not len(distances) or not np.isfinite(distances).all():
        raise ValueError("horizontal error needs at least one error, all finite")
    median, third_quartile, ce95 = np.percentile(distances, [50, 75, 95])
    return HorizontalError(
        len(distances),
        float(distances.mean()),
        float(np.sqrt(np.mean(distances**2))),
        float(median),
        float(third_quartile),
        float(ce95),
        float(distances.max()),
    )


def availability(output_times_s: Array, start_s: float, end_s: float, *, max_age_s: float) -> float:
    """Share of the instants from `start_s` to `end_s`, every 50 ms, whose last output is no older than `max_age_s`."""
    instants = np.arange(start_s, end_s, 0.05)
    times = np.sort(output_times_s)
    if not len(instants) or not len(times):
        return 0.0
    last = np.searchsorted(times, instants, side="right") - 1
    fresh = (last >= 0) & (instants - times[np.maximum(last, 0)] <= max_age_s)
    return float(np.mean(fresh))
