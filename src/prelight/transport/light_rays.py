"""How much of a light each vertex sees: shadow rays to one light from many vertices in one launch, again and again.

The same rays for the same light, whatever was traced before: places on a light are spread evenly, and shifted for each
vertex by numbers that only the vertex decides. So nothing flickers while something else moves.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from ..arrays import Float32, Float64, Int32, Normals, Positions
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.geometry import Scene
from .hemisphere import lit_sides
from .lamps import spread_numbers
from .sparse_product import aligned

_LANES = 1 << 22  # rays of one launch
_SHORT = 1e-4  # of the way to a panel that a ray leaves out: what the panel hangs on must not shadow it
_LOOKS = 64  # rays that tell whether a point is inside a solid

Share = Float32[np.ndarray, "chosen"]
Aim = Callable[[Any, Any, tuple], tuple]


class LightRays:
    """Shadow rays of the vertices of a scene.

    Parameters
    ----------
    scene, occluders
        Its triangles; its normals tell which side of them is lit.
    origins
        ``(V, 3)`` where the vertices' rays begin, before they are lifted: ``vantage.vantage_points``.

    Attributes
    ----------
    points
        ``(V, 3)`` where they begin, lifted.
    """

    def __init__(self, scene: Scene, occluders: Occluders, origins: Positions) -> None:
        mi = self._mi = occluders.mi
        self._scene = occluders.scene
        self._offset = np.float32(ray_offset(occluders.positions))
        self._lit_sides = lit_sides(scene)
        self.points: Positions = np.ascontiguousarray(origins + self._offset * scene.normals)
        self._origin = _points(mi, self.points)
        self._normal = _points(mi, scene.normals)

    def elsewhere(self, origins: Positions, normals: Normals) -> LightRays:
        """The same of other points (n, 3) with unit normals; ``rows`` are theirs then."""
        other = copy(self)
        other.points = np.ascontiguousarray(origins + self._offset * normals, np.float32)
        other._origin, other._normal = _points(self._mi, other.points), _points(self._mi, normals)
        return other

    def of_ball(
        self, rows: Int32[np.ndarray, "chosen"], centre: Float64[np.ndarray, "3"], radius: float, *, rays: int
    ) -> Share:
        """The share of its light, 0 to 1, that vertices outside a ball get; ``rays`` each, one to a point."""
        import drjit as dr

        mi = self._mi
        middle, r2 = mi.Point3f(*(dr.opaque(mi.Float, float(x)) for x in centre)), radius * radius
        if radius == 0:

            def to_point(origin: Any, normal: Any, numbers: tuple) -> tuple:
                del normal, numbers
                way = middle - origin
                square = dr.squared_norm(way)
                return way * dr.rsqrt(square), dr.sqrt(square), mi.Float(1)

            return self._shares(rows, 1, to_point)
        square_radius = dr.opaque(mi.Float, r2)

        def to_ball(origin: Any, normal: Any, numbers: tuple) -> tuple:
            way = middle - origin
            square = dr.squared_norm(way)
            sin2 = dr.minimum(square_radius / square, 1)
            low = sin2 / (1 + dr.sqrt(1 - sin2)) * numbers[0]  # 1 − cos within the cone in which it is seen
            across = dr.sqrt(low * (2 - low))
            s, c = dr.sincos(2 * dr.pi * numbers[1])
            frame = mi.Frame3f(way * dr.rsqrt(square))
            d = frame.to_world(mi.Vector3f(across * c, across * s, 1 - low))
            into = dr.sqrt(dr.maximum(square_radius - square * low * (2 - low), 0))
            return d, dr.sqrt(square) * (1 - low) - into, dr.maximum(dr.dot(normal, d), 0)

        return self._shares(rows, rays, to_ball)

    def of_panel(
        self, rows: Int32[np.ndarray, "chosen"], corners: Float64[np.ndarray, "4 3"], *, rays: int
    ) -> Share:
        """The share of the light of a rectangle (its corners in turn) that vertices in front of it get."""
        import drjit as dr

        mi = self._mi
        along, up = corners[1] - corners[0], corners[3] - corners[0]
        facing = np.cross(along, up)
        facing /= np.linalg.norm(facing)
        corner, first, second, front = (
            mi.Point3f(*(dr.opaque(mi.Float, float(x)) for x in v)) for v in (corners[0], along, up, facing)
        )

        def to_panel(origin: Any, normal: Any, numbers: tuple) -> tuple:
            way = corner + numbers[0] * first + numbers[1] * second - origin
            square = dr.maximum(dr.squared_norm(way), 1e-20)
            d = way * dr.rsqrt(square)
            weight = dr.maximum(dr.dot(normal, d), 0) * dr.maximum(-dr.dot(front, d), 0) / square
            return d, dr.sqrt(square) * (1 - _SHORT), weight

        return self._shares(rows, rays, to_panel)

    def of_direction(self, rows: Int32[np.ndarray, "chosen"], direction: np.ndarray) -> Share:
        """1 where vertices see a light infinitely far away, 0 where not."""
        import drjit as dr

        mi = self._mi
        toward = mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in direction))

        def along(origin: Any, normal: Any, numbers: tuple) -> tuple:
            del normal, numbers
            return toward + 0 * origin, dr.full(mi.Float, dr.inf, dr.width(origin)), mi.Float(1)

        return self._shares(rows, 1, along)

    def share_of_backs(self, point: Float64[np.ndarray, "3"]) -> float:
        """Of rays from a point in all directions, how many of those that meet something meet its unlit side.

        Near 1 inside a solid, 0 in a room and where nothing is met.
        """
        import drjit as dr

        mi = self._mi
        k = (np.arange(_LOOKS) + 0.5) / _LOOKS
        turn, y = np.pi * (1 + 5**0.5) * np.arange(_LOOKS), 1 - 2 * k
        r = np.sqrt(1 - y * y)
        d = np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)
        origin = mi.Point3f(*(dr.opaque(mi.Float, float(x)) for x in point))
        hit = self._scene.ray_intersect_preliminary(mi.Ray3f(origin, mi.Vector3f(_points(mi, d))))
        triangle = dr.select(hit.is_valid(), mi.Int32(hit.prim_index), -1).numpy()
        met = triangle >= 0
        back = np.einsum("ij,ij->i", self._lit_sides[triangle], d) >= 0
        return float((back & met).sum() / met.sum()) if met.any() else 0.0

    def _shares(self, rows: np.ndarray, rays: int, aim: Aim) -> Share:
        out = np.empty(len(rows), np.float32)
        step = max(1, _LANES // rays)
        for start in range(0, len(rows), step):
            part = slice(start, min(start + step, len(rows)))
            out[part] = self._launch(rows[part], rays, aim)
        return out

    def _launch(self, rows: np.ndarray, rays: int, aim: Aim) -> Share:
        import drjit as dr

        mi, count = self._mi, len(rows)
        # Memory is used in place, and whether it begins with a cache line would be part of the compiled program.
        block = aligned(1, -(-count // 16) * 16)[0, :count].view(np.uint32)
        block[:] = rows
        lane = dr.arange(mi.UInt32, count * rays)
        many = dr.opaque(mi.UInt32, rays)
        place = lane // many
        vertex = dr.gather(mi.UInt32, mi.UInt32(block), place)
        origin = dr.gather(mi.Point3f, self._origin, vertex)
        normal = dr.gather(mi.Point3f, self._normal, vertex)
        numbers = () if rays == 1 else spread_numbers(mi, vertex, lane - place * many, rays=many, seed=0)
        d, length, weight = aim(origin, normal, numbers)
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(d))
        ray.maxt = length
        free = ~self._scene.ray_test(ray, active=weight > 0)
        if rays == 1:
            return dr.select(free, mi.Float(1), 0).numpy()
        lit, whole = (dr.block_sum(value, rays) for value in (dr.select(free, weight, 0), weight))
        dr.eval(lit, whole)
        return np.divide(lit.numpy(), whole.numpy(), out=np.zeros(count, np.float32), where=whole.numpy() > 0)


def _points(mi: Any, values: np.ndarray) -> Any:
    return mi.Point3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in np.asarray(values).T))
