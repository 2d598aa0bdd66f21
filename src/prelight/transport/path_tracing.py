"""The reference: Mitsuba's own path tracer at a bake's receivers, under exactly its cube map."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ..arrays import CubeMap, Float64, Int32, Normals, Positions, Triangles
from ..rays.mitsuba import triangle_mesh
from ..rays.offset import ray_offset
from ..rays.surfaces import SurfaceScene
from ..scene.variant import mitsuba
from .cube_emitter import cube_emitter
from .eye import SeenPoints
from .opening_emitter import opening_emitter

_LANES = 1 << 22
_INSIDE = 1e-3  # of the way to a triangle's centre: a ray at a vertex could slip between two
DEEPEST = 1024  # bounces; Russian roulette ends nearly all paths long before
ROULETTE_FROM = 12
_LIFTS = 1  # offsets above the surface where a ray at a vertex begins: as in a bake

MeanAndVariance = tuple[Float64[np.ndarray, "chosen 3"], Float64[np.ndarray, "chosen 3"]]
Report = Callable[[float], None]


def path_traced_radiance(  # noqa: PLR0913 - the geometry is three of them
    positions: Positions,
    triangles: Triangles,
    normals: Normals,
    *,
    receivers: Int32[np.ndarray, "chosen"],
    cube: CubeMap,
    samples: int = 1024,
    seed: int = 0,
    report: Report | None = None,
) -> MeanAndVariance:
    """Direct radiance of white diffuse receivers and the variance of that mean, by plugin ``path``.

    A ray looks straight down at each receiver (a thousandth of the way into one of its triangles, so
    as not to slip between two), and ``path`` samples light and surface as it does in any picture.
    ``report`` hears the share done, 0 to 1.
    """
    mi = mitsuba()
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}
    mesh = triangle_mesh(positions, triangles, normals=normals, bsdf=white)
    scene = mi.load_dict({"type": "scene", "mesh": mesh, "sky": cube_emitter(mi, cube)})
    lift = _LIFTS * ray_offset(positions) * normals[receivers]
    origin = just_inside(positions, triangles, receivers) + lift
    there = np.ones(len(receivers), bool)
    values = _paths(scene, (origin, -normals[receivers], there), samples=samples, seed=seed, report=report)
    return _mean_and_variance(values, points=1)


def path_traced_view(  # noqa: PLR0913
    surfaces: SurfaceScene,
    points: SeenPoints,
    *,
    cube: CubeMap,
    receivers: Int32[np.ndarray, "chosen"] | None = None,
    bounces: int | None = 0,
    samples: int = 1024,
    seed: int = 0,
    openings: Float64[np.ndarray, "openings 3 3"] | None = None,
    lights: Sequence[Any] = (),
    report: Report | None = None,
) -> MeanAndVariance:
    """Radiance toward the eye and the variance of that mean, by plugin ``path`` with the scene's BSDFs.

    Direct light, and what arrives by so many ``bounces`` (None: all of them).

    The ``samples`` of a receiver (at least two a point) are shared by its points: those of a pixel are looked at
    from the eye, a vertex from close by. As in a bake a vertex that faces away from the eye is dark, if it is
    not Lambertian: then it is looked at along its normal. Unlike a bake, mirrors show the environment.

    ``openings`` of a room (``opening_emitter``): light is looked for there, and the mean has less noise. ``lights``:
    what Mitsuba makes emitters of, in the scene.
    """
    chosen = np.arange(len(points)) if receivers is None else receivers
    triangle, weights = points.triangle[chosen], points.weights[chosen]
    look = _looks_at_vertices if points.at_vertices else _looks_from_eye
    rays = look(surfaces, triangle.ravel(), weights.reshape(-1, 2), points.eye)
    mi = surfaces.mi
    sky = cube_emitter(mi, cube) if openings is None else opening_emitter(mi, cube, openings)
    scene = surfaces.lit_by(sky, *lights)
    each = max(2, samples // points.samples)
    depth = DEEPEST if bounces is None else 2 + bounces
    values = _paths(scene, rays, depth=depth, samples=each, seed=seed, report=report)
    return _mean_and_variance(values, points=points.samples)


def _looks_from_eye(surfaces: SurfaceScene, triangle: np.ndarray, weights: np.ndarray, eye: Any) -> tuple:
    si, _ = surfaces.interactions(triangle, weights, eye=eye)
    origin = np.broadcast_to(np.float32(eye), (len(triangle), 3))
    there = triangle >= 0
    away = np.where(there[:, None], si.p.numpy().T - origin, [0, 0, 1])
    return origin, away / np.linalg.norm(away, axis=1, keepdims=True), there


def _looks_at_vertices(surfaces: SurfaceScene, triangle: np.ndarray, weights: np.ndarray, eye: Any) -> tuple:
    si, _ = surfaces.interactions(triangle, weights, eye=eye)
    inside, _ = surfaces.interactions(triangle, weights + _INSIDE * (np.float32(1 / 3) - weights), eye=eye)
    toward = np.float32(eye) - si.p.numpy().T
    toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-30)
    normal = si.sh_frame.n.numpy().T
    lambertian = surfaces.lambertian[np.where(triangle >= 0, surfaces.material_of[triangle], 0)]
    there = (triangle >= 0) & (lambertian | (si.wi.z.numpy() > 0))
    toward = np.where((lambertian & there)[:, None], normal, np.where(there[:, None], toward, [0, 0, 1]))
    origin = inside.p.numpy().T + _LIFTS * surfaces.offset * toward
    return origin, -toward, there


def _paths(
    scene: Any, rays: tuple, *, samples: int, seed: int, report: Report | None, depth: int = 2
) -> Iterator[np.ndarray]:
    """Radiance (3, rays, samples) of some rays after the other; 0 where a ray is not ``there``."""
    mi = mitsuba()
    import drjit as dr

    integrator = mi.load_dict(
        {"type": "path", "max_depth": depth, "rr_depth": ROULETTE_FROM, "hide_emitters": True}
    )
    sampler = mi.load_dict({"type": "independent"})
    origins, directions, there = rays
    step = max(1, _LANES // samples)
    for start in range(0, len(origins), step):
        part = slice(start, min(start + step, len(origins)))
        count = part.stop - part.start
        lane = dr.arange(mi.UInt32, count * samples) // dr.opaque(mi.UInt32, samples)
        o, d = (
            mi.Point3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in a[part].T))
            for a in (origins, directions)
        )
        active = dr.gather(mi.Bool, mi.Bool(np.ascontiguousarray(there[part])), lane)
        sampler.seed(seed * 1_000_003 + start, count * samples)
        ray = mi.RayDifferential3f(
            dr.gather(mi.Point3f, o, lane), mi.Vector3f(dr.gather(mi.Point3f, d, lane))
        )
        radiance, _, _ = integrator.sample(scene, sampler, ray, active=active)
        radiance = dr.select(active, radiance, 0)
        yield np.array(radiance).reshape(3, count, samples)
        if report is not None:
            report(part.stop / len(origins))


def _mean_and_variance(parts: Iterator[np.ndarray], *, points: int) -> MeanAndVariance:
    """Of receivers with so many points each, which have samples of their own."""
    means, variances = [], []
    for values in parts:
        wide = values.astype(np.float64)
        means.append(wide.mean(axis=2).T)
        variances.append(wide.var(axis=2, ddof=1).T / values.shape[2])
    mean = np.concatenate(means).reshape(-1, points, 3).mean(axis=1)
    return mean, np.concatenate(variances).reshape(-1, points, 3).sum(axis=1) / points**2


def just_inside(positions: Positions, triangles: Triangles, receivers: np.ndarray) -> Positions:
    """A point of one triangle of each receiver, a thousandth of the way to its centre."""
    triangle_of = np.zeros(len(positions), np.int64)
    triangle_of[triangles] = np.arange(len(triangles))[:, None]
    centre = positions[triangles[triangle_of[receivers]]].mean(axis=1)
    return positions[receivers] + np.float32(_INSIDE) * (centre - positions[receivers])
