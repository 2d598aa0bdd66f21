"""Gathering in gaps narrower than the mesh: under a plinth, behind a canvas.

Light is known at vertices. In a gap of some millimetres it changes within as many, and what a vertex at the gap's edge
gets would be interpolated far into it. So a ray of a vertex in a gap goes on from surface to surface, as light does,
until it lands where it can look around. Where a surface leads into a gap, of a triangle that is partly in there, light
outside falls off towards it by no more than half: so far its vertices in the gap count less.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Normals, Positions
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.geometry import Scene
from .hemisphere import BACK, HemisphereRays, Hits

_LOOKS = 64  # rays that tell whether a vertex is in a gap
_OPEN = 0.1  # of its rays, if no more are long it is; a quarter are where three walls meet
_FARTHEST = 0.015  # of the scene: what is farther away than that is no gap, however coarse the mesh
_LOOKS_ON, _LONG = 6, 2  # rays that tell whether a place is, on the way, and how many are long if it is not
_HOPS = 6
_SHARED = 4  # rays that go on the same way: there are many, and little light to find
_GIVEN = 0.5  # of the weights of vertices in a gap, to those outside of it
_AT_ONCE = 1 << 21  # rays
_STAGE = 67  # keeps these random numbers apart from those of other stages
_HALF_FLOAT = 2.0**-24


@dataclass(frozen=True)
class Gaps:
    """Which vertices are in gaps, (V,), and how far away things are that a gap is between."""

    shut: np.ndarray  # bool
    widths: Float32[np.ndarray, "vertices"]

    @classmethod
    def of(cls, scene: Scene, occluders: Occluders, origins: Positions) -> Gaps:
        """Of a scene whose vertices look out from ``origins``."""
        far = _FARTHEST * float(np.ptp(scene.positions, axis=0).max(initial=0))
        widths = np.minimum(_spacing(scene), far).astype(np.float32)
        rays = _Lengths(occluders, scene, origins=origins, normals=scene.normals, rays=_LOOKS, seed=_STAGE)
        rows = max(1, _AT_ONCE // _LOOKS)
        near = [
            rays.nearer(widths, first, min(rows, len(widths) - first))
            for first in range(0, len(widths), rows)
        ]
        return cls(np.concatenate(near) > 1 - _OPEN if near else np.zeros(0, bool), widths)


class _Lengths(HemisphereRays):
    def nearer(self, than: np.ndarray, first: int, count: int) -> Float32[np.ndarray, "count"]:
        """The share of each receiver's rays that meet something nearer than its own length."""
        import drjit as dr

        mi = self._mi
        receiver, _, _, hit, met = self._sent(first, count)
        near = met & (hit.t < dr.gather(mi.Float, mi.Float(np.ascontiguousarray(than)), receiver))
        return near.numpy().reshape(count, self.rays).mean(axis=1, dtype=np.float32)


