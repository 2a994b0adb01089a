"""Straight rays against prisms, which are vertical walls over a polygon: all rays against all prisms at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_FLAT = 1e-12


@dataclass(frozen=True, slots=True)
class Prism:
    """A body or a hollow; `polygon_m` is (k, 2), any simple polygon, map frame."""

    polygon_m: Floats
    floor_m: float
    top_m: float
    material: str = ""


@dataclass(frozen=True, slots=True)
class ConvexPrisms:
    """Prisms cut into `p` convex parts, each where all of its half-spaces n x >= c meet."""

    normals: Floats  # (p, e, 3), planes repeated to the same number e
    offsets: Floats  # (p, e)
    owner: NDArray[np.int64]  # (p,), number of the prism each part belongs to

    @staticmethod
    def of(prisms: Sequence[Prism]) -> "ConvexPrisms":
        """Cut prisms up."""
        parts = [
            (owner, _half_spaces(corners, prism))
            for owner, prism in enumerate(prisms)
            for corners in convex_parts(prism.polygon_m)
        ]
        most = max((len(planes) for _, planes in parts), default=1)
        padded = np.array([np.resize(planes, (most, 4)) for _, planes in parts]).reshape(-1, most, 4)
        return ConvexPrisms(padded[..., :3], padded[..., 3], np.array([owner for owner, _ in parts], int))

    def spans(self, start_m: Floats, end_m: Floats) -> Floats:
        """Parts of segments (n, 3) inside each prism: (n, p, 2) fractions of entry and exit, (0, 0) where none."""
        planes = self.normals.transpose(1, 0, 2).reshape(-1, 3)  # a row an edge, for folding whole arrays over them
        shape = (*self.offsets.T.shape, len(start_m))
        height = (planes @ start_m.T).reshape(shape) - self.offsets.T[..., None]
        climb = (planes @ (end_m - start_m).T).reshape(shape)
        rising, falling = climb >= _FLAT, climb <= -_FLAT
        flat = ~(rising | falling)
        crossing = -height / np.where(flat, 1.0, climb)
        entry = np.where(rising, crossing, 0.0).max(axis=0)
        leave = np.where(falling, crossing, 1.0).min(axis=0)
        empty = (leave <= entry) | (flat & (height < 0.0)).any(axis=0)
        return np.where(empty[..., None], 0.0, np.clip(np.stack([entry, leave], axis=-1), 0.0, 1.0)).swapaxes(0, 1)


def contains(prisms: ConvexPrisms, points_m: Floats) -> NDArray[np.bool_]:
    """Whether points (n, 3) lie in any of the prisms, (n,)."""
    height = np.einsum("pek,nk->npe", prisms.normals, points_m) - prisms.offsets
    return np.asarray((height >= 0.0).all(axis=2).any(axis=1))


def _half_spaces(corners_m: Floats, prism: Prism) -> Floats:
    """Rows (n_x, n_y, n_z, c) of the sides, the floor and the top; corners counter-clockwise."""
    edge = np.roll(corners_m, -1, axis=0) - corners_m
    inward = np.column_stack([-edge[:, 1], edge[:, 0]])
    sides = np.column_stack([inward, np.zeros(len(edge)), (inward * corners_m).sum(axis=1)])
    return np.vstack([sides, [0.0, 0.0, 1.0, prism.floor_m], [0.0, 0.0, -1.0, -prism.top_m]])


def cross(a: Floats, b: Floats) -> Floats:
    """Third component of the cross product of plane vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def convex_parts(polygon_m: Floats) -> list[Floats]:
    """The polygon itself if convex, else triangles by ear clipping; all counter-clockwise."""
    corners = polygon_m if cross(polygon_m, np.roll(polygon_m, -1, axis=0)).sum() > 0.0 else polygon_m[::-1]
    parts: list[Floats] = []
    while len(corners) > 3:
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        turns = cross(corners - before, after - corners)
        if np.all(turns >= -_FLAT):
            break
        ear = next(
            k for k in range(len(corners)) if turns[k] > 0.0 and _is_empty(before[k], corners[k], after[k], corners)
        )
        parts.append(np.array([before[ear], corners[ear], after[ear]]))
        corners = np.delete(corners, ear, axis=0)
    return [*parts, corners]


def _is_empty(a: Floats, b: Floats, c: Floats, corners: Floats) -> bool:
    """Whether no corner lies strictly inside the triangle a, b, c."""
    sides = [cross(second - first, corners - first) for first, second in ((a, b), (b, c), (c, a))]
    return not np.any(np.min(sides, axis=0) > _FLAT)


def uncovered_length(spans: Floats, length_m: Floats) -> Floats:
    """Length [m] of segments (n,) that none of the spans (n, p, 2), which may overlap, covers."""
    order = np.argsort(spans[..., 0], axis=1)
    entry = np.take_along_axis(spans[..., 0], order, axis=1)
    reached = np.maximum.accumulate(np.take_along_axis(spans[..., 1], order, axis=1), axis=1)
    gaps = np.maximum(entry[:, 1:] - reached[:, :-1], 0.0).sum(axis=1) + entry[:, 0] + 1.0 - reached[:, -1]
    return np.asarray(gaps * length_m)


def detour(prism: Prism, start_m: Floats, end_m: Floats) -> Floats:
    """Excess way [m] of the shortest way round or over a prism, for segments (n, 3) that cross it.

    One turning point a side is taken, the farthest out: exact where one corner is rounded, else a lower bound.
    """
    corner = prism.polygon_m[None]
    start, end = start_m[:, None, :2], end_m[:, None, :2]
    length = np.linalg.norm(end_m[:, :2] - start_m[:, :2], axis=1)
    bent = np.linalg.norm(corner - start, axis=2) + np.linalg.norm(end - corner, axis=2)
    excess = bent - length[:, None]
    left = cross(end - start, corner - start) > 0.0
    beside = np.minimum(np.where(left, excess, 0.0).max(axis=1), np.where(left, 0.0, excess).max(axis=1))
    share = np.clip(_nearest_share(prism.polygon_m.mean(axis=0), start_m, end_m), 0.05, 0.95)
    over = start_m + share[:, None] * (end_m - start_m)
    over[:, 2] = np.maximum(over[:, 2], prism.top_m)
    above = np.linalg.norm(over - start_m, axis=1) + np.linalg.norm(end_m - over, axis=1)
    return np.asarray(np.minimum(beside, above - np.linalg.norm(end_m - start_m, axis=1)))


def _nearest_share(point_m: Floats, start_m: Floats, end_m: Floats) -> Floats:
    way = end_m[:, :2] - start_m[:, :2]
    return np.asarray(((point_m - start_m[:, :2]) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), _FLAT))


def passing_distance(point_m: Floats, start_m: Floats, end_m: Floats) -> Floats:
    """Distance in plan [m] of points (n, 2) from segments (n, 3)."""
    share = np.clip(_nearest_share(point_m, start_m, end_m), 0.0, 1.0)[:, None]
    nearest = start_m[:, :2] + share * (end_m[:, :2] - start_m[:, :2])
    return np.asarray(np.linalg.norm(nearest - point_m, axis=1))
