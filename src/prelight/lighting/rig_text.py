"""Lights as the text of a rig file, which reads back as the same lights."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from .distributions import Distribution, Gobo, Polynomial, Power
from .ies import Photometry
from .panel import Panel
from .spot import Spot


def rig_text(lights: Sequence[Spot | Panel], *, folder: Path, notes: Sequence[str] = ()) -> str:
    """[[spot]] and [[panel]] tables of lights, for a file in ``folder``; ``notes`` become comments at its head.

    Raises InputError for a shape that no key of a rig describes.
    """
    parts = ["".join(f"# {' '.join(note.split())}\n" for note in notes)]
    for light in lights:
        rows: dict[str, object] = {"layer": light.layer} if light.layer is not None else {}
        if isinstance(light, Spot):
            rows |= {"intensity": light.intensity, **_beam(light, folder)}
        else:
            rows |= {
                "position": light.position,
                "width": light.width,
                "radiance": light.radiance,
                "shape": light.shape,
            }
            rows |= {} if light.beam is None else _beam(light.beam, folder)
        head = "[[spot]]" if isinstance(light, Spot) else "[[panel]]"
        parts.append(head + "\n" + "".join(f"{key} = {_value(value)}\n" for key, value in rows.items()))
    return "\n".join(part for part in parts if part)


def _beam(light: Spot, folder: Path) -> dict[str, object]:
    rows: dict[str, object] = (
        {"direction": light.direction} if light.target is None else {"target": light.target}
    )
    rows |= {"roll_deg": light.roll_deg} if light.roll_deg else {}
    return rows | ({} if light.distribution is None else _shape(light.distribution, folder))


def _shape(shape: Distribution, folder: Path) -> dict[str, object]:
    match shape:
        case Power():
            return {"power": shape.power}
        case Polynomial():
            return {"polynomial": shape.coefficients}
        case Photometry() if shape.source:
            return {"ies": os.path.relpath(shape.source, folder)}
        case Gobo() if shape.source:
            return {"picture": os.path.relpath(shape.source, folder), "spread_deg": shape.spread_deg}
    raise InputError("distribution", f"{type(shape).__name__} without a file cannot be written in a rig")


def _value(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(part) for part in value) + "]"
    return repr(float(value))  # ty: ignore[invalid-argument-type]
