"""The scene that a bake was made of, from the bake itself: for tracing the same receivers again."""

from __future__ import annotations

from ..storage.bake import Bake
from .geometry import Scene


def scene_of(bake: Bake) -> Scene:
    """Triangles, materials and textures as baked. Raises DamagedBakeError where its arrays are not whole."""
    receivers = bake.receivers
    return Scene(
        name=bake.manifest.scene.name,
        positions=receivers.positions,
        normals=receivers.normals,
        triangles=bake.triangles,
        albedo=receivers.albedo,
        cameras=bake.cameras,
        notes=tuple(bake.manifest.scene.notes),
        materials=bake.materials,
        material_of=bake.material_of,
        uv=bake.uv,
        tint=None if bake.uv is None else bake.tint,
        textures=bake.textures,
    )
