"""Pieces of a stock scene: each closed or flat, with normals of its own, put together without welding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Float64, Int32
from ...camera import Camera
from ...material import Material
from ..geometry import Scene


@dataclass(frozen=True)
class Part:
    """Triangles of one material. Vertices are never shared across a sharp edge: one normal each."""

    positions: Float64[np.ndarray, "vertices 3"]  # metres
    normals: Float64[np.ndarray, "vertices 3"]  # unit length, outward
    triangles: Int32[np.ndarray, "triangles 3"]  # counter-clockwise seen from outside

    def turned(self, degrees: float) -> Part:
        """Turned about +Y, counter-clockwise seen from above."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])  # acts on rows
        return Part(self.positions @ turn, self.normals @ turn, self.triangles)

    def scaled(self, factor: float) -> Part:
        return Part(self.positions * factor, self.normals, self.triangles)

    def moved(self, offset: tuple[float, float, float]) -> Part:
        return Part(self.positions + offset, self.normals, self.triangles)


def together(parts: list[Part]) -> Part:
    """One part of several, in this order."""
    firsts = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
    return Part(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.triangles + first for part, first in zip(parts, firsts, strict=True)]),
    )


def scene_of(
    name: str,
    parts: list[tuple[Part, Material]],
    *,
    cameras: dict[str, Camera],
) -> Scene:
    """A scene of parts, each of one material."""
    whole = together([part for part, _ in parts])
    albedo = [np.broadcast_to(np.float32(of.colour), part.positions.shape) for part, of in parts]
    material_of = np.repeat(np.arange(len(parts)), [len(part.triangles) for part, _ in parts])
    return Scene(
        name=name,
        positions=whole.positions.astype(np.float32),
        normals=whole.normals.astype(np.float32),
        triangles=whole.triangles.astype(np.int32),
        albedo=np.concatenate(albedo),
        cameras=cameras,
        materials=tuple(of for _, of in parts),
        material_of=material_of.astype(np.int32),
    )


def split_quads(
    positions: Float64[np.ndarray, "vertices 3"], quads: Int32[np.ndarray, "quads 4"]
) -> Int32[np.ndarray, "triangles 3"]:
    """Two triangles a quad, cut along its shorter diagonal."""
    a, b, c, d = quads.T
    diagonal = np.linalg.norm(positions[a] - positions[c], axis=1)
    other = np.linalg.norm(positions[b] - positions[d], axis=1)
    along = (diagonal <= other * (1 + 1e-9))[:, None]  # a tie is cut the same way on every machine
    first = np.where(along, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(along, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return np.stack([first, second], axis=1).reshape(-1, 3).astype(np.int32)


def rectangle(
    corner: Float64[np.ndarray, "3"],
    first_side: Float64[np.ndarray, "3"],
    second_side: Float64[np.ndarray, "3"],
    *,
    cells: tuple[int, int],
) -> Part:
    """A flat grid of vertices, seen from where ``first_side`` turns counter-clockwise into ``second_side``."""
    rows, columns = cells
    s = np.linspace(0.0, 1.0, rows + 1)[:, None, None]
    t = np.linspace(0.0, 1.0, columns + 1)[None, :, None]
    positions = (corner + s * first_side + t * second_side).reshape(-1, 3)
    i, j = np.divmod(np.arange(rows * columns), columns)
    k = i * (columns + 1) + j
    normal = np.cross(first_side, second_side)
    normals = np.broadcast_to(normal / np.linalg.norm(normal), positions.shape)
    quads = np.stack([k, k + columns + 1, k + columns + 2, k + 1], axis=1)
    return Part(positions, normals, split_quads(positions, quads))
