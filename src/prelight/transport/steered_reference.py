"""The reference for steered lamps: Mitsuba's own path tracer under the real light, an emitter written in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import Float64
from ..camera import Camera
from ..errors import InputError
from ..rays.surfaces import SurfaceScene
from .steered_lamps import SteeredBox, SteeredLamp, SteeredSky, SteeredSpot

_LANES = 1 << 18

Emission = Callable[[Any, Any, Any, Any], Any]
"""Of Mitsuba, a unit direction in which light leaves (of a sky, toward it), and u and v on a panel: intensity W/sr,
or radiance."""

_FAR = 1e6  # metres; the sky of a small scene


def steered_emitter(mi: Any, lamp: SteeredLamp, emission: Emission) -> Any:
    """The lamp as it really shines, for a scene of Mitsuba's. A point is not among them, nor a box of light."""
    import drjit as dr

    from .eye_paths import place_on

    if isinstance(lamp, SteeredSky):
        return _steered_sky(mi, emission)
    if isinstance(lamp, SteeredBox):
        raise InputError("lamp", "a box of light is no surface that shines")

    scale = 1 / (np.pi * lamp.radius**2) if isinstance(lamp, SteeredSpot) else 1.0

    class Shining(mi.Emitter):
        def __init__(self, props: Any) -> None:
            mi.Emitter.__init__(self, props)
            self.m_flags = mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying

        def _radiance(self, direction: Any, p: Any) -> Any:
            return scale * emission(mi, direction, *place_on(mi, lamp, p))

        def eval(self, si: Any, active: Any = True) -> Any:
            front = active & (si.wi.z > 0)
            return dr.select(front, self._radiance(si.to_world(si.wi), si.p), 0)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            ds = self.get_shape().sample_direction(it, sample, active)
            front = active & (dr.dot(ds.d, ds.n) < 0) & (ds.pdf != 0)
            ds.emitter = mi.EmitterPtr(self)
            return ds, dr.select(front, self._radiance(-ds.d, ds.p) / ds.pdf, 0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            there = self.get_shape().pdf_direction(it, ds, active)
            return dr.select(dr.dot(ds.d, ds.n) < 0, there, 0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return dr.select(dr.dot(ds.d, ds.n) < 0, self._radiance(-ds.d, ds.p), 0)

        def bbox(self) -> Any:
            return self.get_shape().bbox()

        def traverse(self, callback: Any) -> None:
            pass

    name = "prelight_steered"
    mi.register_emitter(name, Shining)
    return lamp.emitting_shape({"type": name})


def _steered_sky(mi: Any, emission: Emission) -> Any:
    import drjit as dr

    class Sky(mi.Emitter):
        def __init__(self, props: Any) -> None:
            mi.Emitter.__init__(self, props)
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.SpatiallyVarying

        def eval(self, si: Any, active: Any = True) -> Any:
            return dr.select(active, emission(mi, -si.wi, mi.Float(0), mi.Float(0)), 0)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            ds = mi.DirectionSample3f()
            ds.d = mi.warp.square_to_uniform_sphere(sample)
            ds.dist = mi.Float(_FAR)
            ds.p, ds.n, ds.uv = it.p + ds.d * ds.dist, -ds.d, sample
            ds.time, ds.delta, ds.emitter = it.time, False, mi.EmitterPtr(self)
            ds.pdf = mi.Float(1 / (4 * np.pi)) + 0 * ds.d.x
            return ds, emission(mi, ds.d, mi.Float(0), mi.Float(0)) / ds.pdf

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return mi.Float(1 / (4 * np.pi)) + 0 * ds.d.x

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return emission(mi, ds.d, mi.Float(0), mi.Float(0))

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f()

        def traverse(self, callback: Any) -> None:
            pass

    return Sky(mi.Properties())


def path_traced_picture(  # noqa: PLR0913 - a picture's size and quality
    surfaces: SurfaceScene,
    lamp: SteeredLamp,
    camera: Camera,
    *,
    emission: Emission | None,
    width: int,
    height: int,
    samples: int,
    depth: int = 12,
    seed: int = 0,
    sampler: str = "independent",
) -> tuple[Float64[np.ndarray, "height width 3"], Float64[np.ndarray, "height width 3"]]:
    """The picture by plugin ``path`` and the variance of its means; the lamp is not seen directly.

    Pixels are the same tents as those of basis images. With another ``sampler`` of Mitsuba's the samples of a pixel are
    spread evenly, and the variance told is more than there is. Without ``emission`` the lamp shines 1 everywhere.
    """
    import drjit as dr

    from .eye_paths import PinholeRays

    mi = surfaces.mi
    emitter = lamp.emitter(mi) if emission is None else steered_emitter(mi, lamp, emission)
    scene = surfaces.lit_by(emitter)
    options = {"max_depth": depth, "rr_depth": 5, "hide_emitters": True}
    integrator = mi.load_dict({"type": "path", **options})
    numbers = mi.load_dict({"type": sampler, "sample_count": samples})
    if numbers.sample_count() != samples:
        raise InputError("samples", f"{samples}, but sampler {sampler} takes {numbers.sample_count()}")
    numbers.set_samples_per_wavefront(samples)
    view = PinholeRays(mi, camera, width=width, height=height)
    step = max(1, _LANES // samples)
    means, variances = [], []
    for first in range(0, width * height, step):
        count = min(step, width * height - first)
        numbers.seed((seed * 1_000_003 + first) & 0x7FFFFFFF, count * samples)
        lane = dr.arange(mi.UInt32, count * samples)
        pixel = lane // dr.opaque(mi.UInt32, samples) + dr.opaque(mi.UInt32, first)
        ray = mi.RayDifferential3f(view.through(pixel, numbers.next_2d()))
        radiance, _, _ = integrator.sample(scene, numbers, ray)
        values = np.array(radiance).reshape(3, count, samples).astype(np.float64)
        means.append(values.mean(axis=2).T)
        variances.append(values.var(axis=2, ddof=1).T / samples)
    return tuple(np.concatenate(part).reshape(height, width, 3) for part in (means, variances))  # ty: ignore
