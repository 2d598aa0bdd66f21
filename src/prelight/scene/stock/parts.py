"""Pieces of a stock scene: each closed or flat, with normals of its own, put together without welding."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Albedo, Float64, Int32, Texture
from ...camera import Camera
from ...images.textures import sample
from ...images.tonemap import srgb_decode
from ...material import Material
from ..geometry import Scene


@dataclass(frozen=True)
class Part:
    """Triangles of one material. Vertices are never shared across a sharp edge: one normal each."""

    positions: Float64[np.ndarray, "vertices 3"]  # metres
    normals: Float64[np.ndarray, "vertices 3"]  # unit length, outward
    triangles: Int32[np.ndarray, "triangles 3"]  # counter-clockwise seen from outside
    uv: Float64[np.ndarray, "vertices 2"] | None = None  # v down from a texture's first row

    def turned(self, degrees: float) -> Part:
        """Turned about +Y, counter-clockwise seen from above."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])  # acts on rows
        return replace(self, positions=self.positions @ turn, normals=self.normals @ turn)

    def tipped(self, degrees: float) -> Part:
        """Turned about +X: what is above comes forward, to +Z."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
        return replace(self, positions=self.positions @ turn, normals=self.normals @ turn)

    def scaled(self, factor: float) -> Part:
        return replace(self, positions=self.positions * factor)

    def moved(self, offset: tuple[float, float, float]) -> Part:
        return replace(self, positions=self.positions + offset)


def together(parts: list[Part]) -> Part:
    """One part of several, in this order."""
    firsts = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
    uv = None
    if any(part.uv is not None for part in parts):
        uv = [np.zeros((len(part.positions), 2)) if part.uv is None else part.uv for part in parts]
    return Part(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.triangles + first for part, first in zip(parts, firsts, strict=True)]),
        None if uv is None else np.concatenate(uv),
    )


def scene_of(
    name: str,
    parts: list[tuple[Part, Material]],
    *,
    cameras: dict[str, Camera],
    textures: tuple[Texture, ...] = (),
) -> Scene:
    """A scene of parts, each of one material; parts that name the same material share it."""
    whole = together([part for part, _ in parts])
    materials: list[Material] = []  # compared, not hashed: one with a bsdf has no hash
    for _, of in parts:
        if of not in materials:
            materials.append(of)
    tint = [np.broadcast_to(np.asarray(of.colour, np.float32), part.positions.shape) for part, of in parts]
    albedo = [_coloured(part, of, textures) for part, of in parts]
    material_of = np.repeat(
        [materials.index(of) for _, of in parts], [len(part.triangles) for part, _ in parts]
    )
    return Scene(
        name=name,
        positions=whole.positions.astype(np.float32),
        normals=whole.normals.astype(np.float32),
        triangles=whole.triangles.astype(np.int32),
        albedo=np.concatenate(albedo),
        cameras=cameras,
        materials=tuple(materials),
        material_of=material_of.astype(np.int32),
        uv=None if whole.uv is None else whole.uv.astype(np.float32),
        tint=np.concatenate(tint) if textures else None,
        textures=textures,
    )


def _coloured(part: Part, material: Material, textures: tuple[Texture, ...]) -> Albedo:
    """(V, 3) the material's colour, times its texture at each vertex."""
    albedo = np.tile(np.asarray(material.colour, np.float32), (len(part.positions), 1))
    if material.colour_texture is not None and part.uv is not None:
        albedo *= srgb_decode(sample(textures[material.colour_texture], part.uv) / 255)
    return albedo


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
    s, t = np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1)
    return sheet(corner, first_side, second_side, s=s, t=t)


def sheet(
    corner: Float64[np.ndarray, "3"],
    first_side: Float64[np.ndarray, "3"],
    second_side: Float64[np.ndarray, "3"],
    *,
    s: Float64[np.ndarray, "rows"],
    t: Float64[np.ndarray, "columns"],
) -> Part:
    """As ``rectangle``, with vertices at corner + s·first_side + t·second_side; s and t ascend."""
    rows, columns = len(s) - 1, len(t) - 1
    s, t = s[:, None, None], t[None, :, None]
    positions = (corner + s * first_side + t * second_side).reshape(-1, 3)
    i, j = np.divmod(np.arange(rows * columns), columns)
    k = i * (columns + 1) + j
    normal = np.cross(first_side, second_side)
    normals = np.broadcast_to(normal / np.linalg.norm(normal), positions.shape)
    quads = np.stack([k, k + columns + 1, k + columns + 2, k + 1], axis=1)
    return Part(positions, normals, split_quads(positions, quads))
