"""The reference of bounced light: direct and indirect irradiance at receivers by Mitsuba's own ``path``.

Slow and plain. Each sample of a receiver asks for light once and looks once along a cosine-distributed ray: what that
ray finds shining is direct light (weighted with the other, balance heuristic), what it finds lit is indirect light,
which ``path`` works out with the scene's own BSDFs to any depth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import CubeMap, Float64, Int32, Positions
from ..errors import InputError
from ..material import Material
from ..rays.offset import ray_offset
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..scene.variant import mitsuba
from .cube_emitter import cube_emitter
from .lamps import SphereLamps
from .path_tracing import DEEPEST, ROULETTE_FROM, just_inside

_LANES = 1 << 21

Values = Float64[np.ndarray, "chosen 3"]
Report = Callable[[float], None]


@dataclass(frozen=True)
class LightWithVariance:
    """E / π at some receivers, without their albedo, and the variances of these means."""

    direct: Values
    direct_variance: Values
    indirect: Values
    indirect_variance: Values
    total_variance: Values  # of the sum: both parts share samples

    @property
    def total(self) -> Values:
        return self.direct + self.indirect


def as_diffuse(scene: Scene) -> Scene:
    """The scene as bounced light is baked: every surface Lambertian with its base colour, what emits still does."""
    plain = tuple(
        Material(
            material.name, material.colour, material.colour_texture,
            emission=material.emission, emission_texture=material.emission_texture,
        )
        for material in scene.materials
    )  # fmt: skip
    return replace(scene, materials=plain)


class LitScene:
    """A scene of Mitsuba's under its lights.

    Surfaces are seen and lit on both sides, as ``SurfaceScene`` makes them.

    Parameters
    ----------
    scene
        Triangles and materials.
    sky
        A cube map of radiance; it may be a basis function and below 0.
    lamps
        Spheres (black, and in the way of other light) and points.
    emission
        Whether the scene's luminous materials shine, from the side their normals are on.
    surfaces
        Of the scene, with ``emits`` as ``emission``, to be made only once for many lights.
    emitters
        Others of Mitsuba's, as dicts or objects.

    Raises InputError where nothing shines.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        sky: CubeMap | None = None,
        lamps: SphereLamps | None = None,
        emission: bool = False,
        surfaces: SurfaceScene | None = None,
        emitters: Sequence[Any] = (),
    ) -> None:
        self.scene, self.mi = scene, mitsuba()
        surfaces = surfaces or SurfaceScene(scene, emits=emission)
        lights = [*emitters, *([] if lamps is None else lamps_of_mitsuba(self.mi, lamps))]
        if sky is not None:
            lights.append(cube_emitter(self.mi, sky))
        self._lit = surfaces.lit_by(*lights)
        if not self._lit.emitters():
            raise InputError("lights", "nothing shines: give a sky, lamps, or a scene that emits")

    def light(
        self,
        receivers: Int32[np.ndarray, "chosen"],
        *,
        origins: Positions | None = None,
        bounces: int | None = None,
        samples: int = 1024,
        seed: int = 0,
        report: Report | None = None,
    ) -> LightWithVariance:
        """E / π at some vertices by ``samples`` paths each, with so many ``bounces`` (None: all of them).

        Samples come in independent sets, each stratified; the variances are those between the sets. A receiver stands
        at its place in ``origins`` (V, 3), those of a bake, or a thousandth of the way to the middle of one of its
        triangles; and a ray's offset above that. ``report`` hears the share done, 0 to 1.
        """
        strata = _strata(samples)
        if samples < 2 or (bounces is not None and bounces < 0):
            raise InputError(
                "reference", f"{samples} samples and {bounces} bounces, expected 2 and 0 or more"
            )
        scene = self.scene
        normals = scene.normals[receivers]
        own = origins is not None
        stand = origins[receivers] if own else just_inside(scene.positions, scene.triangles, receivers)
        stand = stand + ray_offset(scene.positions) * normals
        depth = DEEPEST if bounces is None else bounces + 1  # as ``path`` counts from what a receiver sees
        integrator = self.mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": ROULETTE_FROM})
        parts, step = [], max(1, _LANES // samples)
        for start in range(0, len(receivers), step):
            part = slice(start, min(start + step, len(receivers)))
            direct, found = self._samples(
                integrator, stand[part], normals[part], (samples // strata, strata), seed + 7919 * start
            )
            # With no bounce the looking ray brings nothing but direct light.
            indirect = np.zeros_like(found) if bounces == 0 else found
            parts.append(_moments(direct, indirect))
            if report is not None:
                report(part.stop / max(len(receivers), 1))
        if not parts:
            parts = [_moments(np.zeros((3, 0, 2)), np.zeros((3, 0, 2)))]
        return LightWithVariance(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _samples(
        self, integrator: Any, origins: np.ndarray, normals: np.ndarray, sets: tuple[int, int], seed: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Direct and indirect light (3, receivers, sets), the means of independent sets of stratified samples."""
        import drjit as dr

        mi, count, samples = self.mi, len(origins), sets[0] * sets[1]
        sampler = mi.load_dict({"type": "multijitter", "sample_count": sets[1]})
        sampler.set_samples_per_wavefront(sets[1])
        sampler.seed(seed, count * samples)
        lane = dr.arange(mi.UInt32, count * samples) // dr.opaque(mi.UInt32, samples)
        o, n = (
            dr.gather(
                mi.Point3f, mi.Point3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in a.T)), lane
            )
            for a in (origins, normals)
        )
        n = mi.Normal3f(n)
        here = dr.zeros(mi.SurfaceInteraction3f, count * samples)
        here.p = o
        ds, light = self._lit.sample_emitter_direction(here, sampler.next_2d(), True)
        cosine = dr.maximum(dr.dot(n, ds.d), 0) * dr.inv_pi
        asked = light * cosine * dr.select(ds.delta, 1, _balance(ds.pdf, cosine))
        d = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        chance = d.z * dr.inv_pi
        ray = mi.RayDifferential3f(o, mi.Frame3f(n).to_world(d))
        si = self._lit.ray_intersect(ray)
        emitter = si.emitter(self._lit)
        shining = emitter.eval(si)
        hit = mi.DirectionSample3f(self._lit, si, here)
        met = dr.select(emitter != None, self._lit.pdf_emitter_direction(here, hit), 0)  # noqa: E711 - a pointer array
        found, _, _ = integrator.sample(self._lit, sampler, ray)
        direct = asked + dr.select(dr.max(dr.abs(shining)) > 0, shining * _balance(chance, met), 0)
        dr.eval(direct, found, shining)
        wide = [np.array(x, np.float64).reshape(3, count, *sets) for x in (direct, found, shining)]
        return wide[0].mean(axis=-1), (wide[1] - wide[2]).mean(axis=-1)


def _strata(samples: int) -> int:
    """Of a set: a power of four, so that there are 16 sets or more."""
    return 4 ** int(np.log2(max(samples / 16, 1)) // 2)


def _balance(own: Any, other: Any) -> Any:
    """Veach's balance heuristic; 0 where neither could be."""
    import drjit as dr

    return dr.select(own > 0, own / dr.maximum(own + other, 1e-30), 0)


def _moments(direct: np.ndarray, indirect: np.ndarray) -> tuple[np.ndarray, ...]:
    """Means over the last axis, of independent sets, and their variances; in the order of ``LightWithVariance``."""
    out = []
    for values in (direct, indirect):
        wide = values.astype(np.float64)
        out += [wide.mean(axis=2).T, wide.var(axis=2, ddof=1).T / values.shape[2]]
    both = direct.astype(np.float64) + indirect
    return (*out, both.var(axis=2, ddof=1).T / both.shape[2])


def lamps_of_mitsuba(mi: Any, lamps: SphereLamps) -> list[Any]:
    """Mitsuba's points and spheres."""
    out = []
    for centre, radius, power in zip(lamps.centres, lamps.radii, lamps.power, strict=True):
        at, watts = [float(x) for x in centre], np.asarray(power, np.float64)
        if radius == 0:
            intensity = {"type": "rgb", "value": (watts / (4 * np.pi)).tolist()}
            out.append(mi.load_dict({"type": "point", "position": at, "intensity": intensity}))
            continue
        radiance = (watts / (4 * np.pi**2 * float(radius) ** 2)).tolist()
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
        out.append(
            mi.load_dict(
                {"type": "sphere", "center": at, "radius": float(radius), "emitter": emitter, "bsdf": black}
            )
        )
    return out
