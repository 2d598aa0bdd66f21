"""What a reader found in a file, and the checks that make a scene of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Albedo, Float64, Normals, Positions, Texture
from ..camera import Camera
from ..errors import printable
from ..images.textures import sample
from ..material import GREY, Material
from .geometry import Scene
from .normals import vertex_normals, zero_area

DEFAULT_ALBEDO = GREY[0]
MOST_VERTICES = 50_000_000
MOST_TRIANGLES = 50_000_000


class UnreadableMesh(ValueError):
    """A reader's refusal; `loading` adds the file's name and raises it as InputError."""

    def __init__(self, reason: str, where: str | None = None) -> None:
        self.reason, self.where = reason, where
        super().__init__(reason)


@dataclass(frozen=True)
class MeshAsRead:
    """Arrays as a file gives them: vertices in file order, indices not yet trusted."""

    positions: np.ndarray  # (V, 3) real, metres
    triangles: np.ndarray  # (F, 3) integers
    normals: np.ndarray | None = None  # (V, 3) real, any length; zero or not finite where the file has none
    albedo: np.ndarray | None = None  # (V, 3) linear Rec.709, any range; without texture
    notes: tuple[str, ...] = ()
    materials: tuple[Material, ...] = (Material(),)
    material_of: np.ndarray | None = None  # (F,) integers in range; all zero if not given
    uv: np.ndarray | None = None  # (V, 2) real, v down from a texture's first row
    textures: tuple[Texture, ...] = ()
    cameras: dict[str, Camera] = field(default_factory=dict)


def linear_from_srgb(encoded: np.ndarray) -> Float64[np.ndarray, "..."]:
    """The decoding of IEC 61966-2-1: values of 0 to 1 as displayed, to linear light of 0 to 1."""
    encoded = np.asarray(encoded, np.float64)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4)


def short_name(text: object) -> str:
    """A name from a file, safe and short enough to stand inside a sentence."""
    name = printable(text)
    return name if len(name) <= 60 else name[:59] + "…"


def check_counts(vertices: int, triangles: int) -> None:
    """Raises UnreadableMesh above the limits; call it before allocating."""
    for count, most, what in (
        (vertices, MOST_VERTICES, "vertices"),
        (triangles, MOST_TRIANGLES, "triangles"),
    ):
        if count > most:
            raise UnreadableMesh(f"{count:,} {what}, at most {most:,} are read; simplify the mesh")


def scene_from(mesh: MeshAsRead, *, name: str) -> Scene:
    """Check what was read and complete it: zero-area triangles dropped, normals and albedo filled in.

    Vertices keep their order and count. Raises UnreadableMesh.
    """
    check_counts(len(mesh.positions), len(mesh.triangles))
    positions = _checked_positions(mesh.positions)
    notes = list(mesh.notes)
    triangles, kept = _checked_triangles(mesh.triangles, positions, notes)
    material_of = np.zeros(len(kept), np.int32) if mesh.material_of is None else mesh.material_of
    material_of = np.ascontiguousarray(material_of[kept], np.int32)
    normals = _normals(mesh.normals, positions, triangles, notes)
    tint = _checked_albedo(mesh.albedo, len(positions), notes)
    scene = Scene(
        printable(name), positions, normals, triangles, tint, cameras=mesh.cameras, notes=tuple(notes),
        materials=mesh.materials, material_of=material_of, uv=_checked_uv(mesh.uv), textures=mesh.textures,
    )  # fmt: skip
    return textured(scene)


def _checked_uv(given: np.ndarray | None) -> np.ndarray | None:
    """Finite; a coordinate that is no number becomes 0."""
    if given is None:
        return None
    uv = np.asarray(given, np.float64).reshape(-1, 2)
    return np.ascontiguousarray(np.where(np.abs(uv) < 1e9, uv, 0), np.float32)


def textured(scene: Scene) -> Scene:
    """The albedo of vertices times the texture there, the tint kept beside it."""
    if scene.uv is None or all(m.colour_texture is None for m in scene.materials):
        return scene
    albedo: Albedo = scene.albedo.copy()
    material_of = scene.material_of_vertex
    for k, material in enumerate(scene.materials):
        if material.colour_texture is not None:
            here = material_of == k
            texture = scene.textures[material.colour_texture]
            albedo[here] *= linear_from_srgb(sample(texture, scene.uv[here]) / 255).astype(np.float32)
    return replace(scene, albedo=albedo, tint=scene.albedo)


def _checked_positions(given: np.ndarray) -> Positions:
    positions = np.ascontiguousarray(given, np.float32).reshape(-1, 3)
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        x, y, z = (float(v) for v in np.asarray(given).reshape(-1, 3)[first])
        at = f"({x:g}, {y:g}, {z:g})"
        raise UnreadableMesh(f"vertex {first} is at {at}; every coordinate must be finite and below 3.4e38")
    return positions


def _checked_triangles(
    given: np.ndarray, positions: Positions, notes: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Those with an area, and which of the given they are."""
    if len(given) == 0:
        raise UnreadableMesh("no triangles, only points: a mesh is needed")
    outside = (given < 0) | (given >= len(positions))
    if outside.any():
        face, corner = np.argwhere(outside)[0]
        raise UnreadableMesh(
            f"triangle {face} uses vertex {given[face, corner]}, but there are {len(positions)} vertices"
        )
    triangles = np.ascontiguousarray(given, np.int32)
    empty = zero_area(positions, triangles)
    if empty.all():
        raise UnreadableMesh("every triangle has zero area: nothing can be lit")
    if dropped := int(empty.sum()):
        notes.append(
            f"triangles of zero area dropped: {dropped:,} of {len(triangles):,}; their vertices stay"
        )
        triangles = triangles[~empty]
    return triangles, ~empty


