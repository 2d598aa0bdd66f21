"""What the sun shines on, as luminous surfaces: its bounced light by Mitsuba's ``path`` with a fraction of the noise.

Paths from a receiver seldom meet the few square metres that the sun lights. Here the triangles that it reaches are
cut into cells, what each reflects of the sun alone is found by Mitsuba's rays and BSDFs, and the cells are area lights
of Mitsuba's: ``path`` asks for them as for any lamp, and its directions meet them as they meet any surface. What they
send is the sun's light after one bounce; all further bounces are the path tracer's own. Nothing of the bake is used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from prelight.bases import cube_map
from prelight.rays.mitsuba import Occluders, triangle_mesh
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.scene.subdivision import subdivided
from prelight.scene.variant import mitsuba
from prelight.transport.path_traced_light import LitScene

CELL, OUTDOORS = 0.15, 0.6  # metres, the longest edge of a cell: only where within it the sun ends is lost
NEAR = 0.02  # of what a triangle outdoors sends: if more goes in through glass, its cells are as small as indoors
FOUND, LEAST = 600.0, 16  # points a square metre, and a triangle at least, by which lit triangles are found
POINTS = 16  # of a cell, each with a ray to a place on the sun
LOOKS = 64  # of a cell outdoors, to see how much of its light goes in through glass
STEP, ALIKE = 1.3, 4.0  # of what is one lamp, the largest radiance over the least, and how much it matters
REST = 0.01  # of samples, for what seems to matter to nobody
_CELL = {
    "type": "twosided",
    "inner": {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "face_albedo"}},
}
_LIFT = 5e-4  # metres before a surface that rays begin
_LANES = 1 << 21


@dataclass(frozen=True)
class Sun:
    """Directions spread over its disc as its light is, and the irradiance of what faces it."""

    directions: np.ndarray  # (n, 3)
    irradiance: np.ndarray  # (3,)

    @classmethod
    def of(cls, cube: np.ndarray, *, count: int = 4096, seed: int = 1) -> Sun:
        """Of a cube map of nothing but the sun."""
        rng, n = np.random.default_rng(seed), cube.shape[1]
        light = cube.reshape(-1, 3).astype(np.float64) * np.tile(cube_map.solid_angles(n).ravel(), 6)[:, None]
        texels = np.flatnonzero(light.sum(axis=1))
        power = light[texels].sum(axis=1)
        chosen = rng.choice(texels, count, p=power / power.sum()).astype(np.int32)
        face, (row, column) = chosen // (n * n), np.divmod(chosen % (n * n), n)
        u, v = (2 * (place + rng.random(count)) / n - 1 for place in (column, row))
        d = cube_map.AXIS[face] + u[:, None] * cube_map.U[face] + v[:, None] * cube_map.V[face]
        return cls(d / np.linalg.norm(d, axis=1, keepdims=True), light.sum(axis=0))


@dataclass(frozen=True)
class _Cells:
    """What the sun reaches, turned to it: corners, radiance, albedo, material, and how much it matters."""

    positions: np.ndarray  # (n, 3, 3)
    normals: np.ndarray  # (n, 3, 3) of the corners
    radiance: np.ndarray  # (n, 3)
    albedo: np.ndarray  # (n, 3)
    material: np.ndarray  # (n,)
    matters: np.ndarray  # (n,) the share of what it sends that is indoors, or goes in through glass next


def sunlit(scene: Scene, glass: Any, sun: Sun, *, seed: int = 0) -> tuple[LitScene, int]:
    """The scene with what the sun lights as its lamps, and how many cells these are.

    ``scene`` is diffuse and without its windows' ``glass``, which is a scene of Mitsuba's of its own.
    """
    rng = np.random.default_rng(seed)
    occluders = Occluders(scene.positions, scene.triangles)
    reached, by_glass = _reached(scene, occluders, glass, sun, rng)
    fine = [subdivided(_only(scene, reached & by_glass), CELL)] if (reached & by_glass).any() else []
    if (reached & ~by_glass).any():
        coarse = subdivided(_only(scene, reached & ~by_glass), OUTDOORS)
        near = _goes_in(coarse, _sides(coarse, sun), occluders, glass, rng) > NEAR
        fine += [subdivided(_only(coarse, near), CELL)] if near.any() else []
        fine += [_only(coarse, ~near)] if not near.all() else []
    parts = [_cells(each, occluders, glass, sun, rng) for each in fine]
    names = _Cells.__dataclass_fields__
    cells = _Cells(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
    plain = SurfaceScene(_only(scene, ~reached))
    return LitScene(scene, surfaces=plain, emitters=_lamps(cells)), len(cells.matters)


def _only(scene: Scene, chosen: np.ndarray) -> Scene:
    return replace(
        scene, triangles=np.ascontiguousarray(scene.triangles[chosen]), material_of=scene.material_of[chosen]
    )


def _reached(
    scene: Scene, occluders: Occluders, glass: Any, sun: Sun, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """(F,) whether the sun reaches one of some points of a triangle, and whether through glass."""
    a, b, c = np.moveaxis(scene.positions[scene.triangles].astype(np.float64), 1, 0)
    area, mi = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, occluders.mi
    triangle = np.repeat(np.arange(len(area)), np.maximum(np.ceil(area * FOUND), LEAST).astype(np.int64))
    out, by_glass = np.zeros(len(area), bool), np.zeros(len(area), bool)
    for first in range(0, len(triangle), _LANES):
        some = triangle[first : first + _LANES]
        p, n, _ = _places(scene, some, rng)
        d = sun.directions[rng.integers(len(sun.directions), size=len(some))]
        facing = np.einsum("ij,ij->i", n, d)
        start = p + _LIFT * np.sign(facing)[:, None] * n
        free = np.flatnonzero(~_met(mi, occluders.scene, start, d) & (facing != 0))
        out[some[free]] = True
        by_glass[some[free[_met(mi, glass, start[free], d[free])]]] = True
    return out, by_glass


def _sides(scene: Scene, sun: Sun) -> np.ndarray:
    """(F,) 1 where the sun is on the side of the normals, −1 where it is behind."""
    n = scene.normals[scene.triangles].astype(np.float64).sum(axis=1)
    return np.where(n @ sun.directions.mean(axis=0) < 0, -1.0, 1.0)


def _cells(fine: Scene, occluders: Occluders, glass: Any, sun: Sun, rng: np.random.Generator) -> _Cells:
    """What triangles reflect, by rays from points of each to the sun."""
    count, mi = len(fine.triangles), occluders.mi
    surfaces = SurfaceScene(fine)
    side = _sides(fine, sun)
    light, colour, seen, through = (np.zeros((count, k)) for k in (3, 3, 1, 1))
    for first in range(0, count, _LANES // POINTS):
        cells = np.arange(first, min(first + _LANES // POINTS, count))
        some = np.repeat(cells, POINTS)
        p, n, weights = _places(fine, some, rng)
        d = sun.directions[rng.integers(len(sun.directions), size=len(some))]
        cosine = np.maximum(np.einsum("ij,ij->i", n, d) * side[some], 0)
        start = p + _LIFT * side[some, None] * n
        free = (cosine > 0) & ~_met(mi, occluders.scene, start, d)
        si, bsdf = surfaces.interactions(
            some.astype(np.int32), weights.astype(np.float32), eye=(0.0, 0.0, 0.0)
        )
        albedo = np.array(bsdf.eval_diffuse_reflectance(si)).T
        by_glass = free & _met(mi, glass, start, d)
        for out, values in (
            (light, (cosine * free)[:, None] * albedo), (colour, albedo), (seen, free[:, None]),
            (through, by_glass[:, None]),
        ):  # fmt: skip
            out[cells] = values.reshape(len(cells), POINTS, -1).mean(axis=1)
    indoors = (through > seen / 2)[:, 0]
    matters = np.where(indoors, 1.0, _goes_in(fine, side, occluders, glass, rng))
    of = np.where(side[:, None] < 0, fine.triangles[:, ::-1], fine.triangles)
    normals = fine.normals[of] * side[:, None, None]
    radiance = light * sun.irradiance / np.pi
    return _Cells(fine.positions[of], normals, radiance, colour, fine.material_of, matters)


def _goes_in(
    fine: Scene, side: np.ndarray, occluders: Occluders, glass: Any, rng: np.random.Generator
) -> np.ndarray:
    """(cells,) the share of what cells send that goes through glass next."""
    count, mi = len(side), occluders.mi
    share = np.zeros(count)
    for first in range(0, count, _LANES // LOOKS):
        cells = np.arange(first, min(first + _LANES // LOOKS, count))
        some = np.repeat(cells, LOOKS)
        p, n, _ = _places(fine, some, rng)
        n *= side[some, None]
        d = rng.standard_normal(p.shape)
        d = n + d / np.linalg.norm(d, axis=1, keepdims=True)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        to_glass, to_wall = (_distance(mi, kind, p + _LIFT * n, d) for kind in (glass, occluders.scene))
        share[cells] = (to_glass < to_wall).reshape(-1, LOOKS).mean(axis=1)
    return share


def _lamps(cells: _Cells) -> list[Any]:
    """Area lights, each of cells of one material, about as bright, that matter as much; chosen by their worth.

    Mitsuba chooses places of a mesh by area and takes one radiance for all: that of its cells together.
    """
    corners = cells.positions.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    bright = cells.radiance.mean(axis=1)
    worth = bright * cells.matters * area
    levels = [_level(bright, STEP), _level(cells.matters, ALIKE), cells.material]
    _, group = np.unique(np.stack(levels, axis=1), axis=0, return_inverse=True)
    order = np.argsort(group.ravel(), kind="stable")
    ends, out = np.cumsum(np.bincount(group.ravel())), []
    shares = worth / worth.sum() + REST / len(worth)
    for chosen in np.split(order, ends[:-1]):
        radiance = np.average(cells.radiance[chosen], axis=0, weights=area[chosen]).tolist()
        lamp = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
        lamp |= {"sampling_weight": float(shares[chosen].sum())}
        mesh = triangle_mesh(
            cells.positions[chosen].reshape(-1, 3), np.arange(3 * len(chosen), dtype=np.int32).reshape(-1, 3),
            normals=cells.normals[chosen].reshape(-1, 3).astype(np.float32), bsdf=_CELL,
            emitter=mitsuba().load_dict(lamp) if any(radiance) else None,
        )  # fmt: skip
        mesh.add_attribute("face_albedo", 3, np.ascontiguousarray(cells.albedo[chosen], np.float32).ravel())
        out.append(mesh)
    return out


def _level(values: np.ndarray, step: float) -> np.ndarray:
    """Values that are alike to a factor have the same number; −1 is none at all."""
    with np.errstate(divide="ignore"):
        found = np.log(values.max() / values) / np.log(step)
    return np.where(values > 0, np.minimum(found, 99), -1).astype(np.int64)


def _places(
    scene: Scene, triangle: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A random point of each triangle, its shading normal, and the weights of the second and third corner."""
    root, t = np.sqrt(rng.random(len(triangle))), rng.random(len(triangle))
    weights = np.stack([1 - root, root * (1 - t), root * t], axis=1)
    of = scene.triangles[triangle]
    p, n = (
        np.einsum("nk,nkx->nx", weights, x[of].astype(np.float64)) for x in (scene.positions, scene.normals)
    )
    return p, n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12), weights[:, 1:]


def _ray(mi: Any, start: np.ndarray, d: np.ndarray) -> Any:
    o, way = (
        kind(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in values.T))
        for kind, values in ((mi.Point3f, start), (mi.Vector3f, d))
    )
    return mi.Ray3f(o, way)


def _met(mi: Any, scene: Any, start: np.ndarray, d: np.ndarray) -> np.ndarray:
    return np.array(scene.ray_test(_ray(mi, start, d)))


def _distance(mi: Any, scene: Any, start: np.ndarray, d: np.ndarray) -> np.ndarray:
    hit = scene.ray_intersect_preliminary(_ray(mi, start, d))
    return np.where(np.array(hit.is_valid()), np.array(hit.t), np.inf)
