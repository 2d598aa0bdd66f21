"""Paths from the eye to a lamp whose light is not chosen yet: what they bring, and how it left the lamp.

A path tracer with next-event estimation and multiple importance sampling, as Mitsuba's ``path``, but for one
thing: a contribution is not added up. It is written down with the direction (and, on a panel, the place) in which
light left the lamp, so that every function of these can be multiplied to it afterwards.

Paths are parted by class, after their vertices seen from the lamp L to the eye E, S a mirror or clear glass, D what
scatters: **L S⁺ D … D E** is left to `light_tracing`, which finds it easily; **L S⁺ D … S⁺ E** (light through
glass, seen in a mirror) neither direction finds well: `seen_in_glass` joins the two, or, from the eye, a lamp of some
size is met by chance. **L S⁺ E** takes many more paths than the rest: `mirrored_lamp` makes those of some pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32
from ..camera import Camera
from ..rays.surfaces import SurfaceScene
from .steered_lamps import SteeredLamp, SteeredPanel, SteeredSky

_ROULETTE_FROM = 5  # surfaces met
_SURVIVAL = 0.95
_GLOSSY = 4  # times as dense: then a lamp is better met than aimed at, of marked places


@dataclass(frozen=True)
class PathRules:
    """Which paths count.

    Parameters
    ----------
    depth
        The most edges of a path, as ``max_depth`` of Mitsuba's: 2 is direct light.
    least_depth
        The fewest; 3 leaves direct light out.
    traced_from_lamp
        L S⁺ D … D E is left out here.
    by_chance
        L S⁺ D … S⁺ E is kept.
    marks_aimed
        Add 2 to the coordinate u of places that were aimed at, not met; and aim at all that is not in a narrow gloss.
    """

    depth: int = 12
    least_depth: int = 1
    traced_from_lamp: bool = False
    by_chance: bool = True
    marks_aimed: bool = False


@dataclass(frozen=True)
class EyeRecords:
    """Contributions of a launch, in slots of one entry a path: slot · lanes + lane."""

    carried: Float32[np.ndarray, "entries 4"]  # red, green, blue, u
    left: Float32[np.ndarray, "entries 4"]  # direction in which light left the lamp, v
    counts: np.ndarray  # (lanes,) uint32, slots filled


class EyePaths:
    """Paths of a camera's pixels in a scene with one lamp; for a box of light, `box_paths.BoxPaths`.

    Parameters
    ----------
    surfaces, lamp
        What is lit, and by what.
    camera, width, height
        The eye and its picture. Samples of a pixel are spread by a tent two pixels wide.
    rules
        Which paths count.
    """

    def __init__(
        self,
        surfaces: SurfaceScene,
        lamp: SteeredLamp,
        camera: Camera,
        *,
        width: int,
        height: int,
        rules: PathRules,
    ) -> None:
        import drjit as dr

        self.mi, self.lamp, self.rules = surfaces.mi, lamp, rules
        shining = lamp.emitter(surfaces.mi)
        self.scene = surfaces.lit_by() if shining is None else surfaces.lit_by(shining)
        self._leaves = 1 if isinstance(lamp, SteeredSky) else -1  # a sky's directions are those toward it
        self._view = PinholeRays(self.mi, camera, width=width, height=height)
        self._sampler: Any = None
        self._apart = dr.zeros(self.mi.Bool, width * height)
        self._slots = 2 * rules.depth
        self._loop = dr.syntax(type(self)._walk)

    def leave_mirrored(self, pixels: np.ndarray) -> None:
        """Leave L S⁺ E out of these pixels: somebody else traces it."""
        apart = np.zeros(self._view.width * self._view.height, bool)
        apart[pixels] = True
        self._apart = self.mi.Bool(apart)

    def trace(self, first_pixel: int, pixels: int, *, samples: int, seed: int) -> EyeRecords:
        """``samples`` paths through each of some pixels, those of a pixel side by side."""
        import drjit as dr

        mi = self.mi
        lanes = pixels * samples
        self._sampler = self._evenly(samples)
        self._sampler.seed(seed, lanes)
        lane = dr.arange(mi.UInt32, lanes)
        pixel = lane // dr.opaque(mi.UInt32, samples) + dr.opaque(mi.UInt32, first_pixel)
        ray = self._view.through(pixel, self._sampler.next_2d())
        carried = dr.empty(mi.Float, 4 * lanes * self._slots)
        left = dr.empty(mi.Float, 4 * lanes * self._slots)
        cells = self._cells(
            lane - (lane // dr.opaque(mi.UInt32, samples)) * dr.opaque(mi.UInt32, samples), samples
        )
        notes = Notes(mi, lane, lanes, carried, left, dr.gather(mi.Bool, self._apart, pixel))
        counts = self._loop(self, ray, cells, notes)
        dr.eval(counts, carried, left)
        dr.sync_thread()
        used = int(dr.max(counts)[0])
        kept = (np.asarray(buffer).reshape(-1, 4)[: used * lanes] for buffer in (carried, left))
        return EyeRecords(*kept, np.asarray(counts))

    def _evenly(self, samples: int) -> Any:
        """Random numbers of which those of a pixel are spread evenly, where their number is a square.

        So what varies slowly over a pixel, a lamp or the directions is hardly noisy; less than a variance says that
        takes samples for independent.
        """
        if self._sampler is not None and self._sampler.sample_count() == samples:
            return self._sampler
        kind = "multijitter" if math.isqrt(samples) ** 2 == samples else "independent"
        even = self.mi.load_dict({"type": kind, "sample_count": samples})
        even.set_samples_per_wavefront(samples)
        return even

    def _cells(self, number: Any, samples: int) -> tuple[Any, Any, Any]:
        """For each of a pixel's paths its own part of the lamp, as corner and size of a square in [0, 1)².

        k² of the paths share the lamp among them, those over and above take any place: so every part is as likely.
        """
        import drjit as dr

        mi, k = self.mi, int(samples**0.5)
        side = dr.opaque(mi.UInt32, k)
        row = number // side
        own = row < side
        size = dr.select(own, dr.opaque(mi.Float, 1 / k), 1)
        x, y = (dr.select(own, mi.Float(part) * size, 0) for part in (number - row * side, row))
        return x, y, size

    def _walk(self, ray: Any, cells: tuple[Any, Any, Any], notes: Notes) -> Any:
        """The loop over surfaces; how many slots each path has filled."""
        import drjit as dr

        mi, scene, rules = self.mi, self.scene, self.rules
        sampler, ctx = self._sampler, mi.BSDFContext()
        most, least = dr.opaque(mi.UInt32, rules.depth), dr.opaque(mi.UInt32, rules.least_depth)
        met = mi.UInt32(0)  # surfaces met
        slot = mi.UInt32(0)
        carry, eta = mi.Spectrum(1), mi.Float(1)
        before = dr.zeros(mi.Interaction3f, dr.width(notes.lane))
        mark = dr.opaque(mi.Float, 2.0 if rules.marks_aimed else 0.0)
        pdf, by_mirror = mi.Float(0), mi.Bool(True)  # of the last direction
        scattered, first_scatters = mi.Bool(False), mi.Bool(False)
        active = mi.Bool(True)
        while active:
            si = scene.ray_intersect(ray, mi.RayFlags.All, met == 0, active)
            lamp = si.emitter(scene, active)
            hit_lamp = active & (lamp != None)  # noqa: E711 - of every lane
            seen = hit_lamp & (met == 0)
            unseen = seen & si.is_valid()  # the eye looks through the lamp; behind the sky there is nothing

            # ---- the lamp met by chance, or in a mirror ------------------------------------------
            ds = mi.DirectionSample3f(scene, si, before)
            chance = scene.pdf_emitter_direction(before, ds, hit_lamp & ~by_mirror)
            share = dr.select(by_mirror, 1, self._of_met(pdf, chance))
            through = by_mirror & scattered  # L S⁺ D …
            ours = dr.select(scattered, ~through | self._keeps(first_scatters), ~notes.apart)
            counts = hit_lamp & ~seen & ours & (met + 1 <= most) & (met + 1 >= least)
            brought = carry * lamp.eval(si, counts) * share
            slot += notes.write(slot, brought, self._leaves * ray.d, self._place(si.p), counts)

            active_next = active & si.is_valid() & ~hit_lamp & (met + 1 < most)

            # ---- the lamp aimed at -----------------------------------------------------------------
            bsdf = si.bsdf()
            smooth = active_next & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            aim = sampler.next_2d()
            within = mi.Point2f(cells[0] + aim.x * cells[2], cells[1] + aim.y * cells[2])
            aim = dr.select(scattered, aim, within)
            ds, light = scene.sample_emitter_direction(si, aim, True, smooth)
            smooth &= ds.pdf != 0
            wo = si.to_local(ds.d)
            value, wo_pdf, sample, weight = bsdf.eval_pdf_sample(
                ctx, si, wo, sampler.next_1d(), sampler.next_2d(), active_next
            )
            share = dr.select(ds.delta, 1, 1 - self._of_met(wo_pdf, ds.pdf))
            brought = carry * value * light * share
            aimed = smooth & (met + 2 >= least)
            u, v = self._place(ds.p)
            slot += notes.write(slot, brought, self._leaves * ds.d, (u + mark, v), aimed)

            # ---- on ----------------------------------------------------------------------------------
            on = si.spawn_ray(si.to_world(sample.wo))
            mirror = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            first_scatters = dr.select((met == 0) & active_next, ~mirror, first_scatters)
            scattered |= active_next & ~mirror
            before = dr.select(active_next, mi.Interaction3f(si), before)
            pdf, by_mirror = sample.pdf, dr.select(active_next, mirror, by_mirror)
            carry = dr.select(active_next, carry * weight, carry)
            eta = dr.select(active_next, eta * sample.eta, eta)
            ray = dr.select(unseen, si.spawn_ray(ray.d), on)
            met = dr.select(active_next, met + 1, met)

            strength = dr.max(carry)
            alive = dr.minimum(strength * eta * eta, _SURVIVAL)
            roulette = active_next & (met >= _ROULETTE_FROM)
            carry[roulette] *= dr.rcp(alive)
            active_next &= ~roulette | (sampler.next_1d() < alive)
            active = unseen | (active_next & (strength > 0))
        return slot

    def _of_met(self, met: Any, aimed: Any) -> Any:
        """The share of what is met by chance, of these densities, in light that could have been aimed at too.

        Where places are marked, all or nothing, and nothing but in gloss: what is aimed at is spread evenly.
        """
        import drjit as dr

        if self.rules.marks_aimed:
            return dr.select(met > _GLOSSY * aimed, self.mi.Float(1), self.mi.Float(0))
        return power_heuristic(met, aimed)

    def _keeps(self, first_scatters: Any) -> Any:
        """Of paths that a mirror or glass brought from what scatters to the lamp."""
        from_eye, by_chance = not self.rules.traced_from_lamp, self.rules.by_chance
        return (first_scatters & from_eye) | (~first_scatters & by_chance)

    def _place(self, p: Any) -> tuple[Any, Any]:
        """Coordinates u and v of a point of the lamp."""
        return place_on(self.mi, self.lamp, p)


class PinholeRays:
    """Rays of a camera, and where a point falls in its picture.

    Parameters
    ----------
    mi
        Mitsuba.
    camera, width, height
        A pinhole; pixels in rows from the top.
    """

    def __init__(self, mi: Any, camera: Camera, *, width: int, height: int) -> None:
        import drjit as dr

        self.mi, self.width, self.height = mi, width, height
        focal = height / (2 * np.tan(np.radians(camera.vertical_fov_deg) / 2))  # pixels
        self._focal = dr.opaque(mi.Float, focal)
        self._eye = mi.Point3f(*(dr.opaque(mi.Float, x) for x in camera.eye))
        axes = camera.axes().tolist()
        self._right, self._up, self._back = (
            mi.Vector3f(*(dr.opaque(mi.Float, x) for x in axis)) for axis in axes
        )
        self._columns, self._middle = (
            dr.opaque(mi.UInt32, width),
            [dr.opaque(mi.Float, width / 2), dr.opaque(mi.Float, height / 2)],
        )

    @property
    def eye(self) -> Any:
        return self._eye

    @property
    def focal(self) -> Any:
        """Pixels: what is as far away as this is as wide as a pixel there."""
        return self._focal

    def through(self, pixel: Any, sample: Any) -> Any:
        """A ray through each pixel, at a place about its middle of which a tent two pixels wide is the density."""
        import drjit as dr

        mi = self.mi
        row = pixel // self._columns
        column = pixel - row * self._columns
        x = mi.Float(column) + 0.5 + _tent(sample.x) - self._middle[0]
        y = mi.Float(row) + 0.5 + _tent(sample.y) - self._middle[1]
        d = self._right * x - self._up * y - self._back * self._focal
        return mi.Ray3f(mi.Point3f(self._eye), dr.normalize(d))

    def pixel_of(self, p: Any, sample: Any) -> tuple[Any, Any, Any]:
        """The pixel that a point adds to, one of the four whose tents it is under, taken by their weights.

        Also whether there is one, and the solid angle of a pixel in that direction.
        """
        import drjit as dr

        mi = self.mi
        to = p - self._eye
        ahead = -dr.dot(to, self._back)
        x = dr.dot(to, self._right) / ahead * self._focal + self._middle[0]
        y = -dr.dot(to, self._up) / ahead * self._focal + self._middle[1]
        column, row = dr.floor(x - 0.5 + sample.x), dr.floor(y - 0.5 + sample.y)
        inside = (ahead > 0) & (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        pixel = mi.UInt32(dr.select(inside, row, 0)) * self._columns + mi.UInt32(dr.select(inside, column, 0))
        cosine = ahead / dr.norm(to)
        return pixel, inside, cosine * cosine * cosine / (self._focal * self._focal)


def _tent(u: Any) -> Any:
    """−1 to 1, most often near 0, from 0 to 1."""
    import drjit as dr

    return dr.select(u < 0.5, dr.sqrt(2 * u) - 1, 1 - dr.sqrt(dr.maximum(2 - 2 * u, 0)))


def power_heuristic(a: Any, b: Any) -> Any:
    """a² / (a² + b²), 0 where both are."""
    import drjit as dr

    a2 = a * a
    share = a2 / dr.fma(b, b, a2)
    return dr.select(dr.isfinite(share), share, 0)


def place_on(mi: Any, lamp: SteeredLamp, p: Any) -> tuple[Any, Any]:
    """Coordinates u and v, 0 to 1 along a panel's sides, of points of it; 0 of a spot's."""
    import drjit as dr

    if not isinstance(lamp, SteeredPanel):
        return mi.Float(0), mi.Float(0)
    corner = mi.Point3f(*lamp.corner)
    u, v = (
        dr.dot(p - corner, mi.Vector3f(*(np.array(side) / np.dot(side, side)).tolist()))
        for side in (lamp.side_u, lamp.side_v)
    )
    return u, v


class Notes:
    """Where paths write: every lane in its own column, so that nothing is ever added up at random.

    ``apart``: lanes that do not bring the lamp's own image in mirrors.
    """

    def __init__(self, mi: Any, lane: Any, lanes: int, carried: Any, left: Any, apart: Any = False) -> None:
        import drjit as dr

        self.apart = apart
        self._mi, self.lane, self._lanes = mi, lane, dr.opaque(mi.UInt32, lanes)
        self._carried, self._left = carried, left

    def write(self, slot: Any, brought: Any, direction: Any, place: tuple[Any, Any], active: Any) -> Any:
        """1 where something was written: what is finite and not zero."""
        import drjit as dr

        mi = self._mi
        total = brought.x + brought.y + brought.z
        there = active & (total > 0) & dr.isfinite(total)
        at = slot * self._lanes + self.lane
        dr.scatter(self._carried, mi.Vector4f(brought.x, brought.y, brought.z, place[0]), at, there)
        dr.scatter(self._left, mi.Vector4f(direction.x, direction.y, direction.z, place[1]), at, there)
        return dr.select(there, mi.UInt32(1), mi.UInt32(0))
