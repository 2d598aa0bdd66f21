"""A cloud of lights: the paper's table, lamps between the lights, growth; each part kept as soon as it is there."""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import measuring
import numpy as np

from prelight.baking.cloud import bake_cloud
from prelight.baking.cloud_plan import CloudGround
from prelight.baking.cloud_settings import CloudSettings
from prelight.cli.doctor import _llvm, _machine
from prelight.encoding.clustered_pca import clustered_components
from prelight.relighting.cloud import CloudRelighter
from prelight.relighting.cloud_figure import cloud_figure
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

RAYS = 1024
MAZE_BOX = ((0.0, 0.0, 0.0), (4.3, 0.9, 4.3))


def _sponza(data: Path) -> Scene:
    return load_scene(str(next((data / "sponza").glob("sponza*.obj"))), subdivide=0.55)


# The scene, and what of the settings is its own: lights as many as in the paper's Table 1.
SCENES: dict[str, tuple[Callable[[Path], Scene], dict[str, Any]]] = {
    "cornell": (lambda _: load_scene("stock:cornell"), {"lights": 216, "box": ((-0.5, 0.03, -0.5), (0.5, 1.03, 0.6))}),
    "window": (
        lambda _: load_scene("stock:pierced-box"), {"lights": 250, "box": ((-1.0, 0.05, -0.6), (0.55, 1.1, 0.6))}
    ),
    "maze": (lambda _: load_scene("stock:maze"), {"lights": 1024, "box": MAZE_BOX}),
    "sponza": (_sponza, {"lights": 384}),
}  # fmt: skip


def of_scene(name: str, data: Path, work: Path) -> dict[str, Any]:
    """A scene of the paper in kind: its row of Table 1, errors of fifty lamps with both interpolations."""
    load, own = SCENES[name]
    scene = load(data)
    figures: dict[str, Any] = {"vertices": len(scene.positions), "triangles": len(scene.triangles)}
    areas = CloudGround(scene).areas
    truth = None
    for kind, more in (("paper", {"patches": 0, "interpolation": "kernel"}), ("ours", {})):
        path = work / f"{name}-{kind}.prelight"
        began = time.perf_counter()
        bake = bake_cloud(scene, path, settings=CloudSettings(gather_rays=RAYS, **own, **more), force=True)
        seconds = time.perf_counter() - began
        light = CloudRelighter(bake)
        if truth is None:
            truth = measuring.Truth.of(scene, light.layer, RAYS, areas)
        places = measuring.between(scene, light.layer)
        layer = bake.layers["cloud"]
        figures[kind] = {
            "bake_seconds": seconds, "bytes": measuring.bytes_of(path), "lights": layer.basis_lights,
            "parameters": layer.parameters, "statistics": layer.statistics,
            **measuring.errors(light, truth, places),
        }  # fmt: skip
        if kind == "ours":
            figures["against_paths"] = measuring.against_paths(light, scene, places, areas)
            middle = len(light.layer.zone_rows) // 2
            cloud_figure(path, work / f"{name}-lights.png", zone=middle, force=True)
    return figures


def coefficients(data: Path, work: Path) -> dict[str, Any]:
    """Figure 8: indirect light against uncompressed, by coefficients a vertex."""
    del data
    scene, found = load_scene("stock:cornell-small"), {}
    for count in (0, 2, 4, 8, 16, 32):
        settings = CloudSettings(gather_rays=RAYS, coefficients=count, **SCENES["cornell"][1])
        bake = bake_cloud(scene, work / f"cornell-{count}.prelight", settings=settings, force=True)
        found[count] = bake.layers["cloud"].statistics["components_error"]
    return {"components_error": found}


def falloff(data: Path, work: Path) -> dict[str, Any]:
    """Figure 5: how much of direct and of indirect light each component of the back wall accounts for."""
    del data, work
    scene = load_scene("stock:cornell-small")
    ground = CloudGround(scene)
    from prelight.baking.cloud_grid import light_grid
    from prelight.transport.gathering import Gathering

    grid = light_grid(scene, ground.segments, lights=216, box=SCENES["cornell"][1]["box"])
    gathering = Gathering.trace(scene, ground.occluders, origins=ground.origins, rays=RAYS)
    truth = measuring.Truth(scene, gathering, ground.occluders, ground.origins, ground.areas)
    wall = np.flatnonzero((scene.normals[:, 2] > 0.99) & (scene.positions[:, 2] < -0.45))
    found = {}
    for part, light in zip(("direct", "indirect"), truth.light(grid.positions), strict=True):
        values = np.linalg.svd(light[wall, :, 0] - light[wall, :, 0].mean(axis=0), compute_uv=False) ** 2
        found[part] = (values.cumsum() / values.sum())[:32].tolist()
        X = np.ascontiguousarray(light[wall].transpose(2, 0, 1))
        kept = clustered_components(X, clusters=4, mean_components=16)
        lost = sum(float(np.square(c.approximation(k) - X[k][c.rows]).sum()) for c in kept for k in range(3))
        found[f"{part}_left_over_at_16"] = float(np.sqrt(lost / np.square(X).sum()))
    return found


