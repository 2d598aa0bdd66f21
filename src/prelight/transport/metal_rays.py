"""Gathering by way of rough metal: a ray that meets some goes on as its BSDF sends light, to what is mirrored there.

The operator takes surfaces as diffuse. Of rough metal the energy is right so and its way is not: what stands beside it
toward a window gets a fifth too little. A ray that goes on brings what it ends at, times the metal's colour. The sky
by way of metal is handed on with its directions, for direct light knows nothing of it. Metal after metal is diffuse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Directions, Float32, Float64, Int32, Int64, Normals, Positions
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from .hemisphere import BACK, NOTHING, HemisphereRays, Hits

_STAGE = 83  # keeps these random numbers apart from those of other stages
_HALF_FLOAT = 2.0**-24
_SKYWARD = 16  # directions of a ray that look for the sky
_AT_ONCE = 1 << 15  # rays that go on
MOST_BYTES = 200 * _SKYWARD * _AT_ONCE  # of their directions, measured


@dataclass(frozen=True)
class ToSky:
    """What light of each cell of the sky comes back by way of metal, of receivers one after the other.

    Attributes
    ----------
    counts
        ``(rows,)`` cells that a receiver has light from; at most all.
    cells
        ``(n,)``, ascending in a row.
    weights
        ``(3, n)`` of light from a cell, added up over the rays of a receiver.
    rays
        That metal sent on, and how many of them met nothing.
    """

    counts: Int64[np.ndarray, "rows"]
    cells: Int32[np.ndarray, "n"]
    weights: Float32[np.ndarray, "3 n"]
    rays: int
    gone: int

    @property
    def bytes(self) -> int:
        return self.counts.nbytes + self.cells.nbytes + self.weights.nbytes

    def by_row(self) -> Float32[np.ndarray, "rows 3"]:
        """Of all cells together."""
        row, n = np.repeat(np.arange(len(self.counts)), self.counts), len(self.counts)
        return np.stack([np.bincount(row, w, minlength=n) for w in self.weights], axis=1).astype(np.float32)


@dataclass(frozen=True)
class MirroredHits(Hits):
    """Where rays end, by way of metal or not; ``weights`` what of the light there arrives, 1 without metal."""

    weights: Float32[np.ndarray, "rows rays 3"]
    to_sky: ToSky


@dataclass(frozen=True)
class Metals:
    """Which materials of a scene rays go on from, its surfaces, and the cells that the sky is told apart by."""

    surfaces: SurfaceScene
    chosen: np.ndarray  # (materials,) bool
    cell_of: Callable[[Directions], Int32[np.ndarray, "n"]]
    cells: int


class MetalRays(HemisphereRays):
    """Rays of receivers that go on from some metals of the scene, all others as ``HemisphereRays``."""

    def __init__(
        self, occluders: Occluders, scene: Scene, metals: Metals, *, origins: Positions, normals: Normals, rays: int,
        seed: int = 0,
    ) -> None:  # fmt: skip
        super().__init__(occluders, scene, origins=origins, normals=normals, rays=rays, seed=seed)
        self._surfaces, self._is_metal = metals.surfaces, metals.chosen[scene.material_of]
        self._cell_of, self._cells = metals.cell_of, metals.cells
        self._words = np.random.SeedSequence([seed, _STAGE]).generate_state(2)

    def trace(self, first: int, count: int) -> MirroredHits:
        """Where the rays of receivers first … first + count end."""
        import drjit as dr

        _, _, d, hit, met = self._sent(first, count)
        triangle, u, v = self._ends(hit, d, met)
        dr.eval(triangle, u, v, d)
        found, u, v = (np.array(x.numpy()) for x in (triangle, u, v))
        shape = count, self.rays
        weights = np.ones((count * self.rays, 3), np.float32)
        going = np.flatnonzero((found >= 0) & self._is_metal[found]).astype(np.int32)
        parts, gone = [(np.zeros(0, np.int64), np.zeros((3, 0)))], 0
        for start in range(0, len(going), _AT_ONCE):
            some = going[start : start + _AT_ONCE]
            look = self._at_metal(some, (found[some], u[some], v[some]), d)
            rays = some.astype(np.int64) + first * self.rays
            (end, u[some], v[some]), weights[some], _ = self._onward(look, rays, trials=range(1))
            found[some] = np.where(end == NOTHING, BACK, end)
            keys, sums, away = self._to_sky(look, rays, first)
            parts.append((keys, sums))
            gone += away
        keys, sums = _added(*(np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)))
        row, cell = np.divmod(keys, self._cells)
        to_sky = ToSky(
            np.bincount(row, minlength=count), cell.astype(np.int32), sums.astype(np.float32),
            rays=len(going) * (1 + _SKYWARD), gone=gone,
        )  # fmt: skip
        return MirroredHits(
            found.reshape(shape), u.reshape(shape), v.reshape(shape), weights.reshape(*shape, 3), to_sky
        )

    def _at_metal(
        self, lanes: Int32[np.ndarray, "n"], where: tuple[np.ndarray, ...], d: Any
    ) -> tuple[Any, Any]:
        """Interactions of rays with the metal that they met, and its BSDFs."""
        import drjit as dr

        triangle, u, v = where
        si, bsdf = self._surfaces.interactions(triangle, np.stack([u, v], axis=1), eye=(0.0, 0.0, 0.0))
        si.wi = si.to_local(-dr.gather(self._mi.Vector3f, d, self._mi.UInt32(lanes.astype(np.uint32))))
        return si, bsdf

    def _to_sky(
        self, look: tuple[Any, Any], rays: Int64[np.ndarray, "n"], first: int
    ) -> tuple[Int64[np.ndarray, "n"], Float64[np.ndarray, "3 n"], int]:
        """Several directions of each ray, for a sun is small: as ``_added``, and how many met nothing."""
        ends, weights, away = self._onward(look, rays, trials=range(1, 1 + _SKYWARD))
        gone = np.flatnonzero(ends[0] == NOTHING)
        row = rays[gone // _SKYWARD] // self.rays - first
        keys = row * self._cells + self._cell_of(away[gone])
        return *_added(keys, weights[gone].T / np.float32(_SKYWARD)), len(gone)

    def _onward(
        self, look: tuple[Any, Any], rays: Int64[np.ndarray, "n"], *, trials: range
    ) -> tuple[tuple[np.ndarray, ...], np.ndarray, np.ndarray]:
        """Where rays end that metal sends on, the metal's weights (n, 3), and directions; trials of a ray together."""
        import drjit as dr

        mi, count = self._mi, len(trials)
        lane = dr.arange(mi.UInt32, len(rays) * count)
        of = lane // dr.opaque(mi.UInt32, count)
        trial = lane - of * dr.opaque(mi.UInt32, count) + dr.opaque(mi.UInt32, trials.start)
        si, bsdf = dr.gather(mi.SurfaceInteraction3f, look[0], of), dr.gather(mi.BSDFPtr, look[1], of)
        ray = dr.gather(mi.UInt32, mi.UInt32((rays & 0xFFFFFFFF).astype(np.uint32)), of)
        keys = [dr.opaque(mi.UInt32, int(word)) for word in self._words]
        a, b = mi.sample_tea_32(ray ^ keys[0], trial ^ keys[1], 8)
        c, _ = mi.sample_tea_32(ray ^ keys[1], trial ^ keys[0], 8)
        a, b, c = (mi.Float(number >> 8) * _HALF_FLOAT for number in (a, b, c))
        sample, weight = bsdf.sample(mi.BSDFContext(), si, c, mi.Point2f(a, b), True)
        d = si.to_world(sample.wo)
        there = (sample.pdf > 0) & dr.isfinite(dr.sum(weight)) & (dr.max(weight) > 0)
        hit = self._scene.ray_intersect_preliminary(si.spawn_ray(d), active=there)
        end, *where = self._ends(hit, d, there & hit.is_valid())
        ends = dr.select(there, end, mi.Int32(BACK)), *where  # what is sent into the metal is lost
        weight = dr.select(there, weight, 0)
        dr.eval(ends, weight, d)
        found = tuple(x.numpy() for x in ends)
        return found, np.array([x.numpy() for x in weight]).T, np.array([x.numpy() for x in d]).T


def _added(
    keys: Int64[np.ndarray, "n"], values: np.ndarray
) -> tuple[Int64[np.ndarray, "m"], Float64[np.ndarray, "3 m"]]:
    """Row × cells + cell, each once and ascending, and the sums of (3, n) values there."""
    keys, place = np.unique(keys, return_inverse=True)
    return keys, np.stack([np.bincount(place.ravel(), v, minlength=len(keys)) for v in values])


def with_albedo(hits: MirroredHits, colours: np.ndarray, scene: Scene) -> MirroredHits:
    """Weights times the albedo where the rays end: ``colours`` (rows, rays, 3), or without channels the vertices'."""
    if not colours.shape[2]:
        w = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=2)
        corners = scene.triangles[np.maximum(hits.triangle, 0)]
        colours = sum(w[:, :, k, None] * scene.albedo[corners[:, :, k]] for k in range(3))
    return replace(hits, weights=np.ascontiguousarray(hits.weights * colours, np.float32))
