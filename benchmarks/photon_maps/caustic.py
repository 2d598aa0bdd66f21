"""The caustic of a glass ball, of a lamp and of a sky, against Mitsuba's path tracer."""

from __future__ import annotations

import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import prelight as pl
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.stock.parts import Part, rectangle, scene_of
from prelight.scene.stock.revolved import Profile
from prelight.transport.lamps import SphereLamps
from prelight.transport.path_traced_light import LitScene
from prelight.transport.photon_mapping import PhotonMap
from prelight.transport.photon_sources import SphereSource
from prelight.transport.photon_tracing import CAUSTIC
from prelight.transport.vantage import vantage_points

GLASS = Material("glass", (1.0, 1.0, 1.0), bsdf={"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})
FLOOR = Material("floor", (0.6, 0.6, 0.6))
BLACK = Material("floor", (0.0, 0.0, 0.0))
LAMP = SphereLamps(np.float32([[0.5, 2.0, 0.3]]), np.float32([0.15]), np.float32([[40, 40, 40]]))
IN_CAUSTIC = 0.1  # of its brightest


def half_circle(radius: float) -> tuple[tuple[float, float], ...]:
    angles = np.linspace(-np.pi / 2, np.pi / 2, 33)
    return tuple((max(float(radius * np.cos(t)), 0.0), float(radius * np.sin(t))) for t in angles)


def ball_on_floor(*, cells: int, rings: int, floor: Material = FLOOR) -> Scene:
    """A glass ball of 25 cm, 2 cm above a floor of 2 × 2 m."""
    ball: Part = Profile(half_circle(0.25)).part(along=rings, around=2 * rings).moved((0.0, 0.27, 0.0))
    ground = rectangle(
        np.array([-1.0, 0, -1]), np.array([0.0, 0, 2]), np.array([2.0, 0, 0]), cells=(cells, cells)
    )
    return scene_of("glass ball", [(ground, floor), (ball, GLASS)], cameras={})


def glass_ball(work: Path, *, small: bool = False) -> dict[str, Any]:
    """A lamp of 15 cm through a glass ball: photons against `path`, at the floor's vertices in the caustic."""
    cells, rings = (100, 64) if small else (160, 96)
    scene = ball_on_floor(cells=cells, rings=rings, floor=BLACK)
    occluders = Occluders(scene.positions, scene.triangles)
    photons = PhotonMap(scene, occluders, SphereSource(LAMP), ways=CAUSTIC)
    photons.more(1 << 17)  # compiles
    started = time.perf_counter()
    photons.more((1 << 20) if small else (1 << 23))
    traced = time.perf_counter()
    found = photons.light(nearest=500)
    done = time.perf_counter()
    on_floor = np.unique(scene.triangles[scene.material_of == 0])
    bright = found.light[on_floor, 0, 0]
    chosen = on_floor[bright > IN_CAUSTIC * bright.max()]
    chosen = np.sort(
        np.random.default_rng(3).choice(chosen, min(len(chosen), 100 if small else 600), replace=False)
    )
    samples = 1 << (14 if small else 18)
    mean, variance = _reference(scene, occluders, chosen, work / f"ball-{cells}.npz", samples=samples)
    ours = found.light[chosen, 0, 0].astype(np.float64)
    figures = {
        "vertices": len(scene.positions), "photons": photons.emitted, "landed": len(photons.photons),
        "photons_a_second": (photons.emitted - (1 << 17)) / (traced - started), "density_seconds": done - traced,
        "receivers_in_the_caustic": len(chosen), "brightest_over_direct": _over_direct(bright.max()),
        "said_noise": float(np.sqrt((found.noise[chosen, 0, 0] ** 2).mean()) / ours.mean()),
    }  # fmt: skip
    return figures | against(ours, mean, variance) | {"by_neighbours": _by_neighbours(photons, chosen, mean)}


def _over_direct(brightest: float) -> float:
    """How much brighter than the same lamp unhindered."""
    d2 = float((LAMP.centres[0] ** 2).sum())
    return float(brightest / (40 / (4 * np.pi**2) * LAMP.centres[0, 1] * d2**-1.5))


def _by_neighbours(photons: PhotonMap, chosen: np.ndarray, mean: np.ndarray) -> dict[str, float]:
    """Mean |difference| with more or fewer neighbours, and with the mesh not heeded."""
    out = {}
    for nearest, finest in ((50, 0.5), (200, 0.5), (2000, 0.5), (500, 1.0), (500, 0.25)):
        light = photons.light(nearest=nearest, finest=finest).light[chosen, 0, 0]
        out[f"{nearest} from {finest:g} edges"] = float(np.abs(light - mean).mean() / mean.mean())
    return out


def _reference(
    scene: Scene, occluders: Occluders, chosen: np.ndarray, kept: Path, *, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indirect light on a black floor: all of it has gone through the ball, or off it."""
    if kept.exists():
        data = np.load(kept)
        if np.array_equal(data["chosen"], chosen):
            return data["mean"], data["variance"]
    stand = vantage_points(scene, occluders)
    lit = LitScene(scene, lamps=LAMP).light(chosen, origins=stand, samples=samples, seed=5)
    mean, variance = lit.indirect[:, 0], lit.indirect_variance[:, 0]
    np.savez(kept, chosen=chosen, mean=mean, variance=variance)
    return mean, variance


def against(ours: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> dict[str, float]:
    return {
        "mean_difference": float(np.abs(ours - mean).mean() / mean.mean()),
        "of_which_noise_of_the_reference": float(np.sqrt(2 / np.pi * variance).mean() / mean.mean()),
        "relative_rms": float(np.sqrt(((ours - mean) ** 2).mean()) / np.sqrt((mean**2).mean())),
        "signed_mean": float((ours - mean).mean() / mean.mean()),
        "detectable_bias": float(2 * np.sqrt(variance.sum()) / mean.sum()),
    }


def sky_layer(work: Path, *, small: bool = False) -> dict[str, Any]:
    """An environment layer with a glass ball, two skies, against `path`: in the caustic, and around."""
    cells, rings = (60, 24) if small else (160, 64)
    scene = ball_on_floor(cells=cells, rings=rings)
    R = 32 if small else 64
    folder = Path(tempfile.mkdtemp(dir=work))
    figures: dict[str, Any] = {"vertices": len(scene.positions), "resolution": R}
    lights: dict[str, pl.Relighter] = {}
    for name, photons in (("with photons", None), ("without", 0)):
        started = time.perf_counter()
        bake = pl.bake_environment(
            scene, folder / f"{photons}.prelight", resolution=R, tolerance=0.007, photons=photons
        )
        figures[name] = {"seconds": time.perf_counter() - started}
        figures[name]["bytes"] = sum(f.stat().st_size for f in Path(bake.path).rglob("*") if f.is_file())
        lights[name] = pl.Relighter(bake)
    soft_sun = pl.Environment.constant((0.2, 0.2, 0.2)).with_discs(
        (pl.Disc(direction=(0.3, 0.8, 0.5), radius_deg=6, radiance=(20, 20, 20)),)
    )
    floor = np.unique(scene.triangles[scene.material_of == 0])
    for light in lights.values():
        light.environment = soft_sun
    bright = (lights["with photons"].irradiance - lights["without"].irradiance)[floor].mean(axis=1)
    near = floor[np.linalg.norm(scene.positions[floor], axis=1) < 0.6]
    chance = np.random.default_rng(4)
    places = {"around": chance.choice(near, min(len(near), 60 if small else 400), replace=False)}
    places["caustic"] = floor[bright > IN_CAUSTIC * bright.max()][: 40 if small else 200]
    stand = vantage_points(scene, Occluders(scene.positions, scene.triangles))
    skies = {"sunset": pl.Environment.stock("sunset"), "soft sun": soft_sun}
    for (sky, environment), (place, some) in product(skies.items(), places.items()):
        if sky == "sunset" and place == "caustic":
            continue  # its sun's caustic lies elsewhere
        chosen, kept = np.sort(some), work / f"{sky}-{place}-{cells}-{R}.npz"
        samples = 1 << (11 if small else 15)
        mean, variance = _of_sky(scene, chosen, stand, environment.cube(R), kept, samples)
        for name, light in lights.items():
            light.environment = environment
            ours = light.irradiance[chosen].mean(axis=1).astype(np.float64)
            figures[name][f"{sky}, {place}"] = {"receivers": len(chosen)} | against(ours, mean, variance)
    return figures


def _of_sky(
    scene: Scene, chosen: np.ndarray, stand: np.ndarray, cube: np.ndarray, kept: Path, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    if kept.exists():
        data = np.load(kept)
        if np.array_equal(data["chosen"], chosen):
            return data["mean"], data["variance"]
    lit = LitScene(scene, sky=cube).light(chosen, origins=stand, samples=samples, seed=6)
    mean, variance = lit.total.mean(axis=1), lit.total_variance.mean(axis=1)
    np.savez(kept, chosen=chosen, mean=mean, variance=variance)
    return mean, variance
