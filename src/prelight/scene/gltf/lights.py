"""The lights of a glTF file (KHR_lights_punctual), as they stand in its default scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import FailFast, Field, ValidationError

from ...errors import InputError
from ...files import read_regular
from ..mesh import UnreadableMesh, short_name
from .container import check_json_size, read_chunks
from .document import parse_document
from .fields import Index, Part, Vector
from .nodes import placed_nodes

_LARGEST_FILE = 4 << 30
_MOST = 1_000
_Angle = Annotated[float, Field(ge=0, le=math.pi / 2)]


@dataclass(frozen=True)
class FileLight:
    """A point, a spot or a directional light.

    ``intensity`` is in candela (a directional light's in lux), to be multiplied by the linear ``colour``. ``forward``
    is where a spot or directional light shines, of length 1. ``cone``: half angles in degrees, within which a spot is
    full and beyond which it is dark.
    """

    kind: Literal["point", "spot", "directional"]
    name: str
    position: tuple[float, float, float]
    forward: tuple[float, float, float]
    colour: tuple[float, float, float]
    intensity: float
    cone: tuple[float, float]
    has_range: bool


class _Cone(Part):
    innerConeAngle: _Angle = 0.0
    outerConeAngle: _Angle = math.pi / 4


class _Light(Part):
    name: str = ""
    type: Literal["point", "spot", "directional"]
    color: Vector = (1.0, 1.0, 1.0)
    intensity: Annotated[float, Field(ge=0)] = 1.0
    range: float | None = None
    spot: _Cone = _Cone()


class _Lights(Part):
    lights: Annotated[list[_Light], FailFast(), Field(max_length=_MOST)] = Field(default_factory=list)


class _Extensions(Part):
    KHR_lights_punctual: _Lights = _Lights()


class _Place(Part):
    light: Index


class _PlaceExtension(Part):
    KHR_lights_punctual: _Place | None = None


class _Node(Part):
    extensions: _PlaceExtension = _PlaceExtension()


class _Document(Part):
    extensions: _Extensions = _Extensions()
    nodes: Annotated[list[_Node], FailFast()] = Field(default_factory=list)


def file_lights(path: str | Path) -> list[FileLight]:
    """The lights of a .glb or .gltf file in the order of their nodes; at most 1,000.

    Raises InputError for another or damaged file.
    """
    path = Path(path)
    if path.suffix.lower() not in (".glb", ".gltf"):
        raise InputError(path, "expected a .glb or .gltf file: other formats' lights are not read")
    data = read_regular(path, limit=_LARGEST_FILE)
    try:
        if data[:4] == b"glTF":
            data = read_chunks(data)[0]
        check_json_size(data)
        return _placed(data)
    except UnreadableMesh as error:
        raise InputError(path, error.reason, error.where) from None
    except (ValueError, OverflowError) as error:
        raise InputError(path, f"damaged glTF file: {error}") from None


def _placed(text: bytes) -> list[FileLight]:
    matrices = placed_nodes(parse_document(text))
    try:
        document = _Document.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        pointer = "".join(f"/{short_name(part)}" for part in first["loc"])
        raise UnreadableMesh(f"damaged glTF file: {first['msg']}", pointer) from None
    known, found = document.extensions.KHR_lights_punctual.lights, []
    for index, world in matrices.items():
        place = document.nodes[index].extensions.KHR_lights_punctual
        if place is None:
            continue
        where = f"/nodes/{index}/extensions/KHR_lights_punctual"
        if place.light >= len(known):
            raise UnreadableMesh(f"damaged glTF file: there is no light {place.light}", where)
        if len(found) == _MOST:
            raise UnreadableMesh(f"has more than {_MOST:,} lights; remove some", where)
        found.append(_of(known[place.light], world, where))
    return found


def _of(light: _Light, world: np.ndarray, where: str) -> FileLight:
    forward, position = -world[:3, 2], world[:3, 3]
    length = float(np.linalg.norm(forward))
    if not (0 < length < math.inf and np.isfinite(position).all()):
        raise UnreadableMesh("damaged glTF file: its node leaves the light no place or direction", where)
    if min(light.color) < 0:
        raise UnreadableMesh("damaged glTF file: the light's color is negative", where)
    inner, outer = light.spot.innerConeAngle, light.spot.outerConeAngle
    if inner >= outer:
        reason = f"innerConeAngle {inner:g} is not below outerConeAngle {outer:g}"
        if light.type == "spot":
            raise UnreadableMesh(f"damaged glTF file: {reason}", where)
    x, y, z = position.tolist()
    a, b, c = (forward / length).tolist()
    return FileLight(
        light.type, short_name(light.name), (x, y, z), (a, b, c), light.color, light.intensity,
        (math.degrees(inner), math.degrees(outer)), light.range is not None,
    )  # fmt: skip
