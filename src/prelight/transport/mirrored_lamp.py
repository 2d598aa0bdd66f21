"""The lamp itself, seen in mirrors and through glass: paths L S⁺ E.

A small lamp in curved glass fills a fraction of a pixel: of the paths that make the rest of a picture few meet it, and
those carry all the light. But chains of mirrors alone are cheap, and few pixels show any: so these have many more.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..camera import Camera
from ..rays.surfaces import SurfaceScene
from .eye_paths import EyeRecords, Notes, PathRules, PinholeRays, place_on
from .steered_lamps import SteeredLamp

_LANES = 1 << 20  # of a launch; few large ones are much faster
_TIMES = 64  # as many as of other paths
_MOST = 1 << 25  # of a picture
_SHARE = 0.75  # of all other paths, at most: then it costs a quarter of them
_TRIED = 16  # rays of a pixel that find whether it shows a mirror


class MirroredLamp:
    """Chains of mirrors and glass from some pixels to a lamp; parameters as those of `EyePaths`.

    Parameters
    ----------
    samples
        Of a pixel's other paths.
    seed
        Of the rays that find the pixels.

    Attributes
    ----------
    pixels
        Those that show a mirror or glass, in order; none where not more than ``samples`` chains each were affordable.
    samples
        Chains of each: a square number.
    """

    def __init__(
        self,
        surfaces: SurfaceScene,
        lamp: SteeredLamp,
        view: PinholeRays,
        *,
        rules: PathRules,
        samples: int,
        seed: int,
    ) -> None:
        import drjit as dr

        self.mi, self.lamp, self.rules, self._view = surfaces.mi, lamp, rules, view
        self._unlit = surfaces.lit_by()  # the eye looks through the lamp
        self.scene = surfaces.lit_by(lamp.emitter(surfaces.mi))
        self._loop = dr.syntax(MirroredLamp._walk)
        shown = self._showing(seed)
        budget = min(_MOST, int(_SHARE * samples * view.width * view.height))
        side = math.isqrt(min(_TIMES * samples, budget // max(1, len(shown))))
        self.samples = side * side
        self.pixels = shown if self.samples > samples else shown[:0]
        self._sampler = self.mi.load_dict({"type": "multijitter", "sample_count": max(1, self.samples)})
        self._sampler.set_samples_per_wavefront(max(1, self.samples))

    def _showing(self, seed: int) -> np.ndarray:
        """Pixels through which some ray meets what mirrors or lets pass without scattering."""
        import drjit as dr

        mi, count = self.mi, self._view.width * self._view.height
        sampler = mi.load_dict({"type": "multijitter", "sample_count": _TRIED})
        sampler.set_samples_per_wavefront(_TRIED)
        step, found = _LANES // _TRIED, []
        for first in range(0, count, step):
            lanes = min(step, count - first) * _TRIED
            sampler.seed(seed + first & 0x7FFFFFFF, lanes)
            pixel = dr.arange(mi.UInt32, lanes) // _TRIED + dr.opaque(mi.UInt32, first)
            si = self._unlit.ray_intersect(self._view.through(pixel, sampler.next_2d()))
            mirrors = si.is_valid() & mi.has_flag(si.bsdf().flags(), mi.BSDFFlags.Delta)
            found.append(np.array(mirrors).reshape(-1, _TRIED).any(axis=1))
        return np.flatnonzero(np.concatenate(found))

    @property
    def at_once(self) -> int:
        """How many pixels a launch takes."""
        return max(1, _LANES // self.samples)

    def trace(self, pixels: np.ndarray, *, seed: int) -> EyeRecords:
        """``samples`` chains through each of these pixels, those of a pixel side by side, in one slot."""
        import drjit as dr

        mi, lanes = self.mi, len(pixels) * self.samples
        self._sampler.seed(seed, lanes)
        lane = dr.arange(mi.UInt32, lanes)
        number = lane // dr.opaque(mi.UInt32, self.samples)
        pixel = dr.gather(mi.UInt32, mi.UInt32(pixels.astype(np.uint32).tolist()), number)
        ray = self._view.through(pixel, self._sampler.next_2d())
        carried, left = (dr.zeros(mi.Float, 4 * lanes) for _ in range(2))
        counts = self._loop(self, ray, Notes(mi, lane, lanes, carried, left))
        dr.eval(counts, carried, left)
        dr.sync_thread()
        return EyeRecords(
            np.asarray(carried).reshape(-1, 4), np.asarray(left).reshape(-1, 4), np.asarray(counts)
        )

    def _walk(self, ray: Any, notes: Notes) -> Any:
        """The loop over mirrors and glass; 1 where it ends at the lamp."""
        import drjit as dr

        mi, scene, sampler = self.mi, self.scene, self._sampler
        ctx = mi.BSDFContext()
        most, least = dr.opaque(mi.UInt32, self.rules.depth), dr.opaque(mi.UInt32, self.rules.least_depth)
        met, slot, carry, ray = mi.UInt32(0), mi.UInt32(0), mi.Spectrum(1), mi.Ray3f(ray)
        si = self._unlit.ray_intersect(ray)
        active = si.is_valid()
        while active:
            sample, weight = si.bsdf().sample(ctx, si, sampler.next_1d(), sampler.next_2d(), active)
            active &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta) & (met + 2 <= most)
            carry = dr.select(active, carry * weight, carry)
            active &= dr.max(carry) > 0
            ray = dr.select(active, si.spawn_ray(si.to_world(sample.wo)), ray)
            met += dr.select(active, mi.UInt32(1), mi.UInt32(0))
            si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)
            lamp = si.emitter(scene, active)
            ends = active & (lamp != None)  # noqa: E711 - of every lane
            counts = ends & (met + 1 >= least)
            brought = carry * lamp.eval(si, counts)
            slot += notes.write(slot, brought, -ray.d, place_on(mi, self.lamp, si.p), counts)
            active &= si.is_valid() & ~ends
        return slot


def mirrored_lamp(
    surfaces: SurfaceScene, lamp: SteeredLamp, camera: Camera, *, size: tuple[int, int], rules: PathRules,
    samples: int, seed: int,
) -> MirroredLamp | None:  # fmt: skip
    """Chains to a lamp that has an image in the mirrors and glass of a scene; None where there is none."""
    if lamp.is_point or not surfaces.delta.any():
        return None
    view = PinholeRays(surfaces.mi, camera, width=size[0], height=size[1])
    found = MirroredLamp(surfaces, lamp, view, rules=rules, samples=samples, seed=seed)
    return found if len(found.pixels) else None
