"""All bounces of a scene's light against the path tracer, at receivers chosen by area."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import lit_scenes
import numpy as np

from prelight.checking.comparison import compare
from prelight.drawing.figures import difference_picture, panels, readable_factor, save_figure
from prelight.drawing.surface import Surface
from prelight.drawing.view import View
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.transport import path_traced_light
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.mesh_fitness import measure_fitness
from prelight.transport.vantage import vantage_points

RECEIVERS = 1000
MEMORY = 6_000_000_000
PATHS = {"direct": 16384, "indirect": 4096}  # of each receiver
MORE_PATHS = {
    "room": {"direct": 65536, "indirect": 24576},  # light that finds its way in by one window
    "sponza": {"direct": 16384, "indirect": 8192},
    "sibenik": {"direct": 16384, "indirect": 8192},
}


class Baked:
    """E of a scene by the gathering operator, and what it cost."""

    def __init__(self, lit: lit_scenes.LitScene, *, rays: int = 1024) -> None:
        scene, started = lit.scene, time.perf_counter()
        self.occluders = Occluders(scene.positions, scene.triangles)
        self.stand = vantage_points(scene, self.occluders)
        self.gathering = Gathering.trace(scene, self.occluders, origins=self.stand, rays=rays, memory=MEMORY)
        traced = time.perf_counter()
        self.direct = lit.direct(self.occluders, self.stand, scene.normals)
        lit_by = time.perf_counter()
        found = bounced(self.gathering, self.direct)
        done = time.perf_counter()
        self.indirect = found.indirect
        self.figures = {
            "vertices": len(scene.positions), "triangles": len(scene.triangles), "rays": self.gathering.rays,
            "entries": self.gathering.entries, "operator_bytes": self.gathering.bytes,
            "products": found.bounces, "remaining": found.remaining,
            "seconds": {"operator": traced - started, "direct": lit_by - traced, "bounces": done - lit_by},
        }  # fmt: skip


def areas(scene: Any) -> np.ndarray:
    """A third of the triangles around each vertex, square metres."""
    a, b, c = (scene.positions[scene.triangles[:, k]].astype(np.float64) for k in range(3))
    of_triangle = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6
    out = np.zeros(len(scene.positions))
    for k in range(3):
        np.add.at(out, scene.triangles[:, k], of_triangle)
    return out


def against_path_tracer(lit: lit_scenes.LitScene, work: Path, name: str) -> dict[str, Any]:
    """One scene: the mesh's criterion first, then the bake, then the reference at receivers by area."""
    scene = lit.scene
    baked = Baked(lit)
    fit = measure_fitness(
        scene, baked.occluders, direct=baked.direct, indirect=baked.indirect,
        direct_at=lambda points, normals: lit.direct(baked.occluders, points, normals),
    )  # fmt: skip
    area = areas(scene) * scene.normals.any(axis=1)
    if lit.looked_at is not None:
        area *= lit.looked_at
    rows = np.sort(
        np.random.default_rng(12).choice(len(area), RECEIVERS, replace=False, p=area / area.sum())
    ).astype(np.int32)
    paths = MORE_PATHS.get(name, PATHS)
    reference = _reference(lit, rows, baked.stand, work / f"{name}.npz", paths=paths)
    judged = fit.judged[rows]
    figures: dict[str, Any] = {
        "lit_by": lit.said,
        "bake": baked.figures,
        "area_judged": float(area[fit.judged].sum() / area.sum()),
        "area_where_the_mesh_holds_the_light": fit.share,
        "reference": {"paths": paths, "seconds": reference["seconds"]},
    }
    for part, chosen in (("judged", judged), ("left_out", ~judged)):
        figures[part] = {"receivers": int(chosen.sum())}
        if not chosen.any():
            continue
        for what in ("direct", "indirect", "total"):
            mine = {"direct": baked.direct, "indirect": baked.indirect}
            ours = sum(mine.values()) if what == "total" else mine[what]
            figures[part][what] = _figures(ours[rows[chosen], 0], *(x[chosen] for x in reference[what]))
    _picture(lit, baked, _pictures() / f"{name}.png")
    return figures


def _figures(ours: np.ndarray, reference: np.ndarray, variance: np.ndarray) -> dict[str, float]:
    found = compare(ours, reference, variance, tolerance=0.05 * float(np.abs(reference).mean()))
    return {
        "mean_difference": found.mean_difference,
        "of_which_noise": float(np.sqrt(2 / np.pi * variance).sum() / max(np.abs(reference).sum(), 1e-300)),
        "signed_mean": found.signed_mean,
        "detectable_bias": found.detectable_bias,
        "relative_rms": found.relative_rms,
        "z_rejected_share": found.z_rejected_share,
        "mean_reference": float(reference.mean()),
    }


def _reference(
    lit: lit_scenes.LitScene, rows: np.ndarray, stand: np.ndarray, kept: Path, *, paths: dict[str, int]
) -> dict[str, Any]:
    """Means and variances of direct, indirect and total; kept, because it takes minutes."""
    names = ("direct", "indirect")
    if kept.exists():
        with np.load(kept) as file:
            same = file["paths"].tolist() == list(paths.values())
            if same and np.array_equal(file["rows"], rows) and np.array_equal(file["stand"], stand[rows]):
                found = {n: (file[n], file[n + "_variance"]) for n in names}
                return _with_total(found, float(file["seconds"]))
    started = time.perf_counter()
    lamp = path_traced_light.LitScene(lit.scene, **lit.lights)
    once = lamp.light(rows, origins=stand, bounces=0, samples=paths["direct"], report=_say("direct"))
    every = lamp.light(rows, origins=stand, samples=paths["indirect"], seed=1, report=_say("indirect"))
    seconds = time.perf_counter() - started
    found = {
        "direct": (once.direct, once.direct_variance),
        "indirect": (every.indirect, every.indirect_variance),
    }
    flat = {n: found[n][0] for n in names} | {n + "_variance": found[n][1] for n in names}
    np.savez(kept, rows=rows, stand=stand[rows], seconds=seconds, paths=list(paths.values()), **flat)
    return _with_total(found, seconds)


