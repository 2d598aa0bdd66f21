"""The surroundings as an emitter that looks for the openings of a room: the same light, less noise in the reference.

Directions chosen by radiance alone nearly all end in a wall. These go through a point of an opening, one of several
about as large as it is seen, or, a few, as ``cube_emitter`` chooses them, and are weighed by the density of both.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ..arrays import CubeMap, Float64
from .cube_emitter import cube_emitter

_BY_OPENING = 0.75  # of the samples
_FLAT = 1e-6  # cosine
_SELDOM = 0.05  # cosine by which an opening that is seen edge-on is chosen all the same
_BESIDE = 1e-4  # of an opening's size: from nearer to its plane it is not looked for, for it is a line


def opening_emitter(mi: ModuleType, cube: CubeMap, openings: Float64[np.ndarray, "openings 3 3"]) -> Any:
    """A cube map as an infinite emitter (``cube_emitter``), sampled through parallelograms.

    ``openings``: a corner and the two edges from it of each, metres. Light that comes another way is not lost: it is
    found as often as the other samples find it.
    """
    import drjit as dr

    plain: Any = type(cube_emitter(mi, cube))
    corners, first, second = (np.asarray(openings, np.float64)[:, k] for k in range(3))
    across = np.cross(first, second)
    areas = np.linalg.norm(across, axis=1)
    count, middles = len(areas), corners + (first + second) / 2

    def vectors(values: np.ndarray) -> Any:
        return mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in values.T))

    class OpeningEnvironment(plain):
        def __init__(self, props: Any) -> None:
            plain.__init__(self, props)
            self.sheets = [vectors(values) for values in (corners, first, second)]

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            chances, whole, beside = self._chances(it)
            share = dr.select(beside, 0.0, mi.Float(_BY_OPENING))
            through = sample.x < share
            rest = mi.Point2f((sample.x - share) / (1 - share), sample.y)
            rest.x = dr.select(through, 0.5, rest.x)
            ds, _ = plain.sample_direction(self, it, rest, active)
            which, left = self._chosen(chances, whole, sample.x / _BY_OPENING)
            corner, u, v = (dr.gather(mi.Vector3f, values, which, active) for values in self.sheets)
            place = corner + left * u + sample.y * v
            ds.d = dr.select(through, dr.normalize(place - mi.Vector3f(it.p)), ds.d)
            ds.p, ds.n = it.p + ds.d * ds.dist, -ds.d
            ds.pdf = self._density_of(it, ds, (chances, whole, beside), active)
            colour = self._colour(self._lookup(ds.d, active)[0], active)
            return ds, dr.select(ds.pdf > 0, colour / ds.pdf, 0)

        def _chances(self, it: Any) -> tuple[list[Any], Any, Any]:
            """How often each opening is chosen, about as its solid angle; their sum; whether one is edge-on."""
            origin, whole, chances = mi.Vector3f(it.p), mi.Float(0), []
            beside = dr.full(mi.Bool, False, dr.width(it.p))
            for k in range(count):
                area = float(areas[k])
                normal, middle = (mi.Vector3f(*x.tolist()) for x in (across[k] / areas[k], middles[k]))
                way = middle - origin
                height, square = dr.abs(dr.dot(way, normal)), dr.squared_norm(way) + area
                beside |= height < _BESIDE * area**0.5
                chances.append((height * dr.rsqrt(square) + _SELDOM) * area * dr.rcp(square))
                whole += chances[-1]
            return chances, whole, beside

        def _chosen(self, chances: list[Any], whole: Any, x: Any) -> tuple[Any, Any]:
            """The opening that a number from 0 to 1 falls to, and where between its bounds it lies."""
            want, before = dr.minimum(x, 1) * whole, mi.Float(0)
            which = dr.full(mi.UInt32, count - 1, dr.width(whole))
            left = dr.full(mi.Float, 0.5, dr.width(whole))
            for k, chance in enumerate(chances):
                here = (want >= before) & (want < before + chance)
                left = dr.select(here, (want - before) / chance, left)
                which = dr.select(here, mi.UInt32(k), which)
                before += chance
            return which, left

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return self._density_of(it, ds, self._chances(it), active)

        def _density_of(self, it: Any, ds: Any, of: tuple[list[Any], Any, Any], active: Any) -> Any:
            density, origin, (chances, whole, beside) = mi.Float(0), mi.Vector3f(it.p), of
            for k, chance in enumerate(chances):
                normal, corner, u, v = (
                    mi.Vector3f(*x.tolist()) for x in (across[k] / areas[k], corners[k], first[k], second[k])
                )
                cosine = dr.dot(ds.d, normal)
                distance = dr.dot(corner - origin, normal) / cosine
                place = origin + distance * ds.d - corner
                area = float(areas[k])  # a number of NumPy's would take the product for its own
                a, b = (dr.dot(dr.cross(*pair), normal) / area for pair in ((place, v), (u, place)))
                met = (dr.abs(cosine) > _FLAT) & (distance > 0) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
                density += dr.select(met, chance * distance * distance / (dr.abs(cosine) * area), 0)
            by_texel = plain.pdf_direction(self, it, ds, active)
            share = dr.select(beside, 0.0, mi.Float(_BY_OPENING))
            return share * density / whole + (1 - share) * by_texel

    return OpeningEnvironment(mi.Properties())
