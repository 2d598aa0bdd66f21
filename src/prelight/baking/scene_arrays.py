"""What a bake keeps of its scene, whatever kind of light it is for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..scene.geometry import Scene
from ..storage.chunks import ArraySpec, ChunkRecord
from ..storage.journal import BakeWriter
from ..storage.manifest import CameraRecord, SceneRecord
from .exitant import ExitantPart, write_exitant

_ARRAYS = ("positions", "normals", "albedo", "triangles", "material_of", "uv", "tint")


class WrittenArrays:
    """Arrays of a bake as they are written, each in one chunk: what a manifest says of them."""

    def __init__(self, writer: BakeWriter) -> None:
        self._writer = writer
        self.arrays: dict[str, ArraySpec] = {}
        self.chunks: dict[str, ChunkRecord] = {}

    def write(self, name: str, values: np.ndarray) -> None:
        """Raises OutputError."""
        spec = whole(values)
        key, record = self._writer.write_chunk(name, (0,) * values.ndim, values, spec)
        self.arrays[name], self.chunks[key] = spec, record

    def write_gloss(self, at: str, part: ExitantPart) -> dict[str, int | float]:
        """A layer's glossy part; returns what is told of it."""
        said = write_exitant(self._writer, at, part)
        self.arrays |= {name: ArraySpec(**spec) for name, spec in said["arrays"].items()}
        self.chunks |= {key: ChunkRecord(**record) for key, record in said["chunks"].items()}
        return said["statistics"]

    def write_scene(self, scene: Scene) -> None:
        """Geometry, albedo and textures."""
        for name in _ARRAYS:
            if (values := getattr(scene, name)) is not None:
                self.write(f"scene/{name}", values)
        for k, texture in enumerate(scene.textures):
            self.write(f"scene/textures/{k:05d}", texture)


def scene_record(scene: Scene, notes: Sequence[str] = ()) -> SceneRecord:
    """What a manifest says of the scene besides its arrays."""
    return SceneRecord(
        name=scene.name,
        digest=scene.digest,
        cameras=[CameraRecord(name=n, view=plain(c.to_dict())) for n, c in scene.cameras.items()],
        notes=[*scene.notes, *notes],
        materials=[plain(material.to_dict()) for material in scene.materials],
    )


def plain(value: Any) -> Any:
    """Tuples as lists, as JSON gives them back."""
    if isinstance(value, Mapping):
        return {name: plain(inner) for name, inner in value.items()}
    return [plain(inner) for inner in value] if isinstance(value, list | tuple) else value


def not_empty(values: np.ndarray) -> np.ndarray:
    """One zero instead of nothing: an array of a bake has no empty shape."""
    return values if len(values) else np.zeros(1, values.dtype)


def told_digits(value: float) -> float:
    """As many digits as a measurement has, so that manifests do not say more than is known."""
    return float(f"{value:.6g}")


def whole(values: np.ndarray) -> ArraySpec:
    """An array in one chunk."""
    return ArraySpec(shape=list(values.shape), dtype=values.dtype.name, chunk_shape=list(values.shape))
