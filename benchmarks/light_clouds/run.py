"""A cloud of lights: the paper's table, lamps between the lights, growth; each part kept as soon as it is there."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import figures
import measuring
import numpy as np

from prelight.checking.kept_parts import measure_parts, parts_parser
from prelight.relighting.cloud import CloudRelighter
from scenes import SCENES, areas_of, baked, row_of, scene_of

COUNTS = (0, 2, 4, 8, 16, 32)
GROWTH = (64, 256, 1024, 4096)


def row(name: str, kind: str, data: Path, work: Path) -> dict[str, Any]:
    """A row of Table 1, baked: a scene in kind, by the paper's settings or ours."""
    scene = scene_of(name, data)
    bake, seconds = baked(name, scene, work, kind)
    return {"bake_seconds": seconds, **row_of(bake, scene)}


def lamps(name: str, data: Path, work: Path) -> dict[str, Any]:
    """Fifty lamps between the lights, both interpolations, against the same operator solved for each lamp."""
    scene = scene_of(name, data)
    ours, paper = (baked(name, scene, work, kind)[0] for kind in ("ours", "paper"))
    light = CloudRelighter(ours)
    truth = measuring.Truth.of(
        scene, light.layer, int(light.layer.parameters["gather_rays"]), areas_of(scene)
    )
    places = measuring.between(scene, light.layer)
    return {
        "ours": measuring.errors(light, truth, places),
        "kernel_on_ours": measuring.errors(CloudRelighter(ours, interpolation="kernel"), truth, places),
        "paper": measuring.errors(CloudRelighter(paper), truth, places),
    }


def paths(name: str, data: Path, work: Path) -> dict[str, Any]:
    """The whole light of fifty lamps beside Mitsuba's path tracer, and what its picture of one lamp takes."""
    scene = scene_of(name, data)
    light = CloudRelighter(baked(name, scene, work)[0])
    return measuring.against_paths(light, scene, measuring.between(scene, light.layer), areas_of(scene))


def moves(name: str, data: Path, work: Path) -> dict[str, Any]:
    """A move of ten lamps beside the path tracer at equal error, one right after the other."""
    scene = scene_of(name, data)
    light = CloudRelighter(baked(name, scene, work)[0])
    places = measuring.between(scene, light.layer, 10)
    return measuring.at_equal_error(light, scene, places, areas_of(scene))


def grid_columns(name: str, data: Path, work: Path) -> dict[str, Any]:
    """What components lose of the grid's own lights: indirect light against uncompressed, at 16 coefficients."""
    scene = scene_of(name, data)
    light = CloudRelighter(baked(name, scene, work)[0])
    truth = measuring.Truth.of(
        scene, light.layer, int(light.layer.parameters["gather_rays"]), areas_of(scene)
    )
    chosen = np.random.default_rng(3).permutation(len(light.layer.grid))[:64]
    return measuring.columns_lost(light, truth, np.sort(chosen))


def coefficients(data: Path, work: Path) -> dict[str, Any]:
    """Figure 8: indirect light against uncompressed, by coefficients a vertex; a curve and pictures."""
    scene, found = scene_of("cornell-small", data), {}
    for count in COUNTS:
        bake, _ = baked("cornell-small", scene, work, coefficients=count)
        found[count] = bake.layers["cloud"].statistics["components_error"]
    figures.of_coefficients(scene, work, COUNTS)
    return {"components_error": found}


def falloff(data: Path, work: Path) -> dict[str, Any]:
    """Figure 5: how much of direct and of indirect light each component of the back wall accounts for."""
    scene = scene_of("cornell-small", data)
    light = CloudRelighter(baked("cornell-small", scene, work)[0])
    truth = measuring.Truth.of(scene, light.layer, 1024, light.layer.areas)
    wall = np.flatnonzero((scene.normals[:, 2] > 0.99) & (scene.positions[:, 2] < -0.45))
    found = {}
    for part, values in zip(("direct", "indirect"), truth.light(light.layer.grid), strict=True):
        own = values[wall, :, 0]
        squares = np.linalg.svd(own - own.mean(axis=0), compute_uv=False) ** 2
        found[part] = (squares.cumsum() / squares.sum())[:32].tolist()
    figures.falloff(found)
    return found


def growth(count: int, data: Path, work: Path) -> dict[str, Any]:
    """Bytes, update and bake at one number of lights of the four that are drawn."""
    scene = scene_of("room-small", data)
    bake, seconds = baked("room-small", scene, work, lights=count)
    light, took = CloudRelighter(bake), []
    for at in measuring.between(scene, light.layer, 30):
        light.shine([measuring.point(at)])
        took.append(light.last.milliseconds)
    direct = []
    for at in measuring.between(scene, light.layer, 20, seed=9):
        began = time.perf_counter()
        light._placed.of(measuring.point(at))
        direct.append((time.perf_counter() - began) * 1e3)
    return {
        "bake_seconds": seconds, "milliseconds": float(np.median(took[5:])),
        "of_which_direct": float(np.median(direct[5:])), **row_of(bake, scene),
    }  # fmt: skip


