"""Where the rays of a receiver begin, so that it sees its own side of the surfaces around it and no other.

A vertex on the edge where a wall meets the floor lies on both: half of its rays would begin behind the floor. Such
vertices look out from a little inside their own triangles. Vertices whose surface goes on, or simply ends, stay.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float64, Int64, Positions
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.geometry import Scene
from .hemisphere import lit_sides
from .sparse_product import aligned

_INSET = 4.0  # offsets of a ray's origin from its surface: how far from an edge a vantage point is
_TOUCH = 0.25  # offsets: a ray that begins nearer to a surface, or behind it, begins on it
_ASIDE = 0.37  # offsets beside an edge that rays go, lest they meet another mesh just between its triangles
_SHARP = 4.0  # insets a vantage point is moved at most, where edges meet at a small angle
_OF_EDGE = 0.25  # of its shortest edge it is moved at most
_LANES = 1 << 22


def vantage_points(scene: Scene, occluders: Occluders) -> Positions:
    """``(V, 3)`` where rays of the vertices begin, before they are lifted along their normals.

    Two things move a vertex. On a border of its mesh, where another surface stands within a few offsets: a few
    offsets (``rays.offset``) away from the border. And where an edge runs from another vertex through the lit side of
    a surface to this one, which is then behind it or on it: to just before that surface.

    ``occluders`` are the triangles of ``scene``. What a surface's lit side is, the normals of its vertices say.
    """
    probe = _Probe(scene, occluders)
    points = scene.positions.astype(np.float64)
    points = _off_borders(scene, probe, points)
    return _before_surfaces(scene, probe, points).astype(np.float32)


@dataclass(frozen=True)
class _Met:
    """What short rays meet first: distance (infinite if nothing), triangle (−1), and whether on its lit side."""

    distance: Float64[np.ndarray, "rays"]
    triangle: Int64[np.ndarray, "rays"]
    lit: np.ndarray


class _Probe:
    """Short rays through a scene."""

    def __init__(self, scene: Scene, occluders: Occluders) -> None:
        self._mi, self._scene = occluders.mi, occluders.scene
        self.offset = ray_offset(occluders.positions)
        self.inset, self.touch = _INSET * self.offset, _TOUCH * self.offset
        self.lit_sides = lit_sides(scene)

    def meet(self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray) -> _Met:
        """First hits of rays (n, 3) with unit directions, no farther than ``reach`` (n,)."""
        parts = [
            self._launch(origins[k : k + _LANES], directions[k : k + _LANES], reach[k : k + _LANES])
            for k in range(0, len(origins), _LANES)
        ]
        distance, triangle = (np.concatenate(a) for a in zip(*parts, strict=True)) if parts else ((), ())
        triangle = np.asarray(triangle, np.int64)
        facing = np.einsum("ij,ij->i", self.lit_sides[triangle], directions) < 0
        return _Met(np.asarray(distance, np.float64), triangle, facing & (triangle >= 0))

    def _launch(self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray) -> tuple[Any, Any]:
        import drjit as dr

        mi = self._mi
        # Memory is used in place, and whether it begins with a cache line would be part of the compiled program.
        block = aligned(7, -(-len(origins) // 16) * 16)[:, : len(origins)]
        block[:3], block[3:6], block[6] = origins.T, directions.T, reach
        columns = [mi.Float(x) for x in block]
        o, d, most = mi.Point3f(*columns[:3]), mi.Vector3f(*columns[3:6]), columns[6]
        hit = self._scene.ray_intersect_preliminary(mi.Ray3f(o, d, most, 0.0, []))
        triangle = dr.select(hit.is_valid(), mi.Int32(hit.prim_index), -1)
        distance = dr.select(hit.is_valid(), hit.t, dr.inf)
        dr.eval(triangle, distance)
        return distance.numpy(), triangle.numpy()


def _off_borders(scene: Scene, probe: _Probe, points: np.ndarray) -> np.ndarray:
    """Border vertices that another surface stands next to, moved into their own triangles."""
    vertex, inward, along = _border_directions(scene)
    if len(vertex) == 0:
        return points
    toward = np.zeros_like(points)
    np.add.at(toward, vertex, inward)
    length = np.linalg.norm(toward, axis=1, keepdims=True)
    toward = np.divide(toward, length, out=np.zeros_like(toward), where=length > 1e-6)
    # So far that the distance from each of its borders is the inset.
    across = np.ones(len(points))
    np.minimum.at(across, vertex, np.einsum("ij,ij->i", toward[vertex], inward))
    move = probe.inset / np.maximum(across, 1 / _SHARP)
    move = np.minimum(move, _OF_EDGE * _shortest_edges(scene))
    inset = points + move[:, None] * toward
    lifted = inset[vertex] + probe.offset * (scene.normals[vertex] + _ASIDE * along)
    from_border = move[vertex] * np.einsum("ij,ij->i", toward[vertex], inward)
    met = probe.meet(lifted, -inward, from_border + probe.touch)
    cornered = np.zeros(len(points), bool)
    cornered[vertex[(met.triangle >= 0) & ~_near(scene, met.triangle, vertex)]] = True
    return np.where(cornered[:, None], inset, points)


def _before_surfaces(scene: Scene, probe: _Probe, points: np.ndarray) -> np.ndarray:
    """Vertices behind or on the lit side of a surface that an edge of theirs goes through, moved before it."""
    ends = _edges(scene)
    start, end = np.concatenate([ends, ends[:, ::-1]]).T
    lifted = points + probe.offset * scene.normals
    way = lifted[end] - lifted[start]
    length = np.linalg.norm(way, axis=1)
    way /= np.maximum(length, 1e-30)[:, None]
    aside = _ASIDE * probe.offset * np.cross(scene.normals[start], way)
    met = probe.meet(lifted[start] + aside, way, length + probe.inset)
    found = (met.triangle >= 0) & ~_near(scene, met.triangle, start) & ~_near(scene, met.triangle, end)
    other = np.roll(np.arange(len(start)), len(ends))  # the same edge from its other end
    through, reached = found & met.lit, found & (met.distance <= length + probe.touch)
    left = length - met.distance
    on_it = np.abs(left) <= probe.touch
    behind = (left > 0) & reached[other] & ~met.lit[other]
    # A ray beside a slanting edge meets the surface sooner or later than the edge does.
    aslant = through & ~on_it & ~behind & (np.abs(left) <= probe.inset)
    back = np.full(len(start), probe.inset)
    at = np.flatnonzero(aslant)
    plane, rest = probe.lit_sides[met.triangle[at]], left[at, None] * way[at] - aside[at]
    aslant[at] = np.abs(np.einsum("ij,ij->i", rest, plane)) <= probe.touch
    steep = np.maximum(np.abs(np.einsum("ij,ij->i", way[at], plane)), 1 / _SHARP)
    back[at] = probe.inset / steep - left[at]
    chosen = np.flatnonzero(through & (on_it | behind | aslant))
    if len(chosen) == 0:
        return points
    # The surface nearest to a vertex, those last that only slanting edges reach; of equals that of the first edge.
    chosen = chosen[np.lexsort((chosen, left[chosen], aslant[chosen], end[chosen]))]
    moved, first = np.unique(end[chosen], return_index=True)
    chosen = chosen[first]
    distance = np.maximum(met.distance[chosen] - back[chosen], met.distance[chosen] / 2)
    out = points.copy()
    out[moved] = lifted[start[chosen]] + distance[:, None] * way[chosen] - probe.offset * scene.normals[moved]
    return out


def _border_directions(
    scene: Scene,
) -> tuple[Int64[np.ndarray, "n"], Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n 3"]]:
    """Both ends of every edge that one triangle alone has, and unit ways into that triangle and to the other end."""
    ends = np.stack([scene.triangles, np.roll(scene.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, which, count = np.unique(_keys(ends), return_inverse=True, return_counts=True)
    border = np.flatnonzero(count[which] == 1)
    a, b = ends[border].T
    opposite = scene.triangles[border // 3, (border + 2) % 3]
    p, q, r = (scene.positions[k].astype(np.float64) for k in (a, b, opposite))
    along = q - p
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    inward = (r - p) - np.einsum("ij,ij->i", r - p, along)[:, None] * along
    inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-300)
    vertex = np.concatenate([a, b]).astype(np.int64)
    return vertex, np.concatenate([inward, inward]), np.concatenate([along, -along])


def _edges(scene: Scene) -> Int64[np.ndarray, "edges 2"]:
    """Every edge once, by vertex numbers."""
    ends = np.stack([scene.triangles, np.roll(scene.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    keys = np.unique(_keys(ends))
    return np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1)


def _near(scene: Scene, triangle: np.ndarray, vertex: np.ndarray) -> np.ndarray:
    """(n,) whether a triangle has the vertex, or one that an edge joins with it: then it is part of its own surface."""
    edges = _keys(_edges(scene))
    near = np.zeros(len(triangle), bool)
    for corner in scene.triangles[triangle].T:
        key = _keys(np.stack([corner, vertex], axis=1))
        place = np.minimum(np.searchsorted(edges, key), len(edges) - 1)
        near |= (corner == vertex) | (edges[place] == key)
    return near


def _keys(ends: np.ndarray) -> Int64[np.ndarray, "n"]:
    low, high = np.sort(ends.astype(np.int64), axis=1).T
    return low << 32 | high


def _shortest_edges(scene: Scene) -> Float64[np.ndarray, "vertices"]:
    ends = _edges(scene)
    p, q = (scene.positions[ends[:, k]].astype(np.float64) for k in (0, 1))
    length = np.linalg.norm(q - p, axis=1)
    shortest = np.full(len(scene.positions), np.inf)
    np.minimum.at(shortest, ends.ravel(), np.repeat(length, 2))
    return shortest
