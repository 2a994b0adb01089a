"""Where people can be: the galleries and chambers of a site, on the ground plan."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from mine_loc_core.polygon import is_inside, nearest_on_border
from mine_loc_core.site import Chamber, Gallery, Site

Array = npt.NDArray[np.float64]


class WalkableArea:
    """Ground plan of galleries and chambers in the map [m].

    A gallery is a strip of its width along the centre line. Strips overlap by half a width where a line bends, so that
    corners are walkable, and end flat at the line's ends.
    """

    def __init__(self, galleries: Iterable[Gallery], chambers: Iterable[Chamber] = ()) -> None:
        legs = [(number, leg) for number, gallery in enumerate(galleries) for leg in _legs(gallery)]
        self.legs = np.array([leg for _, leg in legs]).reshape(-1, 7)
        """(n, 7): start x, y, unit vector x, y, extent along it from, to, half width."""
        self.gallery_of_leg = np.array([number for number, _ in legs], dtype=np.int64)
        """(n,): number of the gallery that each leg is part of."""
        self.polygons = tuple(np.array(chamber.polygon_m, dtype=float) for chamber in chambers)
        boxes = [(*polygon.min(axis=0), *polygon.max(axis=0)) for polygon in self.polygons]
        self.chamber_boxes = np.array(boxes).reshape(-1, 4)
        """(m, 4): least x, y and greatest x, y of each chamber."""

    @classmethod
    def of(cls, site: Site) -> "WalkableArea | None":
        """The area of a site; None where the site file says nothing of galleries and chambers."""
        return cls(site.galleries, site.chambers) if site.galleries or site.chambers else None

    def holds(self, point_m: Array) -> bool:
        """Whether a point (2,) lies in a gallery or chamber: a tenth of what the nearest point costs."""
        legs = self.legs
        x, y = point_m[0] - legs[:, 0], point_m[1] - legs[:, 1]
        s, t = x * legs[:, 2] + y * legs[:, 3], y * legs[:, 2] - x * legs[:, 3]
        if ((s >= legs[:, 4]) & (s <= legs[:, 5]) & (np.abs(t) <= legs[:, 6])).any():
            return True
        return any(bool(is_inside(polygon, point_m[None])[0]) for polygon in self.polygons)

    def outside_m(self, points_m: Array) -> Array:
        """Distance of `points_m` (n, 2) from the area, (n,); 0 inside."""
        distance_m: Array = np.linalg.norm(points_m - self.nearest(points_m), axis=1)
        return distance_m

    def outside_legs_m(self, point_m: Array) -> Array:
        """Distance of a point (2,) from each leg's strip, (n,); 0 inside."""
        distance_m: Array = np.linalg.norm(_nearest_in_legs(self.legs, point_m[None])[:, 0] - point_m, axis=1)
        return distance_m

    def outside_chambers_m(self, point_m: Array) -> Array:
        """Distance of a point (2,) from each chamber, (n,); 0 inside."""
        return np.array([np.linalg.norm(_nearest_in(p, point_m[None])[0] - point_m) for p in self.polygons])

    def nearest(self, points_m: Array) -> Array:
        """The point of the area nearest to each of `points_m` (n, 2); a point inside is its own."""
        candidates = [*_nearest_in_legs(self.legs, points_m), *(_nearest_in(p, points_m) for p in self.polygons)]
        stacked = np.stack(candidates)
        best = np.argmin(np.sum((stacked - points_m) ** 2, axis=2), axis=0)
        found: Array = stacked[best, np.arange(len(points_m))]
        return found


def _legs(gallery: Gallery) -> Iterable[tuple[float, ...]]:
    line = np.array(gallery.centre_line_m, dtype=float)[:, :2]
    half = gallery.width_m / 2.0
    last = len(line) - 2
    for number, (start, end) in enumerate(pairwise(line)):
        length = float(np.hypot(*(end - start)))
        if length > 0.0:
            along = (end - start) / length
            yield (*start, *along, -half * (number > 0), length + half * (number < last), half)


def _nearest_in_legs(legs: Array, points_m: Array) -> Array:
    """(legs, n, 2)."""
    offset = points_m - legs[:, None, :2]
    along, across = legs[:, None, 2:4], np.stack([-legs[:, 3], legs[:, 2]], axis=1)[:, None]
    s = np.clip(np.sum(offset * along, axis=2), legs[:, None, 4], legs[:, None, 5])
    t = np.clip(np.sum(offset * across, axis=2), -legs[:, None, 6], legs[:, None, 6])
    nearest: Array = legs[:, None, :2] + s[..., None] * along + t[..., None] * across
    return nearest


def _nearest_in(polygon: Array, points_m: Array) -> Array:
    """(n, 2)."""
    inside = is_inside(polygon, points_m)[:, None]
    nearest: Array = np.where(inside, points_m, nearest_on_border(polygon, points_m))
    return nearest
