"""A pane of rough glass, a centimetre thick, as the path tracer has it, beside our frosted glass."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from boxes import BEHIND, CHUNK, OUTWARD, lit_box, open_box, picture_points, sky
from boxes import Case as BoxCase
from points import Points, figures_of, found_on
from window_emitter import lit_sides

import rooms
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.lighting.rough_pane import rough_pane
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.scene.variant import mitsuba
from prelight.transport.path_traced_light import LitScene, as_diffuse

ALPHA, IOR, THICK = 0.5, 1.5, 0.01  # of GGX, of glass, metres
GLASS_SAMPLES = 8192
ROUGH = {"type": "roughdielectric", "distribution": "ggx", "alpha": ALPHA, "int_ior": IOR, "ext_ior": 1.0}
SMOOTH = {"type": "dielectric", "int_ior": IOR, "ext_ior": 1.0}


def with_pane(scene: Scene, window: float) -> Scene:
    """The open box with rough glass toward the room, smooth toward the sky, in a black frame."""
    low, size = (rooms.SIDE - window) / 2, window
    y, z, x = np.array([0, size, 0.0]), np.array([0, 0, size]), np.array([-THICK, 0, 0])
    corner = np.array([0, low, low])
    sheets = [
        (corner, y, z, 1), (corner + x, z, y, 2), (corner, x, y, 3), (corner + z, y, x, 3),
        (corner, z, x, 3), (corner + y, x, z, 3),
    ]  # fmt: skip
    places, normals, triangles, of = (
        [scene.positions],
        [scene.normals],
        [scene.triangles],
        [scene.material_of],
    )
    count = len(scene.positions)
    for start, first, second, material in sheets:
        places.append(np.float32([start, start + first, start + first + second, start + second]))
        normal = np.cross(first, second)
        normals.append(np.tile(np.float32(normal / np.linalg.norm(normal)), (4, 1)))
        triangles.append(np.int32([[0, 1, 2], [0, 2, 3]]) + count)
        of.append(np.full(2, len(scene.materials) + material - 1, np.int32))
        count += 4
    more = (
        Material("rough", bsdf=ROUGH),
        Material("smooth", bsdf=SMOOTH),
        Material("frame", (0.0, 0.0, 0.0)),
    )
    added = count - len(scene.positions)
    albedo = np.concatenate([scene.albedo, np.zeros((added, 3), np.float32)])
    return replace(
        scene, positions=np.concatenate(places), normals=np.concatenate(normals),
        triangles=np.concatenate(triangles), material_of=np.concatenate(of), materials=(*scene.materials, *more),
        albedo=albedo,
    )  # fmt: skip


def turned_by(degrees: float = 0.0, count: int = 100_000) -> tuple[float, float]:
    """Of light that meets the pane at an angle from the room: σ, degrees, by which it is turned, and the share that
    gets through."""
    import drjit as dr

    mi = mitsuba()
    scene = LitScene(with_pane(_nothing(), 1.0), sky=np.ones((6, 4, 4, 3), np.float32))._lit
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(5, count)
    t, middle = math.radians(degrees), rooms.SIDE / 2
    way = mi.Vector3f(-math.cos(t), -math.sin(t), 0.0)
    ray = mi.Ray3f(
        mi.Point3f(0.05, middle + 0.05 * math.tan(t), middle) + dr.zeros(mi.Point3f, count),
        way + dr.zeros(mi.Vector3f, count),
    )
    weight, active = dr.ones(mi.Float, count), dr.full(mi.Bool, True, count)
    through, out = dr.full(mi.Bool, False, count), dr.zeros(mi.Vector3f, count)
    for _ in range(24):
        si = scene.ray_intersect(ray, active)
        gone = active & ~si.is_valid()
        out[gone] = ray.d
        through |= gone & (ray.d.x < 0)
        active &= si.is_valid()
        bs, value = si.bsdf().sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d(), active)
        weight *= dr.select(active, mi.Float(value[0]), 1)
        active &= weight > 0
        ray = si.spawn_ray(si.to_world(bs.wo))
    counted = np.array(dr.select(through, weight, 0), np.float64)
    angle = np.arccos(np.clip(np.array(dr.dot(out, way), np.float64), -1, 1))
    square = float((counted * angle**2).sum() / counted.sum())
    return math.degrees(math.sqrt(square / 2)), float(counted.mean())


def _nothing() -> Scene:
    """A triangle far away, for a scene that is nothing but the pane."""
    far = np.float32([[0, 90, 0], [0.01, 90, 0], [0, 90, 0.01]])
    up = np.tile(np.float32([0, 1, 0]), (3, 1))
    return Scene("pane", far, up, np.int32([[0, 1, 2]]), np.zeros((3, 3), np.float32))


def rough_glass(data: Path, work: Path) -> dict[str, Any]:
    """Our frosted glass beside a pane of rough glass: with a tint, straight light's or what fits, and as ``rough``."""
    angles = np.array([0, 15, 30, 40, 50, 60, 70, 80])
    found = [turned_by(float(angle)) for angle in angles]
    sigma, straight = found[0]
    true = _reference(data, work)
    light, scene, _ = lit_box(data, work, BoxCase())
    at = found_on(scene, true["places"], true["normals"])
    known, variance = true["total"] * true["albedo"], true["variance"] * true["albedo"] ** 2
    light.light(Rig(sky(data, BEHIND), portals=(Glass(kind="frosted", frost_deg=round(sigma, 1)),)))
    ours = at.of(scene, light.irradiance) * true["albedo"]
    fits = float(known.sum() / ours.sum())
    light.light(Rig(sky(data, BEHIND), portals=(Glass(kind="frosted", rough=ALPHA),)))
    rough = at.of(scene, light.irradiance) * true["albedo"]
    pane = rough_pane(ALPHA)
    return {
        "alpha": ALPHA, "frost_deg": sigma, "angles": angles.tolist(), "let_through": [let for _, let in found],
        "fitting_tint": fits, "with_straight": figures_of(ours * straight, known, variance),
        "with_fit": figures_of(ours * fits, known, variance), "as_rough": figures_of(rough, known, variance),
        "ours": {"frost_deg": pane.turned_deg, "let_through": pane.share(np.cos(np.radians(angles))).tolist()},
        "points": len(known), "samples": GLASS_SAMPLES,
    }  # fmt: skip


