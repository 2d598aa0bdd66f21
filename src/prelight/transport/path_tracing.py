"""The reference: Mitsuba's own path tracer at a bake's receivers, under exactly its cube map."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ..arrays import CubeMap, Float64, Int32, Normals, Positions, Triangles
from ..bases import cube_map
from ..rays.mitsuba import triangle_mesh
from ..scene.variant import mitsuba
from .visibility import ray_offset

_LANES = 1 << 22


def path_traced_radiance(
    positions: Positions,
    triangles: Triangles,
    normals: Normals,
    *,
    receivers: Int32[np.ndarray, "chosen"],
    cube: CubeMap,
    samples: int = 1024,
    seed: int = 0,
) -> tuple[Float64[np.ndarray, "chosen 3"], Float64[np.ndarray, "chosen 3"]]:
    """Direct radiance of white diffuse receivers and the variance of that mean, by plugin ``path``.

    A ray looks straight down at each receiver (a thousandth of the way into one of its triangles, so
    as not to slip between two), and ``path`` samples light and surface as it does in any picture.
    """
    mi = mitsuba()
    import drjit as dr

    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}
    mesh = triangle_mesh(positions, triangles, normals=normals, bsdf=white)
    sky = _cube_emitter(mi, cube)
    scene = mi.load_dict({"type": "scene", "mesh": mesh, "sky": sky})
    integrator = mi.load_dict({"type": "path", "max_depth": 2, "rr_depth": 64})
    sampler = mi.load_dict({"type": "independent"})

    lift = 20 * ray_offset(positions) * normals[receivers]
    target = _just_inside(positions, triangles, receivers)
    mean, variance = np.empty((2, len(receivers), 3))
    step = max(1, _LANES // samples)
    for start in range(0, len(receivers), step):
        part = slice(start, min(start + step, len(receivers)))
        count = part.stop - part.start
        lane = dr.arange(mi.UInt32, count * samples) // dr.opaque(mi.UInt32, samples)
        origin = mi.Point3f(*(mi.Float(np.ascontiguousarray(x)) for x in (target + lift)[part].T))
        down = mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in -normals[receivers][part].T))
        sampler.seed(seed * 1_000_003 + start, count * samples)
        ray = mi.RayDifferential3f(dr.gather(mi.Point3f, origin, lane), dr.gather(mi.Vector3f, down, lane))
        radiance, _, _ = integrator.sample(scene, sampler, ray)
        values = np.array(radiance).reshape(3, count, samples).astype(np.float64)
        mean[part] = values.mean(axis=2).T
        variance[part] = values.var(axis=2, ddof=1).T / samples
    return mean, variance


def _just_inside(positions: Positions, triangles: Triangles, receivers: np.ndarray) -> Positions:
    """A point of one triangle of each receiver, a thousandth of the way to its centre."""
    triangle_of = np.zeros(len(positions), np.int64)
    triangle_of[triangles] = np.arange(len(triangles))[:, None]
    centre = positions[triangles[triangle_of[receivers]]].mean(axis=1)
    return positions[receivers] + np.float32(1e-3) * (centre - positions[receivers])


def _cube_emitter(mi: ModuleType, cube: CubeMap) -> Any:
    """A cube map as an infinite emitter, radiance constant over each texel."""
    import drjit as dr

    R = cube.shape[1]
    luminance = cube @ np.array([0.2126, 0.7152, 0.0722], np.float32) + 1e-6 * cube.max()
    power = (luminance * cube_map.solid_angles(R)).ravel()

    class CubeEnvironment(mi.Emitter):
        def __init__(self, props: Any) -> None:
            mi.Emitter.__init__(self, props)
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.SpatiallyVarying
            self.texels = mi.DiscreteDistribution(mi.Float(power))
            self.radiance = [mi.Float(np.ascontiguousarray(cube[..., c].ravel())) for c in range(3)]
            self.axes = [self._vectors(table) for table in (cube_map.AXIS, cube_map.U, cube_map.V)]
            self.radius = mi.Float(1.0)

        @staticmethod
        def _vectors(table: np.ndarray) -> Any:
            return mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in table.T))

        def set_scene(self, scene: Any) -> None:
            self.radius = dr.maximum(1e-3, scene.bbox().bounding_sphere().radius) * 4

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
            ds.dist = 2 * self.radius
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
