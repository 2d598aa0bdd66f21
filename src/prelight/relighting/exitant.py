"""Gloss seen from anywhere: the light that falls on a layer's glossy vertices, as exitant spherical harmonics.

What is kept is factored (``transport.exitant``): what a vertex sees, and what its material makes of light from any
angle. So any light comes in: a sky, the light of all surfaces (every bounce, every layer), single lights. The result
is (n + 1)² coefficients a colour for each glossy vertex, and a picture costs their sum toward the eye.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import Float32, Int32, Radiance, UInt16
from ..bases import exitant
from ..bases.cube_map import directions, solid_angles
from ..bases.spherical_harmonics import components, count
from ..errors import DamagedBakeError, InputError
from ..lighting.quantities import Triple
from ..storage.bake import Bake
from .exitant_kernels import SINES, exitant_coefficients, exitant_toward
from .pixel_gloss_kernels import recurrence, shine_of_corners

CELLS = 16  # a side of a face
_NONE = (1 << 25) - 1
_GRAZING = 0.05  # cosine: what is seen flatter than this is seen as at this
_LARGEST = 1e6
MOST_PANES = 1024

_NO_SOURCES = (np.zeros((0, 3), np.float32),) * 2

CellLight = Float32[np.ndarray, "6 cells cells 3"] | Float32[np.ndarray, "panes 6 cells cells 3"]
Coefficients = Float32[np.ndarray, "rows 3 functions"]
Lights = tuple[Float32[np.ndarray, "rows lights 3"], Float32[np.ndarray, "rows lights 3"]]


@dataclass(frozen=True)
class StoredExitant:
    """The arrays of a glossy part, checked; their meaning is in docs/bake-format.md."""

    rows: Int32[np.ndarray, "rows"]
    counts: UInt16[np.ndarray, "rows"]
    texels: UInt16[np.ndarray, "entries"]
    codes: Int32[np.ndarray, "entries"]
    lobe_of: Int32[np.ndarray, "rows"]
    lobes: Float32[np.ndarray, "lobes incident 3 functions"]
    highlights: Float32[np.ndarray, "lobes halves differences azimuths 3"]
    matt: Float32[np.ndarray, "rows 3"]
    strength: Float32[np.ndarray, "rows 3"]
    reflectance: Float32[np.ndarray, "rows 3"]
    panes: UInt16[np.ndarray, "entries"] | None = None


class Exitant:
    """Glossy vertices of a scene.

    Parameters
    ----------
    stored
        See ``StoredExitant``.
    positions, normals, albedo
        ``(V, 3)`` of all vertices; ``albedo`` is what irradiance is multiplied with to be shown.

    Attributes
    ----------
    rows
        The glossy vertices, ascending.
    order
        n of the harmonics.
    """

    def __init__(
        self, stored: StoredExitant, *, positions: np.ndarray, normals: np.ndarray, albedo: np.ndarray
    ) -> None:
        self._stored, self.rows = stored, stored.rows
        self.order = exitant.order_of(stored.lobes.shape[3])
        self._positions, self._frames = positions[self.rows], frames(normals[self.rows])
        self._matt_above = stored.matt - albedo[self.rows]
        self._reflectance = albedo.astype(np.float32).copy()
        self._reflectance[self.rows] = stored.reflectance
        starts = np.concatenate([[0], np.cumsum(stored.counts, dtype=np.int64)])
        cells = stored.texels.astype(np.uint32)
        self.panes = 1 if stored.panes is None else int(stored.panes.max(initial=0)) + 1
        if stored.panes is not None:
            cells += stored.panes.astype(np.uint32) * np.uint32(6 * CELLS * CELLS)
        self._seen = (starts, cells, stored.codes)
        self._vertices = len(positions)

    @property
    def bytes(self) -> int:
        """Of what a change of light reads."""
        return self._stored.texels.nbytes + self._stored.codes.nbytes + self._stored.lobes.nbytes

    @property
    def functions(self) -> int:
        """Coefficients of a colour."""
        return count(self.order)

    @cached_property
    def _cells(self) -> tuple[Float32[np.ndarray, "cells 3"], Float32[np.ndarray, "cells"]]:
        """Directions and solid angles of the cells, in the order of texels."""
        face, row, column = (x.ravel() for x in np.indices((6, CELLS, CELLS)))
        d = directions(face, (2 * column + 1) / CELLS - 1, (2 * row + 1) / CELLS - 1)
        solid = np.tile(solid_angles(CELLS).ravel(), 6 * self.panes)
        return np.tile(d.astype(np.float32), (self.panes, 1)), solid

    @cached_property
    def _step_of(self) -> np.ndarray:
        """The bin of each step of the cosine."""
        angle = np.arccos((np.arange(SINES) + 0.5) / SINES)
        return np.minimum((angle * (exitant.INCIDENT / (0.5 * np.pi))).astype(np.int64), exitant.INCIDENT - 1)

    def coefficients(
        self,
        *,
        sky: CellLight | None = None,
        surfaces: Radiance | None = None,
        lights: Lights | None = None,
    ) -> Coefficients:
        """What leaves each row beside its matt part, in harmonics of the row's own frame.

        Parameters
        ----------
        sky
            ∫ L dω of each cell of a cube map of 16² to a face (``on_cells``); (panes, 6, 16, 16, 3) as each pane shows
            it, where the sky is seen through panes.
        surfaces
            (V, 3) irradiance / π before albedo at every vertex, of all bounces: what is seen mirrored. Glossy surfaces
            are mirrored as if they sent as much light alike into all directions.
        lights
            Unit directions toward single lights, and the irradiance that a surface facing each gets of it, shadows
            included: (G, K, 3) each, for each row. Their highlights are as wide as harmonics make them; see ``shine``.

        Raises InputError for arrays of other shapes.
        """
        sources, lit = self._sources(sky, surfaces), self._lights(lights)
        stored = self._stored
        surface = (self._frames, stored.lobe_of, stored.strength)
        out = np.empty((len(self.rows), 3, self.functions), np.float32)
        exitant_coefficients(self._seen, self._cells, sources, surface, lit, stored.lobes, self._step_of, out)
        return out

    def shine(
        self, eye: Triple, coefficients: Coefficients | None = None, *, lights: Lights | None = None
    ) -> Float32[np.ndarray, "rows 3"]:
        """Radiance of the rows toward a point without their matt part.

        ``coefficients`` as found, never below 0, whatever their fit says; ``lights`` as there, but by the BRDF itself,
        so that highlights are as sharp as the material's.
        """
        toward = _toward_eye(eye, self._positions, self._frames)
        total = np.zeros((len(self.rows), 3), np.float32)
        if coefficients is not None:
            for k, Y in enumerate(components(self.order, *toward.T)):
                total += coefficients[:, :, k] * Y[:, None]
            np.maximum(total, 0, out=total)
        if lights is not None:
            total += self._by_brdf(toward, _NO_SOURCES, self._lights(lights))
        return total

    def are_alike(self, corners: np.ndarray) -> np.ndarray:
        """(n,) bool: whether all of some rows (n, k) are of one material."""
        of = self._stored.lobe_of[corners]
        return (of == of[:, :1]).all(axis=1)

    def shine_between(
        self,
        eye: Triple,
        corners: np.ndarray,
        weights: Float32[np.ndarray, "points 3"],
        *,
        coefficients: Coefficients,
        lights: Lights | None = None,
        there: Lights | None = None,
    ) -> Float32[np.ndarray, "points 3"]:
        """``shine`` at points of triangles, by the normals there.

        ``corners`` (points, 3): places in ``rows`` of each triangle's vertices, ``weights`` add up to 1. ``lights`` are
        the rows', and interpolated; ``there`` those of the points, (points, K, 3) each.
        """
        stored = self._stored
        normals, positions, strength = (
            np.einsum("nk,nkc->nc", weights, values[corners])
            for values in (self._frames[:, 2], self._positions, stored.strength)
        )
        normals = _unit(normals)
        out = np.empty((len(weights), 3), np.float32)
        shine_of_corners(
            np.ascontiguousarray(corners), np.ascontiguousarray(weights), normals,
            _unit(np.asarray(eye, np.float32) - positions), self._frames, coefficients, recurrence(self.order),
            np.float32(_GRAZING), out,
        )  # fmt: skip
        local = frames(normals)
        of_points = (local, stored.lobe_of[corners[:, 0]], strength)
        toward = _toward_eye(eye, positions, local)
        if lights is not None:
            d, energies = self._lights(lights)
            way = _unit(np.einsum("nk,nklc->nlc", weights, d[corners]))
            energy = np.einsum("nk,nklc->nlc", weights, energies[corners])
            out += self._mirrored(of_points, (way, energy), toward)
        if there is not None:
            out += self._mirrored(of_points, self._lights(there, len(out)), toward)
        return out

    def _mirrored(
        self, surface: tuple, lights: Lights, toward: np.ndarray
    ) -> Float32[np.ndarray, "points 3"]:
        """Single lights by the BRDF itself: ``surface`` frames, tables and strengths of points."""
        none = (np.zeros(len(toward) + 1, np.int64), self._seen[1], self._seen[2])
        out = np.empty((len(toward), 3), np.float32)
        exitant_toward(
            none, self._cells, _NO_SOURCES, surface, lights, self._stored.highlights, toward, out
        )  # fmt: skip
        return out

    def exact(
        self,
        eye: Triple,
        *,
        sky: CellLight | None = None,
        surfaces: Radiance | None = None,
        lights: Lights | None = None,
    ) -> Float32[np.ndarray, "rows 3"]:
        """``shine`` of all light by the BRDF itself: nothing of it is in harmonics, and each eye costs as much."""
        toward = _toward_eye(eye, self._positions, self._frames)
        return self._by_brdf(toward, self._sources(sky, surfaces), self._lights(lights))

    def toward(
        self, eye: Triple, coefficients: Coefficients, irradiance: Radiance, *, lights: Lights | None = None
    ) -> Radiance:
        """(V, 3) what to add to albedo × ``irradiance`` (irradiance / π) for all light that leaves toward a point.

        The matt part of a row is its own, not its albedo: the difference is in what this returns, so no light is twice.
        """
        return self.added(self.shine(eye, coefficients, lights=lights), irradiance)

    def added(self, shine: Float32[np.ndarray, "rows 3"], irradiance: Radiance) -> Radiance:
        """(V, 3) a ``shine``, and what the rows' matt part is more than their albedo."""
        more = np.zeros((self._vertices, 3), np.float32)
        more[self.rows] = shine + self._matt_above * irradiance[self.rows]
        return more

    def _by_brdf(self, toward: np.ndarray, sources: tuple, lights: Lights) -> Float32[np.ndarray, "rows 3"]:
        stored = self._stored
        out = np.empty((len(self.rows), 3), np.float32)
        surface = (self._frames, stored.lobe_of, stored.strength)
        exitant_toward(self._seen, self._cells, sources, surface, lights, stored.highlights, toward, out)
        return out

    def _sources(self, sky: np.ndarray | None, surfaces: Radiance | None) -> tuple[np.ndarray, np.ndarray]:
        cells = 6 * CELLS * CELLS
        light, B = np.zeros((self.panes * cells, 3), np.float32), np.zeros((self._vertices, 3), np.float32)
        if sky is not None:
            if np.ndim(sky) == 4:
                sky = np.broadcast_to(sky, (self.panes, *np.shape(sky)))
            _expect("sky", sky[: self.panes], (self.panes, 6, CELLS, CELLS, 3))
            light = np.array(sky[: self.panes], np.float32, order="C").reshape(
                -1, 3
            )  # a broadcast is read only
        if surfaces is not None:
            _expect("surfaces", surfaces, B.shape)
            B = np.ascontiguousarray(self._reflectance * surfaces, np.float32)
        return light, B

    def _lights(self, lights: Lights | None, rows: int | None = None) -> Lights:
        rows = len(self.rows) if rows is None else rows
        d, energy = (np.zeros((rows, 0, 3), np.float32),) * 2 if lights is None else lights
        for given in (d, energy):
            _expect("lights", given, (rows, d.shape[1] if np.ndim(d) == 3 else 0, 3))
        return np.ascontiguousarray(d, np.float32), np.ascontiguousarray(energy, np.float32)


