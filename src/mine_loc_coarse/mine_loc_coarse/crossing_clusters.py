"""Agglomerative hierarchical clustering of crossings (paper E, step 4), one dendrogram an emission.

The distance is Mahalanobis', by the covariances of both crossings, and complete linkage stops where two crossings of
one emitter would be farther apart only once in a thousand times: the threshold comes from the expected error. The
dendrogram is scipy's.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from mine_loc_coarse.crossing import pairs_within
from mine_loc_core.gates import chi2_quantile

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_SAME = 0.999


def clusters(position_m: Array, covariance_m2: Array, emission: Indices) -> Indices:
    """Number of the cluster of each crossing (n,), given in order of `emission`; numbers follow that order too."""
    if not len(emission):
        return np.zeros(0, np.int64)
    threshold = math.sqrt(chi2_quantile(_SAME, 2))
    first, second = pairs_within(emission)
    distance = _mahalanobis(position_m[first] - position_m[second], covariance_m2[first] + covariance_m2[second])
    starts = np.flatnonzero(np.diff(emission, prepend=emission[0] - 1))
    sizes = np.diff(starts, append=len(emission))
    offsets = np.cumsum(sizes * (sizes - 1) // 2) - sizes * (sizes - 1) // 2
    number = np.repeat(np.arange(len(starts)), sizes) * len(emission)
    for start, size, offset in zip(starts.tolist(), sizes.tolist(), offsets.tolist(), strict=True):
        if size > 1:
            within = distance[offset : offset + size * (size - 1) // 2]
            if within.max() > threshold:  # otherwise all are one: there is no dendrogram to cut
                number[start : start + size] += fcluster(linkage(within, "complete"), threshold, "distance")
    return np.unique(number, return_inverse=True)[1].reshape(-1)


def _mahalanobis(offset: Array, covariance: Array) -> Array:
    a, b, d = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    x, y = offset[:, 0], offset[:, 1]
    determinant = np.maximum(a * d - b * b, 1e-12 * a * d + 1e-300)
    distance: Array = np.sqrt(np.maximum((d * x * x - 2.0 * b * x * y + a * y * y) / determinant, 0.0))
    return distance
