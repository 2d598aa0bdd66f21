"""Shadow rays without a renderer, on processors: for a finished bake, and to check the renderer's."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Directions, Float64, Int32, Normals, Positions, Triangles, UInt8
from ..errors import InputError
from .box_tree_kernels import build
from .offset import ray_offset
from .packet_kernels import morton_codes, trace_rays, trace_receivers

_PADDING = np.float32(1e-6)  # of boxes: more than float32 rounds away of points within [−2, 2]
_NEAR = 2.0  # rays that begin farther out are first brought to the scene, in double precision
_LANES = 1 << 25  # rays of one call, a byte each


class PlainOccluders:
    """Triangles that cast shadows, in a tree of boxes.

    No ray passes between triangles that share an edge. Triangles are seen from both sides.

    Parameters
    ----------
    positions, triangles
        ``(V, 3)`` metres, finite, and ``(F, 3)`` indices into them.

    Raises InputError if there are none, or for positions and indices that cannot be.

    References
    ----------
    In `box_tree_kernels` and `packet_kernels`.
    """

    def __init__(self, positions: Positions, triangles: Triangles) -> None:
        positions, triangles = _checked(positions, triangles)
        self.positions = positions
        used = positions[triangles].astype(np.float64)  # (F, 3, 3)
        low, high = used.min(axis=(0, 1)), used.max(axis=(0, 1))
        self._centre = (low + high) / 2
        self._scale = 2.0 / (float((high - low).max()) or 1.0)
        corners = ((used - self._centre) * self._scale).astype(np.float32)
        boxes = np.concatenate([corners.min(axis=1) - _PADDING, corners.max(axis=1) + _PADDING], axis=1)
        count = len(triangles)
        order = np.arange(count, dtype=np.int32)
        bounds = np.empty((count, 12), np.float32)
        children, axes = np.empty((count, 2), np.int32), np.empty(count, np.int8)
        nodes = build(boxes, order, bounds, children, axes)
        self._tree = (
            bounds[:nodes].copy(),
            children[:nodes].copy(),
            axes[:nodes].copy(),
            np.ascontiguousarray(corners[order].reshape(-1, 9)),
        )

    @cached_property
    def offset(self) -> float:
        """``ray_offset`` of the scene."""
        return ray_offset(self.positions)

    @property
    def nbytes(self) -> int:
        """Memory of the tree."""
        return sum(array.nbytes for array in self._tree)

    def local(self, points: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
        """Points in the tree's own coordinates, the scene within [−1, 1]."""
        return (points - self._centre) * self._scale

    def visible(self, origins: Positions, directions: Directions) -> np.ndarray:
        """(n,) bool: whether the ray from each of ``origins`` (n, 3) meets no triangle however far.

        ``directions`` (n, 3) need not be of unit length; rays that follow each other with one direction are
        traced together, several times faster.
        """
        origins, directions = np.asarray(origins, np.float64), np.ascontiguousarray(directions, np.float32)
        if origins.ndim != 2 or origins.shape != directions.shape or origins.shape[1] != 3:
            said = f"origins {origins.shape} and directions {directions.shape}, expected (n, 3) of each"
            raise InputError("rays", said)
        if not directions.any(axis=1).all():
            raise InputError("rays", "a direction of zero length")
        free = np.empty(len(origins), np.uint8)
        starts = _brought_near(self.local(origins), directions)
        trace_rays(*self._tree, np.ascontiguousarray(starts, np.float32), directions, free)
        return free.view(bool)


class PlainVisibility:
    """Shadow rays from receivers, as ``transport.visibility.Visibility`` traces them with the renderer.

    Parameters
    ----------
    occluders
        What casts shadows.
    origins, normals
        The receivers, ``(R, 3)``, not many times farther out than the scene is wide; a ray is traced where the
        normal faces the direction.
    """

    def __init__(self, occluders: PlainOccluders, *, origins: Positions, normals: Normals) -> None:
        self._occluders = occluders
        self.receivers = len(origins)
        lifted = origins + np.float32(occluders.offset) * normals
        self._origins = np.ascontiguousarray(occluders.local(lifted.astype(np.float64)), np.float32)
        self._normals = np.ascontiguousarray(normals, np.float32)
        codes = np.empty(self.receivers, np.uint32)
        morton_codes(self._origins, codes)
        self._order = np.argsort(codes, kind="stable").astype(np.int32)

    def trace(
        self, directions: Directions
    ) -> tuple[UInt8[np.ndarray, "directions bytes"], Int32[np.ndarray, "directions"]]:
        """Visibility as bits, receiver i in bit i mod 8 of byte i div 8, and the rays of each direction.

        A bit is 1 if the receiver faces the direction and nothing is in between.
        """
        directions = np.ascontiguousarray(directions, np.float32).reshape(-1, 3)
        bits = np.empty((len(directions), -(-self.receivers // 8)), np.uint8)
        rays = np.empty(len(directions), np.int32)
        step = max(1, _LANES // max(1, self.receivers))
        for start in range(0, len(directions), step):
            tile = slice(start, start + step)
            state = np.empty((len(directions[tile]), self.receivers), np.uint8)
            trace_receivers(
                *self._occluders._tree, self._origins, self._normals, self._order, directions[tile], state
            )
            bits[tile] = np.packbits(state & 1, axis=1, bitorder="little")
            rays[tile] = np.count_nonzero(state, axis=1)
        return bits, rays


def _brought_near(starts: Float64[np.ndarray, "n 3"], directions: Directions) -> Float64[np.ndarray, "n 3"]:
    """Rays that begin far outside the scene begin before the ball around it instead."""
    far = np.abs(starts).max(axis=1, initial=0) > _NEAR
    if not far.any():
        return starts
    o, d = starts[far], directions[far].astype(np.float64)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    ahead = np.maximum(-np.einsum("ij,ij->i", o, d) - np.sqrt(3.0), 0)
    starts[far] = o + ahead[:, None] * d
    return starts


def _checked(positions: Positions, triangles: Triangles) -> tuple[Positions, Triangles]:
    positions, triangles = np.asarray(positions, np.float32), np.asarray(triangles, np.int32)
    if positions.ndim != 2 or triangles.ndim != 2 or positions.shape[1] != 3 or triangles.shape[1] != 3:
        raise InputError("occluders", "expected positions (V, 3) and triangles (F, 3)")
    if not len(triangles):
        raise InputError("occluders", "no triangles: nothing casts a shadow")
    if triangles.min() < 0 or triangles.max() >= len(positions):
        raise InputError("occluders", f"a triangle uses a vertex that is not one of {len(positions)}")
    if not np.isfinite(positions).all():
        raise InputError("occluders", "positions that are not finite")
    return positions, triangles
