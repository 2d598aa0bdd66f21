"""What a bake says of itself: scene, arrays, layers and a record of every chunk.

The manifest is written last. It holds nothing that differs between two bakes of the same scene with
the same settings (no dates, no seconds), so that identical bakes are identical bytes.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from pathlib import Path, PurePosixPath
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import DamagedBakeError, InputError
from ..files import read_regular
from .chunks import DTYPES, ArraySpec, ChunkRecord, chunk_key
from .cloud_layer import cloud_problem
from .environment_layer import environment_problem
from .portals_layer import portals_problem
from .steerable_layer import steerable_problem
from .transfer_layer import transfer_problem

FORMAT = "prelight-bake"
VERSION = 3
READABLE = (2, VERSION)  # what version 2 had not: bounced light
NAME = "manifest.json"
_LARGEST_MANIFEST = 16_000_000  # about ten thousand parcels of an environment layer
_LARGEST_PROSE = 1_000_000
_LARGEST_ARRAY = 1 << 40
_BYTES_PER_VALUE = 16  # of a manifest of ours there are 25 to each value: denser text only fills memory
_SCENE = {"positions": "float32", "normals": "float32", "albedo": "float32", "triangles": "int32"}
_CHECKS = {
    "environment": environment_problem,
    "steerable": steerable_problem,
    "portals": portals_problem,
    "transfer": transfer_problem,
    "cloud": cloud_problem,
}
_ZARR_GROUP = b'{"attributes": {}, "node_type": "group", "zarr_format": 3}'


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class CameraRecord(_Strict):
    name: str
    view: dict[str, Any]  # the fields of ``camera.Camera``


class SceneRecord(_Strict):
    name: str
    digest: str = Field(pattern=r"^[0-9a-f]{64}$")
    cameras: list[CameraRecord]  # the first is the one pictures are taken with
    notes: list[str]
    materials: list[dict[str, Any]]  # the fields of ``material.Material``, at least one


class LayerRecord(_Strict):
    kind: str
    basis_lights: int = Field(gt=0, le=_LARGEST_ARRAY)
    coefficients: int = Field(gt=0, le=_LARGEST_ARRAY)
    rays: int = Field(ge=0, lt=2**63)
    camera: CameraRecord | None = None  # the eye, where it is fixed
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

    def metadata(self) -> dict[str, bytes]:
        """The ``zarr.json`` of every array and of the groups they are in, by its name inside the bake."""
        groups = {parent for name in self.arrays for parent in PurePosixPath(name).parents}
        files = {str(group / "zarr.json"): _ZARR_GROUP for group in sorted(groups)}
        return files | {f"{name}/zarr.json": spec.zarr_metadata() for name, spec in self.arrays.items()}

    def to_bytes(self) -> bytes:
        """Canonical JSON; its member ``sha256`` is the hash of the rest."""
        body = self.model_dump()
        return json.dumps(
            {**body, "sha256": _digest(body)}, sort_keys=True, indent=1, allow_nan=False
        ).encode()

    @classmethod
    def open(cls, root: Path) -> Manifest:
        """Read and distrust: raises InputError for what is no bake, DamagedBakeError for a broken one."""
        path = root / NAME
        if not os.path.isdir(root):
            raise InputError(root, _why_no_bake(root))
        if not os.path.isfile(path):
            raise DamagedBakeError(root, "has no manifest.json: not a bake, or one that was never finished")
        try:
            data = _read_json(path)
            if data.get("format") != FORMAT or data.get("version") not in READABLE:
                found = f"{data.get('format')!r} version {data.get('version')!r}"
                raise DamagedBakeError(root, f"is {found}, this Prelight reads {FORMAT!r} versions 2 and 3")
            digest = data.pop("sha256", None)
            if digest != _digest(data):
                raise DamagedBakeError(root, "manifest.json was altered (its own sha256 differs)")
            _parse_records(data, set(cls.model_fields))
            manifest = cls.model_validate(data)
        except ValidationError as error:
            first = error.errors(include_url=False, include_context=False, include_input=False)[0]
            where = "/".join(str(x) for x in first["loc"])
            raise DamagedBakeError(root, f"manifest.json: {first['msg']} at /{where}") from None
        except (InputError, ValueError, RecursionError) as error:
            if isinstance(error, DamagedBakeError):
                raise
            reason = error.reason if isinstance(error, InputError) else str(error)
            raise DamagedBakeError(root, f"manifest.json is not readable: {reason}") from None
        manifest.check(root)
        return manifest

    def check(self, root: Path) -> None:
        """Shapes, types and chunk names agree; nothing is allocated. Raises DamagedBakeError."""
        for name, spec in self.arrays.items():
            if problem := _array_problem(name, spec):
                raise DamagedBakeError(root, f"array {name!r}: {problem}")
        counted = 0
        for name, spec in self.arrays.items():
            for index in spec.chunk_indices():  # ends at the first that is missing, whatever a shape claims
                key = chunk_key(name, index)
                if key not in self.chunks:
                    raise DamagedBakeError(root, f"chunk {key} is not in the manifest")
                if self.chunks[key].size != spec.chunk_bytes():
                    claimed = f"chunk {key}: {self.chunks[key].size} bytes do not fit its shape"
                    raise DamagedBakeError(root, claimed)
                counted += 1
        if counted != len(self.chunks):
            raise DamagedBakeError(root, "the manifest names chunks that no array has")
        if problem := self._scene_problem() or self._layer_problem():
            raise DamagedBakeError(root, problem)

    def _scene_problem(self) -> str | None:
        receivers = 0
        for name, dtype in _SCENE.items():
            spec = self.arrays.get(f"scene/{name}")
            if spec is None or spec.dtype != dtype or len(spec.shape) != 2 or spec.shape[1] != 3:
                return f"array scene/{name} is not triples of {dtype}"
            receivers = receivers or spec.shape[0]
            if name != "triangles" and spec.shape[0] != receivers:
                return f"array scene/{name} has {spec.shape[0]} rows, expected {receivers}"
        if not self.scene.materials:
            return "it has no material"
        of = self.arrays.get("scene/material_of")
        if of is None or of.dtype != "int32" or of.shape != [self.arrays["scene/triangles"].shape[0]]:
            return "array scene/material_of is not one int32 a triangle"
        for name, width in (("uv", 2), ("tint", 3)):
            spec = self.arrays.get(f"scene/{name}")
            if spec is not None and (spec.dtype != "float32" or spec.shape != [receivers, width]):
                return f"array scene/{name} is not {width} float32 a receiver"
        for name, spec in self.arrays.items():
            is_picture = spec.dtype == "uint8" and len(spec.shape) == 3 and spec.shape[2] == 3
            if name.startswith("scene/textures/") and not is_picture:
                return f"array {name} is no picture of bytes"
        return None

    def _layer_problem(self) -> str | None:
        for name, layer in self.layers.items():
            said = layer.parameters | layer.statistics
            has_eye = layer.camera is not None
            check = _CHECKS.get(layer.kind)
            if check is None:
                continue  # of a later version, say; left alone
            problem = check(name, said, self.arrays, coefficients=layer.coefficients, has_eye=has_eye)
            if problem:
                return problem
        return None


def _why_no_bake(root: Path) -> str:
    if root.name and os.path.isdir(root.with_name(root.name + ".partial")):
        return "this bake is not finished; run its prelight bake command again with --resume"
    if os.path.isfile(root):
        return "a file, expected a bake, a folder NAME.prelight; a mesh is first baked: prelight bake environment"
    return "no such bake; expected a folder NAME.prelight"


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


def _read_json(path: Path) -> dict[str, Any]:
    """Raises InputError or ValueError."""
    text = read_regular(path, limit=_LARGEST_MANIFEST)
    values = text.count(b",") + text.count(b"[") + text.count(b"{")
    if values * _BYTES_PER_VALUE > max(len(text), 1_000_000):
        raise ValueError("it is not one of ours")
    data = json.loads(text, parse_constant=_refuse_constant)
    if not isinstance(data, dict):
        raise ValueError("not an object")
    return data


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no number")


def _parse_records(data: dict[str, Any], fields: set[str]) -> None:
    """One at a time, so that the first wrong one is the last looked at: a million errors are no help."""
    if data.keys() != fields:
        raise ValueError(f"its fields are {sorted(data)}, expected {sorted(fields)}")
    if len(json.dumps({name: data[name] for name in fields - {"arrays", "chunks"}})) > _LARGEST_PROSE:
        raise ValueError(f"it says more than {_LARGEST_PROSE / 1e6:.0f} MB besides its arrays and chunks")
    for field, record in (("arrays", ArraySpec), ("chunks", ChunkRecord)):
        values = data.get(field)
        if not isinstance(values, dict):
            raise ValueError(f"{field} is not an object")
        for name, value in values.items():
            try:
                values[name] = record.model_validate(value)
            except ValidationError as error:
                raise ValueError(
                    f"{error.errors(include_input=False)[0]['msg']} at /{field}/{name}"
                ) from None


def _digest(body: dict) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
