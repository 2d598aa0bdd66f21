"""A glass ball in layers of portals and of a cloud of lights: its caustic under every basis light, against `path`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from caustic import IN_CAUSTIC, against, half_circle

import prelight as pl
from prelight.baking.cloud import bake_cloud
from prelight.baking.cloud_plan import plan_cloud
from prelight.baking.cloud_settings import CloudSettings
from prelight.baking.portals import bake_portals
from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.lighting.placed_lights import Lamp
from prelight.lighting.rig import Rig
from prelight.material import Material
from prelight.relighting.cloud import CloudRelighter
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.scene.stock.parts import Part, rectangle, scene_of
from prelight.scene.stock.revolved import Profile
from prelight.storage.bake import Bake
from prelight.transport.lamps import SphereLamps
from prelight.transport.path_traced_light import LitScene
from prelight.transport.photon_mapping import PhotonMap
from prelight.transport.photon_sources import SphereSource
from prelight.transport.photon_tracing import CAUSTIC

PLASTER = Material("plaster", (0.5, 0.5, 0.5))
CLEAR = Material("clear glass", (1.0, 1.0, 1.0), transmission=1.0, specular=1.0)
BALL = Material("crystal", (1.0, 1.0, 1.0), bsdf={"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})
X, Y, Z = 2.4, 1.8, 2.4
_SILL, _LINTEL, _FROM, _TO = 0.5, 1.5, 0.6, 1.8  # of the window in the wall at x = 0
_CENTRE, _RADIUS = (0.9, 0.32, 1.2), 0.2


def room_with_ball(*, cells: int, rings: int, window: bool = True, glass: Material = BALL) -> Scene:
    """A room of 2.4 m with a window in one wall; its floor is finer than its walls, and a glass ball hangs above it."""
    few = max(4, cells // 4)
    parts: list[tuple[Part, Material]] = [
        (_side((0, 0, 0), (0, 0, Z), (X, 0, 0), cells), PLASTER),
        (_side((0, Y, 0), (X, 0, 0), (0, 0, Z), few), PLASTER),
        (_side((X, 0, 0), (0, 0, Z), (0, Y, 0), few), PLASTER),
        (_side((0, 0, 0), (X, 0, 0), (0, Y, 0), few), PLASTER),
        (_side((0, 0, Z), (0, Y, 0), (X, 0, 0), few), PLASTER),
    ]
    if window:
        for low, high, begin, end in (
            (0, _SILL, 0, Z), (_LINTEL, Y, 0, Z), (_SILL, _LINTEL, 0, _FROM), (_SILL, _LINTEL, _TO, Z)
        ):  # fmt: skip
            parts.append((_side((0, low, begin), (0, high - low, 0), (0, 0, end - begin), few // 2), PLASTER))
        pane = _side((0, _SILL, _FROM), (0, _LINTEL - _SILL, 0), (0, 0, _TO - _FROM), 2)
        parts.append((pane, CLEAR))
    else:
        parts.append((_side((0, 0, 0), (0, Y, 0), (0, 0, Z), few), PLASTER))
    ball: Part = Profile(half_circle(_RADIUS)).part(along=rings, around=2 * rings).moved(_CENTRE)
    return scene_of("glass ball in a room", [*parts, (ball, glass)], cameras={})


def _side(corner: Any, first: Any, second: Any, cells: int) -> Part:
    corner, first, second = (np.array(v, np.float64) for v in (corner, first, second))
    return rectangle(corner, first, second, cells=(cells, cells))


def portals(work: Path, *, small: bool = False) -> dict[str, Any]:
    """A room with a window and a glass ball under three skies, with photons and without, against `path` at vertices."""
    cells = 32 if small else 72
    scene = room_with_ball(cells=cells, rings=24 if small else 64)
    cube, rays = 32, 1024 if small else 4096
    skies = {
        "even": pl.Environment.constant((1.0, 1.0, 1.0)),
        "overcast": pl.Environment.stock("overcast"),
        "low sun of 6 degrees": pl.Environment.constant((0.2, 0.2, 0.2)).with_discs(
            (pl.Disc(direction=(-0.85, 0.55, 0.1), radius_deg=6, radiance=(60, 60, 60)),)
        ),
    }
    figures: dict[str, Any] = {"vertices": len(scene.positions), "cube": cube, "rays": rays}
    lit: dict[str, dict[str, np.ndarray]] = {}
    for name, photons in (("without", 0), ("a million photons", 1 << 20), ("4 million photons", 1 << 22)):
        if small and photons > 1 << 20:
            continue
        settings, path = (
            PortalsSettings(cube=cube, rays=rays, photons=photons),
            work / f"portals-{cells}-{photons}.prelight",
        )
        part: dict[str, Any] = {}
        if not path.exists():  # a run that was stopped goes on with its bakes
            started = time.perf_counter()
            bake_portals(scene, path, settings=settings)
            part["seconds"] = time.perf_counter() - started
        bake = Bake.open(path)
        part["bytes"] = sum(f.stat().st_size for f in path.rglob("*") if f.is_file())
        figures[name] = part | _said(bake)
        lit[name] = _relit(bake, skies)
    open_, chosen = PortalsRoom(scene, PortalsSettings()), {}
    best = lit["a million photons" if small else "4 million photons"]
    for sky, environment in skies.items():
        of_sun = sky.startswith("low")  # fewer vertices, more paths: few of them find it
        chosen[sky] = _in_caustic(
            scene, best[sky] - lit["without"][sky], 40 if small else 60 if of_sun else 300
        )
        samples = 1 << (11 if small else 17 if of_sun else 16)
        kept = work / f"portals-{sky}-{len(scene.positions)}-{samples}.npz"
        mean, variance = _reference(open_, environment.cube(cube), chosen[sky], kept, samples)
        for name, light in lit.items():
            ours = light[sky][chosen[sky]].astype(np.float64)
            figures[name][sky] = against(ours, mean, variance) | {"vertices": len(chosen[sky])}
    return figures


def cloud(work: Path, *, small: bool = False) -> dict[str, Any]:
    """A closed room with a glass ball: a lamp that is a light of the grid and two between lights, against `path`.

    Vertices of the floor where photons of the very lamp bring a tenth of the brightest; their
    caustic beside the cloud's.
    """
    scene = room_with_ball(cells=24 if small else 96, rings=16 if small else 32, window=False)
    radius, lights = 0.15, 60
    settings = {
        name: CloudSettings(
            lights=lights, box=((0.4, 1.0, 0.4), (2.0, 1.6, 2.0)), radius=radius, photons=photons
        )
        for name, photons in (("without", 0), ("with photons", 1 << (14 if small else 16)))
    }
    plan = plan_cloud(scene, settings["with photons"])
    grid, step = plan.grid.positions.astype(np.float64), float(plan.grid.step.max())
    near = grid[np.linalg.norm(grid - [0.9, 1.3, 1.2], axis=1).argmin()]
    lamps = {
        "a light of the grid": near,
        "between eight": near + 0.5 * step,
        "a quarter of a step off": near + np.array([0.25 * step, 0, 0]),
    }
    figures: dict[str, Any] = {
        "vertices": len(scene.positions),
        "lights": len(grid),
        "step": step,
        "radius": radius,
    }
    lit: dict[str, CloudRelighter] = {}
    for name, wanted in settings.items():
        started = time.perf_counter()
        bake = bake_cloud(scene, work / f"cloud-{name}.prelight", settings=wanted, force=True)
        found = bake.layers["cloud"].statistics
        figures[name] = {"seconds": time.perf_counter() - started} | {
            key: found[key]
            for key in ("interpolation_error", "error", "worst_error", "groups")
            if key in found
        }
        lit[name] = CloudRelighter(bake)
    for place, at in lamps.items():
        light = SphereLamps(np.float32([at]), np.float32([radius]), np.float32([[10, 10, 10]]))
        own = PhotonMap(scene, plan.ground.occluders, SphereSource(light), ways=CAUSTIC)
        own.more(1 << (17 if small else 20))
        chosen = _in_caustic(scene, own.light().light[:, 0, 1], 40 if small else 60)
        kept = work / f"cloud-{place}-{len(scene.positions)}.npz"
        mean, variance = _of_lamp(scene, plan, light, chosen, kept, 1 << (11 if small else 16))
        for name, cloud_ in lit.items():
            cloud_.shine([Lamp.of_power(tuple(at.tolist()), (10, 10, 10), radius=radius)])
            ours = cloud_.irradiance[chosen, 1].astype(np.float64)
            brightest = float(ours.max() / mean.max())
            figures[name][place] = against(ours, mean, variance) | {"brightest_over_reference": brightest}
        figures[place] = {"at": at.tolist(), "vertices_in_the_caustic": len(chosen)}
    return figures


def _of_lamp(
    scene: Scene, plan: Any, light: SphereLamps, chosen: np.ndarray, kept: Path, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    if kept.exists():
        data = np.load(kept)
        if np.array_equal(data["chosen"], chosen):
            return data["mean"], data["variance"]
    lit = LitScene(scene, lamps=light).light(chosen, origins=plan.ground.origins, samples=samples, seed=8)
    mean, variance = lit.total[:, 1], lit.total_variance[:, 1]
    np.savez(kept, chosen=chosen, mean=mean, variance=variance)
    return mean, variance


def _said(bake: Any) -> dict[str, float]:
    found = next(iter(bake.layers.values())).statistics
    return {name: found[name] for name in ("caustic_noise", "rows", "row_bytes") if name in found}


def _relit(bake: Any, skies: dict[str, Any]) -> dict[str, np.ndarray]:
    room, out = PortalsRelighter(bake), {}
    for sky, environment in skies.items():
        room.light(Rig(environment))
        out[sky] = room.irradiance.mean(axis=1)
    return out


def _in_caustic(scene: Scene, brought: np.ndarray, most: int) -> np.ndarray:
    """Vertices of the floor where a caustic brings a tenth of what it brings at its brightest."""
    floor = np.flatnonzero((scene.positions[:, 1] < 1e-4) & (scene.normals[:, 1] > 0.9))
    inner = floor[(np.abs(scene.positions[floor][:, [0, 2]] - [X / 2, Z / 2]) < 0.49 * X).all(axis=1)]
    bright = inner[brought[inner] > IN_CAUSTIC * brought[inner].max()]
    return np.sort(np.random.default_rng(3).choice(bright, min(len(bright), most), replace=False))


def _reference(
    room: PortalsRoom, cube: np.ndarray, chosen: np.ndarray, kept: Path, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    if kept.exists():
        data = np.load(kept)
        if np.array_equal(data["chosen"], chosen):
            return data["mean"], data["variance"]
    lit = LitScene(room.open, sky=cube).light(chosen, origins=room.origins, samples=samples, seed=7)
    mean, variance = lit.total.mean(axis=1), lit.total_variance.mean(axis=1)
    np.savez(kept, chosen=chosen, mean=mean, variance=variance)
    return mean, variance
