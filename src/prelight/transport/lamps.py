"""Direct light of lamps and luminous triangles at receivers, by shadow rays: E / π, without albedo.

Sample k of n is evenly spread whatever n, and shifted for each pair of receiver and light by numbers that only the seed
and the two depend on: without bias, and the same however the work is cut into tiles.

References
----------
Cranley and Patterson, Randomization of number theoretic methods for multiple integration, 1976. Roberts, The
unreasonable effectiveness of quasirandom sequences, 2018 (the places within a triangle).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, Normals, Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.geometry import Scene
from .ordering import receiver_order

_LANES = 1 << 22  # rays of one launch
_OTHER = 0x5BD1E995  # tells a second set of random numbers from the first
_ROBERTS = (3242174889, 2447445414)  # 2³² / 1.3247… and / its square
_SHORT = 1e-4  # of the way to a luminous triangle that a shadow ray leaves out: it must not be its own shadow

Light = Float32[np.ndarray, "receivers lights 3"]


@dataclass(frozen=True)
class SphereLamps:
    """Spheres of even radiance; points where the radius is 0. They cast no shadow.

    ``power`` is radiant, in watts for each of red, green and blue: 4π² r² times the radiance, 4π times a point's
    intensity.
    """

    centres: Float32[np.ndarray, "lights 3"]  # metres
    radii: Float32[np.ndarray, "lights"]  # metres, 0 or more
    power: Float32[np.ndarray, "lights 3"]

    def __post_init__(self) -> None:
        count = len(self.centres)
        if np.shape(self.centres) != (count, 3) or np.shape(self.radii) != (count,):
            raise InputError("lamps", "expected as many centres (L, 3) as radii (L,)")
        if np.shape(self.power) != (count, 3) or not np.all(np.asarray(self.radii) >= 0):
            raise InputError("lamps", "expected a power (L, 3) for each lamp, and radii of 0 or more")

    def __len__(self) -> int:
        return len(self.centres)


@dataclass(frozen=True)
class LuminousTriangles:
    """Triangles that shine from the side on which they are counter-clockwise, grouped into lights.

    ``radiance`` is W·sr⁻¹·m⁻² up to a common exposure, 0 or more; ``light_of`` the number of the light that a triangle
    is part of, 0 to ``lights`` − 1.
    """

    corners: Float32[np.ndarray, "triangles 3 3"]
    radiance: Float32[np.ndarray, "triangles 3"]
    light_of: Int32[np.ndarray, "triangles"]
    lights: int

    @classmethod
    def of_scene(cls, scene: Scene, *, each: bool = False) -> LuminousTriangles:
        """What a scene's materials emit, all as one light, or one light for each luminous material."""
        emission = np.array([material.emission for material in scene.materials], np.float32).reshape(-1, 3)
        shining = np.flatnonzero(np.any(emission, axis=1)[scene.material_of])
        materials, light_of = np.unique(scene.material_of[shining], return_inverse=True)
        return cls(
            scene.positions[scene.triangles[shining]],
            emission[scene.material_of[shining]],
            (light_of if each else np.zeros(len(shining))).astype(np.int32),
            max(1, len(materials)) if each else 1,
        )

    def __len__(self) -> int:
        return self.lights


def lamp_light(
    occluders: Occluders,
    origins: Positions,
    normals: Normals,
    *,
    lamps: SphereLamps,
    rays: int = 64,
    seed: int = 0,
) -> Light:
    """E / π at receivers of each lamp; a receiver inside a lamp is dark.

    ``rays`` to each lamp, spread over the cone in which it is seen; one to a point.
    """
    count = rays if np.any(lamps.radii) else 1
    mi = occluders.mi
    centres, radii = _points(mi, lamps.centres), mi.Float(np.ascontiguousarray(lamps.radii, np.float32))

    def seen(lamp: Any, origin: Any, normal: Any, numbers: Any) -> tuple:
        return _through_cone(
            mi, _at(mi.Point3f, centres, lamp), _at(mi.Float, radii, lamp), origin, normal, numbers
        )

    plan = _Pairs(occluders, origins, normals, lights=len(lamps), rays=count, seed=seed)
    return plan.sums(seen) * np.asarray(lamps.power, np.float32)


def triangle_light(
    occluders: Occluders,
    origins: Positions,
    normals: Normals,
    *,
    lights: LuminousTriangles,
    rays: int = 256,
    seed: int = 0,
    beyond: Any = None,
) -> Light:
    """E / π at receivers of each group of luminous triangles, ``rays`` spread over its area by power.

    Given ``beyond``, an emitter of Mitsuba's at infinity, triangles are openings in which it is seen: their radiance
    filters its own. What stands in front of an opening, on either side, shadows it.
    """
    mi = occluders.mi
    if not len(lights.corners):
        return np.zeros((len(origins), lights.lights, 3), np.float32)
    table = _AreaTable(mi, lights, beyond)
    plan = _Pairs(occluders, origins, normals, lights=lights.lights, rays=rays, seed=seed)
    return plan.sums(table.seen)


