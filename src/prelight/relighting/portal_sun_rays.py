"""Rays from points of a room toward a light infinitely far away: through which pane, past what stands in the way."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import Float32, Float64, Int32, Int64, Normals, Positions, Triangles
from ..rays.offset import ray_offset
from ..rays.plain import PlainOccluders, PlainVisibility
from .portal_sun_kernels import list_cells, look_through

_MOST_CELLS = 256  # a side of the grid over panes
SAMPLES, _MOST_OF_ONE = 400_000, 64  # points over all triangles, about; over one at most


class Seen(NamedTuple):
    """Which points see the light through which pane: rows of points, panes, and the mean of max(cos, 0) / π."""

    point: Int64[np.ndarray, "n"]
    pane: Int64[np.ndarray, "n"]
    weight: Float64[np.ndarray, "n"]


class SunRays:
    """Of one room.

    Parameters
    ----------
    corners, pane_of
        ``(T, 3, 3)`` the portals' triangles, and the pane of each.
    positions, triangles
        The scene's opaque triangles.
    """

    def __init__(
        self,
        corners: Float32[np.ndarray, "triangles 3 3"],
        pane_of: Int32[np.ndarray, "triangles"],
        *,
        positions: Positions,
        triangles: Triangles,
    ) -> None:
        self._corners, self._pane_of = corners.astype(np.float64), pane_of
        self._positions, self._triangles = positions, triangles
        self._offset = np.float32(ray_offset(positions))
        self._lifted: tuple[Positions, Normals, Positions] | None = None  # points, normals, where rays begin
        self.panes = int(pane_of.max(initial=-1)) + 1

    def seen(
        self,
        origins: Positions,
        normals: Normals,
        towards: Float64[np.ndarray, "k 3"],
        *,
        beyond: Int32[np.ndarray, "n"] | None = None,
    ) -> Seen:
        """From points (n, 3) with normals, not yet lifted, toward unit directions: each as much of the light.

        With ``beyond``, the panes that points outside are seen through: what they see past all panes, and only that.
        """
        through = self._panes_along(origins, normals, towards)
        if beyond is not None:
            past = (through < 0) & (normals @ towards.T.astype(np.float32) > 0)
            through = np.where(past, beyond[:, None], np.int32(-1))
        lit = np.zeros(len(through), bool)
        for along in through.T:  # rays, a few; NumPy's maximum over them takes ten times as long
            lit |= along >= 0
        rows = np.flatnonzero(lit)
        if not len(rows):
            none = np.zeros(0, np.int64)
            return Seen(none, none, np.zeros(0))
        rays = PlainVisibility(self._occluders, origins=origins[rows], normals=normals[rows])
        bits, _ = rays.trace(towards.astype(np.float32))
        free = np.unpackbits(bits, axis=1, count=len(rows), bitorder="little").astype(bool)
        pane = through[rows].T
        k, i = np.nonzero(free & (pane >= 0))
        cosine = np.maximum(np.einsum("ij,ij->i", normals[rows[i]].astype(np.float64), towards[k]), 0)
        pairs, place = np.unique(rows[i] * self.panes + pane[k, i], return_inverse=True)
        weight = np.bincount(place, cosine, minlength=len(pairs)) / (len(towards) * np.pi)
        return Seen(*np.divmod(pairs, self.panes), weight)

    def may_be_seen(self, direction: Float64[np.ndarray, "3"]) -> np.ndarray:
        """Whether anything of each of the scene's triangles may lie behind the panes along a direction."""
        across = axes_around(direction)[:2]
        panes = (self._corners @ across.T).reshape(-1, 2)
        slack = 2 * self._offset
        low, high = panes.min(axis=0) - slack, panes.max(axis=0) + slack
        flat = (self._positions @ across.T.astype(np.float32)).T
        sides = np.zeros(flat.shape[1], np.uint8)  # of the panes' box that a vertex lies beyond, a bit each
        for k in range(2):
            sides |= (flat[k] < low[k]) * np.uint8(1 << 2 * k) | (flat[k] > high[k]) * np.uint8(2 << 2 * k)
        a, b, c = self._triangles.T
        return sides[a] & sides[b] & sides[c] == 0

    def _panes_along(
        self, origins: Positions, normals: Normals, towards: Float64[np.ndarray, "k 3"]
    ) -> Int32[np.ndarray, "points k"]:
        axes = axes_around(towards.mean(axis=0))
        along = towards @ axes.T
        shears = along[:, :2] / along[:, 2:]
        flat = self._corners @ axes.T
        ends = [flat[..., :2] - shear * flat[..., 2:] for shear in (shears.min(axis=0), shears.max(axis=0))]
        least, most = np.minimum(*ends), np.maximum(*ends)
        boxes = np.concatenate(
            [
                np.minimum(np.minimum(least[:, 0], least[:, 1]), least[:, 2]),
                np.maximum(np.maximum(most[:, 0], most[:, 1]), most[:, 2]),
            ],
            axis=1,
        )
        low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        cells = int(np.clip(2 * np.sqrt(len(boxes)), 1, _MOST_CELLS))
        frame = np.concatenate([low, cells / np.maximum(high - low, 1e-9), high])
        starts = np.empty(cells * cells + 1, np.int64)
        list_cells(_frozen(boxes), frame, cells, starts, np.empty(0, np.int32))
        listed = np.zeros(int(starts[-1]), np.int32)
        list_cells(_frozen(boxes), frame, cells, starts, listed)
        found = np.empty((len(normals), len(towards)), np.int32)
        known = self._lifted
        if known is None or known[0] is not origins or known[1] is not normals:
            lifted = np.ascontiguousarray(origins + self._offset * normals, np.float32)
            self._lifted = known = origins, normals, lifted
        look_through(
            _frozen(known[2]), _frozen(np.ascontiguousarray(normals, np.float32)), _frozen(axes), _frozen(shears),
            _frozen(flat.reshape(-1, 9)), _frozen(self._pane_of),
            (_frozen(starts), _frozen(listed), cells), frame, found,
        )  # fmt: skip
        return found

    @cached_property
    def _occluders(self) -> PlainOccluders:
        return PlainOccluders(self._positions, self._triangles)


