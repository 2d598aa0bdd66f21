"""What glossy vertices see, and what their materials make of it: transport into exitant spherical harmonics, factored.

A matrix from lights to exitant coefficients of every vertex, (n + 1)² × lights × colours, is hundreds of kilobytes
a vertex. Its factors are small: what the vertex sees in each direction of a coarse cube, the sky or the light that
another vertex sends (``seen_from``), and the lobes of its material, the same for all its vertices but for two
factors of each colour (``lobes_of``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32, Normals, Positions, UInt16
from ..bases import exitant
from ..bases.cube_map import directions
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..scene.mesh import short_name
from .eye import vertex_points
from .hemisphere import lit_sides

CELLS = 16  # along a side of a face of the cube that vertices look into
SUBRAYS = 4  # of a cell
NONE = (1 << 25) - 1  # the vertex of a cell that shows none
_LANES = 1 << 22
_STAGE = 37  # keeps these random numbers apart from those of other stages
_TURNS = 4  # of the frame, over half a turn, that a BRDF is averaged over
_EVEN = 0.02  # a BRDF that differs less between them is isotropic
_ALIKE = 0.02  # RMS by which the highlights of a material's vertices may differ before it is told
_SMALLEST = 1e-6
_LOWEST = 1e-4  # cosine, that a BRDF is asked at

Report = Callable[[float], None]


@dataclass(frozen=True)
class Seen:
    """Cells above the horizon of each row, one row after the other.

    ``codes``: sky · 2²⁸ + surface · 2²⁵ + vertex, the first two the quarters of the cell that show the sky, and a lit
    surface; ``vertex`` (or NONE) one of those that the surface's light is known at.
    """

    counts: UInt16[np.ndarray, "rows"]
    texels: UInt16[np.ndarray, "entries"]  # face · 16² + row · 16 + column
    codes: Int32[np.ndarray, "entries"]
    rays: int


@dataclass(frozen=True)
class Lobes:
    """f of each row = matt/π + strength · the lobes of its table, colour by colour."""

    lobe_of: Int32[np.ndarray, "rows"]
    tables: Float32[np.ndarray, "lobes incident channels functions"]  # bases.exitant.lobe_table
    highlights: Float32[np.ndarray, "lobes halves differences azimuths 3"]  # bases.exitant.highlight_table
    matt: Float32[np.ndarray, "rows 3"]
    strength: Float32[np.ndarray, "rows 3"]
    reflectance: Float32[np.ndarray, "rows 3"]  # share of even light that leaves it
    error: float  # what the fit of the worst table leaves, RMS as a share
    notes: tuple[str, ...]


def least_width(order: int) -> float:
    """α of the narrowest microfacet lobe that harmonics of an order hold without ringing."""
    return 1.0 / (order + 1)


def glossy_rows(scene: Scene) -> Int32[np.ndarray, "rows"]:
    """Vertices with a normal whose material does not send light alike into all directions, ascending."""
    glossy = np.array([not material.is_lambertian for material in scene.materials])
    there = scene.normals.any(axis=1)
    return np.flatnonzero(glossy[scene.material_of_vertex] & there).astype(np.int32)


# ---- what is seen ------------------------------------------------------------------------------------


def cell_directions(cells: int, parts: int) -> Float32[np.ndarray, "cells parts² 3"]:
    """Middles of ``parts``² equal parts of every cell, cells in the order of texels."""
    face, row, column = (x.ravel() for x in np.indices((6, cells, cells)))
    inside = (np.arange(parts) + 0.5) / parts
    v = (row[:, None] + np.repeat(inside, parts)) * (2.0 / cells) - 1
    u = (column[:, None] + np.tile(inside, parts)) * (2.0 / cells) - 1
    d = directions(np.repeat(face, parts * parts), u.ravel(), v.ravel())
    return d.reshape(len(face), parts * parts, 3).astype(np.float32)


def seen_from(
    occluders: Occluders,
    scene: Scene,
    *,
    origins: Positions,
    normals: Normals,
    seed: int = 0,
    report: Report | None = None,
) -> Seen:
    """What each of some places sees above its horizon: a ray for every quarter of every cell.

    ``origins`` before they are lifted from their surface; ``normals`` unit length.
    """
    sent = _CellRays(occluders, scene, origins, normals)
    counts, texels, codes, rays = [], [], [], 0
    step = max(1, _LANES // (len(sent.middles) * SUBRAYS))
    for first in range(0, len(origins), step):
        rows = slice(first, min(first + step, len(origins)))
        found, u, v, above = sent.trace(rows)
        rng = np.random.default_rng(np.random.SeedSequence([seed, _STAGE, first]))
        cell_codes, shown = _coded(found, u, v, above, scene.triangles, rng)
        rays += int(above.sum())
        counts.append(shown.sum(axis=1))
        texels.append(np.nonzero(shown)[1].astype(np.uint16))
        codes.append(cell_codes[shown])
        if report is not None:
            report(rows.stop / len(origins))
    if not counts:
        return Seen(np.zeros(0, np.uint16), np.zeros(0, np.uint16), np.zeros(0, np.int32), 0)
    parts = (np.concatenate(part) for part in (counts, texels, codes))
    counts_, texels_, codes_ = parts
    return Seen(counts_.astype(np.uint16), texels_, codes_, rays)


class _CellRays:
    """Rays through the quarters of all cells."""

    def __init__(self, occluders: Occluders, scene: Scene, origins: Positions, normals: Normals) -> None:
        self._mi, self._scene = occluders.mi, occluders.scene
        mi = self._mi
        lifted = origins + np.float32(ray_offset(occluders.positions)) * normals
        self.middles = cell_directions(CELLS, 1)[:, 0]
        around = cell_directions(CELLS, 2).reshape(-1, 3)
        self._origin, self._normal, self._d, self._lit = (
            mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in a.T))
            for a in (lifted, normals, around, lit_sides(scene))
        )
        self._normals = normals

    def trace(self, rows: slice) -> tuple[np.ndarray, ...]:
        """Triangles (rows, cells, 4), −1 the sky, −2 what sends nothing; weights; and which are above the horizon."""
        import drjit as dr

        mi, each = self._mi, len(self.middles) * SUBRAYS
        count = rows.stop - rows.start
        lane = dr.arange(mi.UInt32, count * each)
        row = lane // dr.opaque(mi.UInt32, each)
        ray = lane - row * dr.opaque(mi.UInt32, each)
        row += dr.opaque(mi.UInt32, rows.start)
        d = dr.gather(mi.Vector3f, self._d, ray)
        above = dr.dot(dr.gather(mi.Vector3f, self._normal, row), d) > 0
        origin = mi.Point3f(dr.gather(mi.Vector3f, self._origin, row))
        hit = self._scene.ray_intersect_preliminary(mi.Ray3f(origin, d), active=above)
        met = above & hit.is_valid()
        lit = dr.dot(dr.gather(mi.Vector3f, self._lit, hit.prim_index, met), d) < 0
        outcome = dr.select(lit, mi.Int32(hit.prim_index), mi.Int32(-2))
        found = dr.select(met, outcome, dr.select(above, mi.Int32(-1), mi.Int32(-2)))
        u, v = (dr.select(met, w, mi.Float(0)) for w in (hit.prim_uv.x, hit.prim_uv.y))
        up = dr.select(above, mi.UInt32(1), mi.UInt32(0))
        dr.eval(found, u, v, up)
        shape = (count, len(self.middles), SUBRAYS)
        values = [a.numpy().reshape(shape) for a in (found, u, v)]
        return (*values, up.numpy().reshape(shape).astype(bool))


def _coded(
    found: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    above: np.ndarray,
    triangles: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Codes (rows, cells), and which cells have light to bring: one hit stands for all of a cell, one vertex for it."""
    sky = ((found == -1) & above).sum(axis=2)
    lit = found >= 0
    surface = lit.sum(axis=2)
    draw = rng.random((*sky.shape, 2), np.float32)
    wanted = np.minimum((draw[..., 0] * surface).astype(np.int64), np.maximum(surface - 1, 0))
    which = ((np.cumsum(lit, axis=2) - 1 == wanted[..., None]) & lit).argmax(axis=2)[..., None]
    triangle, u, v = (np.take_along_axis(a, which, axis=2)[..., 0] for a in (found, u, v))
    corner = (draw[..., 1] < u + v).astype(np.int64) + (draw[..., 1] < v)  # 2 by v, 1 by u, else 0
    vertex = np.where(surface > 0, triangles[np.maximum(triangle, 0), corner], NONE)
    codes = (sky.astype(np.int64) << 28) | (surface.astype(np.int64) << 25) | vertex
    return codes.astype(np.int32), (sky + surface) > 0


