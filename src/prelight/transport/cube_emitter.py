"""A cube map as an emitter of Mitsuba's, so that the reference sees exactly our texels."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ..arrays import CubeMap
from ..bases import cube_map

_FAR = 1e9  # metres, beyond any scene: an emitter written in Python is not told the size of its scene


def cube_emitter(mi: ModuleType, cube: CubeMap) -> Any:
    """A cube map as an infinite emitter, radiance constant over each texel; it may be below 0, as a basis function's.

    Directions are chosen by the magnitude of the radiance.
    """
    import drjit as dr

    R = cube.shape[1]
    magnitude = np.abs(cube)
    luminance = magnitude @ np.array([0.2126, 0.7152, 0.0722], np.float32) + 1e-6 * magnitude.max()
    power = (luminance * cube_map.solid_angles(R)).ravel()

    class CubeEnvironment(mi.Emitter):
        def __init__(self, props: Any) -> None:
            mi.Emitter.__init__(self, props)
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.SpatiallyVarying
            self.texels = mi.DiscreteDistribution(mi.Float(power))
            self.radiance = [mi.Float(np.ascontiguousarray(cube[..., c].ravel())) for c in range(3)]
            self.axes = [self._vectors(table) for table in (cube_map.AXIS, cube_map.U, cube_map.V)]

        @staticmethod
        def _vectors(table: np.ndarray) -> Any:
            return mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in table.T))

        def _lookup(self, d: Any, active: Any) -> tuple[Any, Any, Any]:
            """Texel, u and v of a direction."""
            x, y, z = dr.abs(d.x), dr.abs(d.y), dr.abs(d.z)
            major = dr.select(
                (x >= y) & (x >= z), mi.UInt32(0), dr.select(y >= z, mi.UInt32(1), mi.UInt32(2))
            )
            along = dr.select(major == 0, d.x, dr.select(major == 1, d.y, d.z))
            face = 2 * major + dr.select(along < 0, mi.UInt32(1), mi.UInt32(0))
            u = dr.dot(d, dr.gather(mi.Vector3f, self.axes[1], face, active)) / dr.abs(along)
            v = dr.dot(d, dr.gather(mi.Vector3f, self.axes[2], face, active)) / dr.abs(along)
            column, row = (mi.UInt32(dr.clip((t + 1) * (R / 2), 0, R - 1)) for t in (u, v))
            return (face * R + row) * R + column, u, v

        def _colour(self, texel: Any, active: Any) -> Any:
            return mi.Color3f(*(dr.gather(mi.Float, channel, texel, active) for channel in self.radiance))

        def _density(self, texel: Any, u: Any, v: Any, active: Any) -> Any:
            """Per solid angle: dω = du dv / (1 + u² + v²)^(3/2)."""
            r2 = 1 + u * u + v * v
            return self.texels.eval_pmf_normalized(texel, active) * (R * R / 4) * r2 * dr.sqrt(r2)

        def eval(self, si: Any, active: Any = True) -> Any:
            return self._colour(self._lookup(-si.wi, active)[0], active)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            texel, first = self.texels.sample_reuse(sample.x, active)
            face, inside = texel // (R * R), texel % (R * R)
            u = (mi.Float(inside % R) + first) * (2 / R) - 1
            v = (mi.Float(inside // R) + sample.y) * (2 / R) - 1
            axis, right, down = (dr.gather(mi.Vector3f, table, face, active) for table in self.axes)
            ds = mi.DirectionSample3f()
            ds.d = dr.normalize(axis + u * right + v * down)
            ds.dist = mi.Float(_FAR)
            ds.p = it.p + ds.d * ds.dist
            ds.n = -ds.d
            ds.uv, ds.time, ds.delta, ds.emitter = sample, it.time, False, mi.EmitterPtr(self)
            ds.pdf = self._density(texel, u, v, active)
            return ds, self._colour(texel, active) / ds.pdf

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return self._density(*self._lookup(ds.d, active), active)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return self._colour(self._lookup(ds.d, active)[0], active)

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f()

        def traverse(self, callback: Any) -> None:
            pass

    return CubeEnvironment(mi.Properties())
