"""Direct light through portals: how much of what comes from each cell of a cube map arrives at receivers.

Points are spread over a portal, and from a receiver one ray goes to each and on to infinity: what stands on either
side of the opening shadows it (the paper's forward and backward occlusion; glass is not in the way). The ray's
direction names the cell of the cube map that is seen there. Section 4.1.2 of the portals paper.

Rays are shared among a receiver's portals by the solid angle they fill, roughly. Point k of n is evenly spread
whatever n, and shifted for each pair by numbers that only the seed and the two depend on. Close to a portal, points of
it are no good: receivers there look over their hemisphere as well, and both are weighted by the balance heuristic
(Veach and Guibas, Optimally combining sampling techniques, 1995).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Directions, Float32, Int32, Int64, Normals, Positions
from ..bases import cube_map
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.portals import Portals
from .lamps import spread_numbers
from .ordering import receiver_order

MOST_RAYS = 1 << 16  # a receiver
LEAST_RAYS = 16  # to a pane that may be seen
_NEAR = (
    50.0  # squares of the distance between points on a pane: nearer receivers look over their hemisphere too
)
_LANES = 1 << 21
_SHEETS = 4  # panes behind each other, at most, of which the last counts
_LOOK = 0x68E31DA4  # tells the random numbers of looking from those of points
_BOX = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T


@dataclass(frozen=True)
class PortalSamples:
    """What rays from some receivers through panes found.

    Pair (receiver i, pane p) has the lanes ``starts[i·panes + p]`` up to the next start. ``weight`` is irradiance / π
    for unit radiance in ``cell``; the pair's sum over lanes, 0 where a ray is blocked.
    """

    starts: Int64[np.ndarray, "pairs_and_one"]
    cell: Int32[np.ndarray, "lanes"]
    weight: Float32[np.ndarray, "lanes"]
    rays: int  # sent, those that no lane is left of too


class PortalRays:
    """Rays from receivers through the panes of portals.

    Parameters
    ----------
    occluders
        What stands in the way: the scene without the portals' glass.
    portals
        Triangles and their panes.
    origins, normals
        ``(R, 3)`` receivers; those without a normal send no rays.
    resolution
        Of the cube map.
    rays
        From each receiver, shared among the panes before it.
    glass
        A scene of Mitsuba's of the portals' triangles alone, in their order.
    layered
        Whether a ray may leave through more than one pane: it then counts for the last one only.
    alike
        Send the rays of all receivers to the same points: noise that they share falls out of their differences.
    beyond
        ``(R,)`` the pane that counts for what receivers outside see of the sky through no glass; −1 of those inside.
    """

    def __init__(  # noqa: PLR0913 - most of them are seldom given
        self,
        occluders: Occluders,
        portals: Portals,
        *,
        origins: Positions,
        normals: Normals,
        resolution: int = 32,
        rays: int = 4096,
        seed: int = 0,
        glass: Any,
        layered: bool = False,
        alike: bool = False,
        beyond: Int32[np.ndarray, "receivers"] | None = None,
    ) -> None:
        if not 1 <= rays <= MOST_RAYS:
            raise InputError("rays", f"{rays} a receiver, expected 1 to {MOST_RAYS:,}")
        self._mi, self._scene = occluders.mi, occluders.scene
        self._glass, self._layered, self._alike = glass, layered, alike
        self._beyond = np.full(len(origins), -1, np.int32) if beyond is None else beyond
        self._offset = ray_offset(occluders.positions)
        self._positions = origins + np.float32(self._offset) * normals
        self._normals, self.rays, self._seed, self.resolution = normals, rays, seed, resolution
        self._panes = _Panes(self._mi, portals.corners, portals.pane_of)
        self.panes, self.receivers = self._panes.count, len(origins)
        self._origin, self._normal = (_points(self._mi, x) for x in (self._positions, normals))
        self._tables = [_points(self._mi, t) for t in (cube_map.U, cube_map.V)]

    def counts(
        self, first: int, rows: int
    ) -> tuple[Int64[np.ndarray, "rows panes"], Int64[np.ndarray, "rows"]]:
        """How many rays receivers first … first + rows send to each pane, and over their hemisphere.

        None to a pane that lies behind them, nor where they are far from all panes.
        """
        x = self._positions[first : first + rows].astype(np.float64)
        n = self._normals[first : first + rows].astype(np.float64)
        panes = self._panes
        ahead = np.full((rows, panes.count), -np.inf)
        for corner in panes.boxes:
            np.maximum(ahead, n @ corner.T - np.einsum("ij,ij->i", n, x)[:, None], out=ahead)
        to = panes.centres[None] - x[:, None]
        square = np.einsum("ijk,ijk->ij", to, to)
        angle = panes.areas / (panes.areas / (2 * np.pi) + square)
        angle *= (ahead > 0) & (np.abs(n).sum(axis=1) > 0)[:, None]
        share = angle / np.maximum(angle.sum(axis=1, keepdims=True), 1e-300)
        least = min(LEAST_RAYS, self.rays)
        points = np.where(angle > 0, np.maximum(np.rint(share * self.rays), least), 0).astype(np.int64)
        low, high = panes.boxes[0], panes.boxes[-1]
        apart = np.maximum(0, np.maximum(low[None] - x[:, None], x[:, None] - high[None]))
        near = np.einsum("ijk,ijk->ij", apart, apart) * points < _NEAR * panes.areas
        near = (near & (points > 0)).any(axis=1) | (self._beyond[first : first + rows] >= 0)
        return points, np.where(near, self.rays, 0).astype(np.int64)

    def trace(self, first: int, rows: int) -> PortalSamples:
        """Send the rays of receivers first … first + rows."""
        points, looks = self.counts(first, rows)
        counts = points.ravel()
        starts = np.concatenate([[0], np.cumsum(counts)])
        if not starts[-1] and not looks.any():
            return PortalSamples(starts, np.zeros(0, np.int32), np.zeros(0, np.float32), 0)
        pair = np.repeat(np.arange(len(counts), dtype=np.uint32), counts)
        sample = (np.arange(starts[-1]) - starts[:-1].astype(np.int64)[pair]).astype(np.uint32)
        counted = (counts.astype(np.uint32), looks.astype(np.uint32))
        cell, weight = np.zeros(0, np.int32), np.zeros(0, np.float32)
        if len(pair):
            cell, weight = self._to_points(first, pair, sample, counted)
        if not looks.any():
            return PortalSamples(starts, cell, weight, len(cell))
        row = np.repeat(np.arange(rows, dtype=np.uint32), looks)
        before = np.cumsum(looks) - looks
        sample = (np.arange(len(row)) - before[row]).astype(np.uint32)
        found, *looked = self._over_hemisphere(first, row, sample, counted)
        return _merged(starts, cell, weight, (found, *looked), rays=len(cell) + len(row))

    def reached(self, directions: Directions) -> Float32[np.ndarray, "receivers directions"]:
        """The cosine at receivers of directions in which the sky is seen through a pane, over π; 0 where it is not."""
        import drjit as dr

        mi, count = self._mi, len(directions)
        out, d = np.zeros((self.receivers, count), np.float32), _points(self._mi, directions)
        step = max(1, _LANES // max(count, 1))
        for first in range(0, self.receivers, step):
            many = min(step, self.receivers - first)
            lane = dr.arange(mi.UInt32, many * count)
            row = lane // dr.opaque(mi.UInt32, count)
            to = dr.gather(mi.Vector3f, mi.Vector3f(d), lane - row * dr.opaque(mi.UInt32, count))
            receiver = row + dr.opaque(mi.UInt32, first)
            origin, facing = (dr.gather(mi.Point3f, x, receiver) for x in (self._origin, self._normal))
            cosine = dr.dot(facing, to)
            ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(to))
            seen = self._glass.ray_test(ray, active=cosine > 0)
            seen &= ~self._scene.ray_test(ray, active=seen)
            out[first : first + many] = dr.select(seen, cosine * dr.inv_pi, 0).numpy().reshape(many, count)
        return out

    def _to_points(
        self, first: int, pair_of: np.ndarray, sample_of: np.ndarray, counted: tuple[np.ndarray, np.ndarray]
    ) -> tuple[Int32[np.ndarray, "lanes"], Float32[np.ndarray, "lanes"]]:
        import drjit as dr

        mi = self._mi
        pair, sample = mi.UInt32(pair_of), mi.UInt32(sample_of)
        many = dr.gather(mi.UInt32, mi.UInt32(counted[0]), pair)
        row = pair // dr.opaque(mi.UInt32, self.panes)
        pane = pair - row * dr.opaque(mi.UInt32, self.panes)
        looks = dr.gather(mi.UInt32, mi.UInt32(counted[1]), row)
        receiver = row + dr.opaque(mi.UInt32, first)
        whole = receiver * dr.opaque(mi.UInt32, self.panes) + pane
        numbers = spread_numbers(mi, pane if self._alike else whole, sample, rays=many, seed=self._seed)
        point, normal, area = self._panes.points(pane, numbers)
        origin, facing = (
            dr.gather(mi.Point3f, self._origin, receiver),
            dr.gather(mi.Point3f, self._normal, receiver),
        )
        to = point - origin
        square = dr.maximum(dr.squared_norm(to), 1e-20)
        d = to * dr.rsqrt(square)
        weight = _weight(
            dr.dot(facing, d), dr.abs(dr.dot(normal, d)), square, area, (mi.Float(many), mi.Float(looks))
        )
        lit = weight > 0
        lit &= ~self._scene.ray_test(mi.Ray3f(mi.Point3f(origin), mi.Vector3f(d)), active=lit)
        if self._layered:
            start = mi.Point3f(point + d * dr.opaque(mi.Float, 4 * self._offset))
            lit &= ~self._glass.ray_test(mi.Ray3f(start, mi.Vector3f(d)), active=lit)
        cell, weight = self._cell(d), dr.select(lit, weight, 0)
        dr.eval(cell, weight)
        return cell.numpy().astype(np.int32), weight.numpy()

    def _over_hemisphere(
        self, first: int, row_of: np.ndarray, sample_of: np.ndarray, counted: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs, cells and weights of cosine-distributed rays that leave through a pane, or past all, outside."""
        import drjit as dr

        mi = self._mi
        row, sample = mi.UInt32(row_of), mi.UInt32(sample_of)
        looks = dr.gather(mi.UInt32, mi.UInt32(counted[1]), row)
        receiver = row + dr.opaque(mi.UInt32, first)
        of = dr.zeros(mi.UInt32, len(row_of)) if self._alike else receiver
        numbers = spread_numbers(mi, of, sample, rays=looks, seed=self._seed ^ _LOOK)
        origin, facing = (
            dr.gather(mi.Point3f, self._origin, receiver),
            dr.gather(mi.Point3f, self._normal, receiver),
        )
        local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(numbers[0], numbers[1]))
        d = mi.Frame3f(mi.Normal3f(facing)).to_world(local)
        lit = ~self._scene.ray_test(mi.Ray3f(mi.Point3f(origin), d))
        hit = self._glass.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(origin), d), active=lit)
        found, way, triangle = lit & hit.is_valid(), hit.t, mi.UInt32(hit.prim_index)
        for _ in range(_SHEETS - 1 if self._layered else 0):
            reach = way + dr.opaque(mi.Float, 4 * self._offset)
            hit = self._glass.ray_intersect_preliminary(
                mi.Ray3f(mi.Point3f(origin + d * reach), d), active=found
            )
            again = found & hit.is_valid()
            triangle, way = (
                dr.select(again, mi.UInt32(hit.prim_index), triangle),
                dr.select(again, reach + hit.t, way),
            )
        pane, normal, area = self._panes.of_triangle(triangle, found)
        many = dr.gather(
            mi.UInt32, mi.UInt32(counted[0]), row * dr.opaque(mi.UInt32, self.panes) + pane, found
        )
        weight = _weight(
            local.z, dr.abs(dr.dot(normal, d)), way * way, area, (mi.Float(many), mi.Float(looks))
        )
        own = dr.gather(mi.Int32, mi.Int32(self._beyond), receiver)
        past = lit & ~found & (own >= 0)
        pane = dr.select(past, mi.UInt32(own), pane)
        pair, cell = row * dr.opaque(mi.UInt32, self.panes) + pane, self._cell(d)
        weight = dr.select(past, dr.rcp(mi.Float(looks)), dr.select(found & (weight > 0), weight, 0))
        dr.eval(pair, cell, weight)
        kept = np.flatnonzero(weight.numpy())
        return pair.numpy()[kept].astype(np.int64), cell.numpy()[kept].astype(np.int32), weight.numpy()[kept]

    def _cell(self, d: Any) -> Any:
        """The texel of the cube map that a direction falls in; see ``bases.cube_map``."""
        import drjit as dr

        mi = self._mi
        x, y, z = d
        ax, ay, az = dr.abs(x), dr.abs(y), dr.abs(z)
        is_x = (ax >= ay) & (ax >= az)
        is_y = ~is_x & (ay >= az)
        along = dr.select(is_x, x, dr.select(is_y, y, z))
        face = dr.select(is_x, mi.UInt32(0), dr.select(is_y, mi.UInt32(2), mi.UInt32(4)))
        face += dr.select(along < 0, mi.UInt32(1), mi.UInt32(0))
        R = dr.opaque(mi.UInt32, self.resolution)
        half = dr.opaque(mi.Float, self.resolution / 2)
        inside = []
        for table in self._tables:
            t = dr.dot(d, dr.gather(mi.Point3f, table, face)) * dr.rcp(dr.abs(along))
            inside.append(dr.minimum(mi.UInt32(dr.maximum((t + 1) * half, 0)), R - 1))
        column, row = inside
        return (face * R + row) * R + column


