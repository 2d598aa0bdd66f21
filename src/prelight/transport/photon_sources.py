"""Where photons begin: lamps, luminous triangles and portals, suns and the sky, each with its own density.

A photon carries the flux that it stands for if ``emitted`` of them are traced: radiance × cosine / density. The cosine
is the emitter's own: a portal or panel sends L cos θ, so directions are taken by it. Photons may be aimed at balls
around what matters; they then come from a mixture of both densities, and none counts more for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..arrays import Directions, Float32, Int32, Positions
from ..errors import InputError
from .lamps import SphereLamps
from .photon_aim import Balls

_LIFT = 1e-5  # of the size of a scene: photons begin this far before what sends them
_FAR = 1.001  # radii of the ball around a scene, from where distant light begins


@dataclass(frozen=True)
class Emitted:
    """Photons on their way: Dr.Jit arrays."""

    origin: Any
    direction: Any
    flux: Any  # Vector3f; of one photon, if it were the only one
    light: Any


class PhotonSource(Protocol):
    """Lights that send photons; ``lights`` of them, told apart by number. ``is_placed``: in the scene, not far away."""

    @property
    def lights(self) -> int: ...

    @property
    def is_placed(self) -> bool: ...

    def ready(self, mi: Any, scene: SceneBall, aim: Balls | None) -> Any:
        """A function of (six numbers, the scene's rays) that gives ``Emitted``."""
        ...


@dataclass(frozen=True)
class SceneBall:
    """The ball around a scene, and the renderer's scene of its triangles."""

    centre: tuple[float, float, float]
    radius: float
    rays: Any

    @classmethod
    def of(cls, positions: Positions, rays: Any) -> SceneBall:
        low, high = positions.min(axis=0).astype(np.float64), positions.max(axis=0).astype(np.float64)
        centre = (low + high) / 2
        radius = float(np.linalg.norm(positions - centre, axis=1).max())
        return cls((float(centre[0]), float(centre[1]), float(centre[2])), max(radius, 1e-6), rays)


def _checked_power(name: str, power: np.ndarray) -> np.ndarray:
    """(lights,) the largest of red, green and blue. Raises InputError for what is no power or none at all."""
    power = np.asarray(power, np.float64).reshape(-1, 3)
    wrong = ~(np.isfinite(power) & (power >= 0)).all(axis=1)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise InputError(
            f"{name} {first}", f"power {power[first].tolist()}, expected finite numbers from 0 up"
        )
    if not power.any():
        raise InputError(name, "have no power: nothing sends light; give at least one of them some")
    return power.max(axis=1)


def _points(mi: Any, values: np.ndarray) -> Any:
    return mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in np.asarray(values).T))


def _of(mi: Any, values: Any) -> Any:
    import drjit as dr

    return mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in values))


class _Cones:
    """Directions from points toward balls, mixed with the emitter's own."""

    def __init__(self, mi: Any, balls: Balls | None) -> None:
        import drjit as dr

        self._mi, self.count = mi, 0 if balls is None else len(balls)
        self._balls = []
        if balls is not None:
            self._balls = [
                (_of(mi, c), dr.opaque(mi.Float, float(r))) for c, r in zip(balls.centres, balls.radii, strict=True)
            ]  # fmt: skip

    def mixed(self, origin: Any, own: Any, own_density: Any, numbers: tuple, choice: Any) -> tuple[Any, Any]:
        """Direction and density; ``own_density(d)`` of the emitter's own. All toward the balls if there are any."""
        import drjit as dr

        if not self.count:
            return own, own_density(own)
        mi = self._mi
        which = dr.minimum(mi.UInt32(choice * self.count), self.count - 1)
        chosen, cones = mi.Vector3f(0), []  # a tiny cone's own direction may seem to lie just outside
        for k, (centre, radius) in enumerate(self._balls):
            to = centre - origin
            square = dr.squared_norm(to)
            inside = square <= radius * radius
            sin2 = dr.clip(radius * radius / dr.maximum(square, 1e-30), 0, 1)
            height = dr.select(inside, 2, sin2 / (1 + dr.sqrt(1 - sin2)))  # 1 − cos of the cone
            axis = to * dr.rsqrt(dr.maximum(square, 1e-30))
            low = height * numbers[0]
            across = dr.sqrt(dr.maximum(low * (2 - low), 0))
            s, c = dr.sincos(2 * dr.pi * numbers[1])
            d = mi.Frame3f(axis).to_world(mi.Vector3f(across * c, across * s, 1 - low))
            chosen = dr.select(which == k, d, chosen)
            cones.append((axis, height, which == k))
        density = mi.Float(0)
        for axis, height, own_one in cones:
            within = own_one | (dr.dot(axis, chosen) >= 1 - height)
            density += dr.select(within, 1 / (2 * dr.pi * height * self.count), 0)
        return chosen, density