# ---- what materials make of it -----------------------------------------------------------------------


def lobes_of(scene: Scene, surfaces: SurfaceScene, rows: Int32[np.ndarray, "rows"], order: int) -> Lobes:
    """Tables of the materials of some vertices, and how each vertex differs from its material's.

    Light through a surface is left out, and whichever way a BRDF is brushed: both are told in ``notes``.
    """
    asked = _Asked(scene, surfaces, rows)
    material = scene.material_of_vertex[rows]
    kinds = np.unique(material)
    lobe_of = np.searchsorted(kinds, material).astype(np.int32)
    tables, highlights, notes, error = [], [], [], 0.0
    matt, strength, reflectance = (np.zeros((len(rows), 3), np.float32) for _ in range(3))
    for k, m in enumerate(kinds):
        own = np.flatnonzero(lobe_of == k)
        stands = own[scene.albedo[rows[own]].sum(axis=1).argmax()]
        values, spread = asked.table(int(stands))
        base = _matt_part(values)
        lobes = values - base / np.pi
        tables.append(exitant.lobe_table(lobes, order))
        highlights.append(exitant.highlight_table(asked.pairs(int(stands)) - base / np.pi))
        error = max(error, exitant.fit_error(values, order))
        factors, unlike = asked.factors(own, int(stands), base)
        matt[own], strength[own] = factors
        reflectance[own] = np.clip(matt[own] + strength[own] * exitant.mean_albedo(lobes), 0, 1)
        notes += _notes(scene.materials[m], spread=spread, unlike=unlike)
    return Lobes(
        lobe_of, np.stack(tables), np.stack(highlights), matt, strength, reflectance, error, tuple(notes)
    )