class GapRays(HemisphereRays):
    """Rays of a scene's vertices that leave its gaps; all others as ``HemisphereRays``.

    Parameters
    ----------
    gaps
        Of the scene.
    """

    def __init__(
        self, occluders: Occluders, scene: Scene, gaps: Gaps, *, origins: Positions, normals: Normals, rays: int,
        seed: int = 0,
    ) -> None:  # fmt: skip
        import drjit as dr

        super().__init__(occluders, scene, origins=origins, normals=normals, rays=rays, seed=seed)
        mi, self._gaps = self._mi, gaps
        self._triangles = scene.triangles
        self._shut, self._reach = mi.Bool(gaps.shut), mi.Float(np.ascontiguousarray(gaps.widths))
        grey = scene.albedo[scene.triangles].mean(axis=(1, 2), dtype=np.float32)
        self._grey = mi.Float(np.ascontiguousarray(grey))
        self._lift = dr.opaque(mi.Float, ray_offset(occluders.positions))

    def trace(self, first: int, count: int) -> Hits:
        """Where the rays of receivers first … first + count end, those in gaps where they have come out of them."""
        import drjit as dr

        receiver, origin, d, hit, met = self._sent(first, count)
        triangle, u, v = self._ends(hit, d, met)
        width = dr.gather(self._mi.Float, self._reach, receiver)
        going = dr.gather(self._mi.Bool, self._shut, receiver) & (triangle >= 0) & (hit.t < width)
        place = origin + hit.t * d
        if not self._gaps.shut[first : first + count].any():
            dr.eval(triangle, u, v)
            return self._landed([x.numpy() for x in (triangle, u, v)], count)
        dr.eval(triangle, u, v, place, width, going)
        near = np.flatnonzero(going.numpy())
        ends = [x.numpy() for x in (triangle, u, v)]
        if len(near):
            leads, of_lead = self._together(near)
            lane = self._mi.UInt32(near[leads].astype(np.uint32))
            taken = (dr.gather(type(x), x, lane) for x in (triangle, u, v, place, width))
            onward = self._out(lane + dr.opaque(self._mi.UInt32, first * self.rays), *taken)
            for of_all, found in zip(ends, onward, strict=True):
                of_all[near] = found[of_lead]
        return self._landed(ends, count)

    def _together(self, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of rays that go on some go for others of their receiver: which, and for each whose way is its own."""
        row = near // self.rays
        starts = np.concatenate([[0], np.flatnonzero(np.diff(row)) + 1])
        place = np.arange(len(near)) - np.repeat(starts, np.diff(np.append(starts, len(near))))
        leads = place % _SHARED == 0
        return np.flatnonzero(leads), np.cumsum(leads) - 1

    def _out(self, lane: Any, triangle: Any, u: Any, v: Any, place: Any, width: Any) -> list[np.ndarray]:
        """Where rays end at last that met something near; what no hop brings out brings nothing."""
        import drjit as dr

        mi = self._mi
        ends = [triangle.numpy(), u.numpy(), v.numpy()]
        left = np.arange(len(lane))
        for hop in range(_HOPS):
            state = (lane, triangle, place, width)
            is_open, next_hit = self._hop(*state, dr.opaque(mi.UInt32, hop))
            on, alive, triangle, u, v, place = next_hit
            dr.eval(is_open, on, alive, triangle, u, v, place)
            closed, survives = ~is_open.numpy(), alive.numpy()
            ends[0][left[closed]] = BACK
            going = closed & survives
            for of_all, found in zip(ends, (triangle, u, v), strict=True):
                of_all[left[going]] = found.numpy()[going]
            more = dr.compress(mi.Bool(going & on.numpy()))
            if not len(more):
                return ends
            left = left[more.numpy()]
            lane, triangle, place, width = (
                dr.gather(type(x), x, more) for x in (lane, triangle, place, width)
            )
        ends[0][left] = BACK
        return ends

    def _hop(self, lane: Any, triangle: Any, place: Any, width: Any, hop: Any) -> tuple[Any, tuple]:
        """Whether a place can look around; if not, where the first of its looks ends: whether that is as near again,
        whether it is not absorbed here, and what and where it meets."""
        import drjit as dr

        mi = self._mi
        normal = dr.normalize(dr.gather(mi.Vector3f, self._lit, triangle))
        frame, origin = mi.Frame3f(normal), mi.Point3f(place + self._lift * normal)
        far, first = mi.UInt32(0), None
        for look in range(_LOOKS_ON):
            a, b = mi.sample_tea_32(
                lane ^ self._key[0], (hop * _LOOKS_ON + look) ^ self._key[1] ^ _STAGE << 16, 8
            )
            pair = mi.Point2f(mi.Float(a >> 8), mi.Float(b >> 8)) * _HALF_FLOAT
            d = frame.to_world(mi.warp.square_to_cosine_hemisphere(pair))
            hit = self._scene.ray_intersect_preliminary(mi.Ray3f(origin, d))
            far += dr.select(~hit.is_valid() | (hit.t >= width), mi.UInt32(1), mi.UInt32(0))
            first = (d, hit, b) if first is None else first
        d, hit, b = first
        found, u, v = self._ends(hit, d, hit.is_valid())
        chance, _ = mi.sample_tea_32(b, lane, 8)
        alive = mi.Float(chance >> 8) * _HALF_FLOAT < dr.gather(mi.Float, self._grey, triangle)
        return far >= _LONG, (found >= 0, alive, found, u, v, origin + hit.t * d)

    def _landed(self, ends: list[np.ndarray], count: int) -> Hits:
        """Part of the weights of a triangle's vertices in a gap goes to those outside, if it has any."""
        triangle, u, v = ends
        shut = self._gaps.shut[self._triangles]
        mixed = shut.any(axis=1) & ~shut.all(axis=1)
        chosen = np.flatnonzero((triangle >= 0) & mixed[np.maximum(triangle, 0)])
        if len(chosen):
            w = np.stack([1 - u[chosen] - v[chosen], u[chosen], v[chosen]], axis=1)
            outside = np.where(shut[triangle[chosen]], 0, np.maximum(w, 1e-6))
            w += _GIVEN * (outside / outside.sum(axis=1, keepdims=True) - w)
            u[chosen], v[chosen] = w[:, 1], w[:, 2]
        shape = count, self.rays
        return Hits(triangle.reshape(shape), u.reshape(shape), v.reshape(shape))


def _spacing(scene: Scene) -> np.ndarray:
    """(V,) the mean length of the edges at each vertex, metres; 0 where there are none."""
    positions, triangles = scene.positions.astype(np.float64), scene.triangles
    total, count = np.zeros((2, len(positions)))
    for k in range(3):
        ends = triangles[:, k], triangles[:, (k + 1) % 3]
        length = np.linalg.norm(positions[ends[0]] - positions[ends[1]], axis=1)
        for vertex in ends:
            total += np.bincount(vertex, length, len(positions))
            count += np.bincount(vertex, minlength=len(positions))
    return total / np.maximum(count, 1)
