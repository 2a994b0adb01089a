"""Straight rays against prisms: vertical walls over a polygon, from a floor to a top. Vectorised over rays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_PARALLEL = 1e-12


@dataclass(frozen=True, slots=True)
class Prism:
    """A body or a hollow; `polygon_m` is (k, 2), any simple polygon, map frame."""

    polygon_m: Floats
    floor_m: float
    top_m: float
    material: str = ""


def cross(a: Floats, b: Floats) -> Floats:
    """Third component of the cross product of plane vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def contains(prism: Prism, points_m: Floats) -> NDArray[np.bool_]:
    """Whether points (n, 2) lie over the ground plan (even-odd rule)."""
    a, b = prism.polygon_m, np.roll(prism.polygon_m, -1, axis=0)
    x, y = points_m[:, 0, None], points_m[:, 1, None]
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    left = x < a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise
    return np.asarray((straddles & left).sum(axis=1) % 2 == 1)


def inside_spans(prism: Prism, start_m: Floats, end_m: Floats) -> Floats:
    """Parts of the segments start-end, (n, 3) each, that lie in the prism.

    Returns (n, k, 2): fractions 0..1 of entry and exit, empty spans have exit <= entry.
    """
    spans = np.zeros((len(start_m), len(prism.polygon_m) + 1, 2))
    low, high = prism.polygon_m.min(axis=0), prism.polygon_m.max(axis=0)
    near = np.flatnonzero(
        np.all(np.minimum(start_m, end_m)[:, :2] <= high, axis=1)
        & np.all(np.maximum(start_m, end_m)[:, :2] >= low, axis=1)
    )
    if len(near):
        start, way = start_m[near], end_m[near] - start_m[near]
        cuts = _cuts(prism.polygon_m, start, way)
        pairs = np.stack([cuts[:, :-1], cuts[:, 1:]], axis=-1)
        middle = start[:, None, :2] + pairs.mean(axis=-1)[..., None] * way[:, None, :2]
        inside = contains(prism, middle.reshape(-1, 2)).reshape(len(near), -1, 1)
        spans[near] = _clip_height(np.where(inside, pairs, 0.0), prism, start[:, 2], way[:, 2])
    return spans


def _cuts(polygon_m: Floats, start_m: Floats, way_m: Floats) -> Floats:
    """Fractions, rising from 0 to 1, at which segments cross edges: (n, edges + 2)."""
    edge = np.roll(polygon_m, -1, axis=0) - polygon_m
    offset = polygon_m[None] - start_m[:, None, :2]
    turn = cross(way_m[:, None, :2], edge[None])
    safe = np.where(np.abs(turn) < _PARALLEL, np.inf, turn)
    along = cross(offset, edge[None]) / safe
    across = cross(offset, way_m[:, None, :2]) / safe
    hits = (across >= 0.0) & (across <= 1.0) & (along > 0.0) & (along < 1.0)
    ends = np.zeros((len(way_m), 1))
    return np.sort(np.concatenate([ends, np.where(hits, along, 1.0), ends + 1.0], axis=1), axis=1)


def _clip_height(spans: Floats, prism: Prism, height_m: Floats, climb_m: Floats) -> Floats:
    """Keep what lies between floor and top."""
    level = np.abs(climb_m) < 1e-9
    steep = np.where(level, 1.0, climb_m)
    at_floor, at_top = (prism.floor_m - height_m) / steep, (prism.top_m - height_m) / steep
    inside = (height_m >= prism.floor_m) & (height_m <= prism.top_m)
    low = np.where(level, np.where(inside, 0.0, 2.0), np.minimum(at_floor, at_top))
    high = np.where(level, 1.0, np.maximum(at_floor, at_top))
    return np.stack([np.maximum(spans[..., 0], low[:, None]), np.minimum(spans[..., 1], high[:, None])], axis=-1)


def span_lengths(spans: Floats, length_m: Floats) -> Floats:
    """Total length [m] of the spans (n, k, 2) of segments of length (n,)."""
    return np.asarray(np.maximum(spans[..., 1] - spans[..., 0], 0.0).sum(axis=1) * length_m)


def uncovered_length(spans: Floats, length_m: Floats) -> Floats:
    """Length [m] of segments that no span covers; spans (n, k, 2) may overlap."""
    bounds = np.clip(spans, 0.0, 1.0)
    bounds = np.where(bounds[..., 1:] > bounds[..., :1], bounds, 0.0)
    bounds = np.take_along_axis(bounds, np.argsort(bounds[..., 0], axis=1)[..., None], axis=1)
    reached = np.maximum.accumulate(bounds[..., 1], axis=1)
    gaps = np.maximum(bounds[:, 1:, 0] - reached[:, :-1], 0.0).sum(axis=1) + bounds[:, 0, 0] + 1.0 - reached[:, -1]
    return np.asarray(gaps * length_m)


def detour(prism: Prism, start_m: Floats, end_m: Floats) -> Floats:
    """Excess way [m] of the shortest way round or over a convex prism, for segments (n, 3) that cross it.

    One turning point a side is taken, the farthest out: exact where one corner is rounded, else a lower bound.
    """
    corner = prism.polygon_m[None]
    way = (end_m - start_m)[:, None, :2]
    direct = np.linalg.norm(end_m[:, :2] - start_m[:, :2], axis=1)
    excess = (
        np.linalg.norm(corner - start_m[:, None, :2], axis=2)
        + np.linalg.norm(end_m[:, None, :2] - corner, axis=2)
        - direct[:, None]
    )
    left = cross(way, corner - start_m[:, None, :2]) > 0.0
    round_left = np.where(left, excess, 0.0).max(axis=1)
    round_right = np.where(~left, excess, 0.0).max(axis=1)
    share = np.clip(_nearest_share(prism.polygon_m.mean(axis=0), start_m, end_m), 0.05, 0.95)
    over = start_m + share[:, None] * (end_m - start_m)
    over[:, 2] = np.maximum(over[:, 2], prism.top_m)
    above = np.linalg.norm(over - start_m, axis=1) + np.linalg.norm(end_m - over, axis=1)
    above -= np.linalg.norm(end_m - start_m, axis=1)
    return np.asarray(np.minimum(np.minimum(round_left, round_right), above))


def _nearest_share(point_m: Floats, start_m: Floats, end_m: Floats) -> Floats:
    way = end_m[:, :2] - start_m[:, :2]
    return np.asarray(((point_m - start_m[:, :2]) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12))


def passing_distance(point_m: Floats, start_m: Floats, end_m: Floats) -> Floats:
    """Distance in plan [m] of points (n, 2) from segments (n, 3)."""
    share = np.clip(_nearest_share(point_m, start_m, end_m), 0.0, 1.0)[:, None]
    nearest = start_m[:, :2] + share * (end_m[:, :2] - start_m[:, :2])
    return np.asarray(np.linalg.norm(nearest - point_m, axis=1))
