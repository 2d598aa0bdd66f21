"""The paper's box with a bunny against a path tracer: what a picture shows of it, direct and bounced light apart."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from measuring import baked
from points import Points, figures_of, found_on, of_picture, truth_at
from window_emitter import lit_sides, through_window

import rooms
from prelight.baking.portals_refining import refined
from prelight.baking.portals_room import without_triangles
from prelight.baking.portals_settings import PortalsSettings
from prelight.bases import cube_map
from prelight.lighting.disc import Disc, add_discs
from prelight.lighting.environment import Environment
from prelight.lighting.frost import frosted
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.scene.variant import mitsuba

SUN = np.array([-0.74, 0.55, 0.38])  # toward it: through the window past the bunny
SUN_DEG, SUN_SHARE, SUN_RESOLUTION = (
    0.265,
    2.0,
    512,
)  # its radius; its light, of the sky's; texels of the reference's cube
OUTWARD = np.array([-1.0, 0.0, 0.0])
POINTS, SAMPLES, CHUNK = 600, 8192, 2048
SIZE = (320, 240)
TINT, FROST = (0.35, 0.55, 0.95), 15.0
BEHIND, BEFORE = 270.0, 90.0  # the sky turned so that its sun stands behind the box, or shines in
SHADOW_RAYS = 32  # from a point of the picture to the sun


@dataclass(frozen=True)
class Case:
    """A window, its glass, and how the sky is turned."""

    window: float = rooms.LARGE
    glass: Glass = field(default_factory=Glass)
    turn: float = BEHIND
    order: int = 8
    refine: float = 1.0
    sun: bool = False

    @property
    def reference(self) -> str:
        """What its reference is kept as: a tint is a factor of it."""
        return f"{self.window:g}-{self.glass.frost:g}-{self.turn:g}" + ("-sun" if self.sun else "")


CASES = {
    "large": Case(), "order-4": Case(order=4), "small": Case(window=rooms.SMALL),
    "tinted": Case(glass=Glass(tint=TINT)), "frosted": Case(glass=Glass(kind="frosted", frost_deg=FROST)),
    "sun": Case(sun=True), "sun-refined": Case(sun=True, refine=2.0), "refined": Case(refine=2.0),
}  # fmt: skip


def sky(data: Path, turn: float) -> Environment:
    """A sunny sky."""
    return Environment.open(data / "skies" / "kloppenheim_05_1k.hdr").rotated(turn)


def sky_of(data: Path, case: Case) -> Environment:
    """The sky of a case, with a sun as a disc where it has one."""
    plain = sky(data, case.turn)
    if not case.sun:
        return plain
    fallen = np.einsum("fyxc,fyx->c", plain.cube(32), np.tile(cube_map.solid_angles(32), (6, 1, 1)))
    size = 2 * math.pi * (1 - math.cos(math.radians(SUN_DEG)))
    x, y, z = (SUN / np.linalg.norm(SUN)).tolist()
    red, green, blue = (SUN_SHARE * fallen.mean() / size * np.array([1.1, 1.0, 0.85])).tolist()
    return plain.with_discs([Disc((x, y, z), SUN_DEG, (red, green, blue))])


def open_box(data: Path, window: float) -> Scene:
    """The box without its pane, as the reference has it."""
    scene = rooms.box(data, window=window)
    return without_triangles(scene, np.flatnonzero(scene.material_of == rooms.GLASS))


def emitter_of(data: Path, case: Case) -> Any:
    """The sky, through the glass but for its tint, as Mitsuba asks for it."""
    cube = frosted(sky(data, case.turn).cube(32), case.glass.frost, OUTWARD.astype(np.float32))
    if case.sun:  # the same cells, finer, and the disc before them
        many = SUN_RESOLUTION // 32
        cube = np.repeat(np.repeat(cube, many, axis=1), many, axis=2)
        add_discs(cube, sky_of(data, case).discs)
    low, high = (rooms.SIDE - case.window) / 2, (rooms.SIDE + case.window) / 2
    return through_window(mitsuba(), lit_sides(cube, OUTWARD), low=low, high=high)


def picture_points(scene: Scene, count: int = POINTS) -> Points:
    """Seeded pixels of the picture."""
    seen, _ = of_picture(scene, rooms.EYE, width=SIZE[0], height=SIZE[1])
    chosen = np.sort(np.random.default_rng(3).choice(len(seen.triangle), count, replace=False))
    return Points(seen.triangle[chosen], seen.weights[chosen])


def reference(data: Path, work: Path, case: Case) -> dict[str, np.ndarray]:
    """Kept chunk after chunk, so that it can be stopped."""
    parts = []
    for k in range(SAMPLES // CHUNK):
        path = work / f"reference-{case.reference}-{k}.npz"
        if not path.exists():
            scene = open_box(data, case.window)
            at = picture_points(scene)
            found = truth_at(scene, at, emitter_of(data, case), samples=CHUNK, seed=1000 * k)
            np.savez(
                path, places=at.of(scene, scene.positions.astype(np.float64)), normals=at.normals(scene),
                albedo=at.of(scene, scene.albedo.astype(np.float64)), direct=found.direct, indirect=found.indirect,
                direct_variance=found.direct_variance, indirect_variance=found.indirect_variance,
                total_variance=found.total_variance,
            )  # fmt: skip
        parts.append(np.load(path))
    out = {name: parts[0][name] for name in ("places", "normals", "albedo")}
    for name in ("direct", "indirect"):
        out[name] = np.mean([part[name] for part in parts], axis=0)
    for name in ("direct_variance", "indirect_variance", "total_variance"):
        out[name] = np.mean([part[name] for part in parts], axis=0) / len(parts)
    return out


def lit_box(data: Path, work: Path, case: Case) -> tuple[PortalsRelighter, Scene, dict[str, Any]]:
    """Baked, unless another case has done it, and under its sky."""
    scene = rooms.box(data, window=case.window)
    settings = PortalsSettings(rays=4096, gather_rays=1024, order=case.order)
    if case.refine > 1:
        skies = [sky_of(data, case).cube(64)]
        scene = refined(scene, settings, factor=case.refine, skies=skies)
    own = case.reference if case.refine > 1 else f"{case.window:g}"
    path = work / f"box-{own}-{case.order}-{case.refine:g}.prelight"
    light, room, figures = baked(scene, path, settings, keep=True)
    light.light(Rig(sky_of(data, case), portals=(case.glass,)))
    return light, room.open, figures


def shown(light: PortalsRelighter, scene: Scene, at: Points) -> tuple[np.ndarray, np.ndarray]:
    """Direct and all light at points as pictures have them: between vertices, but the sun's by rays from the points."""
    direct, whole = light.direct, light.irradiance
    suns = light.point_lit
    if suns is None:
        return at.of(scene, direct), at.of(scene, whole)
    places = at.of(scene, scene.positions.astype(np.float64)).astype(np.float32)
    normals = at.normals(scene).astype(np.float32)
    more = suns.lamp_light_at(places, normals, shadow_rays=SHADOW_RAYS)
    return tuple(at.of(scene, values - suns.lamp_light) + more for values in (direct, whole))  # ty: ignore


def against_path_tracer(data: Path, work: Path, case: Case) -> dict[str, Any]:
    """Radiance at the points of the picture, beside the path tracer's."""
    true = reference(data, work, case)
    light, scene, figures = lit_box(data, work, case)
    at = found_on(scene, true["places"], true["normals"])
    direct, whole = shown(light, scene, at)
    factor = true["albedo"] * np.array(case.glass.tint or (1.0, 1.0, 1.0))
    total = true["direct"] + true["indirect"]
    ours = {"direct": direct, "bounced": whole - direct, "all": whole}
    known = {"direct": true["direct"], "bounced": true["indirect"], "all": total}
    noise = {"direct": "direct_variance", "bounced": "indirect_variance", "all": "total_variance"}
    found = {
        name: figures_of(ours[name] * true["albedo"], known[name] * factor, true[noise[name]] * factor**2)
        for name in ours
    }
    share = float((known["direct"] * factor).mean() / (total * factor).mean())
    names = ("triangles", "vertices", "direct_megabytes", "indirect_megabytes", "modes", "row_error")
    kept = {name: figures[name] for name in names}
    return {"points": POINTS, "samples": SAMPLES, "direct_share": share} | found | {"bake": kept}
