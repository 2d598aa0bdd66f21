"""The paper's scenes in kind, and bakes of them that are made once."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from prelight.baking.cloud import bake_cloud
from prelight.baking.cloud_plan import CloudGround
from prelight.baking.cloud_settings import CloudSettings
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene
from prelight.scene.stock.maze import maze
from prelight.storage.bake import Bake

RAYS = 1024
MAZE_BOX = ((0.0, 0.0, 0.0), (4.3, 0.9, 4.3))
CORNELL_BOX = ((-0.5, 0.03, -0.5), (0.5, 1.03, 0.6))
WINDOW_BOX = ((-1.0, 0.05, -0.6), (0.55, 1.1, 0.6))
ROOM_BOX = ((-2.1, 0.0, -2.4), (2.1, 2.7, 2.4))
PAPER: dict[str, Any] = {"modes": 0, "interpolation": "kernel"}
KINDS: dict[str, dict[str, Any]] = {"ours": {}, "paper": PAPER}


def _stock(name: str, _: Path) -> Scene:
    return load_scene(f"stock:{name}")


def _sponza(data: Path) -> Scene:
    return load_scene(str(next((data / "sponza").glob("sponza*.obj"))), subdivide=1.3)


# The scene, and what of the settings is its own: at least as many lights as in the paper's Table 1 once those inside
# solids are left out (the small scenes: with them).
SCENES: dict[str, tuple[Callable[[Path], Scene], dict[str, Any]]] = {
    "cornell": (partial(_stock, "cornell"), {"lights": 252, "box": CORNELL_BOX}),
    "window": (partial(_stock, "pierced-box"), {"lights": 300, "box": WINDOW_BOX}),
    "maze": (lambda _: maze(detail=1.08), {"lights": 1200, "modes": 1024, "box": MAZE_BOX}),
    "sponza": (_sponza, {"lights": 450, "gather_rays": 256, "modes": 384, "memory": 6_000_000_000}),
    "cornell-small": (partial(_stock, "cornell-small"), {"lights": 216, "box": CORNELL_BOX}),
    "window-small": (partial(_stock, "pierced-box-small"), {"lights": 250, "box": WINDOW_BOX}),
    "maze-small": (partial(_stock, "maze-small"), {"lights": 1024, "modes": 1024, "box": MAZE_BOX}),
    "room-small": (partial(_stock, "room-small"), {"lights": 384, "box": ROOM_BOX}),
}


def scene_of(name: str, data: Path) -> Scene:
    return SCENES[name][0](data)


def settings_of(name: str, **more: Any) -> CloudSettings:
    return CloudSettings(**{"gather_rays": RAYS, **SCENES[name][1], **more})


def baked(name: str, scene: Scene, work: Path, kind: str = "ours", **more: Any) -> tuple[Bake, float | None]:
    """The bake, and the seconds it took; None where an earlier part made it."""
    told = "".join(f"-{key}{value}" for key, value in more.items())
    path = work / f"{name}-{kind}{told}.prelight"
    if path.exists():
        return Bake.open(path), None
    began = time.perf_counter()
    bake = bake_cloud(scene, path, settings=settings_of(name, **KINDS[kind], **more), resume=True)
    return bake, time.perf_counter() - began


def areas_of(scene: Scene) -> Any:
    return CloudGround(scene).areas


def row_of(bake: Bake, scene: Scene) -> dict[str, Any]:
    """A row of the paper's Table 1."""
    layer = bake.layers["cloud"]
    told = {**layer.parameters, **layer.statistics}
    return {
        "triangles": len(scene.triangles), "vertices": len(scene.positions), "zones": told["zones"], "n_b": 1,
        "w1": told["w1"], "w2": told["w2"], "lights": layer.basis_lights, "in_solids": told["in_solids"],
        "groups": told["groups"], "kept_lights": told["kept_lights"], "clusters": told["clusters"],
        "coefficients": told["coefficients_a_vertex"], "modes": told["modes"],
        "bytes": bake.manifest.bytes_of("layers/cloud/"),
        "errors": {key: value for key, value in told.items() if key.endswith("error")},
    }  # fmt: skip
