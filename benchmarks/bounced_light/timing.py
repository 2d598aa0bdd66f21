"""What all bounces cost: 25 spherical harmonics in colour, in a room of 45,000 vertices; and 75 columns beside 3."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from prelight.bases import spherical_harmonics
from prelight.bases.cube_map import texel_directions
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.stock.room import room as stock_room
from prelight.transport.bounces import bounced
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.exact import integrate
from prelight.transport.gathering import Gathering
from prelight.transport.vantage import vantage_points

RESOLUTION = 32  # of the sky for direct light: 6,144 directions
ORDER = 4  # 25 functions


def sky_functions(order: int) -> np.ndarray:
    """(6, R, R, functions) the values of the harmonics."""
    d = texel_directions(np.arange(6 * RESOLUTION**2), RESOLUTION)
    values = spherical_harmonics.evaluate(order, d)
    return values.reshape(6, RESOLUTION, RESOLUTION, -1).astype(np.float32)


def bake(scene: Scene, functions: np.ndarray) -> dict[str, Any]:
    """All light of some functions of the sky in colour; seconds of each step."""
    times, before = {}, time.perf_counter()

    def done(step: str) -> None:
        nonlocal before
        times[step] = time.perf_counter() - before
        before = time.perf_counter()

    occluders = Occluders(scene.positions, scene.triangles)
    stand = vantage_points(scene, occluders)
    done("scene")
    gathering = Gathering.trace(scene, occluders, origins=stand, rays=1024)
    done("operator")
    D = integrate(DiffuseTransfer(occluders, stand, scene.normals), functions).astype(np.float32)
    done("direct")
    light = np.repeat(D[..., None], 3, axis=2)  # (V, K, 3): coloured by the first bounce
    found = bounced(gathering, light, tolerance=1e-3)
    done("bounces")
    return {
        "seconds": sum(times.values()), "steps": times, "columns": 3 * functions.shape[-1], "rays": gathering.rays,
        "entries": gathering.entries, "products": found.bounces, "remaining": found.remaining,
    }  # fmt: skip


def room(data: Path, work: Path) -> dict[str, Any]:
    """The stock room at 45,000 vertices: 75 columns converged to 1e-3 at 1,024 rays, beside 3 columns."""
    scene = stock_room(detail=1.23)
    many, one = sky_functions(ORDER), np.ones((6, RESOLUTION, RESOLUTION, 1), np.float32)
    bake(stock_room(detail=0.3), one)  # compiles
    runs = []
    for _ in range(3):  # in turn: other work on the machine hurts both
        wide, narrow = bake(scene, many), bake(scene, one)
        runs.append((wide, narrow))
    middle = sorted(runs, key=lambda pair: pair[0]["seconds"] / pair[1]["seconds"])[1]
    return {
        "vertices": len(scene.positions), "seventy_five": middle[0], "three": middle[1],
        "ratio": middle[0]["seconds"] / middle[1]["seconds"],
        "all_seconds": [[a["seconds"], b["seconds"]] for a, b in runs],
    }  # fmt: skip