def growth_updates(data: Path, work: Path) -> dict[str, Any]:
    """Milliseconds of an update at each number of lights, taken in turns so that what else runs weighs on all alike."""
    scene = scene_of("room-small", data)
    lights = {n: CloudRelighter(baked("room-small", scene, work, lights=n)[0]) for n in GROWTH}
    took: dict[int, list[float]] = {n: [] for n in GROWTH}
    for at in measuring.between(scene, lights[GROWTH[0]].layer, 105):
        for n, light in lights.items():
            light.shine([measuring.point(at)])
            took[n].append(light.last.milliseconds)
    return {"milliseconds": {n: float(np.median(values[5:])) for n, values in took.items()}}


def growth_plot(results: Path, data: Path, work: Path) -> dict[str, Any]:
    """What growth has been found so far, drawn as times what the fewest lights cost."""
    kept = {n: results / f"growth-{n}.json" for n in GROWTH}
    found = {n: json.loads(path.read_text())["figures"] for n, path in kept.items() if path.exists()}
    updates = results / "growth-updates.json"
    if len(found) < 2 or not updates.exists():
        return {"skipped": "growth of two numbers of lights and growth-updates are wanted first"}
    for n, milliseconds in json.loads(updates.read_text())["figures"]["milliseconds"].items():
        if int(n) in found:
            found[int(n)]["milliseconds"] = milliseconds
    figures.growth(found)
    return {"lights": sorted(found), "files": ["growth.png"]}


def hole(data: Path, work: Path) -> dict[str, Any]:
    """A lamp through the hole of the box, centimetre by centimetre: its steps beside the reference's."""
    scene = scene_of("window-small", data)
    light = CloudRelighter(baked("window-small", scene, work)[0])
    truth = measuring.Truth.of(scene, light.layer, 1024, light.layer.areas)
    places = np.array([(x, 0.61, -0.04) for x in np.arange(-0.8, -0.2, 0.01)])
    return measuring.steps(light, truth, places)


def leak(data: Path, work: Path) -> dict[str, Any]:
    """Lamps beside a wall of the maze: what lights its other side, beside the reference."""
    scene = scene_of("maze-small", data)
    light = CloudRelighter(baked("maze-small", scene, work)[0])
    truth = measuring.Truth.of(scene, light.layer, 1024, light.layer.areas)
    return measuring.leaks(light, truth, measuring.between(scene, light.layer))


def transfer(name: str, data: Path, work: Path) -> dict[str, Any]:
    """Beside a transfer layer of the same scene: error, bytes, bake and update."""
    from prelight.baking.transfer import bake_transfer
    from prelight.relighting.transfer import TransferRelighter

    scene = scene_of(name, data)
    bake, seconds = baked(name, scene, work)
    cloud = CloudRelighter(bake)
    truth = measuring.Truth.of(scene, cloud.layer, 1024, cloud.layer.areas)
    places = measuring.between(scene, cloud.layer)
    found: dict[str, Any] = {"cloud": {"bake_seconds": seconds, "bytes": bake.manifest.bytes_of("layers/cloud/"),
                                       **measuring.errors(cloud, truth, places)}}  # fmt: skip
    began = time.perf_counter()
    other = bake_transfer(scene, work / f"{name}-transfer.prelight", force=True)
    seconds = time.perf_counter() - began
    found["transfer"] = {
        "bake_seconds": seconds, "bytes": other.manifest.bytes_of("layers/transfer/"),
        **measuring.errors(TransferRelighter(other), truth, places),  # ty: ignore[invalid-argument-type]
    }  # fmt: skip
    return found


def pictures(name: str, data: Path, work: Path) -> dict[str, Any]:
    """Figures 4, 7, 10 and 11 in kind: direct, indirect and all light, and the lights before and after clustering."""
    scene = scene_of(name, data)
    bake, _ = baked(name, scene, work)
    return {"files": figures.of_scene(name, bake)}


BOXES = ("cornell-small", "window-small", "maze-small", "room-small")
LARGE = ("cornell", "window", "maze", "sponza")
PARTS: dict[str, Callable[[Path, Path], dict[str, Any]]] = {}
for _name in (*BOXES, *LARGE):
    PARTS |= {f"{_name}-{kind}": partial(row, _name, kind) for kind in ("ours", "paper")}
    PARTS |= {
        f"{_name}-{part.__name__}": partial(part, _name) for part in (lamps, grid_columns, paths, moves)
    }
PARTS |= {"coefficients": coefficients, "falloff": falloff, "hole": hole, "leak": leak}
PARTS |= {f"growth-{count}": partial(growth, count) for count in GROWTH}
PARTS |= {"growth-updates": growth_updates}
PARTS |= {"growth": partial(growth_plot, Path())}  # where its results are, `main` knows
PARTS |= {f"transfer-{name}": partial(transfer, name) for name in ("room-small", "maze-small")}
PARTS |= {f"pictures-{name}": partial(pictures, name) for name in SCENES if name != "room-small"}


def main() -> None:
    parser = parts_parser(
        __doc__, PARTS, work="where bakes are kept: some gigabytes", data="folder with sponza/"
    )
    options = parser.parse_intermixed_args()
    results = Path(__file__).parent / "results" / options.name
    options.work.mkdir(parents=True, exist_ok=True)
    parts = PARTS | {"growth": partial(growth_plot, results)}
    measure_parts(parts, options.parts, results, call=lambda part: part(options.data, options.work))


if __name__ == "__main__":
    main()
