"""The world outside at run time: meshes of a rig made ready for rays, placed as they are at a moment, and lit.

Outside everything is matte: colours are means over triangles, textures included. What falls on a surface is the light
of suns with their shadows, and of the sky as far as the surface's own body leaves it open; the rest of the hemisphere
sends back what a surface there sends on average. There are no mirrors, and glass is opaque.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..arrays import Float32, Float64
from ..bases import cube_map
from ..errors import InputError
from ..images.textures import sample
from ..images.tonemap import srgb_decode
from ..lighting.disc import Disc
from ..lighting.environment import Environment
from ..lighting.outside import Outside, OutsideObject, Placement
from ..rays.bodies import MOST_SUNS, NO_LIGHT, Bodies, Body, Illumination
from ..rays.plain import PlainOccluders, PlainVisibility
from ..scene.geometry import Scene
from ..scene.loading import load_scene

LARGEST_SUN_DEG = 3.0  # larger discs light as the sky does, without shadows with an edge
_SKY_RAYS = 8_000_000  # to find what is open to the sky, for all points of a body together
_MOST_SKY, _LEAST_SKY = 64, 8  # directions
_TEXELS = 16  # of a texture, for the mean over a triangle
_SKY_RESOLUTION = 16
_CREASE = 0.8  # cosine: a corner's normal that leans farther from its triangle is of an edge, not of a round surface
_INWARD = np.array(
    [(0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8)]
)  # off the edges, where rays start inside walls


class Exterior:
    """The objects of ``Outside``, read and made ready once; they move and are lit many times. Raises InputError."""

    def __init__(self, outside: Outside) -> None:
        self.outside = outside
        self._shapes = [_read(one) for one in outside.objects]
        bodies = [body_of(scene) for scene in self._shapes]
        self.bodies = Bodies(bodies)
        self._corners = [body.positions[np.unique(body.triangles)] for body in bodies]
        self._lit_by: Environment | None = None
        self.light = NO_LIGHT
        self.seconds = 0.0
        self.move(0.0)

    @property
    def triangles(self) -> int:
        """Of all objects."""
        return self.bodies.triangles

    def points(self, seconds: float) -> list[Float64[np.ndarray, "n 3"]]:
        """The vertices of each object, where they are at a time."""
        placed = (one.path.at(seconds) for one in self.outside.objects)
        return [c @ p.rotation.T + p.position for c, p in zip(self._corners, placed, strict=True)]

    def move(self, seconds: float) -> None:
        """Place everything as it is at a time."""
        placed = [one.path.at(seconds) for one in self.outside.objects]
        self.bodies.place([(place.rotation, np.array(place.position)) for place in placed])
        self.seconds = seconds

    def illuminate(self, environment: Environment) -> None:
        """Light everything by an environment, in the world's axes."""
        if environment is self._lit_by:
            return
        large = [disc for disc in environment.discs if not is_sun(disc)]
        suns = [disc for disc in environment.discs if is_sun(disc)]
        if len(suns) > MOST_SUNS:
            raise InputError("disc", f"{len(suns)} small discs, outside at most {MOST_SUNS} cast shadows")
        sky = irradiance_polynomial(environment.with_discs(large))
        rows: Float32[np.ndarray, "suns 6"] = np.zeros((len(suns), 6), np.float32)
        for row, disc in zip(rows, suns, strict=True):
            row[:3], row[3:] = disc.direction, disc.total
        around = self._around(sky, rows) if self.outside.bounce else np.zeros(3)
        self.light = Illumination(sky, rows, np.ascontiguousarray(around, np.float32))
        self._lit_by = environment

    def _around(self, sky: np.ndarray, suns: np.ndarray) -> Float64[np.ndarray, "3"]:
        """Irradiance from surfaces that send what all of them do on average: albedo times what falls on them."""
        bodies, normals = self.bodies, self._mean_normals
        x, y, z = normals.T
        terms = np.stack(
            [np.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1.0], axis=1
        )
        falls = np.maximum(terms @ sky.astype(np.float64), 0.0)
        for sun in suns:
            falls += np.maximum(normals @ sun[:3], 0.0)[:, None] * sun[3:]
        sent = falls * bodies.openness.mean(axis=1, dtype=np.float64)[:, None] * bodies.colour
        return (bodies.areas @ sent) / max(float(bodies.areas.sum()), 1e-30)

    @cached_property
    def _mean_normals(self) -> Float64[np.ndarray, "triangles 3"]:
        normals = self.bodies.corner_normals.reshape(-1, 3, 3).sum(axis=1, dtype=np.float64)
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def is_sun(disc: Disc) -> bool:
    """Whether a disc is so small that it casts shadows outside."""
    return disc.radius_deg <= LARGEST_SUN_DEG


def irradiance_polynomial(environment: Environment) -> Float32[np.ndarray, "9 3"]:
    """The nine numbers of ``Illumination.sky`` for an environment, by least squares over 200 normals."""
    R = _SKY_RESOLUTION
    light = environment.cube(R).reshape(-1, 3) * np.tile(cube_map.solid_angles(R).ravel(), 6)[:, None]
    towards = cube_map.texel_directions(np.arange(6 * R * R, dtype=np.int32), R)
    normals = sphere(200)
    x, y, z = normals.T
    terms = np.stack([np.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1.0], axis=1)
    falls = np.maximum(normals @ towards.T, 0.0) @ light.astype(np.float64)
    return np.ascontiguousarray(np.linalg.lstsq(terms, falls, rcond=None)[0], np.float32)


