"""Error of direct light against the number of triangles: receivers refined where light breaks, beside even meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from boxes import BEFORE, BEHIND, OUTWARD, sky
from points import Points, figures_of, found_on, spread, truth_at
from window_emitter import lit_sides, through_window

import rooms
from prelight.baking.portals_refining import refined
from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.scene.geometry import Scene
from prelight.scene.variant import mitsuba

POINTS, SAMPLES = 2000, 2048
RAYS = {"sky": 1024, "sun": 8192}  # from a vertex: a sun in one cell is met by few
EVEN = (12, 18, 26, 38, 56)  # cells along a wall
REFINED = ((12, (1.7, 3.0, 6.0)), (26, (1.7, 3.0)))  # beginning with so many cells; factors
SKIES = {"sky": BEHIND, "sun": BEFORE}
_BUNNY = "bun_zipper_res3.ply"


def error_against_triangles(data: Path, _work: Path) -> dict[str, Any]:
    """Mean |difference| of direct light at 2,000 points of surfaces, with the sun behind the box, and shining in."""
    out: dict[str, Any] = {"points": POINTS, "samples": SAMPLES, "rays": RAYS}
    whole = rooms.box(data, cells=12, bunny=_BUNNY)
    settings = PortalsSettings()
    bare = PortalsRoom(whole, settings).open
    at = spread(bare, POINTS)
    places, normals = at.of(bare, bare.positions.astype(np.float64)), at.normals(bare)
    for name, turn in SKIES.items():
        cube = lit_sides(sky(data, turn).cube(32), OUTWARD)
        low, high = (rooms.SIDE - rooms.LARGE) / 2, (rooms.SIDE + rooms.LARGE) / 2
        emitter = through_window(mitsuba(), cube, low=low, high=high)
        true = truth_at(bare, at, emitter, samples=SAMPLES, bounces=0)
        rows = []
        for cells in EVEN:
            scene = rooms.box(data, cells=cells, bunny=_BUNNY)
            found = _row(scene, RAYS[name], cube, (places, normals), true)
            rows.append({"mesh": "even", "cells": cells} | found)
        for cells, factors in REFINED:
            for factor in factors:
                scene = rooms.box(data, cells=cells, bunny=_BUNNY)
                skies = [cube] if name == "sun" else []
                fine = refined(scene, settings, factor=factor, skies=skies)
                rows.append(
                    {"mesh": "refined", "cells": cells, "factor": factor}
                    | _row(fine, RAYS[name], cube, (places, normals), true)
                )
        out[name] = rows
    if len(SKIES) == 2:
        _plot(out)
    return out


def light_at_vertices(
    scene: Scene, cube: np.ndarray, rays_each: int = 1024
) -> tuple[PortalsRoom, np.ndarray]:
    """Direct irradiance / π (V, 3) under a sky, as bakes find it but for their bytes."""
    room = PortalsRoom(scene, PortalsSettings(rays=rays_each))
    light = np.zeros((len(scene.positions), 3))
    rays, colours = room.rays, cube.reshape(-1, 3).astype(np.float64)
    for first in range(0, len(light), 1024):
        many = min(1024, len(light) - first)
        found = rays.trace(first, many)
        row = np.repeat(np.arange(many * rays.panes) // rays.panes, np.diff(found.starts))
        for c in range(3):
            sums = np.bincount(row, found.weight * colours[found.cell, c], minlength=many)
            light[room.order[first : first + many], c] = sums
    return room, light


def _row(scene: Scene, rays: int, cube: np.ndarray, at_points: tuple, true) -> dict[str, Any]:
    room, light = light_at_vertices(scene, cube, rays)
    places, normals = at_points
    at: Points = found_on(room.open, places, normals)
    figures = figures_of(at.of(room.open, light), true.direct, true.direct_variance)
    return {"triangles": len(scene.triangles), "vertices": len(scene.positions)} | figures


def _plot(out: dict[str, Any]) -> None:
    from prelight.drawing.figures import save_figure
    from prelight.drawing.plots import Axis, line_plot

    pictures = Path(__file__).parent / "results" / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    lines = {}
    for name, words in (("sky", "sky"), ("sun", "sun")):
        for mesh in ("even", "refined"):
            found = sorted(
                (row["triangles"], 100 * row["difference"]) for row in out[name] if row["mesh"] == mesh
            )
            x, y = np.array(found, np.float64).T
            lines[f"{words}, {mesh}"] = (x, y)
    image = line_plot(lines, x=Axis("triangles"), y=Axis("mean |difference| of direct light, %"))
    save_figure(image, pictures / "refining.png", force=True)
