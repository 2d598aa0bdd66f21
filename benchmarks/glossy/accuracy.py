"""Five eyes around a glossy object: our picture beside the path tracer's, pixel by pixel of the object."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Any

import glossy_scenes
import numpy as np

import prelight as pl
from prelight.drawing.figures import enlarged, panels, save_figure
from prelight.drawing.picture import Picture
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.transport.eye import SeenPoints, seen_points
from prelight.transport.path_tracing import path_traced_view

POINTS = 9  # of a pixel, as pictures of meshes have
PIECE = 18432  # samples of a pixel that are found together
SKIES = {"sky": "stock:sunset", "studio": "stock:studio", "overcast": "stock:overcast"}


class Settings:
    """Of all parts; small unless the command line says otherwise."""

    detail, side, samples, shown_samples, order = 0.5, 72, 18432, 72, 8
    resolution, tolerance, gather_rays, pixels, foot = 64, 0.005, 1024, 160, 0.0


def looked_at(make, kind: str, sky: str, data: Path, work: Path) -> dict[str, Any]:
    """Bake, look from five eyes, compare."""
    s = Settings
    in_room = {"foot": s.foot} if make is glossy_scenes.in_a_room else {}
    looked = make(data, kind, detail=s.detail, **in_room)
    named = f"{looked.scene.name}-{s.detail:g}-{kind}-{s.order}-{s.resolution}"
    named += f"-{s.foot:g}" * bool(s.foot and in_room)
    bake, seconds = _baked(looked, work / f"{named}.prelight")
    light = pl.Relighter(bake)
    light.environment = pl.Rig.open(sky).environment
    light.glossy(looked.eyes[0].eye)
    change = light.glossy_milliseconds
    began = time.perf_counter()
    for eye in looked.eyes:
        light.glossy(eye.eye)
    look = (time.perf_counter() - began) * 1e3 / len(looked.eyes)
    cube = light.environment.cube(light.resolution)
    found = [_eye(light, looked, k, cube, work, sky=sky) for k in range(len(looked.eyes))]
    summary = bake.summary()["layers"][0]
    return {
        "vertices": len(looked.scene.positions),
        "glossy_vertices": summary["statistics"]["glossy_rows"],
        "order": s.order,
        "bake_seconds": seconds,
        "bytes": summary["bytes"],
        "glossy_bytes": summary["glossy_bytes"],
        "change_milliseconds": round(change, 1),
        "look_milliseconds": round(look, 2),
        "fit_error": summary["statistics"]["glossy_fit_error"],
        "eyes": found,
        "mean_of_eyes": float(np.mean([f["mean_difference"] for f in found])),
        "worst_eye": max(f["mean_difference"] for f in found),
        "worst_eye_without_noise": max(f["without_noise"] for f in found),
    }


def _baked(looked, path: Path) -> tuple[pl.Bake, float]:
    """A bake, from the part before if it is of the same scene, and how long it took."""
    s, told = Settings, path.with_suffix(".seconds")
    if told.is_file() and path.is_dir():
        return pl.Bake.open(path), float(told.read_text())
    began = time.perf_counter()
    bake = pl.bake_environment(
        looked.scene, path, resolution=s.resolution, tolerance=s.tolerance, gather_rays=s.gather_rays,
        glossy_order=s.order, force=True,
    )  # fmt: skip
    seconds = round(time.perf_counter() - began, 1)
    told.write_text(str(seconds))
    return bake, seconds


def _eye(light: pl.Relighter, looked, k: int, cube: np.ndarray, work: Path, *, sky: str) -> dict[str, Any]:
    s, eye, scene = Settings, looked.eyes[k], looked.scene
    began = time.perf_counter()
    ours = light.picture(eye, width=s.side, height=s.side, background=None, fine=True)
    drawn = (time.perf_counter() - began) * 1e3
    occluders, surfaces = Occluders(scene.positions, scene.triangles), SurfaceScene(scene)
    points = seen_points(occluders, eye, width=s.side, height=s.side, samples=POINTS)
    there = points.triangle >= 0
    on = (there & (scene.material_of[points.triangle] == looked.glossy)).all(axis=1)
    began = time.perf_counter()
    every = np.flatnonzero(on).astype(np.int32)
    pixels = np.sort(np.random.default_rng(k).permutation(every)[: s.pixels])
    kept = (
        work
        / f"{scene.name}-{s.detail:g}-{scene.materials[looked.glossy].name}-{sky}-{s.resolution}-{s.side}"
    )
    mean, variance = _reference(
        surfaces,
        points,
        looked,
        pixels,
        eye=k,
        cube=cube,
        kept=Path(str(kept).replace(":", "-").replace(" ", "-")),
    )
    took = time.perf_counter() - began
    a = ours.linear.reshape(-1, 3).astype(np.float64)
    if k == 0:
        name = f"{scene.name}-{scene.materials[looked.glossy].name}-{sky}.png".replace(" ", "-").replace(
            ":", "-"
        )
        shown = s.shown_samples
        whole, _ = path_traced_view(
            surfaces, points, cube=cube, bounces=None, samples=shown, seed=k, openings=looked.openings
        )
        whole[pixels] = mean
        _panel(a, whole, ours, work / name)
    return _figures(a[pixels], mean, np.sqrt(variance)) | {
        "picture_milliseconds": round(drawn, 1),
        "reference_seconds": round(took, 1),
    }


def _reference(
    surfaces: SurfaceScene,
    points: SeenPoints,
    looked,
    pixels: np.ndarray,
    *,
    eye: int,
    cube: np.ndarray,
    kept: Path,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and its variance, from pieces of PIECE samples, each kept: a finer one goes on from there."""
    found = []
    for piece in range(max(1, Settings.samples // PIECE)):
        samples = min(Settings.samples, PIECE)
        path = kept.with_name(f"{kept.name}-{eye}-{len(pixels)}-{samples}-{piece}.npz")
        if not path.is_file():
            mean, variance = path_traced_view(
                surfaces, points, cube=cube, receivers=pixels, bounces=None, samples=samples, seed=eye + 100 * piece,
                openings=looked.openings,
            )  # fmt: skip
            np.savez(path, mean=mean, variance=variance)
        with np.load(path) as part:
            found.append((part["mean"], part["variance"]))
    means, variances = (np.array(each) for each in zip(*found, strict=True))
    return means.mean(axis=0), variances.sum(axis=0) / len(found) ** 2


def _panel(a: np.ndarray, b: np.ndarray, ours: Picture, path: Path) -> None:
    side = Settings.side
    theirs = Picture(b.reshape(side, side, 3).astype(np.float32), ours.coverage)
    stops = theirs.stops("auto")
    shown = [enlarged(picture.display(exposure=stops), at_least=320) for picture in (ours, theirs)]
    difference = np.clip(128 + 127 * 4 * (a - b).mean(axis=1) / b.mean(), 0, 255).astype(np.uint8)
    grey = enlarged(np.repeat(difference.reshape(side, side, 1), 3, axis=2), at_least=320)
    save_figure(panels([*shown, grey], ["ours", "path tracer", "difference × 4"]), path, force=True)


def _figures(a: np.ndarray, b: np.ndarray, sigma: np.ndarray) -> dict[str, float]:
    whole = float(np.abs(b).mean())
    found, noise = float(np.abs(a - b).mean() / whole), float(np.sqrt(2 / np.pi) * sigma.mean() / whole)
    return {
        "pixels": len(a),
        "mean_difference": found,
        "of_noise_alone": noise,  # what an exact picture would differ by from so few samples
        "without_noise": float(np.sqrt(max(found**2 - noise**2, 0))),  # were both errors Gaussian
        "signed_mean": float((a - b).mean() / whole),
        "relative_rms": float(np.sqrt(((a - b) ** 2).mean() / (b**2).mean())),
    }


def orders(data: Path, work: Path) -> dict[str, Any]:
    """What each order gives: Phong 10 and rough gold under a sky."""
    kept, found = Settings.order, {}
    for kind in ("phong", "conductor"):
        for order in (3, 4, 6, 8, 10, 12):
            Settings.order = order
            said = looked_at(glossy_scenes.under_a_sky, kind, SKIES["sky"], data, work)
            found[f"{kind}-{order}"] = {name: value for name, value in said.items() if name != "eyes"}
    Settings.order = kept
    return found


def _part(make, kind: str, sky: str, what: str):
    def run(data: Path, work: Path) -> dict[str, Any]:
        return looked_at(make, kind, SKIES[sky], data, work)

    run.__doc__ = what
    return run


PARTS = {
    f"{place}-{kind}-{sky}": _part(make, kind, sky, f"{kind}, {place}, light {SKIES[sky]}")
    for place, make in (("open", glossy_scenes.under_a_sky), ("room", glossy_scenes.in_a_room))
    for kind in glossy_scenes.MATERIALS
    for sky in (("sky", "studio") if place == "open" else ("overcast", "sky"))
} | {"orders": partial(orders)}
PARTS["orders"].__doc__ = orders.__doc__  # ty: ignore[unresolved-attribute]