def _points(mi: Any, values: np.ndarray) -> Any:
    return mi.Point3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in np.asarray(values).T))


def _at(kind: Any, values: Any, index: Any) -> Any:
    import drjit as dr

    return dr.gather(kind, values, index)


def _through_cone(mi: Any, centre: Any, radius: Any, origin: Any, normal: Any, numbers: Any) -> tuple:
    """Direction, length and weight (of unit power) of rays to a sphere or a point."""
    import drjit as dr

    to = centre - origin
    square = dr.squared_norm(to)
    axis = to * dr.rsqrt(square)
    is_point = radius == 0
    sin2 = dr.clip(radius * radius / square, 0, 1)
    spread = sin2 / (1 + dr.sqrt(1 - sin2))  # 1 − cos of the cone
    low = spread * numbers[0]
    across = dr.sqrt(low * (2 - low))
    s, c = dr.sincos(2 * dr.pi * numbers[1])
    d = mi.Frame3f(axis).to_world(mi.Vector3f(across * c, across * s, 1 - low))
    d = dr.select(is_point, axis, d)
    sphere = 0.5 / (dr.pi * dr.pi * (1 + dr.sqrt(1 - sin2)) * square)  # radiance × solid angle / π
    weight = dr.select(is_point, 0.25 / (dr.pi * dr.pi * square), sphere)
    along = dr.sqrt(square) * (1 - low)
    into = dr.sqrt(dr.maximum(radius * radius - square * low * (2 - low), 0))
    return d, along - into, dr.select(square > radius * radius, weight * dr.dot(normal, d), 0)


class _AreaTable:
    """Points of luminous triangles, chosen by power within each light."""

    def __init__(self, mi: Any, lights: LuminousTriangles, beyond: Any) -> None:
        self._beyond = beyond
        order = _neighbours_together(lights)
        a, b, c = np.moveaxis(lights.corners[order].astype(np.float64), 1, 0)
        cross = np.cross(b - a, c - a)
        double = np.linalg.norm(cross, axis=1)
        radiance = lights.radiance[order].astype(np.float64)
        power = double * radiance.max(axis=1)
        group = lights.light_of[order]
        starts = np.searchsorted(group, np.arange(lights.lights + 1))
        whole = np.add.reduceat(np.append(power, 0.0), starts[:-1]) * (np.diff(starts) > 0)
        before = np.concatenate([[0.0], np.cumsum(power)])
        share = power / np.maximum(whole[group], 1e-300)
        upper = (before[1:] - before[starts[group]]) / np.maximum(whole[group], 1e-300)
        # E / π of a point: its radiance · area / the share of rays it gets · cosines / (π d²).
        weight = radiance * (double / (2 * np.pi * np.maximum(share, 1e-300)))[:, None] * (share > 0)[:, None]
        self._mi = mi
        self._a, self._ab, self._ac = (_points(mi, x) for x in (a, b - a, c - a))
        self._normal = _points(mi, cross / np.maximum(double, 1e-300)[:, None])
        self._weight = _points(mi, weight)
        self._upper = mi.Float(np.float32(upper))
        self._halvings = int(np.diff(starts).max()).bit_length()
        self._start, self._stop = (
            mi.UInt32(starts[:-1].astype(np.uint32)),
            mi.UInt32(starts[1:].astype(np.uint32)),
        )

    def seen(self, light: Any, origin: Any, normal: Any, numbers: Any) -> tuple:
        """Direction, length and weight (red, green, blue) of rays to a light."""
        import drjit as dr

        mi = self._mi
        first, last = _at(mi.UInt32, self._start, light), _at(mi.UInt32, self._stop, light)
        there = last > first
        found, beyond = mi.UInt32(first), mi.UInt32(last)  # of those whose upper end lies above the number
        for _ in range(self._halvings):
            middle = (found + beyond) // 2
            below = there & (dr.gather(mi.Float, self._upper, middle, there & (middle < last)) <= numbers[0])
            open_ = found < beyond
            found = dr.select(open_ & below, middle + 1, found)
            beyond = dr.select(open_ & ~below, middle, beyond)
        found = dr.minimum(found, dr.maximum(last, 1) - 1)
        root = dr.sqrt(numbers[2])
        s, t = root * (1 - numbers[3]), root * numbers[3]
        ab, ac = (dr.gather(mi.Point3f, x, found, there) for x in (self._ab, self._ac))
        to = dr.gather(mi.Point3f, self._a, found, there) + s * ab + t * ac - origin
        square = dr.maximum(dr.squared_norm(to), 1e-20)
        d = to * dr.rsqrt(square)
        facing = dr.maximum(-dr.dot(d, dr.gather(mi.Point3f, self._normal, found, there)), 0)
        factor = dr.select(there, facing * dr.maximum(dr.dot(normal, d), 0) / square, 0)
        weight = dr.gather(mi.Point3f, self._weight, found, there) * factor
        if self._beyond is None:
            return d, dr.sqrt(square) * (1 - _SHORT), weight
        through = dr.zeros(mi.DirectionSample3f)
        through.d = mi.Vector3f(d)
        weight *= mi.Point3f(self._beyond.eval_direction(None, through, there))
        return d, dr.full(mi.Float, dr.inf, dr.width(square)), weight


