"""Light through glass and off mirrors onto what scatters, traced from the lamp and joined to the eye.

Paths L S⁺ D … D E: from the lamp by at least one mirror or clear glass, then at once or after scattering further to
the eye. From there they would be met by chance alone. Every surface that scatters is joined to the eye; what
arrives in a pixel is added up in the order of the paths, not as it comes.

Where the lamp meets mirrors and glass is searched first: most paths begin there, and no direction is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Float64
from ..camera import Camera
from ..rays.surfaces import SurfaceScene
from .eye_paths import PathRules, PinholeRays, place_on
from .seen_in_glass import Arrivals, Seen, SeenInGlass
from .shading_normals import for_smoothed
from .steered_lamps import SteeredPanel, SteeredSpot

_BANDS, _SECTORS = 256, 512  # cells of equal solid angle
_SEARCHED = 16  # directions in each
# Shares of the paths that go to all cells alike, whatever was found, and alike to cells with S; the others go where
# more reached the eye. From another place of a panel light goes elsewhere: there a direction tells less.
_SHARES = {True: (0.05, 0.35), False: (0.15, 0.45)}  # of a spot, or not
_PILOT = 1 << 16
_ROULETTE_FROM = 5
_SURVIVAL = 0.95


@dataclass(frozen=True)
class Splats:
    """What some light-traced paths bring to pixels, in the order of the paths and of their surfaces."""

    pixel: np.ndarray  # (splats,) int64
    particle: np.ndarray  # (splats,) int64, row of ``left``
    colour: Float32[np.ndarray, "splats 4"]  # red, green, blue and nothing
    left: Float32[np.ndarray, "particles 5"]  # direction in which it left the lamp, u, v

    def and_seen(self, more: Seen) -> Splats:
        """With what the same paths bring to what is seen in glass, behind the rest."""
        return Splats(
            np.concatenate([self.pixel, more.pixel]), np.concatenate([self.particle, more.particle]),
            np.concatenate([self.colour, more.colour]), self.left,
        )  # fmt: skip


class LightPaths:
    """Paths from a lamp; parameters as those of `EyePaths`, with which they share the rules.

    Attributes
    ----------
    finds_any
        Whether the lamp meets any mirror or glass at all.
    """

    def __init__(
        self,
        surfaces: SurfaceScene,
        lamp: SteeredSpot | SteeredPanel,
        camera: Camera,
        *,
        width: int,
        height: int,
        rules: PathRules,
    ) -> None:
        import drjit as dr

        self.mi, self.lamp, self.rules = surfaces.mi, lamp, rules
        self.scene = surfaces.lit_by(lamp.emitter(surfaces.mi))
        meshes = {f"mesh{m}": mesh for m, mesh in enumerate(surfaces.meshes) if mesh is not None}
        self._unlit = self.mi.load_dict({"type": "scene", **meshes})  # the eye looks through the lamp
        self._view = PinholeRays(self.mi, camera, width=width, height=height)
        self._sampler = self.mi.load_dict({"type": "independent"})
        self._loop = dr.syntax(LightPaths._walk)
        self._frame = _Lamp(self.mi, lamp)
        self._seen: SeenInGlass | None = None
        share = self._search()
        self.finds_any = bool(share.any())
        even = np.full(len(share), 1 / len(share))
        from_one_place = isinstance(lamp, SteeredSpot)
        elsewhere, alike = _SHARES[from_one_place]
        self._aim(elsewhere * even + (1 - elsewhere) * share if self.finds_any else even)
        if self.finds_any:
            reached = self._pilot()
            if not from_one_place:
                reached = _spread(reached)
            useful = reached / reached.sum() if reached.any() else share
            self._aim(elsewhere * even + alike * share + (1 - elsewhere - alike) * useful)

    def see(self, samples: int, *, seed: int) -> bool:
        """From now on join paths to what is seen in mirrors and through glass, too; whether there is any of it."""
        seen = SeenInGlass(
            self.mi,
            self.scene,
            self._unlit,
            view=self._view,
            samples=samples,
            most=self.rules.depth,
            seed=seed,
        )
        self._seen = seen if seen.any else None
        return seen.any

    def _aim(self, share: np.ndarray) -> None:
        self._cells = self.mi.DiscreteDistribution(self.mi.Float(share.astype(np.float32)))

    def _pilot(self) -> Float64[np.ndarray, "cells"]:
        """How much the paths of each cell brought to the eye, RMS, of some."""
        found, colour = self.trace(_PILOT, seed=0x7107), np.zeros(_PILOT)
        np.add.at(colour, found.particle, found.colour[:, :3].sum(axis=1, dtype=np.float64))
        d = found.left[:, :3].astype(np.float64)
        band = np.clip((1 - d[:, 2]) / 2 * _BANDS, 0, _BANDS - 1).astype(np.int64)
        sector = (np.arctan2(d[:, 1], d[:, 0]) / (2 * np.pi) % 1.0 * _SECTORS).astype(np.int64) % _SECTORS
        cell = band * _SECTORS + sector
        density = np.bincount(cell, minlength=_BANDS * _SECTORS).astype(np.float64)
        square = np.bincount(cell, colour**2, minlength=_BANDS * _SECTORS)
        return np.sqrt(square / np.maximum(density, 1))

    def _search(self) -> Float64[np.ndarray, "cells"]:
        """The share of paths for each cell of directions: even over those where, or beside which, one meets S."""
        import drjit as dr

        mi = self.mi
        lanes = _BANDS * _SECTORS * _SEARCHED
        self._sampler.seed(0x5EA2C4, lanes)
        cell = dr.arange(mi.UInt32, lanes) // _SEARCHED
        d = _direction_in(mi, cell, self._sampler.next_2d())
        ray = self._frame.ray(d, self._sampler.next_2d())
        si = self.scene.ray_intersect(ray)
        mirrors = si.is_valid() & mi.has_flag(si.bsdf().flags(), mi.BSDFFlags.Delta)
        found = mirrors.numpy().reshape(_BANDS, _SECTORS, _SEARCHED).any(axis=2)
        wide = found.copy()
        for rows in (-1, 0, 1):  # beside those: a sliver may have been missed
            for columns in (-1, 0, 1):
                moved = np.roll(found, columns, axis=1)
                if rows:
                    moved = np.roll(moved, rows, axis=0)
                    moved[0 if rows > 0 else -1] = False
                wide |= moved
        return wide.ravel() / max(1, wide.sum())

    def trace(self, particles: int, *, seed: int) -> Splats:
        """The splats of so many paths; each is to be divided by the number of all paths."""
        import drjit as dr

        mi = self.mi
        self._sampler.seed(seed, particles)
        lane = dr.arange(mi.UInt32, particles)
        cell, inside = self._cells.sample_reuse(self._sampler.next_1d())
        second = self._sampler.next_1d()
        d = _direction_in(mi, cell, mi.Point2f(inside, second))
        density = self._cells.eval_pmf_normalized(cell) * (_BANDS * _SECTORS / (4 * np.pi))
        ray = self._frame.ray(d, self._sampler.next_2d())
        start = dr.select(density > 0, self._frame.weight(d) / density, 0)
        slots = max(1, self.rules.depth - 2)
        colour = dr.empty(mi.Float, 4 * particles * slots)
        arrived = None if self._seen is None else dr.empty(mi.Float, 12 * particles * slots)
        lanes = dr.opaque(mi.UInt32, particles)
        count, arrivals = self._loop(self, ray, start, lane, lanes, colour, arrived)
        u, v = place_on(mi, self.lamp, ray.o)
        left = dr.empty(mi.Float, 5 * particles)
        for k, value in enumerate((d.x, d.y, d.z, u + 0 * d.x, v + 0 * d.x)):
            dr.scatter(left, value, lane * 5 + k)
        dr.eval(count, colour, left, arrivals, arrived)
        dr.sync_thread()
        splats = self._gathered(np.asarray(count), np.asarray(colour).reshape(slots, particles, 4), left)
        if self._seen is None:
            return splats
        every = np.asarray(arrived).reshape(slots, particles, 12)
        return splats.and_seen(self._seen.splats(_arrivals(np.asarray(arrivals), every)))

    def _gathered(self, count: np.ndarray, colour: np.ndarray, left: Any) -> Splats:
        slots = int(count.max(initial=0))
        filled = np.arange(slots)[None, :] < count[:, None]
        particle, slot = (np.ascontiguousarray(k) for k in np.nonzero(filled))  # path after path
        entries = colour[slot, particle]
        pixel = entries[:, 3].copy().view(np.uint32).astype(np.int64)
        return Splats(pixel, particle, entries, np.asarray(left).reshape(-1, 5).copy())

    def _walk(self, ray: Any, start: Any, lane: Any, lanes: Any, colour: Any, arrived: Any) -> Any:
        """The loop over surfaces; how many splats each path has left, and how many arrivals."""
        import drjit as dr

        mi, scene, view = self.mi, self.scene, self._view
        sampler, ctx = self._sampler, mi.BSDFContext(mi.TransportMode.Importance)
        most, least = dr.opaque(mi.UInt32, self.rules.depth), dr.opaque(mi.UInt32, self.rules.least_depth)
        ray = mi.Ray3f(ray)
        met, slot, fallen = mi.UInt32(0), mi.UInt32(0), mi.UInt32(0)
        carry, eta = mi.Spectrum(start), mi.Float(1)
        bent = mi.Bool(False)  # by a mirror or glass, the first that was met
        active = start > 0
        while active:
            si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)
            active &= si.is_valid() & (si.emitter(scene, active) == None)  # noqa: E711 - of every lane
            bsdf = si.bsdf()

            # ---- joined to the eye -------------------------------------------------------------------
            joins = active & bent & (met + 2 <= most) & (met + 2 >= least)
            joins &= mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            pixel, inside, solid_angle = view.pixel_of(si.p, sampler.next_2d())
            joins &= inside
            to_eye = view.eye - si.p
            distance = dr.norm(to_eye)
            to_eye /= distance
            wo = si.to_local(to_eye)
            value = bsdf.eval(ctx, si, wo, joins) * for_smoothed(si, wo, to_eye)
            seen = carry * value / (distance * distance * solid_angle)
            total = seen.x + seen.y + seen.z
            joins &= (total > 0) & dr.isfinite(total)
            joins &= ~self._unlit.ray_test(si.spawn_ray_to(view.eye), joins)
            packed = mi.Vector4f(seen.x, seen.y, seen.z, dr.reinterpret_array(mi.Float, pixel))
            dr.scatter(colour, packed, slot * lanes + lane, joins)
            slot += dr.select(joins, mi.UInt32(1), mi.UInt32(0))

            # ---- kept for what is seen in glass ------------------------------------------------------
            if arrived is not None:
                falls = active & bent & (met + 3 <= most) & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
                at, number = (fallen * lanes + lane) * 3, dr.reinterpret_array(mi.Float, met)
                dr.scatter(arrived, mi.Vector4f(si.p.x, si.p.y, si.p.z, number), at, falls)
                dr.scatter(arrived, mi.Vector4f(-ray.d.x, -ray.d.y, -ray.d.z, 0), at + 1, falls)
                dr.scatter(arrived, mi.Vector4f(carry.x, carry.y, carry.z, 0), at + 2, falls)
                fallen += dr.select(falls, mi.UInt32(1), mi.UInt32(0))

            # ---- on ------------------------------------------------------------------------------------
            active &= met + 3 <= most
            sample, weight = bsdf.sample(ctx, si, sampler.next_1d(), sampler.next_2d(), active)
            mirror = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            active &= bent | mirror
            bent |= active & mirror
            d = si.to_world(sample.wo)
            correction = for_smoothed(si, sample.wo, d)
            carry = dr.select(active, carry * weight * correction, carry)
            eta = dr.select(active, eta * sample.eta, eta)
            ray = si.spawn_ray(d)
            met += 1
            strength = dr.max(carry)
            alive = dr.minimum(strength / start, _SURVIVAL)
            roulette = active & (met >= _ROULETTE_FROM)
            carry[roulette] *= dr.rcp(alive)
            active &= (~roulette | (sampler.next_1d() < alive)) & (strength > 0) & dr.isfinite(strength)
        return slot, fallen


def _arrivals(counts: np.ndarray, entries: np.ndarray) -> Arrivals:
    """Of entries (slots, paths, 12), those that were filled, path after path."""
    filled = np.arange(int(counts.max(initial=0)))[None, :] < counts[:, None]
    particle, slot = np.nonzero(filled)
    rows = entries[slot, particle]
    points, toward, carried = (np.ascontiguousarray(rows[:, k : k + 3]) for k in (0, 4, 8))
    return Arrivals(particle, points, toward, carried, rows[:, 3].copy().view(np.uint32))


def _spread(cells: Float64[np.ndarray, "cells"]) -> Float64[np.ndarray, "cells"]:
    """The mean of each cell and the eight about it."""
    table = np.pad(cells.reshape(_BANDS, _SECTORS), ((1, 1), (0, 0)), mode="edge")
    rows = [np.roll(table[k : k + _BANDS], turn, axis=1) for k in range(3) for turn in (-1, 0, 1)]
    return np.mean(rows, axis=0).ravel()


class _Lamp:
    """Where light begins that leaves a lamp in given directions, and how much it is."""

    def __init__(self, mi: Any, lamp: SteeredSpot | SteeredPanel) -> None:
        self.mi, self.lamp = mi, lamp

    def ray(self, d: Any, sample: Any) -> Any:
        """From a place of the lamp, even over all that is seen of it from that direction; a panel, over its area."""
        import drjit as dr

        mi, lamp = self.mi, self.lamp
        if isinstance(lamp, SteeredSpot):
            disc = mi.warp.square_to_uniform_disk_concentric(sample)
            ahead = dr.sqrt(dr.maximum(1 - dr.squared_norm(disc), 0)) + 1e-3
            offset = mi.Frame3f(d).to_world(mi.Vector3f(disc.x, disc.y, ahead))
            return mi.Ray3f(mi.Point3f(*lamp.position) + lamp.radius * offset, d)
        side_u, side_v = mi.Vector3f(*lamp.side_u), mi.Vector3f(*lamp.side_v)
        p = mi.Point3f(*lamp.corner) + sample.x * side_u + sample.y * side_v
        lift = 1e-5 * float(np.linalg.norm(np.add(lamp.side_u, lamp.side_v)))
        return mi.Ray3f(p + lift * mi.Vector3f(*lamp.normal.tolist()), d)

    def weight(self, d: Any) -> Any:
        """What a density of 1 per steradian would bring, for the span function 1."""
        import drjit as dr

        if isinstance(self.lamp, SteeredSpot):
            return self.mi.Float(1) + 0 * d.x
        normal = self.mi.Vector3f(*self.lamp.normal.tolist())
        return self.lamp.area * dr.maximum(dr.dot(d, normal), 0)


def _direction_in(mi: Any, cell: Any, sample: Any) -> Any:
    """A direction in each cell, even in solid angle."""
    import drjit as dr

    band, sector = cell // _SECTORS, cell % _SECTORS
    z = 1 - 2 * (mi.Float(band) + sample.x) / _BANDS
    phi = 2 * np.pi * (mi.Float(sector) + sample.y) / _SECTORS
    r = dr.sqrt(dr.maximum(1 - z * z, 0))
    s, c = dr.sincos(phi)
    return mi.Vector3f(r * c, r * s, z)