def sphere(count: int) -> Float64[np.ndarray, "count 3"]:
    """Directions spread evenly (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    y, turn = 1.0 - 2.0 * i / count, np.pi * (3.0 - np.sqrt(5.0)) * i
    ring = np.sqrt(1.0 - y * y)
    return np.stack([ring * np.cos(turn), y, ring * np.sin(turn)], axis=-1)


def body_of(scene: Scene) -> Body:
    """A scene's triangles with one colour each, and how open their corners are to the sky past the others."""
    if not len(scene.triangles):
        raise InputError("outside", f"{scene.name} has no triangles")
    used = scene.positions[scene.triangles].astype(np.float64)
    colour, emission = _colours(scene)
    points = np.einsum("ck,fkx->fcx", _INWARD, used).reshape(-1, 3)
    faces = np.cross(used[:, 1] - used[:, 0], used[:, 2] - used[:, 0])
    faces /= np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-30)
    openness = _openness(scene, points, np.repeat(faces, 3, axis=0)).reshape(-1, 3)
    normals = scene.normals[scene.triangles]
    creased = np.einsum("fkx,fx->fk", normals, faces) < _CREASE
    normals = np.where(creased[..., None], faces[:, None, :], normals)
    return Body(scene.positions, scene.triangles, normals.astype(np.float32), colour, emission, openness)


def _openness(scene: Scene, points: np.ndarray, normals: np.ndarray) -> Float32[np.ndarray, "n"]:
    """(n,) the share of an even sky's light that reaches points past the scene, 0 to 1."""
    count = int(np.clip(_SKY_RAYS // max(len(points), 1), _LEAST_SKY, _MOST_SKY))
    directions = sphere(count).astype(np.float32)
    occluders = PlainOccluders(scene.positions, scene.triangles)
    rays = PlainVisibility(
        occluders, origins=points.astype(np.float32), normals=np.ascontiguousarray(normals, np.float32)
    )
    bits, _ = rays.trace(directions)
    free, whole = np.zeros(len(points)), np.zeros(len(points))
    for row, d in zip(bits, directions, strict=True):
        cosine = np.maximum(normals @ d, 0.0)
        whole += cosine
        free += cosine * np.unpackbits(row, count=len(points), bitorder="little")
    return (free / np.maximum(whole, 1e-9)).astype(np.float32)


def _colours(scene: Scene) -> tuple[Float32[np.ndarray, "f 3"], Float32[np.ndarray, "f 3"]]:
    """Albedo and emission of each triangle, textures as their mean over it."""
    tint = scene.albedo if scene.tint is None else scene.tint
    colour = tint[scene.triangles].mean(axis=1)
    emission = np.zeros_like(colour)
    for k, material in enumerate(scene.materials):
        of = np.flatnonzero(scene.material_of == k)
        if not len(of):
            continue
        emission[of] = material.emission
        if scene.uv is None:
            continue
        uv = scene.uv[scene.triangles[of]]
        if material.colour_texture is not None:
            colour[of] *= _mean(scene.textures[material.colour_texture], uv)
        if material.emission_texture is not None:
            emission[of] *= _mean(scene.textures[material.emission_texture], uv)
    return colour.astype(np.float32), emission.astype(np.float32)


def _mean(texture: np.ndarray, uv: Float32[np.ndarray, "f 3 2"]) -> Float64[np.ndarray, "f 3"]:
    """Of a texture's linear colours over triangles, (f, 3)."""
    i = (np.arange(_TEXELS) + 0.5) / _TEXELS
    turn = np.modf(0.6180339887 * np.arange(1, _TEXELS + 1))[0]
    root = np.sqrt(i)
    weights = np.stack([1.0 - root, root * (1.0 - turn), root * turn], axis=1)  # even over a triangle
    total = np.zeros((len(uv), 3))
    for w in weights:
        total += srgb_decode(sample(texture, np.einsum("k,fkx->fx", w, uv)) / 255.0)
    return total / _TEXELS


def _read(one: OutsideObject) -> Scene:
    """An object's mesh in its own metres, scaled and turned. Raises InputError."""
    scene = load_scene(one.source)
    angle = np.radians(one.turn_deg)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])  # acts on rows
    values = {name: getattr(scene, name) for name in scene.__dataclass_fields__}
    values["positions"] = (scene.positions @ turn * one.scale).astype(np.float32)
    values["normals"] = (scene.normals @ turn).astype(np.float32)
    return Scene(**values)


def placed_shape(one: OutsideObject, seconds: float, *, room: Placement) -> Scene:
    """An object's mesh where it is at a time, in the axes of a room that stands in its world. Raises InputError."""
    scene, place = _read(one), one.path.at(seconds)
    turn = place.rotation.T @ room.rotation  # acts on rows
    shift = (np.array(place.position) - np.array(room.position)) @ room.rotation
    moved = (scene.positions @ turn + shift).astype(np.float32)
    return replace(scene, positions=moved, normals=(scene.normals @ turn).astype(np.float32))


def stamps(outside: Outside) -> Sequence[tuple]:
    """What tells whether the meshes would be read alike again: files by size and time."""
    found = []
    for one in outside.objects:
        try:
            status = os.stat(one.source)
            stamp = status.st_mtime_ns, status.st_size
        except (OSError, ValueError):  # a built-in scene, or no file: reading it says so
            stamp = 0, 0
        found.append((one.source, one.scale, one.turn_deg, *stamp))
    return found
