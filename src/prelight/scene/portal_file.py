"""A small TOML file that says where portals are: materials of the scene by name, or polygons.

[[portal]]
name = "east window"
polygon = [[2.1, 0.8, -1.2], [2.1, 0.8, 0.6], [2.1, 2.2, 0.6], [2.1, 2.2, -1.2]]
tint = [1.0, 0.9, 0.6]

[[portal]]
material = "red glass"
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from ..files import read_regular
from .obj.polygons import triangles_of

_LARGEST_FILE = 4_000_000
_MOST, _MOST_CORNERS = 4096, 1024
_KEYS = ("name", "polygon", "material", "tint")
_FLAT = 0.01  # of a polygon's extent, that its corners may stand off its plane
_LARGEST = 1e6  # metres


@dataclass(frozen=True)
class GivenPortal:
    """A portal as the file has it: a material's triangles, or triangles of its own."""

    name: str
    material: str | None
    triangles: Float64[np.ndarray, "triangles 3 3"]
    tint: tuple[float, float, float] | None


def read_portal_file(path: str) -> list[GivenPortal]:
    """What is in the file; raises InputError with a JSON pointer to what is wrong."""
    try:
        document = tomllib.loads(read_regular(path, limit=_LARGEST_FILE).decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(path, f"not a TOML file of portals: {error}") from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(path, "not a TOML file of portals: a number in it has thousands of digits") from None
    rows = document.get("portal")
    if set(document) != {"portal"} or not isinstance(rows, list) or not 1 <= len(rows) <= _MOST:
        raise InputError(path, f"expected tables [[portal]], 1 to {_MOST:,}, and nothing else")
    return [_portal(path, k, row) for k, row in enumerate(rows)]


def _portal(path: str, k: int, row: Any) -> GivenPortal:
    def wrong(reason: str, key: str = "") -> InputError:
        return InputError(path, reason, f"/portal/{k}" + (f"/{key}" if key else ""))

    if not isinstance(row, dict):
        raise wrong("expected a table [[portal]]")
    for key in row:
        if key not in _KEYS:
            raise wrong(f"{key[:60]!r} is not known here; known are {', '.join(_KEYS)}", key[:60])
    for key in ("name", "material"):
        if key in row and not (isinstance(row[key], str) and row[key].strip() and len(row[key]) <= 200):
            raise wrong("expected a text in quotes", key)
    if ("polygon" in row) == ("material" in row):
        raise wrong("expected either polygon, at least three corners [x, y, z], or material, a name")
    tint = None
    if "tint" in row:
        tint = _numbers(row["tint"], 3, 0.0, 1.0)
        if tint is None:
            raise wrong("expected three numbers of 0 to 1, such as [1.0, 0.9, 0.8]", "tint")
    if "material" in row:
        return GivenPortal(row.get("name", ""), row["material"], np.zeros((0, 3, 3)), tint)
    given = row["polygon"]
    if not isinstance(given, list) or not 3 <= len(given) <= _MOST_CORNERS:
        raise wrong(f"expected 3 to {_MOST_CORNERS:,} corners [x, y, z], metres", "polygon")
    corners = [_numbers(corner, 3, -_LARGEST, _LARGEST) for corner in given]
    if None in corners:
        raise wrong("expected [x, y, z], metres", f"polygon/{corners.index(None)}")
    points = np.array(corners, np.float64)
    if problem := _shape_problem(points):
        raise wrong(problem, "polygon")
    triangles, _ = triangles_of(points, np.array([len(points)]), [])
    return GivenPortal(row.get("name", f"portal {k + 1}"), None, points[triangles], tint)


def _numbers(value: object, count: int, least: float, most: float) -> tuple[float, float, float] | None:
    if not isinstance(value, list) or len(value) != count:
        return None
    for x in value:
        if (
            isinstance(x, bool)
            or not isinstance(x, int | float)
            or not math.isfinite(x)
            or not least <= x <= most
        ):
            return None
    return float(value[0]), float(value[1]), float(value[2])


def _shape_problem(points: Float64[np.ndarray, "corners 3"]) -> str | None:
    centred = points - points.mean(axis=0)
    extent = float(np.linalg.norm(centred, axis=1).max())
    across = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)  # after Newell, twice the area long
    area = float(np.linalg.norm(across)) / 2
    if extent < 1e-4 or area < 1e-6 * extent * extent:
        return "has no area, so it faces nowhere; its corners are to be in order around it"
    off = float(np.abs(centred @ across).max()) / (2 * area)
    if off > _FLAT * extent:
        return f"is not flat (a corner stands {off:.3g} m off its plane); cut it into flat polygons"
    return None