def _weight(cosine: Any, at_pane: Any, square: Any, area: Any, counts: tuple[Any, Any]) -> Any:
    """What a ray counts for, however it was found: cos θ/π over the density of rays to points and over a hemisphere."""
    import drjit as dr

    facing = dr.maximum(cosine, 0) * dr.inv_pi
    points, looks = counts
    # Of a patch seen from near by, as if it were a disc: never more than all light there is.
    seen = area * at_pane
    return facing * seen / (points * square + dr.select(looks > 0, looks * facing * seen, area * dr.inv_pi))


def _merged(
    starts: np.ndarray, cell: np.ndarray, weight: np.ndarray, looked: tuple[np.ndarray, ...], *, rays: int
) -> PortalSamples:
    """Lanes to points, and behind those of each pair what looking found."""
    pair, more_cell, more_weight = looked
    order = np.argsort(pair, kind="stable")
    counts = np.bincount(pair, minlength=len(starts) - 1)
    before = np.concatenate([[0], np.cumsum(counts)])
    whole = starts + before
    cells, weights = np.empty(whole[-1], np.int32), np.empty(whole[-1], np.float32)
    own = np.arange(len(cell)) + np.repeat(before[:-1], np.diff(starts))
    cells[own], weights[own] = cell, weight
    added = np.arange(len(pair)) + starts[1:][pair[order]]
    cells[added], weights[added] = more_cell[order], more_weight[order]
    return PortalSamples(whole, cells, weights, rays)


