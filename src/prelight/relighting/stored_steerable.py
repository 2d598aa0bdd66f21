"""Steerable layers of a bake, opened for relighting: what is said of them checked, nothing trusted."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from ..bases.exponentials import ExponentialAxis, ExponentialBasis
from ..bases.panels import PanelBasis
from ..bases.products import ProductBasis
from ..bases.steering import SpotBasis
from ..camera import Camera
from ..encoding.byte_planes import BytePlanes
from ..errors import DamagedBakeError, InputError
from ..lighting.places import Place
from ..storage.bake import Bake
from ..storage.manifest import LayerRecord
from .deep_buffer import DeepBuffer
from .steerable_layer import Basis, SteerableLayer
from .takers import STEERABLE


def steerable_names(bake: Bake) -> tuple[str, ...]:
    """The steerable layers of a bake, by name."""
    return tuple(name for name, layer in bake.layers.items() if layer.kind == STEERABLE)


def open_steerable(bake: Bake) -> list[SteerableLayer]:
    """All steerable layers of a bake; none if it has none. Raises DamagedBakeError."""
    return [_opened(bake, name, bake.layers[name]) for name in steerable_names(bake)]


def steerable_camera(bake: Bake) -> tuple[str, Camera]:
    """The eye of a bake's steerable layers, which all have the same. Raises DamagedBakeError, InputError."""
    records = [bake.layers[name].camera for name in steerable_names(bake)]
    if not records or records[0] is None:
        raise InputError(bake.path, "has no steerable layer")
    if any(record is None or record.view != records[0].view for record in records):
        raise InputError(bake.path, "its steerable layers have different eyes")
    try:
        return records[0].name, Camera.from_dict(records[0].view)
    except InputError as error:
        raise DamagedBakeError(bake.path, f"the eye in it is wrong: {error.reason}") from None


def keeps_first_bounces(bake: Bake) -> bool:
    """Whether the components of a layer hold later bounces alone, so that ``open_deep`` has the rest."""
    return any(f"layers/{name}/deep_starts" in bake.manifest.arrays for name in steerable_names(bake))


def open_deep(bake: Bake) -> dict[str, DeepBuffer]:
    """The first bounces that are kept apart, by layer; none of layers that hold all light. Raises DamagedBakeError."""
    found = {}
    for name in steerable_names(bake):
        at = f"layers/{name}/deep"
        if f"{at}_starts" not in bake.manifest.arrays:
            continue
        starts, colours, directions = (
            bake.array(f"{at}_{part}") for part in ("starts", "colours", "directions")
        )
        places = bake.array(f"{at}_places") if f"{at}_places" in bake.manifest.arrays else None
        if not np.isfinite(colours).all():
            raise DamagedBakeError(bake.path, f"{at}_colours has values that are not finite")
        try:
            degree = degree_of(basis_of(str(bake.layers[name].parameters["basis"])))
            parts = math.isqrt(int(bake.layers[name].parameters["deep"]))  # ty: ignore
            found[name] = DeepBuffer(starts, colours, directions, degree, places, parts=parts)
        except (InputError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise DamagedBakeError(
                bake.path, f"the first bounce of layer {name!r} is wrong: {error}"
            ) from None
    return found


def _opened(bake: Bake, name: str, record: LayerRecord) -> SteerableLayer:
    at, said = f"layers/{name}", record.parameters
    names = ["bytes", "scales", "image_of", "salience", "mixing"]
    if f"{at}/bright" in bake.manifest.arrays:
        names += ["bright", "bright_values"]
    parts = {part: bake.array(f"{at}/{part}") for part in names}
    for part, values in parts.items():
        if values.dtype == np.float32 and not np.isfinite(values).all():
            raise DamagedBakeError(bake.path, f"{at}/{part} has values that are not finite")
    size = (int(said["width"]), int(said["height"]))  # ty: ignore
    try:
        bright = {part: parts[part] for part in names[5:]}
        planes = BytePlanes(
            size[0] * size[1], parts["bytes"], parts["scales"], parts["image_of"],
            parts["salience"].astype(np.float64), **bright,
        )  # fmt: skip
        basis, place = basis_of(str(said["basis"])), _place(str(said["place"]))
        return SteerableLayer(name, basis, place, size, planes, parts["mixing"].astype(np.float64))
    except (InputError, KeyError, TypeError, ValueError, RecursionError) as error:
        reason = error.reason if isinstance(error, InputError) else str(error)
        raise DamagedBakeError(bake.path, f"layer {name!r} does not fit together: {reason}") from None


def basis_of(text: str) -> Basis:
    """The basis that a bake describes. Raises ValueError, KeyError or TypeError for any other text."""
    said: dict[str, Any] = json.loads(text)
    kind = said["kind"]
    if kind not in ("spot", "panel", "exponential", "product"):
        raise InputError("basis", f"of kind {kind!r}, expected spot, panel, exponential or product")
    turns = kind in ("spot", "product")
    spot = SpotBasis(said["degree"], parity=said["parity"]) if turns else None
    if kind == "spot" and spot is not None:
        return spot
    if "terms" in said:
        terms = tuple((complex(real, imaginary), power) for real, imaginary, power in said["terms"])
        panel = ExponentialBasis((ExponentialAxis(terms),) * 2, orthonormal=True)
    else:
        panel = PanelBasis(tuple(said["harmonics"]))
    return panel if spot is None else ProductBasis(panel, spot)


def degree_of(basis: Basis) -> int | None:
    """Of the directions of a basis; None where light leaves alike in all."""
    spot = basis.spot if isinstance(basis, ProductBasis) else basis
    return spot.degree if isinstance(spot, SpotBasis) else None


def _place(text: str) -> Place:
    said = json.loads(text)
    return Place(said["kind"], tuple(said["origin"]), tuple(tuple(edge) for edge in said["edges"]))
