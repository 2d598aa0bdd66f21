"""Worlds of several sizes, and the hour they are lit at."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from prelight.lighting.daylight import Daylight
from prelight.lighting.moment import Site
from prelight.lighting.outside import Outside, OutsideObject
from prelight.lighting.outside import Path as Way
from prelight.lighting.rig import Rig
from prelight.scene.geometry import Scene
from prelight.scene.stock.town import town

AFTERNOON = Daylight(Site(43.7, 15.9), datetime(2026, 6, 21, 14, 30, tzinfo=UTC))


def large_town(folder: Path) -> str:
    """The stock town with leafier trees, about 680,000 triangles, as a PLY file."""
    path = folder / "town-large.ply"
    if not path.exists():
        write_ply(path, town(trees=576, detail=2.85))
    return str(path)


def write_ply(path: Path, scene: Scene) -> None:
    """Binary, with normals and colours (sRGB bytes)."""
    encoded = np.where(
        scene.albedo <= 0.0031308, 12.92 * scene.albedo, 1.055 * scene.albedo ** (1 / 2.4) - 0.055
    )
    names = [(n, "<f4") for n in ("x", "y", "z", "nx", "ny", "nz")] + [
        (n, "u1") for n in ("red", "green", "blue")
    ]
    rows = np.empty(len(scene.positions), names)
    for k, axis in enumerate("xyz"):
        rows[axis], rows["n" + axis] = scene.positions[:, k], scene.normals[:, k]
    for k, channel in enumerate(("red", "green", "blue")):
        rows[channel] = np.rint(255 * encoded[:, k]).astype(np.uint8)
    faces = np.empty(len(scene.triangles), [("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, scene.triangles
    words = {"<f4": "float", "u1": "uchar"}
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property {words[kind]} {name}" for name, kind in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    path.write_bytes("\n".join(header).encode() + rows.tobytes() + faces.tobytes())


def rig_of(scene: str, *, room: Way, objects: tuple[OutsideObject, ...] = (), scale: float = 1.0) -> Rig:
    """A world with a scene that stands still, under the afternoon's sun."""
    still = OutsideObject(scene, Way.resting(), scale, name="scene")
    outside = Outside((still, *objects), room)
    return Rig(AFTERNOON.environment(), daylight=AFTERNOON, outside=outside)
