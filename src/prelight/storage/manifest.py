"""What a bake says of itself: scene, arrays, layers and a record of every chunk.

The manifest is written last. It holds nothing that differs between two bakes of the same scene with
the same settings (no dates, no seconds), so that identical bakes are identical bytes.
"""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import DamagedBakeError, InputError
from ..files import read_regular
from .chunks import DTYPES, ArraySpec, ChunkRecord, chunk_key

FORMAT = "prelight-bake"
VERSION = 1
NAME = "manifest.json"
_LARGEST_MANIFEST = 256_000_000
_LARGEST_ARRAY = 1 << 40


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class SceneRecord(_Strict):
    name: str
    digest: str = Field(pattern=r"^[0-9a-f]{64}$")
    cameras: dict[str, dict[str, Any]]
    notes: list[str]


class LayerRecord(_Strict):
    kind: str
    basis_lights: int = Field(gt=0)
    coefficients: int = Field(gt=0)
    rays: int = Field(ge=0)
    parameters: dict[str, int | float | str | None]
    statistics: dict[str, int | float]


class Manifest(_Strict):
    format: str
    version: int
    settings: dict[str, int | float | str | None]
    scene: SceneRecord
    layers: dict[str, LayerRecord]
    arrays: dict[str, ArraySpec]
    chunks: dict[str, ChunkRecord]
    software: dict[str, str]

    def bytes_of(self, prefix: str) -> int:
        """Bytes on disk of the chunks whose key begins with ``prefix``, checksums included."""
        return sum(record.size for key, record in self.chunks.items() if key.startswith(prefix))

    def to_bytes(self) -> bytes:
        """Canonical JSON; its last member is the sha256 of the rest."""
        body = self.model_dump()
        return json.dumps(
            {**body, "sha256": _digest(body)}, sort_keys=True, indent=1, allow_nan=False
        ).encode()

    @classmethod
    def open(cls, root: Path) -> Manifest:
        """Read and distrust: raises InputError for what is no bake, DamagedBakeError for a broken one."""
        path = root / NAME
        if not root.is_dir():
            raise InputError(root, "no such bake; expected a folder NAME.prelight")
        if not path.is_file():
            raise DamagedBakeError(root, "has no manifest.json: not a bake, or one that was never finished")
        try:
            data = json.loads(read_regular(path, limit=_LARGEST_MANIFEST))
            if not isinstance(data, dict):
                raise ValueError("not an object")
            if data.get("format") != FORMAT or data.get("version") != VERSION:
                found = f"{data.get('format')!r} version {data.get('version')!r}"
                raise DamagedBakeError(root, f"is {found}, this Prelight reads {FORMAT!r} version {VERSION}")
            digest = data.pop("sha256", None)
            if digest != _digest(data):
                raise DamagedBakeError(root, "manifest.json was altered (its own sha256 differs)")
            manifest = cls.model_validate(data)
        except ValidationError as error:
            first = error.errors()[0]
            where = "/".join(str(x) for x in first["loc"])
            raise DamagedBakeError(root, f"manifest.json: {first['msg']} at /{where}") from None
        except (InputError, ValueError, RecursionError) as error:
            if isinstance(error, DamagedBakeError):
                raise
            raise DamagedBakeError(root, f"manifest.json is not readable: {error}") from None
        manifest.check(root)
        return manifest

    def check(self, root: Path) -> None:
        """Shapes, types and chunk names agree; nothing is allocated. Raises DamagedBakeError."""
        expected = set()
        for name, spec in self.arrays.items():
            problem = _array_problem(name, spec)
            if problem:
                raise DamagedBakeError(root, f"array {name!r}: {problem}")
            keys = [chunk_key(name, index) for index in spec.chunk_indices()]
            for key in keys:
                if key not in self.chunks:
                    raise DamagedBakeError(root, f"chunk {key} is not in the manifest")
                if self.chunks[key].size != spec.chunk_bytes():
                    raise DamagedBakeError(
                        root, f"chunk {key}: {self.chunks[key].size} bytes do not fit its shape"
                    )
            expected.update(keys)
        if len(expected) != len(self.chunks):
            raise DamagedBakeError(root, "the manifest names chunks that no array has")


def _array_problem(name: str, spec: ArraySpec) -> str | None:
    if not all(part.replace("_", "a").isalnum() for part in name.split("/")):
        return "its name is not plain words"
    if spec.dtype not in DTYPES:
        return f"element type {spec.dtype!r} is not one of {', '.join(DTYPES)}"
    if len(spec.shape) != len(spec.chunk_shape) or min(spec.shape + spec.chunk_shape) < 1:
        return f"shape {spec.shape} and chunks {spec.chunk_shape} do not fit"
    if math.prod(spec.shape) > _LARGEST_ARRAY or math.prod(spec.chunk_shape) > _LARGEST_ARRAY:
        return f"shape {spec.shape} is too large"
    if math.prod(spec.grid()) > 1_000_000:
        return "it has more than a million chunks"
    return None


def _digest(body: dict) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
