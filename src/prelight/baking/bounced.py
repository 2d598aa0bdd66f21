"""Bounced light of an environment layer: T of all light cells together, as few modes.

After a bounce light is smooth, over receivers and over directions: the matrix of bounced light, receivers × cells ×
colours, has few modes worth keeping. They are found without ever having the matrix (Halko, Martinsson and Tropp,
Finding structure with randomness, 2011): some seeded mixtures of cells are bounced together and span its range, and
the transpose of the operator then tells how much of each mode any light brings, through its direct light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

import numpy as np

from ..arrays import Float32, Float64
from ..bases.quadtree import Nodes
from ..encoding.range_kernels import add_light, answers, eigenvectors, gram, turned
from ..transport.bounces import Bounced, bounced
from ..transport.direct import DiffuseTransfer
from ..transport.gathering import Gathering
from ..transport.spreading import Spreading
from ..transport.viewed_gathering import ViewedGathering
from .caustics import Caustics, find_caustics, followed_metals, from_metal
from .first_bounce import FirstBounce, first_bounce
from .fitness import even_sky_fitness
from .layer_receivers import LayerReceivers
from .light_cells import CellLight, light_cells, smooth_lights
from .zones import DIFFUSE, VIEWED

TOLERANCE = 1e-3  # of all bounced light: the share that later bounces would add
MIXTURES = 124  # of cells, that are bounced together
MOST_MODES = MIXTURES
HELD = 0.98  # of the area: where less of it holds an even sky's light, a finer mesh is advised
LEFT_OUT = 0.01  # RMS of what the modes leave out, of all bounced light of single cells
COLUMNS = 31  # solved together, with one beside them: whole vectors
_STAGE = 31  # keeps these random numbers apart from those of other stages
_SMOOTH_WEIGHT = 8.0  # of an even sky against all cells by themselves

Share = Callable[[float], None]


@dataclass(frozen=True)
class BouncedPart:
    """T of bounced light ≈ modes · weights. Rows are those of the layer, in its order; colours 1 or 3."""

    cells: Nodes
    modes: Float32[np.ndarray, "rows modes"]
    weights: Float32[np.ndarray, "colours modes cells"]  # of unit light from a cell
    sources: Float32[np.ndarray, "colours vertices modes"]  # of unit direct irradiance / π at a vertex
    bounces: int
    remaining: float
    left_out: float  # see LEFT_OUT
    rays: int
    entries: int
    held: float  # share of the area whose mesh is fine enough for an even sky's light
    edge: float  # metres, the longest edge that would hold it nearly everywhere; infinite where it does
    first: FirstBounce | None = None  # where all rows are Lambertian vertices
    caustics: Caustics | None = None  # where a material needs them; at all vertices
    metal: Caustics | None = None  # the same of rough metal, from gathering


class BouncedLight:
    """Finds the bounced part of a layer.

    Parameters
    ----------
    layer
        Its receivers. Light bounces between all vertices of the scene, as if every surface were diffuse; what
        glossy receivers and pixels see of it, their own BSDF says.
    rays
        From each receiver; a square number.
    most
        Bounces; None for all.
    memory
        Bytes the operator may take.
    """

    def __init__(
        self, layer: LayerReceivers, *, rays: int, most: int | None, memory: int | None, report: Share
    ) -> None:
        self._layer, self._rays, self._most, self._memory = layer, rays, most, memory
        self._report = report

    def found(self, *, lanes: int) -> BouncedPart:
        """Trace, bounce and factor."""
        layer, scene = self._layer, self._layer.bouncing
        told = partial(_within, self._report)
        R = layer.settings.resolution
        cells = light_cells(R)
        metals = followed_metals(layer, cells)
        gathering = Gathering.trace(
            scene, layer.occluders, rays=self._rays, memory=self._memory, metals=metals, report=told(0.0, 0.3)
        )
        transfer = DiffuseTransfer(layer.occluders, layer.origins, scene.normals)
        light = CellLight(transfer, cells, R)
        for share in light.trace(lanes=lanes):
            told(0.3, 0.35)(share)
        caustics = None
        if layer.photons:
            caustics = find_caustics(
                layer.scene, layer.occluders, cells, R, photons=layer.photons, report=told(0.35, 0.4)
            )
        metal = None
        if metals is not None:
            metal = from_metal(gathering.to_sky, cells, R, rays=self._rays)
            gathering.to_sky.clear()
        viewed = self._viewed(gathering)
        colours = 1 if gathering.is_grey and not viewed and (caustics is None or caustics.colours == 1) else 3
        direct = self._direct(gathering, light, cells, colours)
        sent_on = [part for part in (caustics, metal) if part is not None]
        for part in sent_on:
            part.add(_mixtures(cells, R, colours), direct)
        modes, forth = self._range(gathering, direct, viewed, told(0.4, 0.65))
        Q, back = self._sources(gathering, modes, viewed, colours, told(0.65, 0.9))
        weights = self._weights(light, sent_on, Q, len(cells), told(0.9, 0.95))
        modes, Q, weights, left_out = _reduced(modes, Q, weights, smooth_lights(cells, R))
        first = None
        if len(self._plain) == layer.count == gathering.rows:
            first = first_bounce(gathering, scene, transfer, rays=self._rays, lanes=lanes)
        fitness = even_sky_fitness(scene, layer.occluders, gathering, metals=metals)
        return BouncedPart(
            cells=cells,
            modes=modes,
            weights=weights,
            sources=Q,
            bounces=max(forth.bounces, back.bounces),
            remaining=max(forth.remaining, back.remaining),
            left_out=left_out,
            rays=gathering.rays + light.rays + sum(part.rays for _, part in viewed),
            entries=gathering.entries,
            held=fitness.share,
            edge=fitness.edge_for(HELD),
            first=first,
            caustics=None if caustics is None else caustics.for_rows(layer),
            metal=None if metal is None else metal.for_rows(layer),
        )

    def _viewed(self, gathering: Gathering) -> list[tuple[np.ndarray, ViewedGathering]]:
        """Rows that answer toward an eye, and how they gather."""
        layer = self._layer
        return [
            (rows, ViewedGathering(layer.occluders, layer.scene, layer.surfaces, layer.points, rows, rays=self._rays))
            for zone in layer.zones
            if zone.kind == VIEWED and len(rows := np.sort(zone.rows))
        ]  # fmt: skip

    @property
    def _plain(self) -> np.ndarray:
        """Rows that are Lambertian vertices."""
        parts = [zone.rows for zone in self._layer.zones if zone.kind == DIFFUSE]
        return np.sort(np.concatenate(parts)) if parts else np.zeros(0, np.int64)

    def _direct(
        self, gathering: Gathering, light: CellLight, cells: Nodes, colours: int
    ) -> Float32[np.ndarray, "colours vertices mixtures"]:
        """Of mixtures of cells."""
        mixtures = _mixtures(cells, self._layer.settings.resolution, colours)
        direct = np.zeros((colours, gathering.rows, MIXTURES), np.float32)
        for part, T in light.blocks():
            for c in range(colours):
                add_light(T, mixtures[c, part], direct[c])
        return direct

    def _range(
        self,
        gathering: Gathering,
        direct: Float32[np.ndarray, "colours vertices mixtures"],
        viewed: list,
        report: Share,
    ) -> tuple[Float32[np.ndarray, "rows modes"], Bounced]:
        """Orthonormal columns that span what mixtures of cells bring to the rows, all colours added."""
        seen = np.zeros((self._layer.count, MIXTURES), np.float32)
        plain, done = self._plain, []
        for start in range(0, MIXTURES, COLUMNS):
            columns = slice(start, min(start + COLUMNS, MIXTURES))
            D = np.ascontiguousarray(np.moveaxis(direct[:, :, columns], 0, 2))
            result = bounced(gathering, D, tolerance=TOLERANCE, most=self._most)
            done.append(result)
            seen[plain, columns] = result.indirect[plain].sum(axis=2)
            for rows, gather in viewed:
                seen[rows, columns] = gather.gather(D + result.indirect).sum(axis=2)
            report(columns.stop / MIXTURES)
        values, vectors = eigenvectors(gram(seen))
        kept = values > 1e-9 * max(float(values[0]), 1e-30)
        inverse = 1 / np.sqrt(np.where(kept, values, 1))
        modes = turned(seen, (vectors * inverse)[:, kept] if kept.any() else np.zeros((MIXTURES, 1)))
        return modes, _worst(done)

    def _sources(
        self, gathering: Gathering, modes: np.ndarray, viewed: list, colours: int, report: Share
    ) -> tuple[Float32[np.ndarray, "colours vertices modes"], Bounced]:
        """How much of each mode unit direct light at a vertex brings: the operators' transposes on the modes."""
        V, plain, done = gathering.rows, self._plain, []
        Q = np.empty((colours, V, modes.shape[1]), np.float32)
        spreading = Spreading(gathering, self._layer.scene)

        def solve(X: np.ndarray, most: int | None = None) -> Bounced:
            backwards = cast(Gathering, spreading)  # of one, solving needs no more than ``bounce``
            result = bounced(backwards, X / spreading.areas, tolerance=TOLERANCE, most=most)
            return replace(result, indirect=result.indirect * spreading.areas)

        for start in range(0, modes.shape[1], COLUMNS):
            columns = slice(start, min(start + COLUMNS, modes.shape[1]))
            X = np.zeros((V, columns.stop - start, colours), np.float32)
            X[plain] = modes[plain, columns, None]
            first = np.zeros_like(X)
            for rows, gather in viewed:
                first += gather.spread(modes[rows, columns])
            if self._most is None:
                result = solve(X + first)
                total = result.indirect + first
            else:
                result = solve(X, most=self._most)
                total = result.indirect + first
                if viewed and self._most > 1:
                    total += solve(first, most=self._most - 1).indirect
            done.append(result)
            Q[:, :, columns] = np.moveaxis(total, 2, 0)
            report(columns.stop / modes.shape[1])
        return Q, _worst(done)

    def _weights(
        self, light: CellLight, sent_on: list[Caustics], Q: np.ndarray, cells: int, report: Share
    ) -> Float64[np.ndarray, "colours modes cells"]:
        weights = np.zeros((len(Q), cells, Q.shape[2]))
        for part in sent_on:
            part.add_answers(Q, weights)
        for some, T in light.blocks():
            for c in range(len(Q)):
                answers(np.ascontiguousarray(T), Q[c], weights[c, some])
            report(some.stop / cells)
        return np.ascontiguousarray(weights.transpose(0, 2, 1))


