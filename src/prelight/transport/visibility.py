"""V(x_i, d_j): which receivers see the environment in which directions."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..arrays import Directions, Int32, Normals, Positions, UInt8
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset

MAX_LANES = 1 << 25  # rays of one launch: indices stay far below 2³², memory below 100 MB
BYTES_PER_LANE = 2.5  # measured peak of a launch on the processor


class Visibility:
    """Shadow rays from receivers, a tile of receivers × directions to a launch.

    Parameters
    ----------
    occluders
        What casts shadows.
    origins, normals
        The receivers, ``(R, 3)``; a ray is traced where the normal faces the direction.
    """

    def __init__(self, occluders: Occluders, *, origins: Positions, normals: Normals) -> None:
        mi = self._mi = occluders.mi
        self._scene = occluders.scene
        self.receivers = len(origins)
        lifted = origins + np.float32(ray_offset(occluders.positions)) * normals
        self._origin = mi.Point3f(*(mi.Float(np.ascontiguousarray(x)) for x in lifted.T))
        self._normal = mi.Normal3f(*(mi.Float(np.ascontiguousarray(x)) for x in normals.T))
        self._packed = -(-self.receivers // 8)

    def trace(
        self, directions: Directions, *, lanes: int = MAX_LANES
    ) -> tuple[UInt8[np.ndarray, "directions bytes"], Int32[np.ndarray, "directions"]]:
        """Visibility as bits, receiver i in bit i mod 8 of byte i div 8, and the rays of each direction.

        A bit is 1 if the receiver faces the direction and nothing is in between.
        """
        count = len(directions)
        bits = np.empty((count, self._packed), np.uint8)
        rays = np.empty(count, np.int32)
        step = max(1, min(lanes, MAX_LANES) // self.receivers)
        for start in range(0, count, step):
            tile = slice(start, min(start + step, count))
            state = self._launch(directions[tile])
            _pack(state.reshape(-1, self.receivers), bits[tile], rays[tile])
        return bits, rays

    def _launch(self, directions: Directions) -> UInt8[np.ndarray, "lanes"]:
        """For each direction × receiver: 0 faces away, 2 shadowed, 3 visible."""
        import drjit as dr

        mi = self._mi
        d = mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in directions.T))
        receivers = dr.opaque(mi.UInt32, self.receivers)
        lane = dr.arange(mi.UInt32, self.receivers * len(directions))
        j = lane // receivers  # direction
        i = lane - j * receivers  # receiver
        n_i = dr.gather(mi.Normal3f, self._normal, i)
        d_j = dr.gather(mi.Vector3f, d, j)
        facing = dr.dot(n_i, d_j) > 0
        ray = mi.Ray3f(dr.gather(mi.Point3f, self._origin, i), d_j)
        seen = facing & ~self._scene.ray_test(ray, active=facing)
        byte = dr.uint8_array_t(mi.UInt32)
        state = dr.select(facing, dr.select(seen, byte(3), byte(2)), byte(0))
        return state.numpy()


_states = types.Array(types.uint8, 2, "C", readonly=True)


@njit(cache=True)
def _pack_row(row, out):
    traced = 0
    whole = len(row) // 8
    for b in range(whole):
        byte = 0
        for k in range(8):
            value = row[8 * b + k]
            byte |= (value & 1) << k
            traced += value >> 1
        out[b] = byte
    if whole < len(out):
        byte = 0
        for k in range(len(row) - 8 * whole):
            value = row[8 * whole + k]
            byte |= (value & 1) << k
            traced += value >> 1
        out[whole] = byte
    return traced


@njit([types.void(_states, types.uint8[:, ::1], types.int32[::1])], parallel=True, cache=True)
def _pack(state, bits, rays):
    """Eight receivers to a byte, and the lanes that were traced for each direction."""
    for j in prange(len(state)):
        rays[j] = _pack_row(state[j], bits[j])
