"""The arrays of a whole scene, filled primitive by primitive wherever nodes place it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...arrays import Float64
from ...material import Material
from .primitives import LocalMesh

_AT_ONCE = 1 << 20  # vertices of one primitive moved at a time


@dataclass
class Stands:
    """Where one primitive stands: a world matrix, first vertex and first triangle for each of its copies."""

    matrices: list[np.ndarray] = field(default_factory=list)  # (n, 4, 4) each
    vertices: list[np.ndarray] = field(default_factory=list)  # (n,) each
    triangles: list[np.ndarray] = field(default_factory=list)


class Arrays:
    """Vertices and triangles of a scene, allocated at once and then written."""

    def __init__(self, vertices: int, triangles: int, *, normals: bool, uv: bool) -> None:
        self.positions = np.zeros((vertices, 3), np.float32)
        self.tint = np.zeros((vertices, 3), np.float32)
        self.normals = np.zeros((vertices, 3), np.float32) if normals else None
        self.uv = np.zeros((vertices, 2), np.float32) if uv else None
        self.triangles = np.zeros((triangles, 3), np.int32)
        self.material_of = np.zeros(triangles, np.int32)
        self.materials: dict[Material, int] = {}  # equal ones once, in the order of first use

    def place(self, local: LocalMesh, stands: Stands) -> None:
        """Write a primitive at all its places."""
        matrices, vertices, triangles = (
            part[0] if len(part) == 1 else np.concatenate(part)
            for part in (stands.matrices, stands.vertices, stands.triangles)
        )
        number = self.materials.setdefault(local.material, len(self.materials))
        step = max(1, _AT_ONCE // len(local.positions))
        for first in range(0, len(matrices), step):
            here = slice(first, first + step)
            linear, shift = matrices[here, :3, :3], matrices[here, None, :3, 3]
            across, determinants = _cofactors(linear)
            turned = (determinants < 0)[:, None, None]
            rows, faces = vertices[here], local.triangles[None]
            _put(self.positions, rows, local.positions @ linear.transpose(0, 2, 1) + shift)
            _put(self.tint, rows, np.broadcast_to(local.tint, (len(rows), *local.positions.shape)))
            if self.normals is not None and local.normals is not None:
                across = np.where(turned, -across, across)
                _put(self.normals, rows, local.normals @ across.transpose(0, 2, 1))
            if self.uv is not None and local.uv is not None:
                _put(self.uv, rows, np.broadcast_to(local.uv, (len(rows), *local.uv.shape)))
            # A mirrored triangle turns its other side: its corners are taken the other way round.
            wound = np.where(turned, faces[:, :, ::-1], faces) + rows[:, None, None]
            _put(self.triangles, triangles[here], wound)
            _put(self.material_of, triangles[here], np.full(wound.shape[:2], number))

    def drop_unused(self, candidates: np.ndarray) -> None:
        """Leave out those of the vertices (V,) bool that no triangle uses; the others keep their order."""
        keep = ~candidates
        keep[self.triangles] = True
        if keep.all():
            return
        self.triangles = (np.cumsum(keep, dtype=np.int32) - np.int32(1))[self.triangles]
        self.positions, self.tint = self.positions[keep], self.tint[keep]
        self.normals = None if self.normals is None else self.normals[keep]
        self.uv = None if self.uv is None else self.uv[keep]


def _put(array: np.ndarray, firsts: np.ndarray, values: np.ndarray) -> None:
    """Write blocks of rows (n, length, ...), each from its own first row on."""
    length = values.shape[1]
    if len(firsts) == 1:
        array[firsts[0] : firsts[0] + length] = values[0]
    else:
        array[firsts[:, None] + np.arange(length)] = values


def _cofactors(linear: Float64[np.ndarray, "n 3 3"]) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3, 3) what acts on normals, up to a factor, and (n,) the determinants; see `normals.normal_matrix`."""
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(linear, 0, -1)
    rows = [
        [e * i - f * h, f * g - d * i, d * h - e * g],
        [c * h - b * i, a * i - c * g, b * g - a * h],
        [b * f - c * e, c * d - a * f, a * e - b * d],
    ]
    cofactors = np.moveaxis(np.array(rows), -1, 0)
    return cofactors, a * rows[0][0] + b * rows[0][1] + c * rows[0][2]