class _Panes:
    """Points of panes: the place along a pane's area picks a triangle, and what is left over of it a place within."""

    def __init__(self, mi: Any, corners: np.ndarray, pane_of: np.ndarray) -> None:
        a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
        across = np.cross(b - a, c - a)
        size = np.linalg.norm(across, axis=1)
        order = receiver_order(
            ((a + b + c) / 3).astype(np.float32), (across / size[:, None]).astype(np.float32)
        )
        order = order[np.argsort(pane_of[order], kind="stable")]
        a, b, c, across, size, pane_of = (x[order] for x in (a, b, c, across, size, pane_of))
        self.count = int(pane_of[-1]) + 1
        self.areas = np.bincount(pane_of, size / 2, minlength=self.count)
        starts = np.searchsorted(pane_of, np.arange(self.count + 1))
        total = np.cumsum(size / 2)
        before = np.concatenate([[0.0], total])[starts[:-1]]
        upper = (total - before[pane_of]) / self.areas[pane_of]
        upper[starts[1:] - 1] = 1.0
        width = size / 2 / self.areas[pane_of]
        middle = (a + b + c) / 3 * (size / 2)[:, None]
        sums = [np.bincount(pane_of, middle[:, k], minlength=self.count) for k in range(3)]
        self.centres = np.stack(sums, axis=1) / self.areas[:, None]
        flat, of = np.stack([a, b, c], axis=1).reshape(-1, 3), np.repeat(pane_of, 3)
        low, high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        np.minimum.at(low, of, flat)
        np.maximum.at(high, of, flat)
        self.boxes = [np.where(corner, high, low) for corner in _BOX]  # eight corners of each pane's box
        self._mi = mi
        place = np.empty(len(order), np.uint32)
        place[order] = np.arange(len(order))
        self._place, self._pane = mi.UInt32(place), mi.UInt32(pane_of.astype(np.uint32))
        self._a, self._ab, self._ac, self._n = (
            _points(mi, x) for x in (a, b - a, c - a, across / size[:, None])
        )
        self._upper, self._width, self._area = (
            mi.Float(np.ascontiguousarray(x, np.float32)) for x in (upper, width, self.areas)
        )
        self._start, self._stop = (mi.UInt32(x.astype(np.uint32)) for x in (starts[:-1], starts[1:]))
        self._halvings = int(np.diff(starts).max()).bit_length()

    def points(self, pane: Any, numbers: tuple) -> tuple[Any, Any, Any]:
        """A point of each pane, the normal there, and the pane's area."""
        import drjit as dr

        mi = self._mi
        found, beyond = (dr.gather(mi.UInt32, x, pane) for x in (self._start, self._stop))
        last = mi.UInt32(beyond) - 1
        for _ in range(self._halvings):
            middle = (found + beyond) // 2
            open_ = found < beyond
            below = open_ & (dr.gather(mi.Float, self._upper, middle, open_) <= numbers[0])
            found = dr.select(below, middle + 1, found)
            beyond = dr.select(open_ & ~below, middle, beyond)
        found = dr.minimum(found, last)
        upper, width = (dr.gather(mi.Float, x, found) for x in (self._upper, self._width))
        left = dr.clip(1 - (upper - numbers[0]) / width, 0, 1)
        root = dr.sqrt(left)
        s, t = root * (1 - numbers[1]), root * numbers[1]
        a, ab, ac, n = (dr.gather(mi.Point3f, x, found) for x in (self._a, self._ab, self._ac, self._n))
        return a + s * ab + t * ac, n, dr.gather(mi.Float, self._area, pane)

    def of_triangle(self, triangle: Any, active: Any) -> tuple[Any, Any, Any]:
        """The pane of each of the portals' triangles, its normal, and the pane's area."""
        import drjit as dr

        mi = self._mi
        place = dr.gather(mi.UInt32, self._place, triangle, active)
        pane = dr.gather(mi.UInt32, self._pane, place, active)
        return (
            pane,
            dr.gather(mi.Point3f, self._n, place, active),
            dr.gather(mi.Float, self._area, pane, active),
        )


def _points(mi: Any, values: np.ndarray) -> Any:
    return mi.Point3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in np.asarray(values).T))