def _normals(
    given: np.ndarray | None, positions: Positions, triangles: np.ndarray, notes: list[str]
) -> Normals:
    """The file's normals where usable, else angle-weighted; zero where no triangle uses the vertex."""
    used = np.zeros(len(positions), bool)
    used[triangles.ravel()] = True
    if given is None:
        normals = vertex_normals(positions, triangles)
    else:
        # Scaled by the largest component first: a length must neither overflow nor vanish.
        normals = np.array(given, np.float64).reshape(-1, 3)
        largest = np.abs(normals).max(axis=1, keepdims=True)
        usable = np.isfinite(normals).all(axis=1) & (largest[:, 0] > 0)
        normals[~usable] = 0
        np.divide(normals, largest, out=normals, where=usable[:, None])
        np.divide(normals, np.linalg.norm(normals, axis=1, keepdims=True), out=normals, where=usable[:, None])
        missing = used & ~usable
        if missing.any():
            normals[missing] = vertex_normals(positions, triangles)[missing]
            if made := int(normals[missing].any(axis=1).sum()):
                notes.append(
                    f"vertices without a usable normal: {made:,}; theirs are made from the triangles"
                )
        normals[~used] = 0
    if opposed := int((used & ~normals.any(axis=1)).sum()):
        notes.append(
            f"vertices whose triangles face opposite ways: {opposed:,}; without a normal they stay dark"
        )
    return np.ascontiguousarray(normals, np.float32)


def _checked_albedo(given: np.ndarray | None, vertices: int, notes: list[str]) -> np.ndarray:
    if given is None:
        return np.full((vertices, 3), DEFAULT_ALBEDO, np.float32)
    albedo = np.asarray(given, np.float64).reshape(-1, 3)
    missing = np.isnan(albedo).any(axis=1)
    if missing.any():
        raise UnreadableMesh(f"the colour of vertex {int(np.argmax(missing))} is not a number")
    if outside := int(((albedo < 0) | (albedo > 1)).any(axis=1).sum()):
        notes.append(f"vertex colours outside 0 to 1 clipped: {outside:,} of {vertices:,}")
    return np.ascontiguousarray(np.clip(albedo, 0, 1), np.float32)
