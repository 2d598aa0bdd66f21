"""Lights of another program as the text of a rig, cones of spots as photometric files beside it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field

import numpy as np

from .ies import LUMENS_PER_WATT
from .quantities import Triple

SUN_RADIUS_DEG = 0.27
_STEPS = 64  # of a cone's soft edge


@dataclass
class RigText:
    """A rig that grows light by light. ``files``: what it names, by their names beside it."""

    stem: str
    tables: list[str] = field(default_factory=list)
    files: dict[str, bytes] = field(default_factory=dict)

    def lamp(self, name: str, position: Triple, candela: Triple) -> None:
        """A point light; candela for red, green and blue."""
        self._table("lamp", name, position=position, radius=0.0, intensity=_watts(candela))

    def spot(
        self, name: str, position: Triple, direction: Triple, candela: Triple, cone: tuple[float, float]
    ) -> None:
        """A spot that is full within the first half angle, in degrees, and dark from the second on.

        Between them it falls as KHR_lights_punctual recommends: the square of a line in the cosine.
        """
        inner, outer = cone
        file = f"{self.stem}-{inner:.4g}-{outer:.4g}.ies"
        self.files[file] = cone_photometry(inner, outer)
        self._table(
            "spot", name, position=position, direction=direction, radius=0.0, ies=file, intensity=_watts(candela)
        )  # fmt: skip

    def sun(self, name: str, toward: Triple, lux: Triple) -> None:
        """Light from far away; lux on a surface that faces it. It becomes a disc as large as the sun."""
        solid_angle = math.pi * math.sin(math.radians(SUN_RADIUS_DEG)) ** 2  # times the cosine
        radiance = [value / solid_angle for value in _watts(lux)]
        x, y, z = toward
        self._table("disc", name, direction=(-x, -y, -z), radius_deg=SUN_RADIUS_DEG, radiance=radiance)

    @property
    def text(self) -> str:
        """The file, in UTF-8 text."""
        return "\n".join(self.tables)

    def _table(self, kind: str, name: str, **rows: object) -> None:
        text = f"[[{kind}]]\n" + (f"name = {_value(name)}\n" if name else "")
        self.tables.append(text + "".join(f"{key} = {_value(value)}\n" for key, value in rows.items()))


def cone_photometry(inner: float, outer: float) -> bytes:
    """A cone of light as a file of LM-63, 1 candela within ``inner`` degrees of the beam, none from ``outer`` on."""
    edge = inner + (outer - inner) * np.arange(_STEPS + 1) / _STEPS
    angles = np.unique(np.round(np.concatenate([[0.0, 90.0], edge]), 6))
    cosine, full, dark = (np.cos(np.radians(a)) for a in (angles, inner, outer))
    values = np.clip((cosine - dark) / max(full - dark, 1e-9), 0.0, 1.0) ** 2
    rows = [" ".join(f"{v:.6g}" for v in part) for part in (angles, [0.0], values)]
    head = [
        "IESNA:LM-63-2002",
        f"[LUMINAIRE] a cone of {2 * inner:.4g} to {2 * outer:.4g} degrees",
        "TILT=NONE",
    ]
    return "\n".join([*head, f"1 -1 1 {len(angles)} 1 1 2 0 0 0", "1 1 0", *rows, ""]).encode()


def _watts(photometric: Triple) -> list[float]:
    """Per steradian or square metre, of each colour."""
    return [value / LUMENS_PER_WATT for value in photometric]


def _value(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(part) for part in value) + "]"
    return f"{float(value):.9g}"  # ty: ignore[invalid-argument-type]
