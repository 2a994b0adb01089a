"""Which stretches of which galleries a circle covers: with a map, a region is a set of these."""

import math
from collections.abc import Iterable
from itertools import pairwise

from mine_loc_core.site import Gallery


def stretches_within(galleries: Iterable[Gallery], centre_m: tuple[float, float], radius_m: float) -> list[str]:
    """Names such as `main 120-340`: the gallery and the metres along its centre line from where to where."""
    found = []
    for gallery in galleries:
        reach_m = radius_m + gallery.width_m / 2.0
        for start_m, end_m in _merged(_intervals(gallery, centre_m, reach_m)):
            found.append(f"{gallery.id} {math.floor(start_m)}-{math.ceil(end_m)}")
    return found


def _intervals(gallery: Gallery, centre_m: tuple[float, float], reach_m: float) -> Iterable[tuple[float, float]]:
    """The parts of each straight leg within `reach_m` of the centre, in metres from the gallery's beginning."""
    along_m = 0.0
    for (ax, ay, *_), (bx, by, *_) in pairwise(gallery.centre_line_m):
        length = math.hypot(bx - ax, by - ay)
        if length > 0.0:
            ux, uy = (bx - ax) / length, (by - ay) / length
            foot = (centre_m[0] - ax) * ux + (centre_m[1] - ay) * uy
            off = (centre_m[0] - ax) * uy - (centre_m[1] - ay) * ux
            half = math.sqrt(max(reach_m**2 - off**2, 0.0))
            low, high = max(foot - half, 0.0), min(foot + half, length)
            if abs(off) < reach_m and low < high:
                yield along_m + low, along_m + high
        along_m += length


def _merged(intervals: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    merged: list[tuple[float, float]] = []
    for low, high in intervals:
        if merged and low <= merged[-1][1] + 1e-6:
            merged[-1] = (merged[-1][0], max(merged[-1][1], high))
        else:
            merged.append((low, high))
    return merged