@dataclass(frozen=True)
class SphereSource:
    """Points and spheres; ``lamps.power`` is in watts for each of red, green and blue."""

    lamps: SphereLamps
    is_placed: bool = True

    @property
    def lights(self) -> int:
        return len(self.lamps)

    def ready(self, mi: Any, scene: SceneBall, aim: Balls | None) -> Any:
        import drjit as dr

        share = _checked_power("lamp", self.lamps.power)
        chances = mi.DiscreteDistribution(mi.Float(share.astype(np.float32)))
        centres, power = _points(mi, self.lamps.centres), _points(mi, self.lamps.power)
        radii = mi.Float(np.ascontiguousarray(self.lamps.radii, np.float32))
        cones = _Cones(mi, aim)
        lift = dr.opaque(mi.Float, 1 + 1e-4)

        def emit(numbers: tuple) -> Emitted:
            lamp, chance = chances.sample_pmf(numbers[0])
            normal = mi.warp.square_to_uniform_sphere(mi.Point2f(numbers[1], numbers[2]))
            radius = dr.gather(mi.Float, radii, lamp)
            is_point = radius == 0
            origin = dr.gather(mi.Vector3f, centres, lamp) + normal * radius * lift
            frame, pair = mi.Frame3f(normal), mi.Point2f(numbers[3], numbers[4])
            own = dr.select(
                is_point,
                mi.warp.square_to_uniform_sphere(pair),
                frame.to_world(mi.warp.square_to_cosine_hemisphere(pair)),
            )

            def density(d: Any) -> Any:
                return dr.select(is_point, 0.25 * dr.inv_pi, dr.maximum(dr.dot(d, normal), 0) * dr.inv_pi)

            d, chosen = cones.mixed(origin, own, density, numbers[3:5], numbers[5])
            sent = dr.select(chosen > 0, density(d) / chosen, 0)  # of unit power
            return Emitted(origin, d, dr.gather(mi.Vector3f, power, lamp) * (sent / chance), lamp)

        return emit


@dataclass(frozen=True)
class TriangleSource:
    """Triangles that send radiance from the side on which they are counter-clockwise: panels, or portals.

    Parameters
    ----------
    corners, radiance, light_of
        As in ``LuminousTriangles``; for portals a radiance of 1 is unit light of whatever basis function weighs it.
    beyond
        They are openings: what stands behind keeps light from outside away, and no photon leaves there.
    """

    corners: Float32[np.ndarray, "triangles 3 3"]
    radiance: Float32[np.ndarray, "triangles 3"]
    light_of: Int32[np.ndarray, "triangles"]
    beyond: bool = False
    is_placed: bool = True

    @property
    def lights(self) -> int:
        return int(self.light_of.max(initial=0)) + 1

    def ready(self, mi: Any, scene: SceneBall, aim: Balls | None) -> Any:
        import drjit as dr

        a, b, c = np.moveaxis(self.corners.astype(np.float64), 1, 0)
        across = np.cross(b - a, c - a)
        double = np.linalg.norm(across, axis=1)
        power = _checked_power("triangle", self.radiance * double[:, None] / 2)
        chances = mi.DiscreteDistribution(mi.Float(power.astype(np.float32)))
        first, ab, ac = (_points(mi, x) for x in (a, b - a, c - a))
        normals = _points(mi, across / np.maximum(double, 1e-300)[:, None])
        sent = _points(mi, self.radiance * double[:, None] / 2)
        light_of = mi.UInt32(self.light_of.astype(np.uint32))
        cones, lift = _Cones(mi, aim), dr.opaque(mi.Float, _LIFT * scene.radius)

        def emit(numbers: tuple) -> Emitted:
            which, chance = chances.sample_pmf(numbers[0])
            root = dr.sqrt(numbers[1])
            s, t = root * (1 - numbers[2]), root * numbers[2]
            place = dr.gather(mi.Vector3f, first, which) + s * dr.gather(mi.Vector3f, ab, which)
            place += t * dr.gather(mi.Vector3f, ac, which)
            normal = dr.gather(mi.Vector3f, normals, which)
            pair = mi.Point2f(numbers[3], numbers[4])
            own = mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(pair))

            def cosine(d: Any) -> Any:
                return dr.maximum(dr.dot(d, normal), 0)

            d, density = cones.mixed(place, own, lambda d: cosine(d) * dr.inv_pi, numbers[3:5], numbers[5])
            share = dr.select(density > 0, cosine(d) / density, 0) / chance
            if self.beyond:
                back = mi.Ray3f(mi.Point3f(place - lift * normal), -d)
                share = dr.select(scene.rays.ray_test(back, active=share > 0), 0, share)
            flux = dr.gather(mi.Vector3f, sent, which) * share
            return Emitted(place + lift * normal, d, flux, dr.gather(mi.UInt32, light_of, which))

        return emit