def _toward_eye(eye: Triple, positions: np.ndarray, local: np.ndarray) -> Float32[np.ndarray, "rows 3"]:
    """Unit directions to the eye in frames; what is seen from behind, or flatly, as if from a little above."""
    away = np.asarray(eye, np.float32) - positions
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), np.float32(1e-30))
    toward = np.einsum("rij,rj->ri", local, away)
    flat = toward[:, 2] < _GRAZING
    across = np.maximum(np.linalg.norm(toward[flat, :2], axis=1), np.float32(1e-10))
    toward[flat, :2] *= (np.float32((1 - _GRAZING**2) ** 0.5) / across)[:, None]
    toward[flat, 2] = _GRAZING
    return toward


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.float32(1e-20))


def _expect(name: str, values: np.ndarray, shape: tuple[int, ...]) -> None:
    if np.shape(values) != shape:
        raise InputError(name, f"shape {np.shape(values)}, expected {shape}")


def frames(normals: Float32[np.ndarray, "rows 3"]) -> Float32[np.ndarray, "rows 3 3"]:
    """Right-handed frames, rows tangent, bitangent, normal (Duff and others, Building an orthonormal basis, 2017)."""
    x, y, z = normals.astype(np.float64).T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1 / (sign + z)
    b = x * y * a
    tangent = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    bitangent = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.ascontiguousarray(np.stack([tangent, bitangent, normals], axis=1), np.float32)


