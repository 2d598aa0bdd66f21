"""What an eye sees of light that has bounced, by any BSDF: a final gather from every receiver under a fixed eye.

The rays are distributed by the BSDF, toward the eye that looks; where they end, all surfaces are diffuse, as for
``gathering``. A mirror or a pane so shows the diffuse surfaces it reflects, but no second mirror and no sky.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..arrays import Float32, Int32
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from .eye import SeenPoints
from .gathering_kernels import count_entries, fill_entries
from .hemisphere import BACK, NOTHING, Hits, lit_sides
from .hit_colour import HitColour
from .spreading import collect, spread

_RAYS_AT_ONCE = 1 << 20
_STAGE = 23  # keeps these random numbers apart from those of other stages
_HALF_FLOAT = 2.0**-24


class ViewedGathering:
    """(A E)_i = mean over rays from receiver i of BSDF × albedo × E where they end; radiance toward the eye.

    The operator is traced anew whenever it is asked for, to the same numbers.

    Parameters
    ----------
    occluders, scene
        Triangles, and what light is bounced by.
    surfaces, points, receivers
        Materials as they are seen; where receivers lie; which of them are rows here.
    rays
        From each receiver, shared by its points; about so many.
    """

    def __init__(
        self,
        occluders: Occluders,
        scene: Scene,
        surfaces: SurfaceScene,
        points: SeenPoints,
        receivers: Int32[np.ndarray, "rows"],
        *,
        rays: int,
        seed: int = 0,
    ) -> None:
        self._mi, self._scene = occluders.mi, occluders.scene
        self._surfaces, self._points, self._receivers = surfaces, points, receivers
        self._offset = ray_offset(occluders.positions)
        self._side = max(1, math.isqrt(rays // points.samples))
        self._triangles = np.ascontiguousarray(scene.triangles)
        self._albedo, self._colour = scene.albedo, HitColour(scene)
        self._lit = self._mi.Vector3f(*(self._mi.Float(np.ascontiguousarray(x)) for x in lit_sides(scene).T))
        self._key = np.random.SeedSequence([seed, _STAGE]).generate_state(2)
        self.rays = 2 * len(receivers) * points.samples * self._side**2  # forth and back

    def gather(self, E: Float32[np.ndarray, "vertices columns 3"]) -> Float32[np.ndarray, "rows columns 3"]:
        """Radiance that all rows send toward the eye where E is irradiance / π at vertices, before albedo."""
        if self._colour.channels == 0:
            E = E * self._albedo[:, None]
        light = [np.ascontiguousarray(E[:, :, c]) for c in range(3)]
        out = np.empty((3, len(self._receivers), E.shape[1]), np.float32)
        for rows, starts, columns, values in self._tiles():
            for c in range(3):
                collect(starts, columns, values[c], light[c], out[c, rows])
        return np.moveaxis(out, 0, 2)

    def spread(self, X: Float32[np.ndarray, "rows columns"]) -> Float32[np.ndarray, "vertices columns 3"]:
        """The transpose, of the same X for each colour."""
        out = np.zeros((3, len(self._albedo), X.shape[1]), np.float32)
        X = np.ascontiguousarray(X)
        for rows, starts, columns, values in self._tiles():
            for c in range(3):
                spread(starts, columns, values[c], X[rows], out[c])
        out = np.moveaxis(out, 0, 2)
        return out * self._albedo[:, None] if self._colour.channels == 0 else out

    def _tiles(self) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
        """Rows, and their entries: starts, columns and values (3, entries)."""
        vertices = len(self._albedo)
        step = max(1, _RAYS_AT_ONCE // (self._points.samples * self._side**2))
        for first in range(0, len(self._receivers), step):
            rows = slice(first, min(first + step, len(self._receivers)))
            hits, colours = self._trace(rows)
            counts = np.empty(len(hits.triangle), np.int64)
            count_entries(self._triangles, hits.triangle, counts, vertices)
            starts = np.concatenate([[0], np.cumsum(counts)])
            columns, values = np.empty(starts[-1], np.int32), np.empty((3, starts[-1]), np.float32)
            if self._colour.channels:
                colours *= self._colour.at(hits)
            fill_entries(
                self._triangles, hits.triangle, hits.u, hits.v, colours, starts, columns, values, vertices
            )
            yield rows, starts, columns, values

    def _trace(self, rows: slice) -> tuple[Hits, Float32[np.ndarray, "rows rays 3"]]:
        """Where rays of some rows end, and what the BSDF makes of light that comes along them."""
        import drjit as dr

        mi, chosen = self._mi, self._receivers[rows]
        triangle, weights = self._points.triangle[chosen], self._points.weights[chosen]
        si_of, bsdf_of = self._surfaces.interactions(
            triangle.ravel(), weights.reshape(-1, 2), eye=self._points.eye
        )
        samples = self._points.samples
        numbers = (chosen.astype(np.int64)[:, None] * samples + np.arange(samples)).ravel()
        count, each = triangle.size, self._side**2
        lane = dr.arange(mi.UInt32, count * each)
        point = lane // dr.opaque(mi.UInt32, each)
        ray = lane - point * dr.opaque(mi.UInt32, each)
        si = dr.gather(mi.SurfaceInteraction3f, si_of, point)
        bsdf = dr.gather(mi.BSDFPtr, bsdf_of, point)
        number = dr.gather(mi.UInt32, mi.UInt32(numbers.astype(np.uint32)), point)
        answers = si.is_valid() & ((si.wi.z > 0) if self._points.at_vertices else mi.Bool(True))
        first, second = self._random(number, ray)
        sample, weight = bsdf.sample(mi.BSDFContext(), si, first, second, answers)
        weight = dr.select(dr.isfinite(weight), weight, 0)
        d = si.to_world(sample.wo)
        normal = mi.Normal3f(si.sh_frame.n)
        if not self._points.at_vertices:
            normal = dr.mulsign(mi.Normal3f(si.n), dr.dot(si.n, si.sh_frame.n))
        lift = dr.mulsign(mi.Vector3f(normal) * dr.opaque(mi.Float, self._offset), sample.wo.z)
        sends = answers & ((weight.x > 0) | (weight.y > 0) | (weight.z > 0)) & (dr.dot(lift, d) > 0)
        hit = self._scene.ray_intersect_preliminary(mi.Ray3f(si.p + lift, d), active=sends)
        met = sends & hit.is_valid()
        lit = dr.dot(dr.gather(mi.Vector3f, self._lit, hit.prim_index, met), d) < 0
        outcome = dr.select(lit, mi.Int32(hit.prim_index), mi.Int32(BACK))
        found = dr.select(met, outcome, mi.Int32(NOTHING))
        u, v = (dr.select(met, w, mi.Float(0)) for w in (hit.prim_uv.x, hit.prim_uv.y))
        dr.eval(found, u, v, weight)
        shape = (len(triangle), samples * each)
        colours = np.stack([np.array(w).reshape(shape) for w in (weight.x, weight.y, weight.z)], axis=2)
        return Hits(*(a.numpy().reshape(shape) for a in (found, u, v))), colours

    def _random(self, number: Any, ray: Any) -> tuple[Any, Any]:
        """For a lobe, and in stratum ``ray`` of a unit square."""
        import drjit as dr

        mi = self._mi
        keys = [dr.opaque(mi.UInt32, int(key)) for key in self._key]
        a, b = mi.sample_tea_32(number ^ keys[0], ray ^ keys[1], 8)
        lobe, _ = mi.sample_tea_32(number ^ keys[1], ray ^ keys[0], 8)
        side, width = dr.opaque(mi.UInt32, self._side), dr.opaque(mi.Float, 1 / self._side)
        row = ray // side
        x = (mi.Float(ray - row * side) + mi.Float(a >> 8) * _HALF_FLOAT) * width
        y = (mi.Float(row) + mi.Float(b >> 8) * _HALF_FLOAT) * width
        return mi.Float(lobe >> 8) * _HALF_FLOAT, mi.Point2f(x, y)
