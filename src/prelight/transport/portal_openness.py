"""Whether light can come in through portals, and from which side: a few rays from each to infinity, both ways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float64
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.portals import Portals

_POINTS, _RAYS = 128, 32  # of a portal, and of a point to either side
_STAGE = 71
_FLAT = 0.995  # of the length of a flat portal's summed normals
_AT_ONCE = 256  # portals


@dataclass(frozen=True)
class Openness:
    """What rays from portals find.

    Attributes
    ----------
    free
        ``(P, 2)`` share of rays, cosine-distributed, that meet nothing on a portal's more open side and on the other.
    outward
        ``(P, 3)`` unit normals toward the more open side; 0 for a portal that is not flat.
    behind
        Share of the rays into the open that go through other glass on their way.
    """

    free: Float64[np.ndarray, "portals 2"]
    outward: Float64[np.ndarray, "portals 3"]
    behind: float


def portal_openness(occluders: Occluders, portals: Portals, *, glass: Any = None) -> Openness:
    """Of every portal. ``glass`` is a scene of Mitsuba's of the glass alone, which does not count as met."""
    parts = [
        _of_some(occluders, portals, np.arange(first, min(first + _AT_ONCE, len(portals))), glass)
        for first in range(0, len(portals), _AT_ONCE)
    ]
    free, outward = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    met, sent = (sum(part[k] for part in parts) for k in (2, 3))
    return Openness(free, outward, met / max(sent, 1))


def _of_some(occluders: Occluders, portals: Portals, some: np.ndarray, glass: Any) -> tuple:
    normal, rays = _rays(occluders, portals, some)
    free, behind = [], []
    for start, d in rays:
        open_ = ~_met(occluders.mi, occluders.scene, start, d)
        again = _met(occluders.mi, glass, start, d) & open_ if glass is not None else np.zeros_like(open_)
        free.append(open_.reshape(len(some), -1).mean(axis=1))
        behind.append(again.reshape(len(some), -1).sum(axis=1))
    free, behind = np.stack(free, axis=1), np.stack(behind, axis=1)
    sides = np.where(free[:, 0] >= free[:, 1], 1.0, -1.0)
    # Which way the surfaces of a portal turn is no matter: each point's normal is taken to the mean's side.
    by_portal = normal.reshape(len(some), _POINTS, 3)
    way = np.einsum("ijk,ik->ij", by_portal, by_portal[:, 0])
    mean = (np.where(way < 0, -1.0, 1.0)[..., None] * by_portal).mean(axis=1)
    length = np.linalg.norm(mean, axis=1)
    one_way = (way > 0).all(axis=1) | (way < 0).all(axis=1)
    is_flat = (length > _FLAT) & one_way
    outward = np.where(is_flat[:, None], sides[:, None] * mean / np.maximum(length, 1e-12)[:, None], 0.0)
    more = np.argmax(free, axis=1)
    out = int(np.take_along_axis(behind, more[:, None], axis=1).sum())
    return np.sort(free, axis=1)[:, ::-1], outward, out, int(free.max(axis=1).sum() * _POINTS * _RAYS)


def through_others(occluders: Occluders, portals: Portals, some: np.ndarray) -> Float64[np.ndarray, "some"]:
    """Of some portals, the share of their free rays, to either side, that meet other portals on their way.

    Glass that stands in a room sees the sky through its windows alone: all of them.
    """
    out = np.zeros(len(some))
    for k, portal in enumerate(some):
        corners = portals.corners[portals.portal_of != portal].reshape(-1, 3)
        if not len(corners):
            continue
        others = Occluders(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
        _, rays = _rays(occluders, portals, some[k : k + 1])
        free = [(start, d, ~_met(occluders.mi, occluders.scene, start, d)) for start, d in rays]
        met = sum(
            int((_met(others.mi, others.scene, start, d) & is_free).sum()) for start, d, is_free in free
        )
        out[k] = met / max(sum(int(is_free.sum()) for *_, is_free in free), 1)
    return out


def _rays(occluders: Occluders, portals: Portals, some: np.ndarray) -> tuple[np.ndarray, list]:
    """Normals at points of portals, and rays from there to one side and the other: starts and directions."""
    rng = np.random.default_rng(np.random.SeedSequence([_STAGE, int(some[0])]))
    point, normal = _places(portals, some, rng)
    turn, height = rng.random((2, len(some) * _POINTS, _RAYS))
    flat, up = np.sqrt(height), np.sqrt(1 - height)
    first, second = _frames(normal)
    around = flat[..., None] * (
        np.cos(2 * np.pi * turn)[..., None] * first[:, None]
        + np.sin(2 * np.pi * turn)[..., None] * second[:, None]
    )
    return normal, [
        (
            np.repeat(point + sign * ray_offset(occluders.positions) * normal, _RAYS, axis=0),
            (around + sign * up[..., None] * normal[:, None]).reshape(-1, 3),
        )
        for sign in (1.0, -1.0)
    ]


def _places(portals: Portals, some: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points of portals by area, and normals there."""
    area, of = portals.triangle_areas, portals.portal_of
    chosen = []
    for portal in some:
        own = np.flatnonzero(of == portal)
        total = np.cumsum(area[own])
        at = (np.arange(_POINTS) + rng.random(_POINTS)) / _POINTS * total[-1]
        chosen.append(own[np.minimum(np.searchsorted(total, at, side="right"), len(own) - 1)])
    a, b, c = np.moveaxis(portals.corners[np.concatenate(chosen)].astype(np.float64), 1, 0)
    root, along = np.sqrt(rng.random(len(a)))[:, None], rng.random(len(a))[:, None]
    across = np.cross(b - a, c - a)
    point = (1 - root) * a + root * (1 - along) * b + root * along * c
    return point, across / np.linalg.norm(across, axis=1, keepdims=True)


def _frames(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    helper = np.where(np.abs(normal[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normal, first)


def _met(mi: Any, scene: Any, start: np.ndarray, d: np.ndarray) -> np.ndarray:
    o, way = (
        type_(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in values.T))
        for type_, values in ((mi.Point3f, start), (mi.Vector3f, d))
    )
    return np.array(scene.ray_test(mi.Ray3f(o, way)))
