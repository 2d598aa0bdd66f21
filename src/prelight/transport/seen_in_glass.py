"""Light over mirrors or through glass, seen in a mirror or through glass: paths L S⁺ D … D S⁺ E.

Neither direction finds them: what a mirror shows can be joined to nothing. So both are traced up to a surface that
scatters, and light that arrives near what is seen counts as arriving there, as in photon maps (Jensen, 1996). Near is
within what a pixel sees, smaller where a lens enlarges it: what is seen in glass is smoothed over about a pixel, and
nothing else is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32
from .eye_paths import PinholeRays
from .near_points_kernels import count_near, fill_near, point_table
from .photon_density_kernels import build_tree, nearest_radii
from .sparse_product import aligned

_LANES = 1 << 17
_SAMPLES = 16  # of a pixel, at most
MOST_HITS = 1 << 21  # of all pixels, where all show such places
_FEWEST = 4  # hits on the surface that a pixel is taken to see
_REACH = 0.05, 0.56  # of a pixel's side, at least and at most: at most a disc of a pixel's area
_FLAT = 0.3  # of that reach: beyond, it is another surface
_GRAZING = 0.05  # cosine; below, a density over the surface says little
_PAIRS = 1 << 20  # at a time


@dataclass(frozen=True)
class Arrivals:
    """Where some light-traced paths met surfaces that scatter, after a mirror or glass; in the order of the paths."""

    particle: np.ndarray  # (arrivals,) int64
    points: Float32[np.ndarray, "arrivals 3"]
    toward: Float32[np.ndarray, "arrivals 3"]  # where light came from
    carried: Float32[np.ndarray, "arrivals 3"]
    met: np.ndarray  # (arrivals,) uint32, surfaces before


@dataclass(frozen=True)
class Seen:
    """What arrivals bring to pixels: a row for each path and pixel."""

    pixel: np.ndarray  # (rows,) int64
    particle: np.ndarray  # (rows,) int64
    colour: Float32[np.ndarray, "rows 4"]  # red, green, blue and nothing


class SeenInGlass:
    """The places that scatter and that the eye sees in mirrors and through glass.

    Parameters
    ----------
    mi
        Mitsuba.
    scene, unlit
        Its scene with the lamp, and without: the eye looks through it.
    view
        The eye's rays.
    samples
        Of each pixel.
    most
        Edges of a path.
    seed
        Of the randomness.
    """

    def __init__(
        self, mi: Any, scene: Any, unlit: Any, *, view: PinholeRays, samples: int, most: int, seed: int
    ) -> None:
        import drjit as dr

        self.mi, self._scene, self._unlit, self._view, self._most = mi, scene, unlit, view, most
        self._samples = max(1, min(samples, _SAMPLES, MOST_HITS // (view.width * view.height)))
        self._slots = max(1, most - 2)
        self._loop = dr.syntax(SeenInGlass._walk)
        self._sampler = mi.load_dict({"type": "independent"})
        pixels = view.width * view.height
        step = max(1, _LANES // self._samples)
        parts = [
            self._trace(first, min(step, pixels - first), seed + first) for first in range(0, pixels, step)
        ]
        places = np.concatenate(parts)
        self.any = bool(len(places))
        if not self.any:
            return
        ray = mi.Ray3f(mi.Point3f(*_columns(mi, places[:, :3])), mi.Vector3f(*_columns(mi, places[:, 4:7])))
        si = scene.ray_intersect(ray, mi.RayFlags.All, False, True)
        dr.eval(si)
        self._points, self._normal = (
            np.ascontiguousarray(np.array(part, np.float32).T) for part in (si.p, dr.mulsign(si.n, si.wi.z))
        )
        self._reach = self._reaches(places[:, 11])
        self._table, self._order, self._width = point_table(
            self._points, self._reach
        )  # order: among the hits
        self._si, self._carried = si, places[:, 8:11] / self._samples
        self._pixel, self._met = (places[:, k].copy().view(np.uint32).astype(np.int64) for k in (3, 7))

    def _reaches(self, side: Float32[np.ndarray, "hits"]) -> Float32[np.ndarray, "hits"]:
        """How near is near: where as many hits are as a pixel has, there is as much of the surface as it sees."""
        order, axes = np.arange(len(side), dtype=np.int32), np.zeros(len(side), np.int8)
        build_tree(self._points, order, axes)
        tree = (np.ascontiguousarray(self._points[order]), np.ascontiguousarray(self._normal[order]), axes)
        limits = side[:, None] * np.array(_REACH, np.float32)
        found = np.empty(len(side), np.float32)
        nearest_radii(tree, self._points, self._normal, limits, max(self._samples, _FEWEST), found)
        return np.maximum(found, np.float32(1e-6))

    def _trace(self, first: int, count: int, seed: int) -> Float32[np.ndarray, "hits 12"]:
        """Rays that meet what is seen: origin, pixel, direction, surfaces before, carried, pixel's side there."""
        import drjit as dr

        mi, lanes = self.mi, count * self._samples
        self._sampler.seed(seed & 0x7FFFFFFF, lanes)
        lane = dr.arange(mi.UInt32, lanes)
        pixel = lane // dr.opaque(mi.UInt32, self._samples) + dr.opaque(mi.UInt32, first)
        ray = self._view.through(pixel, self._sampler.next_2d())
        buffer = dr.empty(mi.Float, 12 * lanes * self._slots)
        used = self._loop(self, ray, pixel, lane, dr.opaque(mi.UInt32, lanes), buffer)
        dr.eval(used, buffer)
        dr.sync_thread()
        counts = np.asarray(used)
        filled = np.arange(int(counts.max(initial=0)))[None, :] < counts[:, None]
        lanes_of, slots = np.nonzero(filled)
        return np.asarray(buffer).reshape(self._slots, lanes, 12)[slots, lanes_of].copy()

    def _walk(self, ray: Any, pixel: Any, lane: Any, lanes: Any, buffer: Any) -> Any:
        """The loop over mirrors and glass; how many slots each path has filled."""
        import drjit as dr

        mi, scene, sampler = self.mi, self._scene, self._sampler
        ctx, most = mi.BSDFContext(), dr.opaque(mi.UInt32, self._most)
        met, slot, carry, far = mi.UInt32(0), mi.UInt32(0), mi.Spectrum(1), mi.Float(0)
        ray = mi.Ray3f(ray)
        si = self._unlit.ray_intersect(ray, mi.RayFlags.All, True, True)
        active = si.is_valid()
        while active:
            bsdf = si.bsdf()
            far += dr.select(active, si.t, 0)
            here = active & (met > 0) & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            at = (slot * lanes + lane) * 3
            number = dr.reinterpret_array(mi.Float, pixel), dr.reinterpret_array(mi.Float, met)
            dr.scatter(buffer, mi.Vector4f(ray.o.x, ray.o.y, ray.o.z, number[0]), at, here)
            dr.scatter(buffer, mi.Vector4f(ray.d.x, ray.d.y, ray.d.z, number[1]), at + 1, here)
            side = far / self._view.focal
            dr.scatter(buffer, mi.Vector4f(carry.x, carry.y, carry.z, side), at + 2, here)
            slot += dr.select(here, mi.UInt32(1), mi.UInt32(0))
            sample, weight = bsdf.sample(ctx, si, sampler.next_1d(), sampler.next_2d(), active)
            active &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta) & (met + 4 <= most)
            carry = dr.select(active, carry * weight, carry)
            active &= dr.max(carry) > 0
            ray = dr.select(active, si.spawn_ray(si.to_world(sample.wo)), ray)
            met += dr.select(active, mi.UInt32(1), mi.UInt32(0))
            si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)
            active &= si.is_valid() & (si.emitter(scene, active) == None)  # noqa: E711 - of every lane
        return slot

    def splats(self, arrivals: Arrivals) -> Seen:
        """What so many arrivals bring; each is to be divided by the number of all paths."""
        counts = np.zeros(len(arrivals.points), np.int64)
        count_near(arrivals.points, self._table, self._width, counts)
        ends = np.cumsum(counts)
        parts, first = [], 0
        while first < len(counts):  # as many arrivals as have few enough pairs
            before = ends[first - 1] if first else 0
            last = max(first + 1, int(np.searchsorted(ends, before + _PAIRS, side="right")))
            parts.append(self._pairs(arrivals, slice(first, last), counts[first:last]))
            first = last
        if not parts:
            return Seen(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 4), np.float32))
        pixel, particle, colour = (np.concatenate(rows) for rows in zip(*parts, strict=True))
        return _together(pixel, particle, colour)

    def _pairs(
        self, arrivals: Arrivals, part: slice, counts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixel, path and colour of each pair of an arrival and a hit that is on the same surface."""
        starts = np.concatenate([[0], np.cumsum(counts)])
        found = np.empty(starts[-1], np.int64)
        fill_near(np.ascontiguousarray(arrivals.points[part]), self._table, self._width, starts, found)
        light, hit = np.repeat(np.arange(part.start, part.start + len(counts)), counts), self._order[found]
        off = np.abs(((arrivals.points[light] - self._points[hit]) * self._normal[hit]).sum(axis=1))
        edges = arrivals.met[light].astype(np.int64) + self._met[hit] + 2
        kept = (off < _FLAT * self._reach[hit]) & (edges <= self._most)
        light, hit = light[kept], hit[kept]
        if not len(light):
            return light, light, np.zeros((0, 3), np.float32)
        scattered = self._scattered(hit, arrivals.toward[light])
        density = arrivals.carried[light] / (np.pi * np.square(self._reach[hit]))[:, None]
        colour = scattered * density * self._carried[hit]
        return self._pixel[hit], arrivals.particle[light], colour.astype(np.float32)

    def _scattered(self, hit: np.ndarray, toward: np.ndarray) -> Float32[np.ndarray, "pairs 3"]:
        """The BSDF, without a cosine, from these directions of light toward the eye."""
        import drjit as dr

        mi = self.mi
        si = dr.gather(type(self._si), self._si, mi.UInt32(_aligned(hit.astype(np.uint32))))
        wo = si.to_local(mi.Vector3f(*_columns(mi, toward)))
        value = si.bsdf().eval(mi.BSDFContext(), si, wo)
        value /= dr.maximum(dr.abs(wo.z), _GRAZING)
        dr.eval(value)
        return np.nan_to_num(np.stack([np.array(channel) for channel in value], axis=1), posinf=0.0)


def _columns(mi: Any, values: np.ndarray) -> list[Any]:
    """Columns of (n, 3) one by one: as a whole their number would be part of the program, and be compiled anew."""
    return [mi.Float(_aligned(column)) for column in values.T]


def _aligned(values: np.ndarray) -> np.ndarray:
    """A copy that begins with a cache line: whether it does is part of the program, too."""
    copy = aligned(1, len(values))[0].view(values.dtype)
    copy[:] = values
    return copy


def _together(pixel: np.ndarray, particle: np.ndarray, colour: np.ndarray) -> Seen:
    """What a path brings to a pixel as one row, so that rows are independent."""
    order = np.lexsort((pixel, particle))
    pixel, particle, colour = pixel[order], particle[order], colour[order]
    new = np.ones(len(pixel), bool)
    new[1:] = (pixel[1:] != pixel[:-1]) | (particle[1:] != particle[:-1])
    firsts = np.flatnonzero(new)
    sums = np.zeros((len(firsts), 4), np.float32)
    if len(firsts):
        sums[:, :3] = np.add.reduceat(colour, firsts, axis=0)
    return Seen(pixel[firsts], particle[firsts], sums)