def _reference(data: Path, work: Path) -> dict[str, np.ndarray]:
    """By ``path`` through the pane, chunk after chunk; all of it is light that the glass scattered."""
    scene = open_box(data, rooms.LARGE)
    at: Points = picture_points(scene)
    places, normals = at.of(scene, scene.positions.astype(np.float64)), at.normals(scene)
    parts = []
    for k in range(GLASS_SAMPLES // CHUNK):
        path = work / f"reference-rough-{k}.npz"
        if not path.exists():
            cube = lit_sides(sky(data, BEHIND).cube(32), OUTWARD)
            lit = LitScene(with_pane(as_diffuse(scene), rooms.LARGE), sky=cube)
            lit.scene = replace(
                scene, positions=places.astype(np.float32), normals=normals.astype(np.float32),
                triangles=np.zeros((1, 3), np.int32), material_of=np.zeros(1, np.int32), uv=None, tint=None,
                albedo=np.zeros(places.shape, np.float32),
            )  # fmt: skip
            chosen = np.arange(len(places), dtype=np.int32)
            found = lit.light(chosen, origins=places.astype(np.float32), samples=CHUNK, seed=1000 * k)
            np.savez(path, total=found.total, variance=found.total_variance)
        parts.append(np.load(path))
    return {
        "places": places, "normals": normals, "albedo": at.of(scene, scene.albedo.astype(np.float64)),
        "total": np.mean([part["total"] for part in parts], axis=0),
        "variance": np.mean([part["variance"] for part in parts], axis=0) / len(parts),
    }  # fmt: skip