def _mixtures(cells: Nodes, resolution: int, colours: int) -> Float32[np.ndarray, "colours cells mixtures"]:
    """Smooth skies of each colour, and seeded random ones."""
    smooth = smooth_lights(cells, resolution)
    rng = np.random.default_rng(np.random.SeedSequence([0, _STAGE]))
    mixed = rng.standard_normal((colours, len(cells), MIXTURES))
    mixed[:, :, : smooth.shape[1] * colours] = 0
    for c in range(colours):
        mixed[c, :, c * smooth.shape[1] : (c + 1) * smooth.shape[1]] = smooth
    return mixed.astype(np.float32)


def _reduced(
    modes: np.ndarray, Q: np.ndarray, weights: np.ndarray, smooth: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """The principal modes among these, as many as leave out no more than LEFT_OUT, largest first."""
    colours, count, cells = weights.shape
    columns = weights.transpose(0, 2, 1).reshape(-1, count)
    skies = (smooth / np.linalg.norm(smooth, axis=0)).T @ weights.transpose(0, 2, 1)
    heavy = np.concatenate([columns, _SMOOTH_WEIGHT * skies.reshape(-1, count)])
    _, vectors = eigenvectors(gram(heavy.astype(np.float32)))
    turned_columns = turned(columns.astype(np.float32), vectors)
    squares = np.square(turned_columns, dtype=np.float64).sum(axis=0)
    whole = float(squares.sum())
    left = np.sqrt(np.maximum(whole - np.cumsum(squares), 0) / max(whole, 1e-300))
    kept = min(int(np.searchsorted(-left, -LEFT_OUT)) + 1, MOST_MODES, count)
    vectors = vectors[:, :kept]
    new_weights = turned_columns[:, :kept].reshape(colours, cells, kept).transpose(0, 2, 1)
    new_Q = np.stack([turned(Q[c], vectors) for c in range(colours)])
    return turned(modes, vectors), new_Q, np.ascontiguousarray(new_weights), float(left[kept - 1])


def _worst(parts: list[Bounced]) -> Bounced:
    return max(parts, key=lambda part: (part.bounces, part.remaining))


def _within(report: Share, low: float, high: float) -> Share:
    """A report of a part of the work, from ``low`` to ``high`` of it all."""
    return lambda share: report(low + (high - low) * share)