def on_cells(cube: Float32[np.ndarray, "6 R R 3"]) -> Float32[np.ndarray, "6 16 16 3"]:
    """∫ L dω of each cell of 16² to a face, from the radiance of texels; those on a border are shared by area."""
    R = cube.shape[1]
    light = cube * solid_angles(R)[:, :, None]
    edges = np.arange(R + 1) * (CELLS / R)
    low = np.maximum(edges[None, :-1], np.arange(CELLS)[:, None])
    high = np.minimum(edges[None, 1:], np.arange(CELLS)[:, None] + 1)
    share = (np.maximum(high - low, 0) * (R / CELLS)).astype(np.float32)  # (cells, texels)
    return np.einsum("ir,frcx,jc->fijx", share, light, share, optimize=True).astype(np.float32)


def read_exitant(bake: Bake, at: str) -> Exitant | None:
    """The glossy part below ``at``; None where there is none. Raises DamagedBakeError.

    Shapes are checked with the manifest (``storage.exitant_part``); here every number that a kernel follows.
    """
    if f"{at}/rows" not in bake.manifest.arrays:
        return None
    names = (
        "rows",
        "counts",
        "texels",
        "codes",
        "lobe_of",
        "lobes",
        "highlights",
        "matt",
        "strength",
        "reflectance",
    )
    panes = bake.array(f"{at}/panes") if f"{at}/panes" in bake.manifest.arrays else None
    stored = StoredExitant(*(bake.array(f"{at}/{name}") for name in names), panes)
    if panes is not None and int(panes.max(initial=0)) >= MOST_PANES:
        raise DamagedBakeError(bake.path, f"{at}/panes names more than {MOST_PANES}")
    V, rows, codes = len(bake.receivers), stored.rows, stored.codes

    of_angles = (*stored.highlights.shape[:3], stored.highlights.shape[3] // 3, 3)
    stored = replace(stored, highlights=stored.highlights.reshape(of_angles))

    def damaged(what: str) -> DamagedBakeError:
        return DamagedBakeError(bake.path, f"{at}/{what}")

    if not (np.diff(rows) > 0).all() or rows[0] < 0 or rows[-1] >= V:
        raise damaged("rows does not name vertices, each once and ascending")
    if int(stored.counts.sum(dtype=np.int64)) > len(stored.texels):
        raise damaged("counts has more cells than texels lists")
    if int(stored.texels.max(initial=0)) >= 6 * CELLS * CELLS:
        raise damaged("texels names cells that a cube does not have")
    if not ((stored.lobe_of >= 0) & (stored.lobe_of < len(stored.lobes))).all():
        raise damaged("lobe_of names lobes that do not exist")
    shows = ((codes >> 25) & 7) > 0
    if (
        (codes[shows] & _NONE).max(initial=0) >= V
        or (codes < 0).any()
        or ((codes >> 28) + ((codes >> 25) & 7) > 4).any()
    ):
        raise damaged("codes names vertices that do not exist, or more than four quarters")
    for name in ("lobes", "highlights", "matt", "strength", "reflectance"):
        if not (np.abs(getattr(stored, name)) <= _LARGEST).all():
            raise damaged(f"{name} has values that are no numbers, or too large")
    receivers = bake.receivers
    lengths = np.linalg.norm(receivers.normals[rows].astype(np.float64), axis=1)
    if (np.abs(lengths - 1) > 1e-3).any():
        raise damaged("rows names vertices without a normal")
    return Exitant(stored, positions=receivers.positions, normals=receivers.normals, albedo=receivers.albedo)