def _with_total(found: dict[str, Any], seconds: float) -> dict[str, Any]:
    (direct, its), (indirect, other) = found["direct"], found["indirect"]
    return found | {"total": (direct + indirect, its + other), "seconds": seconds}


def _say(what: str):
    def report(share: float) -> None:
        print(f"\r{what} reference {share:.0%}", end="" if share < 1 else "\n", flush=True)

    return report


def _pictures() -> Path:
    folder = Path(__file__).parent / "results" / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


CAMERAS = {
    "cornell-lamp": ((0.0, 1.0, 3.6), (0.0, 0.98, 0.0), 40.0),
    "cornell-sky": ((0.0, 1.0, 3.6), (0.0, 0.98, 0.0), 40.0),
    "cornell-spheres": ((0.0, 0.8, 3.3), (0.0, 0.79, 0.0), 38.0),
    "room": ((0.35, 1.35, 1.9), (-0.25, 0.85, -1.6), 62.0),
    "sponza": ((-7.2, 1.8, 1.3), (6.0, 4.0, -0.3), 62.0),
    "sibenik": ((-15.5, -11.0, 0.0), (4.0, -8.5, 0.0), 66.0),
}
WIDTH, HEIGHT, PIXEL_PATHS = 280, 210, 128


def _picture(lit: lit_scenes.LitScene, baked: Baked, path: Path) -> None:
    """The bake, the same camera path traced, and their difference."""
    from prelight.camera import Camera

    scene = lit.scene
    eye, target, fov = CAMERAS[path.stem]
    camera = Camera(eye=eye, target=target, vertical_fov_deg=fov)
    E = (baked.direct + baked.indirect)[:, 0]
    emission = np.array([m.emission for m in scene.materials], np.float32)[scene.material_of_vertex]
    surface = None
    if scene.textures and scene.uv is not None:
        tint = scene.albedo if scene.tint is None else scene.tint
        surface = Surface(scene.material_of, scene.materials, uv=scene.uv, tint=tint, textures=scene.textures)
    view = View(scene.positions, scene.triangles, camera=camera, width=WIDTH, height=HEIGHT, surface=surface)
    ours = view.draw(E * scene.albedo + emission, irradiance=E)
    theirs = _path_traced(lit, camera)
    covered = view.coverage[..., None] > 0.999
    theirs = np.where(covered, theirs, ours.linear)
    # The lamp's edge is a matter of pixel filters.
    shining = view.draw(emission).linear.any(axis=2, keepdims=True)
    if "lamps" in lit.lights:  # those of the reference are there to be seen, ours are not
        shining |= _path_traced(lit, camera, depth=1, paths=16).any(axis=2, keepdims=True)
    theirs = np.where(shining, ours.linear, theirs)
    white = float(np.percentile(theirs[~shining[..., 0]], 98.5))
    without = ours.linear
    factor = min(readable_factor(white, without, theirs), 20.0)
    shown = [_bytes(image / white) for image in (ours.linear, theirs)]
    difference = difference_picture(without, theirs, factor=factor, white=white)
    captions = ["gathered from vertices", f"path tracer, {PIXEL_PATHS} paths a pixel", "difference"]
    save_figure(panels([*shown, difference], captions), path, force=True)


def _bytes(linear: np.ndarray) -> np.ndarray:
    from prelight.images.tonemap import srgb_encode

    return np.rint(255 * np.clip(srgb_encode(np.clip(linear, 0, 1)), 0, 1)).astype(np.uint8)


def _path_traced(
    lit: lit_scenes.LitScene, camera: Any, *, depth: int = 64, paths: int = PIXEL_PATHS
) -> np.ndarray:
    from prelight.transport.cube_emitter import cube_emitter

    surfaces = SurfaceScene(lit.scene, emits="emission" in lit.lights)
    mi = surfaces.mi
    lights = []
    if "sky" in lit.lights:
        lights = [cube_emitter(mi, lit.lights["sky"])]
    elif "lamps" in lit.lights:
        lights = path_traced_light.lamps_of_mitsuba(mi, lit.lights["lamps"])
    look = mi.ScalarTransform4f().look_at(origin=list(camera.eye), target=list(camera.target), up=[0, 1, 0])
    film = {
        "type": "hdrfilm",
        "width": WIDTH,
        "height": HEIGHT,
        "pixel_format": "rgb",
        "rfilter": {"type": "tent"},
    }
    sensor = mi.load_dict({
        "type": "perspective", "fov": camera.vertical_fov_deg, "fov_axis": "y", "to_world": look, "film": film,
    })  # fmt: skip
    path = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 12})
    return np.array(mi.render(surfaces.lit_by(*lights), sensor=sensor, integrator=path, spp=paths))


def part(name: str, make) -> Any:
    def run(data: Path, work: Path) -> dict[str, Any]:
        return against_path_tracer(make(data), work, name)

    run.__doc__ = make.__doc__
    return run


PARTS = {
    name: part(name, make)
    for name, make in {
        "cornell-lamp": lit_scenes.cornell_lamp,
        "cornell-sky": lit_scenes.cornell_sky,
        "cornell-spheres": lit_scenes.cornell_spheres,
        "room": lit_scenes.room_and_bunny,
        "sponza": lit_scenes.sponza,
        "sibenik": lit_scenes.sibenik,
    }.items()
}