class _Discs:
    """Places that distant light comes through: discs across it, around the scene or around what it is aimed at."""

    def __init__(self, mi: Any, scene: SceneBall, aim: Balls | None) -> None:
        import drjit as dr

        self._mi = mi
        centres = [scene.centre] if aim is None else aim.centres
        radii = [scene.radius] if aim is None else aim.radii
        self._discs = [
            (_of(mi, c), dr.opaque(mi.Float, float(r))) for c, r in zip(centres, radii, strict=True)
        ]  # fmt: skip
        self._centre, self._far = _of(mi, scene.centre), dr.opaque(mi.Float, _FAR * scene.radius)

    def sampled(self, d: Any, numbers: tuple, choice: Any) -> tuple[Any, Any]:
        """Origins outside the scene, and their density over the plane across d."""
        import drjit as dr

        mi, count = self._mi, len(self._discs)
        pair = mi.warp.square_to_uniform_disk_concentric(mi.Point2f(numbers[0], numbers[1]))
        frame = mi.Frame3f(d)
        which = dr.minimum(mi.UInt32(choice * count), count - 1)
        place = mi.Vector3f(0)
        for k, (centre, radius) in enumerate(self._discs):
            place = dr.select(which == k, centre + radius * (frame.s * pair.x + frame.t * pair.y), place)
        density = mi.Float(0)
        for centre, radius in self._discs:
            off = place - centre
            away = dr.squared_norm(off - dr.dot(off, d) * d)
            density += dr.select(
                away <= radius * radius * (1 + 1e-5), dr.inv_pi / (radius * radius * count), 0
            )
        along = dr.dot(self._centre - place, d) - self._far
        return place + along * d, density


@dataclass(frozen=True)
class SkySource:
    """Light from all around, of radiance 1 in every direction: what weighs a photon says how much there is."""

    lights: int = 1
    is_placed: bool = False

    def ready(self, mi: Any, scene: SceneBall, aim: Balls | None) -> Any:
        import drjit as dr

        discs = _Discs(mi, scene, aim)

        def emit(numbers: tuple) -> Emitted:
            d = mi.warp.square_to_uniform_sphere(mi.Point2f(numbers[1], numbers[2]))
            origin, density = discs.sampled(d, numbers[3:5], numbers[5])
            flux = mi.Vector3f(dr.select(density > 0, 4 * dr.pi / density, 0))
            return Emitted(origin, d, flux, mi.UInt32(0) + dr.zeros(mi.UInt32, dr.width(d)))

        return emit


@dataclass(frozen=True)
class SunSource:
    """Suns: ``directions`` toward them, ``irradiance`` across their light (∫ L dω), their angular radius in degrees."""

    directions: Directions
    irradiance: Float32[np.ndarray, "suns 3"]
    radius_deg: float = 0.27
    is_placed: bool = False

    @property
    def lights(self) -> int:
        return len(self.directions)

    def ready(self, mi: Any, scene: SceneBall, aim: Balls | None) -> Any:
        import drjit as dr

        chances = mi.DiscreteDistribution(mi.Float(_checked_power("sun", self.irradiance).astype(np.float32)))
        unit = self.directions / np.linalg.norm(self.directions, axis=1, keepdims=True)
        toward, energy = _points(mi, unit), _points(mi, self.irradiance)
        height = dr.opaque(mi.Float, 1 - float(np.cos(np.radians(self.radius_deg))))
        discs = _Discs(mi, scene, aim)

        def emit(numbers: tuple) -> Emitted:
            sun, chance = chances.sample_pmf(numbers[0])
            low = height * numbers[1]
            across = dr.sqrt(low * (2 - low))
            s, c = dr.sincos(2 * dr.pi * numbers[2])
            axis = dr.gather(mi.Vector3f, toward, sun)
            d = -mi.Frame3f(axis).to_world(mi.Vector3f(across * c, across * s, 1 - low))
            origin, density = discs.sampled(d, numbers[3:5], numbers[5])
            flux = dr.gather(mi.Vector3f, energy, sun) * (dr.select(density > 0, 1 / density, 0) / chance)
            return Emitted(origin, d, flux, sun)

        return emit
