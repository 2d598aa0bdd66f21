"""A finished bake, opened for reading: memory-mapped, checked, never trusted."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Albedo, MaterialOf, Texture, TextureCoordinates, Triangles
from ..camera import Camera
from ..errors import DamagedBakeError, InputError
from ..files import read_regular
from ..material import Material
from ..receivers import Receivers
from .chunks import check_hash, chunk_key, open_chunk
from .manifest import NAME, LayerRecord, Manifest

_SECONDS = "user.prelight.seconds"


@dataclass(frozen=True)
class Bake:
    """Transport on disk, ``NAME.prelight``.

    Opening reads the manifest; an array's chunks are checked (size, crc32c) when it is first used.
    """

    path: Path
    manifest: Manifest = field(repr=False)

    @classmethod
    def open(cls, path: str | Path) -> Bake:
        """Raises InputError if there is no bake at ``path``, DamagedBakeError if it is not whole."""
        root = Path(path)
        return cls(root, Manifest.open(root))

    @cached_property
    def receivers(self) -> Receivers:
        """Positions, normals and albedo, ``(R, 3)`` float32 each."""
        receivers = Receivers(*(self.array(f"scene/{name}") for name in ("positions", "normals", "albedo")))
        for name in ("positions", "normals", "albedo"):
            if not np.isfinite(getattr(receivers, name)).all():
                raise DamagedBakeError(self.path, f"scene/{name} has values that are not finite")
        return receivers

    @cached_property
    def triangles(self) -> Triangles:
        """``(F, 3)`` int32 indices of receivers."""
        triangles = self.array("scene/triangles")
        if triangles.min() < 0 or triangles.max() >= len(self.receivers):
            raise DamagedBakeError(self.path, "scene/triangles names receivers that do not exist")
        return triangles

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        try:
            return {camera.name: Camera.from_dict(camera.view) for camera in self.manifest.scene.cameras}
        except InputError as error:
            raise DamagedBakeError(self.path, f"a camera in it is wrong: {error.reason}") from None

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """What ``material_of`` names; at least one."""
        records = self.manifest.scene.materials
        try:
            return tuple(Material.from_dict(m, textures=len(self.textures)) for m in records)
        except InputError as error:
            raise DamagedBakeError(self.path, f"a material in it is wrong: {error.reason}") from None

    @cached_property
    def material_of(self) -> MaterialOf:
        """``(F,)`` index into ``materials`` of each triangle."""
        material_of = self.array("scene/material_of")
        if (
            material_of.shape != (len(self.triangles),)
            or not ((material_of >= 0) & (material_of < len(self.materials))).all()
        ):
            raise DamagedBakeError(self.path, "scene/material_of names materials that do not exist")
        return material_of

    @cached_property
    def textures(self) -> tuple[Texture, ...]:
        """``(H, W, 3)`` bytes each."""
        names = sorted(name for name in self.manifest.arrays if name.startswith("scene/textures/"))
        return tuple(self.array(name) for name in names)

    @cached_property
    def uv(self) -> TextureCoordinates | None:
        """``(R, 2)`` texture coordinates, v down; None without textures."""
        if "scene/uv" not in self.manifest.arrays:
            return None
        uv = self.array("scene/uv")
        if not np.isfinite(uv).all():
            raise DamagedBakeError(self.path, "scene/uv has values that are not finite")
        return uv

    @cached_property
    def tint(self) -> Albedo:
        """``(R, 3)`` the albedo without its texture."""
        if "scene/tint" not in self.manifest.arrays:
            return self.receivers.albedo
        tint = self.array("scene/tint")
        if not np.isfinite(tint).all():
            raise DamagedBakeError(self.path, "scene/tint has values that are not finite")
        return tint

    @property
    def layers(self) -> dict[str, LayerRecord]:
        return self.manifest.layers

    def array(self, name: str) -> np.ndarray:
        """A whole array, read-only and C-contiguous; in memory once if it has several chunks, else mapped."""
        spec = self.manifest.arrays.get(name)
        if spec is None:
            raise DamagedBakeError(self.path, f"array {name} is not in the manifest")
        if math.prod(spec.grid()) == 1:
            _, whole = next(self._chunks(name))
        else:
            for _ in self._chunks(name):  # every chunk is there and whole, before memory is asked for
                pass
            whole = np.empty([n * c for n, c in zip(spec.grid(), spec.chunk_shape, strict=True)], spec.dtype)
            for index, chunk in self._chunks(name):
                whole[
                    tuple(slice(i * c, (i + 1) * c) for i, c in zip(index, spec.chunk_shape, strict=True))
                ] = chunk
        # Contiguous, whatever chunks a file is cut into: kernels follow addresses.
        values = np.ascontiguousarray(whole[tuple(slice(0, n) for n in spec.shape)])
        values.flags.writeable = False
        return values

    def _chunks(self, name: str) -> Iterator[tuple[tuple[int, ...], np.ndarray]]:
        spec = self.manifest.arrays[name]
        for index in spec.chunk_indices():
            key = chunk_key(name, index)
            yield index, open_chunk(self.path, key, spec, self.manifest.chunks[key])

    def verify(self) -> Iterator[tuple[str, int]]:
        """Check every chunk against its sha256, yielding (key, bytes); DamagedBakeError names one that differs."""
        for key, record in self.manifest.chunks.items():
            check_hash(self.path, key, record.size, record.sha256)
            yield key, record.size
        for name, expected in self.manifest.metadata().items():
            try:
                whole = read_regular(self.path / name, limit=len(expected)) == expected
            except InputError:
                whole = False
            if not whole:
                raise DamagedBakeError(self.path, f"{name} is missing or altered; bake again or restore it")

    @property
    def seconds(self) -> float | None:
        """What the bake took where it was made, if the file system kept the note (see ``note_seconds``)."""
        try:
            seconds = struct.unpack("<d", os.getxattr(self.path / NAME, _SECONDS))[0]
        except (OSError, AttributeError, struct.error):
            return None
        return seconds if 0 <= seconds < math.inf else None

    def note_seconds(self, seconds: float) -> None:
        """Keep the wall time as an extended attribute: beside the bytes, not among them, so that
        two bakes of the same thing stay identical. Lost where attributes are not supported."""
        try:
            os.setxattr(self.path / NAME, _SECONDS, struct.pack("<d", seconds))
        except (OSError, AttributeError):
            return

    def summary(self) -> dict[str, Any]:
        """What ``prelight inspect --json`` prints."""
        manifest = self.manifest
        layers = [
            {
                "kind": layer.kind,
                "name": name,
                "basis_lights": layer.basis_lights,
                "coefficients": layer.coefficients,
                "camera": None if layer.camera is None else layer.camera.name,
                "bytes": manifest.bytes_of(f"layers/{name}/"),
                "bounced_bytes": manifest.bytes_of(f"layers/{name}/bounced/"),
                "glossy_bytes": manifest.bytes_of(f"layers/{name}/glossy/"),
                "seconds": self.seconds,
                "rays": layer.rays,
                "parameters": layer.parameters,
                "statistics": layer.statistics,
            }
            for name, layer in manifest.layers.items()
        ]
        return {
            "path": str(self.path),
            "scene": manifest.scene.name,
            "digest": manifest.scene.digest,
            "receivers": manifest.arrays["scene/positions"].shape[0],
            "triangles": manifest.arrays["scene/triangles"].shape[0],
            "cameras": [camera.name for camera in manifest.scene.cameras],
            "notes": manifest.scene.notes,
            "bytes": manifest.bytes_of(""),
            "layers": layers,
            "software": manifest.software,
        }
