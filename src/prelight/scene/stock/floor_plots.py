"""A floor on which square blocks stand turned: its lines follow their feet, so that no shadow bleeds from below."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Float64
from .parts import Part, split_quads

_INSIDE, _OUTSIDE = -0.012, 0.003  # the lines next to a block's wall, metres from it
_NOTHING = 1e-12  # square metres: a triangle between points that coincide

Plan = Float64[np.ndarray, "corners 2"]  # x and −z: counter-clockwise in it is so seen from above


@dataclass(frozen=True)
class Plot:
    """A convex piece of a floor at y = 0, seen from above."""

    corners: Plan  # counter-clockwise
    hems: tuple[bool, ...]  # of the edge from each corner to the next: whether it ends at a wall

    def cut(self, point: np.ndarray, along: np.ndarray) -> Plot:
        """What is left of the line through ``point`` for one who walks ``along`` it."""
        left = np.array([-along[1], along[0]])
        side = (self.corners - point) @ left
        corners, hems = [], []
        for k, hem in enumerate(self.hems):
            a, b = self.corners[k], self.corners[(k + 1) % len(self.corners)]
            here, there = side[k], side[(k + 1) % len(side)]
            if here >= 0:
                corners.append(a)
                hems.append(hem)
            if (here >= 0) != (there >= 0):
                corners.append(a + here / (here - there) * (b - a))
                hems.append(hem if there >= 0 else False)
        return Plot(np.array(corners), tuple(hems))

    def border(self, spacing: float) -> tuple[Plan, Plan]:
        """Points around it, and where each goes on to under a wall: a unit beyond each hemmed edge."""
        points, beyond = [], []
        previous = np.roll(self.corners, 1, axis=0)
        following = np.roll(self.corners, -1, axis=0)
        for k, hem in enumerate(self.hems):
            a, b = self.corners[k], following[k]
            count = max(2, round(np.linalg.norm(b - a) / spacing))
            points.append(a + np.arange(count)[:, None] / count * (b - a))
            out = _outward(a, b) * hem
            corner = _beyond_corner(previous[k], a, b, hems=(self.hems[k - 1], hem))
            beyond.append(np.concatenate([[corner], np.tile(out, (count - 1, 1))]))
        return np.concatenate(points), np.concatenate(beyond)


def floor_around(
    plot: Plot, *, middle: tuple[float, float], half_width: float, turn_deg: float, spacing: float, hem: float
) -> Part:
    """A plot with a square block standing on it, about ``middle`` (x, z), turned counter-clockwise seen from above.

    Rings from the block's foot to the border, and a strip ``hem`` wide that goes on under the walls. Metres.
    """
    points, beyond = plot.border(spacing)
    centre = np.array([middle[0], -middle[1]])
    reach = np.linalg.norm(points - centre, axis=1)
    d = (points - centre) / reach[:, None]
    angle = np.arctan2(d[:, 1], d[:, 0]) - np.radians(turn_deg)
    stretch = 1 / np.maximum(np.abs(np.cos(angle)), np.abs(np.sin(angle)))  # of a square's half width
    foot = (half_width + _OUTSIDE) * stretch
    count = max(2, round(float((reach - foot).mean()) / spacing))
    radii = [0.55 * half_width * stretch, (half_width + _INSIDE) * stretch]
    radii += [foot + k / count * (reach - foot) for k in range(count)]
    rings = [centre + radius[:, None] * d for radius in radii]
    flat = np.concatenate([centre[None], *rings, points, points + hem * beyond])
    positions = np.stack([flat[:, 0], np.zeros(len(flat)), -flat[:, 1]], axis=1)
    n = len(points)
    j, j_next = np.arange(n), (np.arange(n) + 1) % n
    fan = np.stack([np.zeros(n, int), 1 + j, 1 + j_next], axis=1)
    i = 1 + np.arange(len(rings) + 1)[:, None] * n
    quads = np.stack([i + j, i + n + j, i + n + j_next, i + j_next], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([fan, split_quads(positions, quads)]).astype(np.int32)
    return _without_empty(positions, triangles)


def _outward(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """To the right of one who walks from a to b."""
    edge = (b - a) / np.linalg.norm(b - a)
    return np.array([edge[1], -edge[0]])


def _beyond_corner(
    before: np.ndarray, at: np.ndarray, after: np.ndarray, *, hems: tuple[bool, bool]
) -> np.ndarray:
    """A unit beyond both edges that meet there, or beyond the hemmed one in the line of the other."""
    first, second = _outward(before, at), _outward(at, after)
    if all(hems):
        return (first + second) / (1 + first @ second)
    if not any(hems):
        return np.zeros(2)
    along, out = (at - after, first) if hems[0] else (at - before, second)
    return along / (along @ out)


def _without_empty(positions: np.ndarray, triangles: np.ndarray) -> Part:
    """Triangles of no area left out, and the vertices that then nobody uses."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    triangles = triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 2 * _NOTHING]
    used, index = np.unique(triangles, return_inverse=True)
    kept = positions[used]
    return Part(kept, np.broadcast_to([0.0, 1.0, 0.0], kept.shape), index.reshape(-1, 3).astype(np.int32))
