"""The scenes of this benchmark with their lights: what our side takes as direct light, and what the reference takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
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
from prelight.scene.subdivision import subdivided
from prelight.transport.cube_emitter import cube_emitter
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.exact import integrate
from prelight.transport.hemisphere import lit_sides
from prelight.transport.lamps import LuminousTriangles, SphereLamps, lamp_light, triangle_light
from prelight.transport.path_traced_light import as_diffuse

SKY = 96  # R of the skies
PANE_RAYS = 1024
EDGE = 0.4  # metres, of the large buildings
SHARPEST = 25.0  # degrees between a vertex's normal and its triangles'
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


def smooth_sky(toward: tuple[float, ...]) -> np.ndarray:
    """Blue above, warm at the horizon, a dull ground; dark behind, where no opening looks. (6, R, R, 3)."""
    d = texel_directions(np.arange(6 * SKY * SKY), SKY).astype(np.float64)
    up = np.clip(d[:, 1], 0, 1)[:, None]
    colour = (1 - up) * np.array(WARM) + up * np.array(COOL)
    glow = 0.6 + 0.4 * np.clip(d @ np.array([-0.8, 0.3, 0.52]), -1, 1)
    light = np.where(d[:, 1:2] > 0, colour * glow[:, None], 0.12 * np.array([0.9, 1.0, 0.7]))
    light = light * (d @ np.array(toward, np.float64) > 0)[:, None]
    return light.reshape(6, SKY, SKY, 3).astype(np.float32)


def through_window(
    occluders: Occluders, points: np.ndarray, normals: np.ndarray, *, cube: np.ndarray
) -> np.ndarray:
    """E / π (n, 1, 3) of a sky that is seen by the room's window alone: rays spread over its outer opening.

    In the reveal, which is close to that, by the sum over all texels.
    """
    low, high = (
        np.array([-rooms.HALF_WIDTH - rooms.WALL, y, z]) for y, z in zip(*reversed(rooms.WINDOW), strict=True)
    )
    a, b, c, d = low, (low[0], high[1], low[2]), high, (low[0], low[1], high[2])
    pane = LuminousTriangles(
        np.float32([[a, b, c], [a, c, d]]), np.ones((2, 3), np.float32), np.zeros(2, np.int32), 1
    )  # fmt: skip
    sky = cube_emitter(occluders.mi, cube)
    close = points[:, 0] < -rooms.HALF_WIDTH - 1e-4
    out = np.zeros((len(points), 1, 3), np.float32)
    far = np.flatnonzero(~close)
    out[far] = triangle_light(
        occluders, points[far], normals[far], lights=pane, rays=PANE_RAYS, beyond=sky
    )  # fmt: skip
    near = np.flatnonzero(close & (np.abs(points[:, 1] - 1.5) < 0.71) & (points[:, 0] > low[0] - 1e-4))
    out[near, 0] = integrate(DiffuseTransfer(occluders, points[near], normals[near]), cube)
    return out


def cornell_lamp(data: Path) -> LitScene:
    """The Cornell box of the public set, under its own lamp."""
    scene = pl.load_scene(data / "cornell" / "CornellBox-Original.obj", subdivide=0.03)
    return _by_itself(as_diffuse(scene), "its own lamp; edges up to 3 cm")


def cornell_sky(data: Path) -> LitScene:
    """The same box in the dark, a sky before its open front."""
    scene = pl.load_scene(data / "cornell" / "CornellBox-Original.obj", subdivide=0.04)
    sky = smooth_sky((0.0, 0.0, 1.0))
    return _by_sky(_unlit(as_diffuse(scene)), sky, "a sky through its open front; edges up to 4 cm")


def cornell_spheres(data: Path) -> LitScene:
    """The box with two spheres, taken as diffuse, under its own lamp."""
    scene = pl.load_scene(data / "cornell" / "CornellBox-Sphere.obj", subdivide=0.03)
    return _by_itself(as_diffuse(scene), "its own lamp; spheres diffuse; edges up to 3 cm")


def room_and_bunny(data: Path) -> LitScene:
    """The stock room with a bunny on its stool, lit by the sky in its window."""
    bunny = pl.load_scene(data / "bunny" / "bun_zipper_res2.ply")
    scene = _joined(rooms.room(detail=1.1), _on_the_stool(bunny))
    sky = smooth_sky((-1.0, 0.0, 0.0))
    outside = scene.materials.index(rooms.OUTSIDE)  # nobody's concern, and dark here
    return LitScene(
        scene,
        {"sky": sky},
        partial(through_window, cube=sky),
        "a sky through its window; 36,000 room, 8,171 bunny vertices",
        looked_at=scene.material_of_vertex != outside,
    )


def sponza(data: Path) -> LitScene:
    """Dabrovic's atrium by five lamps in its court."""
    scene = subdivided(creased(pl.load_scene(data / "sponza" / "sponza_materials.obj")), EDGE)
    at = [(-9, 3, 0), (-4, 6, 0.5), (1, 3, -0.5), (6, 7, 0), (10, 3, 0.5)]
    colours = [WARM, COOL, WARM, COOL, WARM]
    lamps = SphereLamps(np.float32(at), np.full(5, 0.4, np.float32), np.float32(colours) * np.float32(600))
    return _by_lamps(as_diffuse(scene), lamps, "five spheres of 40 cm in its court; edges up to 40 cm")


def sibenik(data: Path) -> LitScene:
    """The cathedral by six lamps."""
    scene = subdivided(creased(pl.load_scene(data / "sibenik" / "sibenik.obj")), EDGE)
    at = [(-14, -9, 0), (-6, -10, 2), (-6, -10, -2), (2, -8, 0), (10, -9, 0), (16, -10, 0)]
    lamps = SphereLamps(
        np.float32(at), np.full(6, 0.25, np.float32), np.float32([np.multiply(600.0, WARM)] * 6)
    )
    return _by_lamps(as_diffuse(scene), lamps, "six spheres of 25 cm in the nave; edges up to 40 cm")


def creased(scene: Scene) -> Scene:
    """The scene with vertices of their own for triangles that the normal of a vertex is too far from.

    Files whose normals are averaged over sharp edges (a quarter of Sponza's area) have a shading that no light obeys:
    part of a vertex's hemisphere lies behind its own triangles, and path tracers lose what arrives there.
    """
    sides = lit_sides(scene)
    corners = scene.triangles.copy()
    facing = np.einsum("ij,ikj->ik", sides, scene.normals[corners])
    triangle, corner = np.nonzero(facing < np.cos(np.radians(SHARPEST)))
    keys = np.column_stack([corners[triangle, corner], np.rint(8 * sides[triangle]).astype(np.int64)])
    _, first, of = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    old = keys[first, 0]
    corners[triangle, corner] = len(scene.positions) + of.ravel()
    normals = np.zeros((len(old), 3))
    np.add.at(normals, of.ravel(), sides[triangle])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)

    def longer(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else np.concatenate([values, values[old]])

    return replace(
        scene, positions=longer(scene.positions), albedo=longer(scene.albedo), uv=longer(scene.uv),
        tint=longer(scene.tint), normals=np.concatenate([scene.normals, normals.astype(np.float32)]),
        triangles=corners,
    )  # fmt: skip


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
