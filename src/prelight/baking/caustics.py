"""Caustics of an environment layer: what clear glass and mirrors send from each cell of light to each vertex.

One map of photons from all over the sky serves every cell. A caustic moves with its light and is in no few modes, so it
is kept as it is: for a vertex the cells that it has light from, a byte for each. Its own bounces go with all others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..arrays import Float32, Float64, Int32, Int64
from ..bases.cube_map import face_coordinates
from ..bases.quadtree import Nodes
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..transport.hemisphere import Hits
from ..transport.hit_colour import HitColour
from ..transport.metal_rays import Metals, ToSky
from ..transport.photon_density import LitSurface, PhotonDensity
from ..transport.photon_mapping import PhotonMap
from ..transport.photon_sources import SkySource
from ..transport.photon_tracing import BATCH, BOUNCED_CAUSTIC, CAUSTIC, Photons
from ..transport.sparse_product import multiply
from ..transport.spreading import spread
from .layer_receivers import LayerReceivers
from .light_cells import solid_angles_of
from .zones import DIFFUSE

_NEAREST = 4096  # of all directions together: of one cell some dozens
_REACH = {CAUSTIC: 4.0, BOUNCED_CAUSTIC: 12.0}  # edges of the mesh
BOUNCED_SHARE = 0.25  # of the photons asked for, beside them, for light that bounced before
CELLS_AT_ONCE = 1 << 26  # bytes of cells of some vertices
_STEPS = 255
_BRIGHTEST = np.float32(1 / np.pi)  # direct light of a cell
_MOST_CELLS = 6 * 256
_PIXELS = 1 << 14  # samples of pixels at a time
_STAGE = 37  # keeps these random numbers apart from those of other stages

Share = Callable[[float], None]


@dataclass(frozen=True)
class Caustics:
    """A sparse matrix of irradiance / π at vertices, of unit light from each cell; colours 1 or 3."""

    starts: Int64[np.ndarray, "vertices_and_one"]
    cells: Int32[np.ndarray, "entries"]
    values: Float32[np.ndarray, "colours entries"]
    photons: int
    noise: float  # RMS, of the caustics of an even sky

    @property
    def colours(self) -> int:
        return len(self.values)

    def add(
        self,
        mixtures: Float32[np.ndarray, "colours cells n"],
        direct: Float32[np.ndarray, "colours vertices n"],
    ) -> None:
        """Add what mixtures of cells bring to direct light."""
        for c, mixture in enumerate(mixtures):
            found = np.empty_like(direct[c])
            multiply(self.starts, self.cells, self.values[min(c, self.colours - 1)], mixture, found)
            direct[c] += found

    def add_answers(
        self,
        Q: Float32[np.ndarray, "colours vertices n"],
        weights: Float64[np.ndarray, "colours cells n"],
    ) -> None:
        """Add what each cell's caustic brings of columns at vertices: the transpose."""
        for c in range(len(Q)):
            found = np.zeros(weights[c].shape, np.float32)
            values = self.values[min(c, self.colours - 1)]
            spread(self.starts, self.cells, values, np.ascontiguousarray(Q[c]), found)
            weights[c] += found

    def for_rows(self, layer: LayerReceivers) -> Caustics:
        """Of the layer's receivers: irradiance / π of Lambertian vertices, radiance of pixels; nothing of others.

        What is not Lambertian has its caustics in none of the parts: its BSDF would be needed at every photon.
        """
        if layer.is_picture:
            return replace(self, **_of_pixels(self, layer))
        plain = np.zeros(layer.count, bool)
        for zone in layer.zones:
            plain[zone.rows] = zone.kind == DIFFUSE
        counts = np.diff(self.starts) * plain
        kept = np.repeat(plain, np.diff(self.starts))
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        return replace(
            self, starts=starts, cells=self.cells[kept], values=np.ascontiguousarray(self.values[:, kept])
        )

    def in_bytes(self) -> dict[str, np.ndarray]:
        """``counts``, ``cells``, ``codes`` and ``scales`` for a bake, rounded by chance so that the mean is kept.

        No step is finer than those of direct light that falls on a surface straight: dust far from glass becomes few
        entries.
        """
        rows = np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))
        most = np.zeros(len(self.starts) - 1, np.float32)
        np.maximum.at(most, rows, self.values.max(axis=0))
        scales = np.maximum(most, _BRIGHTEST) / np.float32(_STEPS)
        steps = self.values / scales[rows]
        chance = np.random.default_rng(np.random.SeedSequence([0, _STAGE])).random(steps.shape, np.float32)
        codes = np.minimum(np.floor(steps + chance), _STEPS).astype(np.uint8)
        kept = codes.any(axis=0)
        counts = np.bincount(rows[kept], minlength=len(most)).astype(np.uint16)
        none = np.zeros(1, np.int64)  # an array has no empty shape
        chosen = np.flatnonzero(kept)
        return {
            "counts": counts,
            "cells": (self.cells[chosen] if len(chosen) else none).astype(np.uint16),
            "codes": codes[:, chosen] if len(chosen) else np.zeros((len(codes), 1), np.uint8),
            "scales": scales,
        }


