"""Transfer vectors toward a fixed eye, T_l(x_i) = V(x_i, d_l) f(x_i, d_l, v_i) max(d_l · n_i, 0)  (paper, Eq. 3).

f is any of Mitsuba's BSDFs and T has three channels. A receiver is a vertex, or a pixel as the mean of its
samples, each with a place, a normal, a texture coordinate and a material of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange, types

from ..arrays import Directions, Float32, Float64, Int32, UInt8
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..rays.surfaces import SurfaceScene
from .direct import mean_of_samples
from .eye import SeenPoints
from .transfer import SampleDirections, Samples

MAX_LANES = 1 << 22  # of one launch: what it leaves is floats, not bits
BYTES_PER_LANE = 28.0  # measured peak of a launch on the processor
BYTES_PER_POINT = 320.0  # and what is kept of every sample of every receiver
_LIKE_A_COSINE = np.float32(1.1)  # most over least of what samples bring, divided by their cosines
BLOCK = 256  # receivers; the transfer vectors of a node's samples stay in cache


class ViewedTransfer:
    """``Transfer`` of receivers under a fixed eye; three channels, radiance for unit light.

    A row is float32 (3, receivers). Shadow rays are traced only where the BSDF answers. A vertex whose normal
    faces away from the eye is dark; what a pixel sees of a surface's back is up to its BSDF. Light through a
    transmitting surface comes from behind it, shadowed by what is there.

    Parameters
    ----------
    occluders
        What casts shadows: the same triangles as those of ``surfaces``.
    surfaces, points
        Materials, and where the receivers' samples lie on them.
    receivers
        Rows of ``points`` in storage order; all if not given.
    """

    channels = 3

    def __init__(
        self,
        occluders: Occluders,
        surfaces: SurfaceScene,
        points: SeenPoints,
        *,
        receivers: Int32[np.ndarray, "receivers"] | None = None,
    ) -> None:
        chosen = slice(None) if receivers is None else receivers
        triangle, weights = points.triangle[chosen], points.weights[chosen]
        self.receivers, self.samples = triangle.shape
        self.row_bytes = 12 * self.receivers
        self._mi, self._scene = occluders.mi, occluders.scene
        self._surfaces = surfaces  # the arrays below hold bare pointers to its BSDFs and meshes
        self._si, self._bsdf = surfaces.interactions(triangle.ravel(), weights.reshape(-1, 2), eye=points.eye)
        shading = self._si.sh_frame.n.numpy().reshape(3, self.receivers, self.samples)
        self._normals = np.ascontiguousarray(shading.mean(axis=2, dtype=np.float32))
        self._answers, self._lift = self._sides(points.at_vertices, ray_offset(occluders.positions))

    def _sides(self, at_vertices: bool, offset: float) -> tuple[Any, Any]:
        """Which samples can answer at all, and the way from each to where its rays begin in front of it."""
        import drjit as dr

        si = self._si
        there = si.is_valid()
        if at_vertices:
            answers, normal = there & (si.wi.z > 0), self._mi.Normal3f(si.sh_frame.n)
        else:
            answers, normal = there, dr.mulsign(si.n, dr.dot(si.n, si.sh_frame.n))
        lift = self._mi.Vector3f(normal) * self._mi.Float(offset)
        dr.eval(answers, lift)
        return answers, lift

    def trace(
        self, directions: Directions, *, lanes: int = MAX_LANES
    ) -> tuple[Float32[np.ndarray, "lights 3 receivers"], Int32[np.ndarray, "lights"]]:
        """T_l of each direction and how many shadow rays it took."""
        rows = np.empty((len(directions), 3, self.receivers), np.float32)
        rays = np.empty(len(directions), np.int32)
        step = max(1, min(lanes, MAX_LANES) // (self.receivers * self.samples))
        for start in range(0, len(directions), step):
            tile = slice(start, min(start + step, len(directions)))
            rows[tile], rays[tile] = self._launch(directions[tile])
        return rows, rays

    def _launch(self, directions: Directions) -> tuple[np.ndarray, np.ndarray]:
        """A lane for each direction × receiver × sample, the samples of a receiver side by side."""
        import drjit as dr

        mi = self._mi
        listed = np.concatenate([directions, directions[:1]])  # one alone would be part of the program
        d = mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in listed.T))
        points = self.receivers * self.samples
        count = dr.opaque(mi.UInt32, points)
        lane = dr.arange(mi.UInt32, points * len(directions))
        j = lane // count  # direction
        i = lane - j * count  # sample
        si = dr.gather(mi.SurfaceInteraction3f, self._si, i)
        answers = dr.gather(mi.Bool, self._answers, i)
        d_j = dr.gather(mi.Vector3f, d, j)
        wo = si.to_local(d_j)
        f = dr.gather(mi.BSDFPtr, self._bsdf, i).eval(mi.BSDFContext(), si, wo, answers)  # with the cosine
        f = dr.select(dr.isfinite(f), f, 0)
        lift = dr.mulsign(dr.gather(mi.Vector3f, self._lift, i), wo.z)
        # Where a smoothed normal sees light that the triangle's own does not, the triangle is in the way.
        asked = answers & ((f.x > 0) | (f.y > 0) | (f.z > 0)) & (dr.dot(lift, d_j) > 0)
        blocked = self._scene.ray_test(mi.Ray3f(si.p + lift, d_j), active=asked)
        T = dr.select(asked & ~blocked, f * dr.opaque(mi.Float, 1 / self.samples), 0)
        traced = dr.select(asked, mi.UInt32(1), mi.UInt32(0))
        dr.eval(T, traced)
        rays = dr.block_sum(traced, points, mode="evaluated")
        T = [dr.block_sum(c, self.samples, mode="evaluated") if self.samples > 1 else c for c in T]
        return np.stack([c.numpy().reshape(-1, self.receivers) for c in T], axis=1), rays.numpy()

    def squared_distances(
        self, rows: Float32[np.ndarray, "lights 3 receivers"], sample: Samples, d: SampleDirections
    ) -> Float64[np.ndarray, "nodes samples"]:
        """‖T_C − T_l‖² in the channel where it is largest (Eq. 11)."""
        distance = np.empty(sample.shape, np.float64)
        squared_distances(rows, sample, distance)
        return distance

    def quantized_means(
        self, rows: np.ndarray, sample: Samples, d: SampleDirections, D_C: Float32[np.ndarray, "nodes 3"]
    ) -> tuple[UInt8[np.ndarray, "nodes 3 receivers"], Float32[np.ndarray, "nodes 3"]]:
        """The mean of the samples (Eq. 10); where they bring what goes as their cosines, of the cosine's integral.

        A BSDF has no closed integral over a cluster, the cosine has: what is matt is then exact where unshadowed.
        """
        columns = np.empty((len(sample), 3, self.receivers), np.uint8)
        scale = np.empty((len(sample), 3), np.float32)
        quantized_means(rows, sample, d, D_C, self._normals, columns, scale)
        return columns, scale

    def values(self, rows: np.ndarray, d: Directions) -> Float32[np.ndarray, "lights 3 receivers"]:
        """The rows themselves."""
        return rows


_f4_3 = types.Array(types.float32, 3, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_i4_2 = types.Array(types.int32, 2, "C", readonly=True)


@njit(cache=True)
def _add_distances(rows, sample, channel, used, squared):
    """Σ over receivers of (T_C − T_l)² of one node in one channel; written to ``squared``."""
    S, R = len(sample), rows.shape[2]
    T_C = np.zeros(BLOCK, np.float32)
    squared[:] = 0
    for start in range(0, R, BLOCK):
        count = min(BLOCK, R - start)
        T_C[:] = 0
        for l in range(S):
            if sample[l] >= 0:
                T_l = rows[sample[l], channel, start : start + count]
                for i in range(count):
                    T_C[i] += T_l[i]
        for i in range(count):
            T_C[i] *= np.float32(1.0 / used)
        for l in range(S):
            if sample[l] >= 0:
                T_l = rows[sample[l], channel, start : start + count]
                block = np.float64(0)
                for i in range(count):
                    difference = T_l[i] - T_C[i]
                    block += np.float64(difference * difference)
                squared[l] += block


@njit(cache=True)
def _worst_distances(rows, sample, distance):
    used = 0
    for l in range(len(sample)):
        used += sample[l] >= 0
    squared = np.empty(len(sample), np.float64)
    distance[:] = 0
    for channel in range(3):
        _add_distances(rows, sample, channel, used, squared)
        for l in range(len(sample)):
            distance[l] = max(distance[l], squared[l])


@njit([types.void(_f4_3, _i4_2, types.float64[:, ::1])], parallel=True, cache=True)
def squared_distances(rows, sample, distance):
    """rows (P, 3, R); sample (nodes, S) indices into them, −1 unused; distance (nodes, S), written."""
    for n in prange(len(sample)):
        _worst_distances(rows, sample[n], distance[n])


@njit(cache=True)
def _corrections(rows, sample, d, D_C, normals, correction, bounds):
    """Integral over mean of the samples' cosines for each receiver, as in ``direct``, where that is what it needs.

    1 where all lights of the node are samples, so that nothing is left to estimate, and where what samples bring
    does not go as their cosines: a highlight is no cosine, and would only be scaled by chance.
    """
    D_S = np.zeros(3, np.float32)
    used = mean_of_samples(sample, d, D_S)
    correction[:] = 1
    if used < len(sample):
        return
    least, most = bounds[0], bounds[1]
    least[:], most[:] = np.inf, 0
    for l in range(len(sample)):
        T_l = rows[sample[l]]
        for i in range(len(correction)):
            cosine = normals[0, i] * d[l, 0] + normals[1, i] * d[l, 1] + normals[2, i] * d[l, 2]
            grey = T_l[0, i] + T_l[1, i] + T_l[2, i]
            if cosine <= 0:
                most[i] = np.inf
            elif grey > 0:
                least[i], most[i] = min(least[i], grey / cosine), max(most[i], grey / cosine)
    for i in range(len(correction)):
        if most[i] < _LIKE_A_COSINE * least[i]:
            correction[i] = (normals[0, i] * D_C[0] + normals[1, i] * D_C[1] + normals[2, i] * D_C[2]) / (
                normals[0, i] * D_S[0] + normals[1, i] * D_S[1] + normals[2, i] * D_S[2]
            )


@njit(cache=True)
def _channel_mean(rows, sample, channel, correction, T_C, column):
    used = np.float32(0)
    T_C[:] = 0
    for l in range(len(sample)):
        if sample[l] >= 0:
            used += np.float32(1)
            T_l = rows[sample[l], channel]
            for i in range(len(T_C)):
                T_C[i] += T_l[i]
    largest = np.float32(0)
    for i in range(len(T_C)):
        T_C[i] *= correction[i] / used
        largest = max(largest, T_C[i])
    inverse = np.float32(255) / largest if largest > 0 else np.float32(0)
    for i in range(len(T_C)):
        column[i] = np.uint8(T_C[i] * inverse + np.float32(0.5))
    return largest / np.float32(255)


@njit(cache=True)
def _node_means(rows, sample, d, D_C, normals, columns, scale):
    T_C, correction = np.empty((2, rows.shape[2]), np.float32)
    bounds = np.empty((2, rows.shape[2]), np.float32)
    _corrections(rows, sample, d, D_C, normals, correction, bounds)
    for channel in range(3):
        scale[channel] = _channel_mean(rows, sample, channel, correction, T_C, columns[channel])


@njit(
    [types.void(_f4_3, _i4_2, _f4_3, _f4_2, _f4_2, types.uint8[:, :, ::1], types.float32[:, ::1])],
    parallel=True,
    cache=True,
)
def quantized_means(rows, sample, d, D_C, normals, columns, scale):
    """T_C ≈ scale · byte, rounded to nearest, 0 exactly 0; columns (nodes, 3, R) and scale (nodes, 3), written.

    d (nodes, S, 3) directions of the samples, D_C (nodes, 3) mean directions of the nodes, normals (3, R).
    """
    for n in prange(len(sample)):
        _node_means(rows, sample[n], d[n], D_C[n], normals, columns[n], scale[n])
