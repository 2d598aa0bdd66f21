"""The paper's box with a bunny against a path tracer: what a picture shows of it, direct and bounced light apart."""

from __future__ import annotations

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
from prelight.lighting.environment import Environment
from prelight.lighting.frost import frosted
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.scene.variant import mitsuba

OUTWARD = np.array([-1.0, 0.0, 0.0])
POINTS, SAMPLES, CHUNK = 600, 8192, 2048
SIZE = (320, 240)
TINT, FROST = (0.35, 0.55, 0.95), 15.0
BEHIND, BEFORE = 270.0, 90.0  # the sky turned so that its sun stands behind the box, or shines in


@dataclass(frozen=True)
class Case:
    """A window, its glass, and how the sky is turned."""

    window: float = rooms.LARGE
    glass: Glass = field(default_factory=Glass)
    turn: float = BEHIND
    order: int = 8
    refine: float = 1.0

    @property
    def reference(self) -> str:
        """What its reference is kept as: a tint is a factor of it."""
        return f"{self.window:g}-{self.glass.frost:g}-{self.turn:g}"


CASES = {
    "large": Case(), "order-4": Case(order=4), "small": Case(window=rooms.SMALL),
    "tinted": Case(glass=Glass(tint=TINT)), "frosted": Case(glass=Glass(kind="frosted", frost_deg=FROST)),
    "sun": Case(turn=BEFORE), "sun-refined": Case(turn=BEFORE, refine=2.0), "refined": Case(refine=2.0),
}  # fmt: skip


def sky(data: Path, turn: float) -> Environment:
    """A sunny sky."""
    return Environment.open(data / "skies" / "kloppenheim_05_1k.hdr").rotated(turn)


def open_box(data: Path, window: float) -> Scene:
    """The box without its pane, as the reference has it."""
    scene = rooms.box(data, window=window)
    return without_triangles(scene, np.flatnonzero(scene.material_of == rooms.GLASS))


def emitter_of(data: Path, case: Case) -> Any:
    """The sky, through the glass but for its tint, as Mitsuba asks for it."""
    cube = frosted(sky(data, case.turn).cube(32), case.glass.frost, OUTWARD.astype(np.float32))
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
        skies = [sky(data, case.turn).cube(64)]
        scene = refined(scene, settings, factor=case.refine, skies=skies)
    turn = case.turn if case.refine > 1 else 0
    path = work / f"box-{case.window:g}-{case.order}-{case.refine:g}-{turn:g}.prelight"
    light, room, figures = baked(scene, path, settings, keep=True)
    light.light(Rig(sky(data, case.turn), portals=(case.glass,)))
    return light, room.open, figures


def against_path_tracer(data: Path, work: Path, case: Case) -> dict[str, Any]:
    """Radiance at the points of the picture, beside the path tracer's."""
    true = reference(data, work, case)
    light, scene, figures = lit_box(data, work, case)
    at = found_on(scene, true["places"], true["normals"])
    direct, whole = at.of(scene, light.direct), at.of(scene, light.irradiance)
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
