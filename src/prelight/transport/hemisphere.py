"""Rays over the hemisphere of every receiver: cosine-distributed, one in each of the strata of a square."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, Normals, Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.geometry import Scene

MOST_RAYS = 1 << 14  # a receiver
NOTHING, BACK = -1, -2  # in place of a triangle: the ray met none, or the side of one that is not lit
_STAGE = 18  # keeps these random numbers apart from those of other stages with the same seed
_HALF_FLOAT = 2.0**-24


@dataclass(frozen=True)
class Hits:
    """Where rays end: ``triangle`` (or NOTHING, or BACK), weights ``u`` and ``v`` of its second and third vertex."""

    triangle: Int32[np.ndarray, "rows rays"]
    u: Float32[np.ndarray, "rows rays"]
    v: Float32[np.ndarray, "rows rays"]


def check_rays(rays: int) -> int:
    """The side of the square that ``rays`` is. Raises InputError."""
    side = round(max(rays, 0) ** 0.5)
    if side < 1 or side * side != rays or rays > MOST_RAYS:
        raise InputError("rays", f"{rays} a receiver, expected a square number from 1 to {MOST_RAYS}")
    return side


class HemisphereRays:
    """Final-gathering rays from receivers; the same whatever tiles they are traced in, by any number of threads.

    A unit square is cut into √rays × √rays strata, a random point taken in each, and the square laid on the
    hemisphere so that directions are distributed as cos θ/π: the mean of what the rays meet is irradiance / π.
    Random numbers are a hash of (seed, receiver, ray).

    Parameters
    ----------
    occluders
        The triangles of ``scene``, and nothing else.
    scene
        Whose normals tell which side of a triangle is lit.
    origins, normals
        The receivers, ``(R, 3)``. Those without a normal send no rays.
    rays
        A square number.

    References
    ----------
    Shirley and Chiu, A low distortion map between disk and square, 1997. Zafar, Olano and Curtis, GPU random
    numbers via the tiny encryption algorithm, 2010.
    """

    def __init__(
        self,
        occluders: Occluders,
        scene: Scene,
        *,
        origins: Positions,
        normals: Normals,
        rays: int,
        seed: int = 0,
    ) -> None:
        import drjit as dr

        mi = self._mi = occluders.mi
        self._scene = occluders.scene
        self.rays, self.receivers = rays, len(origins)
        self.sends = np.abs(normals).sum(axis=1) > 0
        side = check_rays(rays)
        lifted = origins + np.float32(ray_offset(occluders.positions)) * normals
        self._origin, self._normal, self._lit = (
            mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in a.T))
            for a in (lifted, normals, lit_sides(scene))
        )
        words = np.random.SeedSequence([seed, _STAGE]).generate_state(2)
        self._key = [dr.opaque(mi.UInt32, int(word)) for word in words]
        self._side, self._rays = dr.opaque(mi.UInt32, side), dr.opaque(mi.UInt32, rays)
        self._width = dr.opaque(mi.Float, 1 / side)

    def trace(self, first: int, count: int) -> Hits:
        """Where the rays of receivers first … first + count end."""
        import drjit as dr

        _, _, d, hit, met = self._sent(first, count)
        triangle, u, v = self._ends(hit, d, met)
        dr.eval(triangle, u, v)
        shape = (count, self.rays)
        return Hits(*(a.numpy().reshape(shape) for a in (triangle, u, v)))

    def _sent(self, first: int, count: int) -> tuple[Any, Any, Any, Any, Any]:
        """Receiver, origin and direction of each ray, what it met, and whether it met anything."""
        import drjit as dr

        mi = self._mi
        lane = dr.arange(mi.UInt32, count * self.rays)
        row = lane // self._rays
        ray = lane - row * self._rays
        receiver = row + dr.opaque(mi.UInt32, first)
        n = mi.Normal3f(dr.gather(mi.Vector3f, self._normal, receiver))
        origin = mi.Point3f(dr.gather(mi.Vector3f, self._origin, receiver))
        d = mi.Frame3f(n).to_world(self._directions(receiver, ray))
        sends = dr.squared_norm(n) > 0
        hit = self._scene.ray_intersect_preliminary(mi.Ray3f(origin, d), active=sends)
        return receiver, origin, d, hit, sends & hit.is_valid()

    def _ends(self, hit: Any, d: Any, met: Any) -> tuple[Any, Any, Any]:
        """As ``Hits``, Dr.Jit arrays."""
        import drjit as dr

        mi = self._mi
        lit = dr.dot(dr.gather(mi.Vector3f, self._lit, hit.prim_index, met), d) < 0
        outcome = dr.select(lit, mi.Int32(hit.prim_index), mi.Int32(BACK))
        triangle = dr.select(met, outcome, mi.Int32(NOTHING))
        u, v = (dr.select(met, w, mi.Float(0)) for w in (hit.prim_uv.x, hit.prim_uv.y))
        return triangle, u, v

    def _directions(self, receiver, ray):
        """In the frame of the normal, of stratum ``ray`` with its own random numbers."""
        mi = self._mi
        row = ray // self._side
        a, b = mi.sample_tea_32(receiver ^ self._key[0], ray ^ self._key[1], 8)
        x = (mi.Float(ray - row * self._side) + mi.Float(a >> 8) * _HALF_FLOAT) * self._width
        y = (mi.Float(row) + mi.Float(b >> 8) * _HALF_FLOAT) * self._width
        return mi.warp.square_to_cosine_hemisphere(mi.Point2f(x, y))


def lit_sides(scene: Scene) -> Float32[np.ndarray, "triangles 3"]:
    """Normals of triangles, not of unit length, on the side that their vertices' normals are on."""
    a, b, c = (scene.positions[scene.triangles[:, k]].astype(np.float64) for k in range(3))
    across = np.cross(b - a, c - a)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    toward = scene.normals[scene.triangles].sum(axis=1)
    turned = np.einsum("ij,ij->i", across, toward) < 0
    return np.where(turned[:, None], -across, across).astype(np.float32)
