"""What glossy materials make of the light that falls on vertices: transport into exitant harmonics, factored.

A matrix from lights to exitant coefficients of every vertex, (n + 1)² × lights × colours, is hundreds of kilobytes
a vertex. Its factors are small: what the vertex sees in each direction of a coarse cube, the sky or the light that
another vertex sends (``seen_cells``), and the lobes of its material, the same for all its vertices but for two
factors of each colour (``lobes_of``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32
from ..bases import exitant
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..scene.mesh import short_name
from .eye import vertex_points

_TURNS = 4  # of the frame, over half a turn, that a BRDF is averaged over
_EVEN = 0.02  # a BRDF that differs less between them is isotropic
_ALIKE = 0.02  # RMS by which the highlights of a material's vertices may differ before it is told
_SMALLEST = 1e-6
_LOWEST = 1e-4  # cosine, that a BRDF is asked at


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
