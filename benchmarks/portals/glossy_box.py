"""The box with a glossy bunny (Phong 10) by its window: our picture beside the path tracer's, pixel by pixel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from boxes import BEHIND, OUTWARD, sky
from figures import PICTURES
from window_emitter import lit_sides

import rooms
from prelight.baking.portals import bake_planned
from prelight.baking.portals_plan import plan_portals
from prelight.baking.portals_settings import PortalsSettings
from prelight.camera import Camera
from prelight.drawing.figures import difference_picture, enlarged, panels, save_figure
from prelight.drawing.picture import Picture
from prelight.lighting.rig import Rig
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.lit_bake import LitBake
from prelight.scene.geometry import Scene
from prelight.storage.bake import Bake
from prelight.transport.eye import seen_points
from prelight.transport.path_tracing import path_traced_view

SIDE, PIXELS, POINTS, CHUNK, CHUNKS = (
    72,
    160,
    9,
    4608,
    4,
)  # of a picture; compared; rays of a pixel; paths of a pixel
ORDER, GLOSSY_ORDER = 8, 8
SHOWN = 576  # paths of a pixel in the figure
_LOW = (rooms.SIDE - rooms.LARGE) / 2
WINDOW = np.array([[(0, _LOW, _LOW), (0, rooms.LARGE, 0), (0, 0, rooms.LARGE)]], np.float64)
BUNNY = 2  # its material
PHONG = {
    "type": "phong", "exponent": 10.0,
    "diffuse_reflectance": {"type": "rgb", "value": [0.22, 0.08, 0.05]},
    "specular_reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]},
}  # fmt: skip
EYE = Camera(eye=(2.6, 1.5, 2.5), target=(1.5, 0.6, 1.5), vertical_fov_deg=50.0)


def _glossy(scene: Scene) -> Scene:
    materials = (*scene.materials[:BUNNY], Material("phong 10", (0.22, 0.08, 0.05), bsdf=PHONG))
    albedo = scene.albedo.copy()
    albedo[np.unique(scene.triangles[scene.material_of == BUNNY])] = (0.22, 0.08, 0.05)
    return replace(scene, materials=materials, albedo=albedo)


def glossy_box(data: Path, work: Path) -> dict[str, Any]:
    """The paper's box with a glossy bunny (Phong 10) by a window of 1.5 m, against the path tracer."""
    plan = plan_portals(
        _glossy(rooms.box(data)),
        PortalsSettings(rays=4096, gather_rays=1024, order=ORDER, glossy_order=GLOSSY_ORDER),
    )
    path = work / f"box-glossy-{GLOSSY_ORDER}.prelight"
    bake = Bake.open(path) if path.exists() else bake_planned(path, plan=plan, force=True)
    light = LitBake(bake)
    light.light(Rig(sky(data, BEHIND)))
    ours = light.picture(EYE, width=SIDE, height=SIDE, background=None, fine=True)
    scene = plan.room.open
    points = seen_points(
        Occluders(scene.positions, scene.triangles), EYE, width=SIDE, height=SIDE, samples=POINTS
    )
    on = ((points.triangle >= 0) & (scene.material_of[points.triangle] == BUNNY)).all(axis=1)
    pixels = np.sort(np.random.default_rng(0).permutation(np.flatnonzero(on).astype(np.int32))[:PIXELS])
    mean, variance = _reference(data, work, (scene, points, pixels))
    a = ours.linear.reshape(-1, 3)[pixels].astype(np.float64)
    whole, sigma = float(mean.mean()), np.sqrt(variance)
    found, noise = (
        float(np.abs(a - mean).mean() / whole),
        float(np.sqrt(2 / np.pi) * sigma.mean() / whole),
    )
    return {
        "pixels": len(pixels), "samples": CHUNK * CHUNKS, "glossy_order": GLOSSY_ORDER, "difference": found,
        "noise": noise, "without_noise": float(np.sqrt(max(found**2 - noise**2, 0))),
        "signed": float((a - mean).mean() / whole),
        "rms": float(np.sqrt(((a - mean) ** 2).mean()) / whole),
    }  # fmt: skip


def _reference(data: Path, work: Path, what: tuple) -> tuple[np.ndarray, np.ndarray]:
    """Kept chunk after chunk."""
    scene, points, pixels = what
    parts = []
    for k in range(CHUNKS):
        path = work / f"reference-glossy-{k}.npz"
        if not path.exists():
            mean, variance = path_traced_view(
                SurfaceScene(scene), points, cube=_cube(data), receivers=pixels, bounces=None, samples=CHUNK,
                seed=1 + k, openings=WINDOW,
            )  # fmt: skip
            np.savez(path, mean=mean, variance=variance, pixels=pixels)
        parts.append(np.load(path))
    return np.mean([part["mean"] for part in parts], axis=0), np.mean(
        [part["variance"] for part in parts], axis=0
    ) / CHUNKS


def figure_11(data: Path, work: Path) -> dict[str, Any]:
    """The paper's figure 11: the glossy bunny, ours and the path tracer's, and what differs."""
    scene = plan_portals(_glossy(rooms.box(data)), PortalsSettings(glossy_order=GLOSSY_ORDER)).room.open
    light = LitBake(Bake.open(work / f"box-glossy-{GLOSSY_ORDER}.prelight"))
    light.light(Rig(sky(data, BEHIND)))
    ours = light.picture(EYE, width=SIDE, height=SIDE, background=None, fine=True)
    points = seen_points(
        Occluders(scene.positions, scene.triangles), EYE, width=SIDE, height=SIDE, samples=POINTS
    )
    true, _ = path_traced_view(
        SurfaceScene(scene), points, cube=_cube(data), bounces=None, samples=SHOWN, openings=WINDOW
    )
    true = true.reshape(SIDE, SIDE, 3).astype(np.float32)
    theirs, factor = Picture(true, ours.coverage), 5.0
    stops = theirs.stops("auto")
    shown = [enlarged(one.display(exposure=stops), at_least=320) for one in (ours, theirs)]
    white = float(2.0**-stops)
    off = difference_picture(ours.linear, true, factor=factor, white=white, legend=False)
    images = [*shown, enlarged(off, at_least=320)]
    captions = ["ours", "path tracer", f"|difference|, {factor:g} times"]
    save_figure(panels(images, captions, columns=3), PICTURES / "figure-11.png", force=True)
    return {"samples": SHOWN, "difference": float(np.abs(ours.linear - true).mean() / true.mean())}


def _cube(data: Path) -> np.ndarray:
    return lit_sides(sky(data, BEHIND).cube(32), OUTWARD)
