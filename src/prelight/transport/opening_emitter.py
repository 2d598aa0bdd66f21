"""The surroundings as an emitter that looks for the openings of a room: the same light, less noise in the reference.

Directions chosen by radiance alone nearly all end in a wall. These go through a point of an opening, or, a few,
as ``cube_emitter`` chooses them, and are weighed by the density of both.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ..arrays import CubeMap, Float64
from .cube_emitter import cube_emitter

_BY_OPENING = 0.75  # of the samples
_FLAT = 1e-6  # cosine
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
    count = len(areas)

    def vectors(values: np.ndarray) -> Any:
        return mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in values.T))

    class OpeningEnvironment(plain):
        def __init__(self, props: Any) -> None:
            plain.__init__(self, props)
            self.sheets = [vectors(values) for values in (corners, first, second)]

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            share = self._by_opening(it)
            through = sample.x < share
            rest = mi.Point2f((sample.x - share) / (1 - share), sample.y)
            rest.x = dr.select(through, 0.5, rest.x)
            ds, _ = plain.sample_direction(self, it, rest, active)
            of = dr.minimum(sample.x, _BY_OPENING) * (count / _BY_OPENING)
            which = dr.minimum(mi.UInt32(of), count - 1)
            corner, u, v = (dr.gather(mi.Vector3f, values, which, active) for values in self.sheets)
            place = corner + (of - mi.Float(which)) * u + sample.y * v
            ds.d = dr.select(through, dr.normalize(place - mi.Vector3f(it.p)), ds.d)
            ds.p, ds.n = it.p + ds.d * ds.dist, -ds.d
            ds.pdf = self.pdf_direction(it, ds, active)
            colour = self._colour(self._lookup(ds.d, active)[0], active)
            return ds, dr.select(ds.pdf > 0, colour / ds.pdf, 0)

        def _by_opening(self, it: Any) -> Any:
            beside = dr.full(mi.Bool, False, dr.width(it.p))
            for normal, corner, area in zip(across / areas[:, None], corners, areas, strict=True):
                height = dr.dot(
                    mi.Vector3f(it.p) - mi.Vector3f(*corner.tolist()), mi.Vector3f(*normal.tolist())
                )
                beside |= dr.abs(height) < float(_BESIDE * area**0.5)
            return dr.select(beside, 0.0, mi.Float(_BY_OPENING))

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            density, origin = mi.Float(0), mi.Vector3f(it.p)
            for k in range(count):
                normal, corner, u, v = (
                    mi.Vector3f(*x.tolist()) for x in (across[k] / areas[k], corners[k], first[k], second[k])
                )
                cosine = dr.dot(ds.d, normal)
                distance = dr.dot(corner - origin, normal) / cosine
                place = origin + distance * ds.d - corner
                area = float(areas[k])  # a number of NumPy's would take the product for its own
                a, b = (dr.dot(dr.cross(*pair), normal) / area for pair in ((place, v), (u, place)))
                met = (dr.abs(cosine) > _FLAT) & (distance > 0) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
                density += dr.select(met, distance * distance / (dr.abs(cosine) * area), 0)
            by_texel = plain.pdf_direction(self, it, ds, active)
            share = self._by_opening(it)
            return share * density / count + (1 - share) * by_texel

    return OpeningEnvironment(mi.Properties())