def find_caustics(
    scene: Scene, occluders: Occluders, cells: Nodes, resolution: int, *, photons: int, report: Share
) -> Caustics:
    """Trace so many photons of the sky at glass and mirrors, and a quarter as many from everywhere else."""
    surface, found = LitSurface(scene), []
    wanted = {CAUSTIC: -(-photons // BATCH), BOUNCED_CAUSTIC: -(-int(photons * BOUNCED_SHARE) // BATCH)}
    done, whole = 0, sum(wanted.values()) + 2
    for way, batches in wanted.items():
        of_way = PhotonMap(scene, occluders, SkySource(), ways=way)
        for _ in range(batches):
            of_way.more(BATCH)
            done += 1
            report(done / whole)
        landed = of_way.photons
        found.append((landed, PhotonDensity(surface, landed, nearest=_NEAREST, widest=_REACH[way])))
    grey = all((p.power == p.power[:, :1]).all() for p, _ in found)
    per_unit = 1 / (np.pi * solid_angles_of(cells, resolution))
    parts = [_Weighed(p, density, cells, resolution, per_unit, 1 if grey else 3) for p, density in found]
    matrix = _sparse(parts, len(scene.positions), len(cells))
    report(1.0)
    return Caustics(**matrix, photons=sum(p.emitted for p, _ in found), noise=_noise(found))


def followed_metals(layer: LayerReceivers, cells: Nodes) -> Metals | None:
    """Metal that gathering follows light from, to cells of the sky; None where there is none."""
    if layer.metals is None:
        return None
    cell_of = partial(cells_of, cells=cells, resolution=layer.settings.resolution)
    return Metals(SurfaceScene(layer.scene), layer.metals, cell_of, len(cells))


def from_metal(found: Sequence[ToSky], cells: Nodes, resolution: int, *, rays: int) -> Caustics:
    """What rough metal sends from each cell, from what it sent to the sky of gathering rays, so many a vertex."""
    matrix = _stacked([(part.counts, part.cells, part.weights) for part in found])
    per_unit = (1 / (rays * solid_angles_of(cells, resolution))).astype(np.float32)
    matrix["values"] *= per_unit[matrix["cells"]]
    return Caustics(**matrix, photons=sum(part.gone for part in found), noise=0.0)


def _of_pixels(caustics: Caustics, layer: LayerReceivers) -> dict[str, np.ndarray]:
    """Rows of pixels: albedo × what is interpolated between vertices, the mean of a pixel's samples."""
    scene, points = layer.scene, layer.points
    colour, samples = HitColour(scene), points.samples
    lambertian = np.append([material.is_lambertian for material in scene.materials], False)
    step, parts = max(1, _PIXELS // samples), []
    for first in range(0, layer.count, step):
        rows = slice(first, min(first + step, layer.count))
        triangle, w = points.triangle[rows], points.weights[rows]
        matt = lambertian[np.where(triangle >= 0, scene.material_of[triangle], -1)]
        corner = np.stack([1 - w.sum(axis=2), w[..., 0], w[..., 1]], axis=2) * matt[..., None]
        vertex = scene.triangles[triangle]
        weight = corner[..., None] * scene.albedo[vertex]
        if colour.channels:
            hits = Hits(triangle, np.ascontiguousarray(w[..., 0]), np.ascontiguousarray(w[..., 1]))
            weight = corner[..., None] * np.broadcast_to(colour.at(hits), (*triangle.shape, 3))[:, :, None]
        row = np.broadcast_to(np.arange(len(triangle))[:, None, None], vertex.shape)
        parts.append(
            _product(caustics, row.ravel(), vertex.ravel(), weight.reshape(-1, 3) / samples, len(triangle))
        )
    return _stacked(parts)


def _product(
    caustics: Caustics, row: np.ndarray, vertex: np.ndarray, weight: np.ndarray, rows: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Counts, cells and values of sums of weighted rows."""
    lengths = np.diff(caustics.starts)[vertex] * weight.any(axis=1)
    entry = np.repeat(caustics.starts[vertex], lengths) + _ramps(lengths)
    key = np.repeat(row * _MOST_CELLS, lengths) + caustics.cells[entry]
    keys, place = np.unique(key, return_inverse=True)
    values = np.empty((3, len(keys)), np.float32)
    for c in range(3):
        of_entry = caustics.values[min(c, caustics.colours - 1)][entry] * np.repeat(weight[:, c], lengths)
        values[c] = np.bincount(place.ravel(), of_entry, minlength=len(keys))
    return np.bincount(keys // _MOST_CELLS, minlength=rows), (keys % _MOST_CELLS).astype(np.int32), values


def _ramps(lengths: np.ndarray) -> np.ndarray:
    """0 … n − 1 for each n, one after the other."""
    ends = np.cumsum(lengths)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - lengths, lengths)


def _stacked(parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> dict[str, np.ndarray]:
    counts, cells, values = (np.concatenate(p, axis=-1) for p in zip(*parts, strict=True))
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return {"starts": starts, "cells": cells, "values": np.ascontiguousarray(values)}


class _Weighed:
    """Photons of one way with the cells that they come from."""

    def __init__(
        self, photons: Photons, density: PhotonDensity, cells: Nodes, resolution: int, per_unit: np.ndarray,
        colours: int,
    ) -> None:  # fmt: skip
        self._density, self._cell = density, cells_of(-photons.direction, cells, resolution)
        share = per_unit[self._cell] / photons.emitted
        self._values = (photons.power[:, :colours] * share[:, None]).astype(np.float32)
        self.colours = colours

    def of(self, rows: slice, count: int) -> Float32[np.ndarray, "rows cells colours"]:
        return self._density.in_cells(self._values, self._cell, count, rows=rows)


def _sparse(parts: list[_Weighed], vertices: int, count: int) -> dict[str, np.ndarray]:
    colours = parts[0].colours
    step = max(1, CELLS_AT_ONCE // (4 * count * colours))
    counts, columns, values = [], [], []
    for first in range(0, vertices, step):
        rows = slice(first, min(first + step, vertices))
        dense = sum((part.of(rows, count) for part in parts[1:]), parts[0].of(rows, count))
        row, cell = np.nonzero(dense.any(axis=2))
        counts.append(np.bincount(row, minlength=rows.stop - rows.start))
        columns.append(cell.astype(np.int32))
        values.append(dense[row, cell].T)
    return _stacked(list(zip(counts, columns, values, strict=True)))


def _noise(found: list[tuple[Photons, PhotonDensity]]) -> float:
    light = noise = 0.0
    for photons, density in found:
        E, squares = density.sums(photons.power.sum(axis=1, keepdims=True) / np.float32(photons.emitted))
        light, noise = light + E.astype(np.float64), noise + squares.astype(np.float64)
    whole = float(np.square(light).sum())
    return float(np.sqrt(np.sum(noise) / whole)) if whole > 0 else 0.0


def cells_of(directions: Float32[np.ndarray, "n 3"], cells: Nodes, resolution: int) -> Int32[np.ndarray, "n"]:
    """The cell of the cube that each direction, toward the light, lies in; ``cells`` as ``light_cells`` cuts them."""
    face, u, v = face_coordinates(directions.astype(np.float64))
    row, column = (
        np.clip(((t + 1) * (resolution / 2)).astype(np.int64), 0, resolution - 1) for t in (v, u)
    )  # fmt: skip
    band_of = np.zeros(resolution, np.int64)  # all faces are cut alike, down as across
    edges = np.unique(cells[cells[:, 0] == 0, 1])
    band_of[edges[1:]] = 1
    band_of = np.cumsum(band_of)
    bands = len(edges)
    number = np.zeros(6 * bands * bands, np.int32)
    number[(cells[:, 0] * bands + band_of[cells[:, 1]]) * bands + band_of[cells[:, 2]]] = np.arange(
        len(cells)
    )
    return number[(face.astype(np.int64) * bands + band_of[row]) * bands + band_of[column]]