class SurfacePoints:
    """Points spread over triangles, and how their light is shared among vertices so that none is lost.

    Light at vertices alone misses what falls between them: a patch of sun on a coarse floor is caught by a few vertices
    or by none. What bounces must be all of it: vertex v gets Σ b·a·E / Σ b·a over the points around it, b the point's
    barycentric weight of v and a its area, and Σ over vertices of light · area is then what fell on all points.
    """

    def __init__(self, positions: Positions, triangles: Triangles, normals: Normals) -> None:
        used = positions[triangles].astype(np.float64)
        across = np.cross(used[:, 1] - used[:, 0], used[:, 2] - used[:, 0])
        area = 0.5 * np.linalg.norm(across, axis=1)
        lit = np.einsum("ij,ikj->i", across, normals[triangles].astype(np.float64))
        across *= np.sign(lit)[:, None] / np.maximum(2 * area, 1e-30)[:, None]
        many = np.clip(np.ceil(area * SAMPLES / max(float(area.sum()), 1e-30)), 1, _MOST_OF_ONE).astype(
            np.int64
        )
        of = np.repeat(np.arange(len(triangles)), many)
        k = np.arange(len(of)) - np.repeat(np.cumsum(many) - many, many)
        # Roberts's sequence, begun elsewhere in every triangle, folded into it.
        s = (0.7548776662466927 * (k + 0.5) + 0.6180339887498949 * of) % 1.0
        t = (0.5698402909980532 * (k + 0.5) + 0.7320508075688772 * of) % 1.0
        s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
        self.weights = np.stack([1 - s - t, s, t], axis=1)  # (points, 3)
        self.origins: Positions = np.einsum("pk,pkx->px", self.weights, used[of]).astype(np.float32)
        self.normals: Normals = across[of].astype(np.float32)
        self.corners = triangles[of]
        self.areas = (area / many)[of]
        self._many, self._facing = many, across
        self._around = np.bincount(
            self.corners.ravel(), (self.weights * self.areas[:, None]).ravel(), minlength=len(positions)
        )

    def of_triangles(
        self, chosen: np.ndarray, direction: Float64[np.ndarray, "3"]
    ) -> Int64[np.ndarray, "some"]:
        """The points of chosen triangles (t,) that face a direction."""
        return np.flatnonzero(np.repeat(chosen & (self._facing @ direction > 0), self._many))

    def at_vertices(self, seen: Seen, panes: int) -> Seen:
        """What points see, shared among vertices."""
        vertex = self.corners[seen.point]
        share = self.weights[seen.point] * (self.areas[seen.point] * seen.weight)[:, None]
        share /= np.maximum(self._around[vertex], 1e-30)
        pairs, place = np.unique(vertex * panes + seen.pane[:, None], return_inverse=True)
        weight = np.bincount(place.ravel(), share.ravel(), minlength=len(pairs))
        return Seen(*np.divmod(pairs, panes), weight)


def axes_around(direction: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """Two directions across, and the direction itself."""
    d = np.asarray(direction, np.float64)
    d = d / np.linalg.norm(d)
    across = np.cross(d, np.eye(3)[np.abs(d).argmin()])
    across /= np.linalg.norm(across)
    return np.ascontiguousarray([across, np.cross(d, across), d])


def _frozen(values: Int64[np.ndarray, "..."]) -> np.ndarray:
    view = np.ascontiguousarray(values).view()
    view.flags.writeable = False
    return view
