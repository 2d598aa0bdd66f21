"""Receivers where direct light through portals is not what lies between its neighbours: edges halved where it breaks.

The paper's limitation (section 8): light is known at vertices, and shadows that the mesh does not follow are jagged.
Light is traced at vertices and at the middle of every edge, through all portals, a few rays each, to the same points
for all. Where what arrives in the middle is not the mean of what arrives at the ends, for a sky of which all that
is known is that it is uneven, the edge is a candidate; those are halved first where most area would be wrong.

Through a wide window an unknown sun's patch may end anywhere. Where its sky is known, the edges of the patch are
found by rays toward the sun.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Int64
from ..bases import cube_map
from ..errors import InputError
from ..scene.geometry import Scene
from ..scene.refinement import halved, unique_edges
from .portals_room import PortalsRoom
from .portals_settings import PortalsSettings

MOST_FACTOR = 16.0
MOST_VERTICES = 4_000_000
ROUNDS = 6
_RAYS = 512
_CUBE = 8  # cells along a face of the cube map: 11 degrees, between a sun's glare and a window's width
_COARSE = 4
_MANY = 200_000  # vertices, above which the coarser cube is used
_UNEVEN = 4.0  # squares of what one cell may differ by from the mean sky
_AT_ONCE = 4096  # receivers
_FLOAT16 = 60000.0
_SUN = 6.0  # times the mean radiance of a sky: a cell that is brighter is a sun's, as when relit
_MOST_SUNS = 64  # cells of a sky
_GLARE = 4.0  # times the mean light of an uneven sky: what a sun's edge counts at most
_STAY = 0.01  # of what light is in the mean where there is any: edges whose error is less are never halved

Share = Callable[[float], None]


def refined(
    scene: Scene,
    settings: PortalsSettings,
    *,
    factor: float,
    skies: Sequence[CubeMap] = (),
    report: Share | None = None,
) -> Scene:
    """The scene with up to ``factor`` times its vertices, new ones where direct light through the portals breaks.

    Edges are halved for all triangles along them: there are no cracks. Vertices keep their order. ``skies`` are cube
    maps of radiance whose suns' patches shall have sharp edges.

    Raises
    ------
    InputError
        A factor that is not above 1 and up to 16, too many vertices, and what ``PortalsRoom`` refuses.
    """
    if isinstance(factor, bool) or not isinstance(factor, int | float) or not 1 < factor <= MOST_FACTOR:
        what = f"{factor!r}, expected how many times as many receivers are allowed, above 1 and up to {MOST_FACTOR:g}"
        raise InputError("refine", what)
    count = len(scene.positions)
    if factor * count > MOST_VERTICES:
        what = f"{factor:g} times {count:,} vertices, at most {MOST_VERTICES:,} are refined to"
        raise InputError("refine", f"{what}; choose less, or a coarser --subdivide")
    search, tell = _Search(PortalsRoom(scene, settings), skies), report or (lambda _: None)
    allowed = int((factor - 1) * count)
    for round_ in range(ROUNDS):
        left = allowed - (len(search.scene.positions) - count)
        if not search.halve(left // (ROUNDS - round_)):
            break
        tell((round_ + 1) / ROUNDS)
    made = len(search.scene.positions) - count
    note = f"receivers refined where direct light through the portals breaks: {made:,} vertices added"
    return replace(search.scene, notes=(*scene.notes, note)) if made else scene


class _Search:
    """The scene so far, and what arrives at its vertices."""

    def __init__(self, room: PortalsRoom, skies: Sequence[CubeMap]) -> None:
        self.scene, self._room, self._suns = room.scene, room, [suns_of(sky) for sky in skies]
        self._origins = room.origins.astype(np.float32)
        self._bare = np.abs(room.open.normals).sum(axis=1) == 0
        self._cube = _CUBE if len(self.scene.positions) <= _MANY else _COARSE
        self._glare = 0.0
        self._light = self._traced(self._origins, self._normals)
        strength = self._strength(self._light)
        mean = float(strength[strength > 0].mean()) if strength.any() else np.inf
        self._least, self._glare = _STAY * mean, _GLARE * mean
        self._known = np.empty(0, np.int64)  # edges, sorted, whose error is known, and that
        self._errors = np.empty(0)

    @property
    def _normals(self) -> Float32[np.ndarray, "vertices 3"]:
        """Of receivers; none of vertices of glass alone."""
        return np.where(self._bare[:, None], np.float32(0), self.scene.normals)

    def halve(self, most: int) -> int:
        """Halve edges until about so many vertices are new; how many are."""
        edges = unique_edges(self.scene.triangles)
        gains = self._gains(edges)
        order = np.argsort(-gains, kind="stable")
        chosen = order[: int((gains > 0).sum())][: max(most, 0)]
        before, done = len(self.scene.positions), len(chosen)
        while len(chosen):
            finer, ends = halved(self.scene, edges[chosen])
            made = len(finer.positions) - before
            if made <= most or done < 8:
                break
            done = int(done * min(0.9, most / made))
            chosen = chosen[:done]
        if not len(chosen):
            return 0
        self.scene = finer
        origins = self._origins[ends].mean(axis=1, dtype=np.float64).astype(np.float32)
        self._origins = np.concatenate([self._origins, origins])
        self._bare = np.concatenate([self._bare, self._bare[ends].any(axis=1)])
        self._light = np.concatenate([self._light, self._traced(origins, self._normals[before:])])
        return len(ends)

    def _gains(self, edges: Int64[np.ndarray, "edges 2"]) -> Float64[np.ndarray, "edges"]:
        """How wrong light is along each edge, times the area beside it; 0 where it is right enough."""
        keys = edges[:, 0] << 32 | edges[:, 1]
        at = np.minimum(np.searchsorted(self._known, keys), max(len(self._known) - 1, 0))
        new = self._known[at] != keys if len(self._known) else np.ones(len(keys), bool)
        errors = np.empty(len(edges))
        errors[~new] = self._errors[at[~new]]
        errors[new] = self._measured(edges[new])
        self._known, self._errors = keys, errors
        return np.where(errors > self._least, errors, 0) * _areas_beside(self.scene, keys)

    def _measured(self, edges: Int64[np.ndarray, "edges 2"]) -> Float64[np.ndarray, "edges"]:
        out = np.zeros(len(edges))
        normals = self._normals
        for start in range(0, len(edges), _AT_ONCE):
            ends = edges[start : start + _AT_ONCE]
            normal = normals[ends].sum(axis=1)
            length = np.linalg.norm(normal, axis=1, keepdims=True)
            normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 1e-6)
            place = self._origins[ends].mean(axis=1, dtype=np.float64).astype(np.float32)
            wrong = self._traced(place, normal).astype(np.float32)
            wrong -= self._light[ends].mean(axis=1, dtype=np.float32)
            lit = np.abs(normals[ends]).sum(axis=2).all(axis=1)
            out[start : start + _AT_ONCE] = self._strength(wrong) * lit
        return out

    def _strength(self, light: np.ndarray) -> Float64[np.ndarray, "n"]:
        """What an uneven sky makes of rows: the root of the mean square over all such skies; suns beside it."""
        cells = light[:, : 6 * self._cube**2].astype(np.float32)
        squares = np.square(cells.sum(axis=1, dtype=np.float64)) + _UNEVEN * np.einsum(
            "ij,ij->i", cells, cells
        )
        out = np.sqrt(squares)
        for column in light[:, cells.shape[1] :].T.astype(np.float64):
            out += np.minimum(np.abs(column), self._glare)
        return out

    def _traced(self, places: Float32[np.ndarray, "n 3"], normals: Float32[np.ndarray, "n 3"]) -> np.ndarray:
        """(n, cells + skies) half-precision irradiance / π of each cell through all portals, and of each sky's suns."""
        room, cells = self._room, 6 * self._cube**2
        out = np.zeros((len(places), cells + len(self._suns)), np.float16)
        rays = room.rays_from(places, normals, resolution=self._cube, rays=_RAYS, alike=True)
        for first in range(0, len(places), _AT_ONCE):
            many = min(_AT_ONCE, len(places) - first)
            found = rays.trace(first, many)
            row = np.repeat(np.arange(many * rays.panes) // rays.panes, np.diff(found.starts))
            sums = np.bincount(row * cells + found.cell, found.weight, minlength=many * cells)
            out[first : first + many, :cells] = sums.reshape(many, cells)
        for k, (directions, power) in enumerate(self._suns):
            if len(directions):
                out[:, cells + k] = np.minimum(rays.reached(directions) @ power, _FLOAT16)
        return out


def suns_of(sky: CubeMap) -> tuple[Directions, Float32[np.ndarray, "suns"]]:
    """Where the cells are that are a sun's, and what each brings where the mean radiance of the sky is 1."""
    n = sky.shape[1]
    radiance = sky.mean(axis=3, dtype=np.float64)
    energy = radiance * cube_map.solid_angles(n)
    mean = max(float(energy.sum()) / (4 * np.pi), 1e-30)
    found = np.flatnonzero(radiance.ravel() > _SUN * mean)
    found = np.sort(found[np.argsort(-energy.ravel()[found], kind="stable")][:_MOST_SUNS])
    directions = cube_map.texel_directions(found.astype(np.int32), n)
    return directions.astype(np.float32), (energy.ravel()[found] / mean).astype(np.float32)


def _areas_beside(scene: Scene, keys: Int64[np.ndarray, "edges"]) -> Float64[np.ndarray, "edges"]:
    """Of the triangles along each edge, whose keys are ascending."""
    a, b, c = np.moveaxis(scene.positions[scene.triangles].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    sides = np.sort(
        np.stack([scene.triangles, np.roll(scene.triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1
    )
    own = sides[:, 0].astype(np.int64) << 32 | sides[:, 1]
    return np.bincount(np.searchsorted(keys, own), np.repeat(area, 3), minlength=len(keys))