def _matt_part(values: exitant.BrdfValues) -> Float64[np.ndarray, "channels"]:
    """π times the least of a BRDF where neither angle is grazing: what leaves alike into all directions."""
    incident, z, _ = exitant.nodes()
    return np.pi * values[np.cos(incident) > 0.2][:, z > 0.2].min(axis=(0, 1, 2))


def _notes(material, *, spread: float, unlike: float) -> list[str]:
    name, notes = short_name(material.name), []
    if spread > _EVEN:
        notes.append(f"gloss of {name}: brushed, seen as if it were brushed all ways")
    if unlike > _ALIKE:
        notes.append(f"gloss of {name}: one roughness for all its vertices ({unlike:.0%} RMS off)")
    if material.transmission or "dielectric" in str(material.bsdf):
        notes.append(f"gloss of {name}: what it reflects; light that passes through is left out")
    return notes


class _Asked:
    """BSDFs at vertices, for any two directions of their own frames."""

    def __init__(self, scene: Scene, surfaces: SurfaceScene, rows: np.ndarray) -> None:
        self._mi, points = surfaces.mi, vertex_points(scene, (0.0, 0.0, 0.0))
        self._surfaces = surfaces  # the BSDFs below are bare pointers
        self._triangle, self._weights = points.triangle[rows, 0], points.weights[rows, 0]

    def values(
        self, rows: np.ndarray, wi: np.ndarray, wo: np.ndarray
    ) -> Float64[np.ndarray, "rows pairs channels"]:
        """f, 1/sr, for light from ``wo`` (pairs, 3) toward ``wi``; 0 where that is no number."""
        import drjit as dr

        mi, pairs = self._mi, len(wi)
        si_of, bsdf_of = self._surfaces.interactions(
            self._triangle[rows], self._weights[rows], eye=(0.0, 0.0, 0.0)
        )
        lane = dr.arange(mi.UInt32, len(rows) * pairs)
        row = lane // dr.opaque(mi.UInt32, pairs)
        pair = lane - row * dr.opaque(mi.UInt32, pairs)
        si = dr.gather(mi.SurfaceInteraction3f, si_of, row)
        toward, away = (
            dr.gather(mi.Vector3f, mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in d.T)), pair)
            for d in (wi, wo)
        )  # fmt: skip
        si.wi = toward
        f = dr.gather(mi.BSDFPtr, bsdf_of, row).eval(mi.BSDFContext(), si, away, si.is_valid()) / away.z
        f = dr.select(dr.isfinite(f), f, 0)
        dr.eval(f)
        of_colour = [np.array(c).reshape(len(rows), pairs) for c in (f.x, f.y, f.z)]
        return np.stack(of_colour, axis=2).astype(np.float64)

    def table(self, row: int) -> tuple[exitant.BrdfValues, float]:
        """f at ``exitant.nodes``, the mean over ways the frame may be turned; and how much these differ, RMS."""
        incident, z, azimuth = exitant.nodes()
        shape = len(incident), len(z), len(azimuth)
        i, e, a = (x.ravel() for x in np.indices(shape))
        sine = np.sqrt(1 - z * z)
        found = []
        for turn in np.arange(_TURNS) * (np.pi / _TURNS):
            wo = _polar(np.sin(incident)[i], np.cos(incident)[i], np.full(i.shape, turn))
            wi = _polar(sine[e], z[e], azimuth[a] + turn)
            found.append(self.values(np.array([row]), wi, wo)[0].reshape(*shape, 3))
        mean = np.mean(found, axis=0)
        weight = (np.sin(2 * incident)[:, None] * z)[:, :, None, None]
        whole = float((weight * mean**2).sum())
        off = max(float((weight * (f - mean) ** 2).sum()) for f in found)
        return mean, float(np.sqrt(off / whole)) if whole else 0.0

    def pairs(self, row: int) -> Float64[np.ndarray, "pairs 3"]:
        """f at ``exitant.half_angle_pairs``, the mean over ways the frame may be turned; 0 below the horizon."""
        one, other = exitant.half_angle_pairs()
        there = (one[:, 2] > _LOWEST) & (other[:, 2] > _LOWEST)
        found = np.zeros((len(one), 3))
        for turn in np.arange(_TURNS) * (np.pi / _TURNS):
            wi, wo = (_turned(d[there], turn) for d in (one, other))
            found[there] += self.values(np.array([row]), wi, wo)[0] / _TURNS
        return found

    def factors(
        self, own: np.ndarray, stands: int, base: np.ndarray
    ) -> tuple[tuple[np.ndarray, np.ndarray], float]:
        """matt (own, 3) and strength (own, 3) that fit each row's f best, and how far off the worst colour is."""
        wi, wo = _probes()
        weight = wi[:, 2] * wo[:, 2]
        lobes = self.values(np.array([stands]), wi, wo)[0] - base / np.pi
        f = self.values(own, wi, wo)
        matt, strength = np.zeros((2, len(own), 3))
        off, whole = 0.0, float((weight[:, None] * f**2).sum())
        for c in range(3):
            g, even = lobes[:, c], np.full(len(wi), 1 / np.pi)
            a, b, d = (weight * even * even).sum(), (weight * even * g).sum(), (weight * g * g).sum()
            p, q = f[:, :, c] @ (weight * even), f[:, :, c] @ (weight * g)
            if d * a - b * b > _SMALLEST * d * a:
                matt[:, c], strength[:, c] = (
                    (d * p - b * q) / (a * d - b * b),
                    (a * q - b * p) / (a * d - b * b),
                )
            else:
                matt[:, c] = p / a
            matt[:, c], strength[:, c] = np.maximum(matt[:, c], 0), np.maximum(strength[:, c], 0)
            left = f[:, :, c] - matt[:, c, None] * even - strength[:, c, None] * g
            off += float((weight * left**2).sum())
        return (matt, strength), float(np.sqrt(off / whole)) if whole else 0.0


def _turned(d: np.ndarray, angle: float) -> np.ndarray:
    """About the normal."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * d[:, 0] - s * d[:, 1], s * d[:, 0] + c * d[:, 1], d[:, 2]], axis=1)


def _polar(sine: np.ndarray, cosine: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1)


def _probes() -> tuple[np.ndarray, np.ndarray]:
    """Pairs of directions that tell a row's BRDF from its material's: in and beside the mirror direction."""
    angle = np.radians([10.0, 35.0, 60.0])
    across = np.pi - np.radians([0.0, 25.0, 90.0, 180.0])
    i, o, a = (x.ravel() for x in np.meshgrid(angle, angle, across, indexing="ij"))
    return _polar(np.sin(o), np.cos(o), a), _polar(np.sin(i), np.cos(i), 0 * i)
