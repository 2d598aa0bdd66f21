"""Transfer vectors of direct light, T_l(x_i) = V(x_i, d_l) max(d_l · n_i, 0) / π  (paper, Eq. 2).

The albedo is left out: a vertex layer keeps irradiance / π. Kernels take visibility as the bits of
``visibility`` and never hold more than a block of 256 receivers of float transfer vectors.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..arrays import Directions, Float32, Float64, Int32, Normals, Positions, UInt8
from ..rays.mitsuba import Occluders
from .transfer import SampleDirections, Samples
from .visibility import Visibility

BLOCK = 256  # receivers; the transfer vectors of a node's samples stay in cache

_bits = types.Array(types.uint8, 2, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_f4_3 = types.Array(types.float32, 3, "C", readonly=True)
_i4_2 = types.Array(types.int32, 2, "C", readonly=True)

# Bit k of a byte as float: a row copy unpacks eight receivers.
_EIGHT = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little").astype(np.float32)


@njit(cache=True)
def _transfer_block(bits, d, normals, start, count, T_l):
    """T_l for receivers start … start + count of one light; start is a multiple of 8."""
    for b in range((count + 7) // 8):
        eight = _EIGHT[bits[start // 8 + b]]
        for k in range(8):
            T_l[8 * b + k] = eight[k]
    nx = normals[0, start : start + count]
    ny = normals[1, start : start + count]
    nz = normals[2, start : start + count]
    for i in range(count):
        cosine = nx[i] * d[0] + ny[i] * d[1] + nz[i] * d[2]
        T_l[i] *= max(cosine, np.float32(0)) * np.float32(1 / np.pi)


@njit(cache=True)
def _node_distances(bits, sample, d, normals, distance):
    S, R = len(sample), normals.shape[1]
    T = np.zeros((S, BLOCK), np.float32)  # T_l of this block
    T_C = np.zeros(BLOCK, np.float32)  # their mean
    used = 0
    for l in range(S):
        used += sample[l] >= 0
        distance[l] = 0
    for start in range(0, R, BLOCK):
        count = min(BLOCK, R - start)
        T_C[:] = 0
        for l in range(S):
            if sample[l] >= 0:
                T_l = T[l]
                _transfer_block(bits[sample[l]], d[l], normals, start, count, T_l)
                for i in range(BLOCK):
                    T_C[i] += T_l[i]
        for i in range(BLOCK):
            T_C[i] *= np.float32(1.0 / used)
        for l in range(S):
            if sample[l] >= 0:
                T_l = T[l]
                block = np.float64(0)
                for i in range(count):
                    difference = T_l[i] - T_C[i]
                    block += np.float64(difference * difference)
                distance[l] += block


@njit([types.void(_bits, _i4_2, _f4_3, _f4_2, types.float64[:, ::1])], parallel=True, cache=True)
def squared_distances(bits, sample, d, normals, distance):
    """‖T_C − T_l‖² of every sample l of every node, T_C their mean (Eqs. 9–11).

    bits (P, bytes); sample (nodes, S) rows of bits, −1 unused; d (nodes, S, 3); normals (3, R);
    distance (nodes, S), written, 0 where unused. One thread to a node, in a fixed order.
    """
    for n in prange(len(sample)):
        _node_distances(bits, sample[n], d[n], normals, distance[n])


@njit(cache=True)
def mean_of_samples(sample, d, D_S):
    """How many samples a node has; D_S (3,), zeros given, becomes their mean direction."""
    used = np.float32(0)
    for l in range(len(sample)):
        if sample[l] >= 0:
            used += np.float32(1)
            for axis in range(3):
                D_S[axis] += d[l, axis]
    for axis in range(3):
        D_S[axis] /= used
    return used


@njit(cache=True)
def unshadowed_correction(sample, d, D_C, D_S, x, y, z):
    """Integral over mean of the samples' cosines, 1 where the node's horizon is in the way."""
    for l in range(len(sample)):
        if sample[l] >= 0 and x * d[l, 0] + y * d[l, 1] + z * d[l, 2] <= 0:
            return np.float32(1)
    return (x * D_C[0] + y * D_C[1] + z * D_C[2]) / (x * D_S[0] + y * D_S[1] + z * D_S[2])


@njit(cache=True)
def _node_mean(bits, sample, d, D_C, normals, column):
    S, R = len(sample), normals.shape[1]
    T_l = np.zeros(BLOCK, np.float32)
    T_C = np.zeros(R, np.float32)
    D_S = np.zeros(3, np.float32)
    used = mean_of_samples(sample, d, D_S)
    largest = np.float32(0)
    for start in range(0, R, BLOCK):
        count = min(BLOCK, R - start)
        for l in range(S):
            if sample[l] >= 0:
                _transfer_block(bits[sample[l]], d[l], normals, start, count, T_l)
                for i in range(count):
                    T_C[start + i] += T_l[i]
        for i in range(start, start + count):
            if T_C[i] > 0:
                ratio = unshadowed_correction(
                    sample, d, D_C, D_S, normals[0, i], normals[1, i], normals[2, i]
                )
                T_C[i] *= ratio / used
                largest = max(largest, T_C[i])
    inverse = np.float32(255) / largest if largest > 0 else np.float32(0)
    for i in range(R):
        column[i] = np.uint8(T_C[i] * inverse + np.float32(0.5))
    return largest / np.float32(255)


@njit(
    [types.void(_bits, _i4_2, _f4_3, _f4_2, _f4_2, types.uint8[:, ::1], types.float32[::1])],
    parallel=True,
    cache=True,
)
def quantized_means(bits, sample, d, D_C, normals, columns, scale):
    """T_C of every node as bytes and one scale: T_C ≈ scale · byte, rounded to nearest, 0 exactly 0.

    Where a receiver faces all samples the mean of their cosines is replaced by the cosine with
    D_C (nodes, 3), the mean direction over the node's solid angle: what light arrives unshadowed is
    then the integral and not its estimate from s² samples. columns (nodes, R) and scale (nodes,) are written.
    """
    for n in prange(len(sample)):
        scale[n] = _node_mean(bits, sample[n], d[n], D_C[n], normals, columns[n])


class DiffuseTransfer:
    """``Transfer`` of Lambertian receivers, a bit each for a light; one channel, without albedo.

    Parameters
    ----------
    occluders
        What casts shadows.
    positions, normals
        The receivers in storage order; unit normals, or zero for one that stays dark.
    """

    channels = 1

    def __init__(self, occluders: Occluders, positions: Positions, normals: Normals) -> None:
        self.receivers = len(positions)
        self.row_bytes = -(-self.receivers // 8)
        self._visibility = Visibility(occluders, origins=positions, normals=normals)
        self.by_axis = np.ascontiguousarray(normals.T)

    def trace(
        self, directions: Directions, *, lanes: int
    ) -> tuple[UInt8[np.ndarray, "lights bytes"], Int32[np.ndarray, "lights"]]:
        """Visibility as bits; see ``Visibility.trace``."""
        return self._visibility.trace(directions, lanes=lanes)

    def squared_distances(
        self, rows: np.ndarray, sample: Samples, d: SampleDirections
    ) -> Float64[np.ndarray, "nodes samples"]:
        """See ``Transfer``."""
        distance = np.empty(sample.shape, np.float64)
        squared_distances(rows, sample, d, self.by_axis, distance)
        return distance

    def quantized_means(
        self, rows: np.ndarray, sample: Samples, d: SampleDirections, D_C: Float32[np.ndarray, "nodes 3"]
    ) -> tuple[UInt8[np.ndarray, "nodes 1 receivers"], Float32[np.ndarray, "nodes 1"]]:
        """See ``Transfer``; what arrives unshadowed is exact."""
        columns = np.empty((len(sample), self.receivers), np.uint8)
        scale = np.empty(len(sample), np.float32)
        quantized_means(rows, sample, d, D_C, self.by_axis, columns, scale)
        return columns[:, None], scale[:, None]

    def values(self, rows: np.ndarray, d: Directions) -> Float32[np.ndarray, "lights 1 receivers"]:
        """T_l itself."""
        seen = np.unpackbits(rows, axis=1, count=self.receivers, bitorder="little")
        cosine = np.maximum(d.astype(np.float32) @ self.by_axis, np.float32(0))
        return (seen * cosine * np.float32(1 / np.pi))[:, None]