def growth(data: Path, work: Path) -> dict[str, Any]:
    """Bytes, update and bake from 64 to 4,096 lights."""
    del data
    scene, rows = load_scene("stock:room-small"), []
    for count in (64, 256, 1024, 4096):
        settings = CloudSettings(lights=count, gather_rays=RAYS, box=((-2.1, 0, -2.4), (2.1, 2.7, 2.4)))
        began = time.perf_counter()
        path = work / "growth.prelight"
        bake = bake_cloud(scene, path, settings=settings, force=True)
        seconds = time.perf_counter() - began
        light, took = CloudRelighter(bake), []
        for at in measuring.between(scene, light.layer, 30):
            light.shine([measuring.point(at)])
            took.append(light.last.milliseconds)
        told = bake.layers["cloud"].statistics
        rows.append(
            {"lights": count, "groups": told["groups"], "bytes": measuring.bytes_of(path), "bake_seconds": seconds,
             "milliseconds": float(np.median(took[5:])), "error": told["error"]}
        )  # fmt: skip
    return {"rows": rows}


def hole(data: Path, work: Path) -> dict[str, Any]:
    """A lamp through the hole of the box, centimetre by centimetre: its steps beside the reference's."""
    del data
    scene = load_scene("stock:pierced-box-small")
    settings = CloudSettings(gather_rays=RAYS, **SCENES["window"][1])
    light = CloudRelighter(bake_cloud(scene, work / "hole.prelight", settings=settings, force=True))
    truth = measuring.Truth.of(scene, light.layer, RAYS, light.layer.areas)
    places = np.array([(x, 0.61, -0.04) for x in np.arange(-0.8, -0.2, 0.01)])
    direct, indirect = truth.light(places)
    ours = []
    for at in places:
        light.shine([measuring.point(at)])
        ours.append(light.irradiance.mean(axis=1))
    real = (direct + indirect).mean(axis=2).T
    a = truth.areas / truth.areas.sum()
    steps, true = (np.abs(np.diff(x, axis=0)) @ a for x in (np.array(ours), real))
    allowed = 2 * true + 0.01 * float(real.mean(axis=0) @ a)
    return {"worst_share_of_what_is_allowed": float((steps / allowed).max()), "steps": len(steps)}


def transfer(data: Path, work: Path) -> dict[str, Any]:
    """Beside a transfer layer of the same scene: error, bytes, bake and update."""
    del data
    from prelight.baking.transfer import bake_transfer
    from prelight.relighting.transfer import TransferRelighter

    found: dict[str, Any] = {}
    for name in ("stock:room-small", "stock:maze-small"):
        scene = load_scene(name)
        box = MAZE_BOX if "maze" in name else ((-2.1, 0, -2.4), (2.1, 2.7, 2.4))
        began = time.perf_counter()
        bake = bake_cloud(
            scene, work / "beside.prelight", settings=CloudSettings(lights=1000, gather_rays=RAYS, box=box), force=True
        )  # fmt: skip
        seconds = time.perf_counter() - began
        cloud = CloudRelighter(bake)
        truth = measuring.Truth.of(scene, cloud.layer, RAYS, cloud.layer.areas)
        places = measuring.between(scene, cloud.layer)
        rows = {"cloud": {"bake_seconds": seconds, "bytes": measuring.bytes_of(work / "beside.prelight"),
                          **measuring.errors(cloud, truth, places)}}  # fmt: skip
        began = time.perf_counter()
        other = bake_transfer(scene, work / "transfer.prelight", force=True)
        seconds = time.perf_counter() - began
        rows["transfer"] = {
            "bake_seconds": seconds, "bytes": other.manifest.bytes_of("layers/transfer/"),
            **measuring.errors(TransferRelighter(other), truth, places),  # ty: ignore[invalid-argument-type]
        }  # fmt: skip
        found[name] = rows
    return found


PARTS: dict[str, Callable[[Path, Path], dict[str, Any]]] = {
    **{name: partial(of_scene, name) for name in SCENES},
    "coefficients": coefficients, "falloff": falloff, "growth": growth, "hole": hole, "transfer": transfer,
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with sponza/")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all that have no result yet, if none")
    parser.add_argument(
        "--work", type=Path, required=True, help="where bakes are kept: some hundred megabytes"
    )
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    results = Path(__file__).parent / "results" / options.name
    results.mkdir(parents=True, exist_ok=True)
    for name in options.parts or PARTS:
        path = results / f"{name}.json"
        if path.exists() and not options.parts:
            continue
        part = PARTS[name]
        what = (getattr(part, "func", part).__doc__ or "").splitlines()[0]
        print(f"== {name}: {what}", flush=True)
        started = time.perf_counter()
        figures = part(options.data, options.work)
        report = {
            "what": what,
            "machine": _machine() | {"python": platform.python_version()} | {"llvm": _llvm()},
            "seconds_in_all": round(time.perf_counter() - started, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        print(text, flush=True)
        path.write_text(text + "\n")


if __name__ == "__main__":
    main()
