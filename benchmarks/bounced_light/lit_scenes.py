"""The scenes of this benchmark with their lights: what our side takes as direct light, and what the reference takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import prelight as pl
from prelight.bases.cube_map import texel_directions
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.mesh import textured
from prelight.scene.stock import room as rooms
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.exact import integrate
from prelight.transport.lamps import LuminousTriangles, SphereLamps, lamp_light, triangle_light
from prelight.transport.path_traced_light import as_diffuse

SKY = 48  # R of the skies: 13,824 lights
WARM, COOL = (1.0, 0.78, 0.52), (0.62, 0.80, 1.0)


@dataclass(frozen=True)
class LitScene:
    """A diffuse scene and its light."""

    scene: Scene
    lights: dict[str, Any]  # of the reference
    direct: Callable[
        [Occluders, np.ndarray, np.ndarray], np.ndarray
    ]  # at points with normals: E / π (n, 1, 3)
    said: str
    looked_at: np.ndarray | None = None  # (V,) bool: receivers that count; all if None


def _by_sky(scene: Scene, cube: np.ndarray, said: str) -> LitScene:
    def direct(occluders: Occluders, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        found = integrate(DiffuseTransfer(occluders, points, normals), cube)
        return found[:, None].astype(np.float32)

    return LitScene(scene, {"sky": cube}, direct, said)


def _by_itself(scene: Scene, said: str) -> LitScene:
    shining = LuminousTriangles.of_scene(scene)

    def direct(occluders: Occluders, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        return triangle_light(occluders, points, normals, lights=shining, rays=256)

    return LitScene(scene, {"emission": True}, direct, said)


def _by_lamps(scene: Scene, lamps: SphereLamps, said: str) -> LitScene:
    def direct(occluders: Occluders, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        return lamp_light(occluders, points, normals, lamps=lamps, rays=64).sum(axis=1, keepdims=True)

    return LitScene(scene, {"lamps": lamps}, direct, said)


def smooth_sky(*, low: tuple[float, ...] = WARM, high: tuple[float, ...] = COOL) -> np.ndarray:
    """Blue above, warm at the horizon, brighter toward −X and +Z; a dull ground. (6, R, R, 3)."""
    d = texel_directions(np.arange(6 * SKY * SKY), SKY).astype(np.float64)
    up = np.clip(d[:, 1], 0, 1)[:, None]
    colour = (1 - up) * np.array(low) + up * np.array(high)
    glow = 0.6 + 0.4 * np.clip(d @ np.array([-0.8, 0.3, 0.52]), -1, 1)
    light = np.where(d[:, 1:2] > 0, colour * glow[:, None], 0.12 * np.array([0.9, 1.0, 0.7]))
    return light.reshape(6, SKY, SKY, 3).astype(np.float32)


def cornell_lamp(data: Path) -> LitScene:
    """The Cornell box of the public set, under its own lamp."""
    scene = pl.load_scene(data / "cornell" / "CornellBox-Original.obj", subdivide=0.03)
    return _by_itself(as_diffuse(scene), "its own lamp; edges up to 3 cm")


def cornell_sky(data: Path) -> LitScene:
    """The same box in the dark, a sky before its open front."""
    scene = pl.load_scene(data / "cornell" / "CornellBox-Original.obj", subdivide=0.03)
    return _by_sky(_unlit(as_diffuse(scene)), smooth_sky(), "a sky through its open front; edges up to 3 cm")


def cornell_spheres(data: Path) -> LitScene:
    """The box with two spheres, taken as diffuse, under its own lamp."""
    scene = pl.load_scene(data / "cornell" / "CornellBox-Sphere.obj", subdivide=0.03)
    return _by_itself(as_diffuse(scene), "its own lamp; spheres diffuse; edges up to 3 cm")


def room_and_bunny(data: Path) -> LitScene:
    """The stock room with a bunny on its stool, lit by the sky in its window."""
    bunny = pl.load_scene(data / "bunny" / "bun_zipper_res2.ply")
    scene = _joined(rooms.room(detail=1.1), _on_the_stool(bunny))
    lit = _by_sky(scene, smooth_sky(), "a sky through its window; 36,000 room, 8,171 bunny vertices")
    outside = scene.materials.index(rooms.OUTSIDE)  # under the open sky, which is no test
    return replace(lit, looked_at=scene.material_of_vertex != outside)


def sponza(data: Path) -> LitScene:
    """Dabrovic's atrium under a sky."""
    scene = pl.load_scene(data / "sponza" / "sponza_materials.obj", subdivide=0.4)
    return _by_sky(as_diffuse(scene), smooth_sky(), "a sky above its court; edges up to 40 cm")


def sibenik(data: Path) -> LitScene:
    """The cathedral by six lamps."""
    scene = pl.load_scene(data / "sibenik" / "sibenik.obj", subdivide=0.4)
    at = [(-14, -9, 0), (-6, -10, 2), (-6, -10, -2), (2, -8, 0), (10, -9, 0), (16, -10, 0)]
    lamps = SphereLamps(
        np.float32(at), np.full(6, 0.25, np.float32), np.float32([np.multiply(600.0, WARM)] * 6)
    )
    return _by_lamps(as_diffuse(scene), lamps, "six spheres of 25 cm in the nave; edges up to 40 cm")


def _unlit(scene: Scene) -> Scene:
    return replace(scene, materials=tuple(replace(m, emission=(0.0, 0.0, 0.0)) for m in scene.materials))


def _on_the_stool(bunny: Scene) -> Scene:
    positions = bunny.positions * np.float32(2.2)
    low, high = positions.min(axis=0), positions.max(axis=0)
    x, z = rooms.STOOL_AT
    foot = np.float32([x, rooms.STOOL_HEIGHT + rooms.GAP, z])
    positions = positions - np.float32([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]) + foot
    fur = Material("bunny", (0.72, 0.70, 0.66))
    return replace(
        bunny, positions=positions, materials=(fur,), albedo=np.tile(np.float32(fur.colour), (len(positions), 1)),
        material_of=np.zeros(len(bunny.triangles), np.int32), tint=None,
    )  # fmt: skip


def _joined(first: Scene, second: Scene) -> Scene:
    """Two scenes as one; textures are the first's."""
    count = len(first.positions)
    uv = np.zeros((len(second.positions), 2), np.float32)
    return textured(
        replace(
            first,
            positions=np.concatenate([first.positions, second.positions]),
            normals=np.concatenate([first.normals, second.normals]),
            triangles=np.concatenate([first.triangles, second.triangles + np.int32(count)]),
            albedo=np.concatenate([first.tint, second.albedo]),  # to which ``textured`` adds the texture
            materials=(*first.materials, *second.materials),
            material_of=np.concatenate(
                [first.material_of, second.material_of + np.int32(len(first.materials))]
            ),
            uv=np.concatenate([first.uv, uv]),
            tint=None,
        )
    )