def _neighbours_together(lights: LuminousTriangles) -> Int32[np.ndarray, "triangles"]:
    """An order by light, then by place: evenly spread numbers become places spread evenly over a light."""
    a, b, c = np.moveaxis(lights.corners, 1, 0)
    across = np.cross(b - a, c - a)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    order = receiver_order((a + b + c) / np.float32(3), across)
    return order[np.argsort(lights.light_of[order], kind="stable")]


class _Pairs:
    """Shadow rays from every receiver to every light, some pairs to a launch."""

    def __init__(
        self, occluders: Occluders, origins: Positions, normals: Normals, *, lights: int, rays: int, seed: int
    ) -> None:  # fmt: skip
        if rays < 1:
            raise InputError("rays", f"{rays}, expected 1 or more to each light")
        self._mi, self._scene = occluders.mi, occluders.scene
        offset = np.float32(ray_offset(occluders.positions))
        self._origin = _points(self._mi, origins + offset * normals)
        self._normal = _points(self._mi, normals)
        self._count, self._lights, self._rays, self._seed = len(origins), lights, rays, seed

    def sums(self, seen: Any) -> Light:
        """The means of weight × visibility; ``seen`` gives rays their direction, length and weight."""
        pairs = self._count * self._lights
        step = max(1, _LANES // self._rays)
        parts = [
            self._launch(seen, start, min(step, pairs - start)) for start in range(0, pairs, step)
        ] or [np.zeros((0, 3), np.float32)]  # fmt: skip
        return np.concatenate(parts).reshape(self._count, self._lights, 3)

    def _launch(self, seen: Any, start: int, count: int) -> Float32[np.ndarray, "pairs 3"]:
        import drjit as dr

        mi = self._mi
        rays = dr.opaque(mi.UInt32, self._rays)
        lane = dr.arange(mi.UInt32, count * self._rays)
        inside = lane // rays
        sample = lane - inside * rays
        pair = inside + dr.opaque(mi.UInt32, start)
        receiver = pair // dr.opaque(mi.UInt32, self._lights)
        light = pair - receiver * dr.opaque(mi.UInt32, self._lights)
        origin, normal = _at(mi.Point3f, self._origin, receiver), _at(mi.Point3f, self._normal, receiver)
        numbers = spread_numbers(mi, pair, sample, rays=rays, seed=self._seed)
        d, length, weight = seen(light, origin, normal, numbers)
        weight = weight if dr.size_v(type(weight)) == 3 else mi.Point3f(weight)
        lit = dr.max(weight) > 0
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(d))
        ray.maxt = length
        lit &= ~self._scene.ray_test(ray, active=lit)
        total = [dr.block_sum(dr.select(lit, w, 0), self._rays) for w in weight]
        dr.eval(*total)
        return np.stack([t.numpy() for t in total], axis=1) / np.float32(self._rays)


def spread_numbers(mi: Any, pair: Any, sample: Any, *, rays: Any, seed: int) -> tuple[Any, ...]:
    """Four numbers in [0, 1) for sample k of ``rays``: (k/n, bit-reversed k) and two of Roberts's sequence."""
    import drjit as dr

    first, second = mi.sample_tea_32(pair, dr.opaque(mi.UInt32, seed), 8)
    third, fourth = mi.sample_tea_32(pair, dr.opaque(mi.UInt32, seed ^ _OTHER), 8)
    along = (mi.Float(sample) + mi.Float(first >> 8) * 2.0**-24) / mi.Float(rays)
    # Integers wrap around, as a shift should.
    rest = (dr.brev(sample) + second, _ROBERTS[0] * sample + third, _ROBERTS[1] * sample + fourth)
    return dr.minimum(along, 1 - 2.0**-24), *(mi.Float(word >> 8) * 2.0**-24 for word in rest)
