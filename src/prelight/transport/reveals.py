"""What lies beyond the glass of a window: the outer part of a reveal, a sill, a mullion, lit by the sky itself.

Light reaches such places through no portal, and what they reflect comes in through one. Their light is counted to the
pane that they are seen through: whatever its glass lets through, dims or shuts out holds for them as well.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Directions, Float32, Int32, Normals, Positions
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.portals import Portals

_SIDES, _LOOKS = 64, 256  # rays to either side of a triangle of glass, and over a receiver's hemisphere
_TURN, _APART = 0.5, 0.25  # of normals, and metres between planes that are taken for one
_CLEAR = 8.0  # offsets that glass is away, at least: what lies in its plane is inside
_STAGE = 73
_AT_ONCE = 1 << 21


def beyond_glass(
    occluders: Occluders, portals: Portals, glass: Any, *, origins: Positions, normals: Normals
) -> Int32[np.ndarray, "receivers"]:
    """The pane that receivers look at from outside, of several the one they see most of; −1 where there is none.

    Outside is who sees a pane's outer side and, past all glass, the sky.

    Parameters
    ----------
    occluders
        The scene without the portals' glass, and ``glass`` a scene of Mitsuba's of that alone, in its order.
    origins, normals
        ``(R, 3)``; those without a normal look at nothing.
    """
    rng = np.random.default_rng(np.random.SeedSequence([_STAGE]))
    outward = _outward(occluders, portals, rng)
    panes = int(portals.pane_of.max()) + 1
    out = np.full(len(normals), -1, np.int32)
    looking = np.flatnonzero(np.abs(normals).sum(axis=1) > 0)
    offset, looks = np.float32(ray_offset(occluders.positions)), _cosine(rng, _LOOKS)
    for first in range(0, len(looking), _AT_ONCE // _LOOKS):
        some = looking[first : first + _AT_ONCE // _LOOKS]
        d = _around(normals[some], looks)
        start = np.repeat(origins[some] + offset * normals[some], _LOOKS, axis=0)
        triangle, distance = _met(occluders.mi, glass, start, d)
        seen = np.flatnonzero(triangle >= 0)
        seen = seen[np.einsum("ij,ij->i", outward[triangle[seen]], d[seen]) < 0]
        seen = seen[distance[seen] > _CLEAR * offset]
        _, before = _met(occluders.mi, occluders.scene, start[seen], d[seen])
        seen = seen[before > distance[seen]]
        pair = seen // _LOOKS * panes + portals.pane_of[triangle[seen]]
        counts = np.bincount(pair, minlength=len(some) * panes).reshape(len(some), panes)
        may = counts.any(axis=1)
        past = np.flatnonzero(np.repeat(may, _LOOKS) & (triangle < 0))
        met, _ = _met(occluders.mi, occluders.scene, start[past], d[past])
        may &= np.bincount(past[met < 0] // _LOOKS, minlength=len(some)) > 0
        out[some[may]] = counts[may].argmax(axis=1)
    return out


def _outward(
    occluders: Occluders, portals: Portals, rng: np.random.Generator
) -> Float32[np.ndarray, "triangles 3"]:
    """Unit normals of the portals' triangles, to the side from which more of the sky is seen.

    Triangles near each other in about one plane have one outside: of a single one the sky may be hidden.
    """
    a, b, c = np.moveaxis(portals.corners.astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    most = np.take_along_axis(normal, np.abs(normal).argmax(axis=1)[:, None], axis=1)
    normal *= np.where(most < 0, -1.0, 1.0)
    middle, looks, free = (a + b + c) / 3, _cosine(rng, _SIDES), []
    plane = np.round(normal / _TURN) * _TURN
    depth = np.einsum("ij,ij->i", plane, middle) / np.linalg.norm(plane, axis=1)
    key = np.column_stack([np.round(plane / _TURN), np.round(depth / _APART)]).astype(np.int64)
    _, of = np.unique(key, axis=0, return_inverse=True)
    for sign in (1.0, -1.0):
        side = (sign * normal).astype(np.float32)
        counts = []
        for first in range(0, len(side), _AT_ONCE // _SIDES):
            some = slice(first, first + _AT_ONCE // _SIDES)
            start = middle[some] + ray_offset(occluders.positions) * side[some]
            met, _ = _met(
                occluders.mi, occluders.scene, np.repeat(start, _SIDES, axis=0), _around(side[some], looks)
            )
            counts.append((met < 0).reshape(-1, _SIDES).sum(axis=1))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        free.append(np.bincount(of.ravel(), np.concatenate(counts) * area))
    return (np.where(free[0] >= free[1], 1.0, -1.0)[of.ravel(), None] * normal).astype(np.float32)


def _cosine(rng: np.random.Generator, count: int) -> Directions:
    """Directions around z, distributed as their cosine."""
    turn = 2 * np.pi * rng.random(count)
    square = (np.arange(count) + rng.random(count)) / count
    flat = np.sqrt(square)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), np.sqrt(1 - square)], axis=1).astype(
        np.float32
    )


def _around(normals: Normals, looks: Directions) -> Directions:
    """(n · looks, 3) the same directions around each normal."""
    helper = np.where(np.abs(normals[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(helper, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frames = np.stack([first, np.cross(normals, first), normals], axis=1)
    return np.einsum("lk,nkx->nlx", looks, frames).reshape(-1, 3).astype(np.float32)


def _met(mi: Any, scene: Any, start: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangle that rays meet first, −1 for none, and how far away it is."""
    if not len(d):
        return np.zeros(0, np.int64), np.zeros(0)
    o, way = (
        kind(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in values.T))
        for kind, values in ((mi.Point3f, start), (mi.Vector3f, d))
    )
    hit = scene.ray_intersect_preliminary(mi.Ray3f(o, way))
    there = np.array(hit.is_valid())
    triangle = np.where(there, np.array(hit.prim_index).astype(np.int64), -1)
    return triangle, np.where(there, np.array(hit.t), np.inf)
