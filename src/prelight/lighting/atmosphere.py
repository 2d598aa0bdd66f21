"""Sunlight in a clear atmosphere: how much of it arrives, and what the air scatters to an eye at sea level.

Air of a density that falls exponentially (Rayleigh), haze (Mie), and ozone. What was scattered once is integrated along
the line of sight; what was scattered more often is taken as isotropic and as much everywhere around a point as there,
which makes its orders a geometric series. Red, green and blue stand for 680, 550 and 440 nm. Lengths are kilometres.

References
----------
Hillaire, A scalable and production ready sky and atmosphere rendering technique, 2020: the method.
Bruneton and Neyret, Precomputed atmospheric scattering, 2008: coefficients, and how transmittance is tabulated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from ..arrays import Float64

Values = Float64[np.ndarray, "..."]
Colours = Float64[np.ndarray, "... 3"]

GROUND, TOP = 6360.0, 6460.0
_RAYLEIGH = np.array([5.802, 13.558, 33.1]) * 1e-3  # scattering at sea level, 1/km
_RAYLEIGH_HEIGHT, _HAZE_HEIGHT = 8.0, 1.2
_OZONE = np.array([0.650, 1.881, 0.085]) * 1e-3  # absorption at 25 km
_HAZE_COLOUR = (np.array([680.0, 550.0, 440.0]) / 550.0) ** -1.3  # Ångström's exponent over land
_HAZE_SCATTERS, _FORWARD = 0.92, 0.8  # share of extinction; mean cosine of what haze scatters
_EYE = GROUND + 0.002
_HORIZON_REACH = float(np.sqrt(TOP**2 - GROUND**2))
_SIGHT_STEPS, _MANY_STEPS, _SUN_STEPS = 40, 16, 40
_SIGHT_ENDS = np.linspace(0.0, 1.0, _SIGHT_STEPS + 1) ** 2  # as ``_steps``


@dataclass(frozen=True)
class Scattered:
    """Light toward the eye for unit irradiance of the sun, (..., 3) each: by air and by haze once, before their phase
    functions, and all that was scattered more often."""

    air: Colours
    haze: Colours
    often: Colours

    def radiance(self, cosine: Values) -> Colours:
        """W·sr⁻¹·m⁻² for 1 W·m⁻² of sunlight above the air; ``cosine`` (...) of the angle to the sun."""
        rayleigh = 3.0 / (16.0 * np.pi) * (1.0 + cosine**2)
        g = _FORWARD
        haze = 3.0 / (8.0 * np.pi) * (1.0 - g * g) * (1.0 + cosine**2)
        haze /= (2.0 + g * g) * (1.0 + g * g - 2.0 * g * cosine) ** 1.5
        return rayleigh[..., None] * self.air + haze[..., None] * self.haze + self.often


@dataclass(frozen=True)
class Atmosphere:
    """Air of a turbidity over ground of an albedo.

    Parameters
    ----------
    turbidity
        How much thicker haze makes the air: the optical thickness of air and haze over that of air alone, straight up
        at 550 nm. 1 is air without haze, 2 a clear day, 5 a hazy one.
    ground
        Albedo, 0 to 1 in red, green and blue: what it sends back lights the sky too.
    """

    turbidity: float
    ground: tuple[float, float, float]

    def densities(self, radius: Values) -> tuple[Values, Values, Values]:
        """Of air, haze and ozone at distances from the earth's centre, relative to their largest."""
        height = radius - GROUND
        ozone = np.maximum(0.0, 1.0 - np.abs(height - 25.0) / 15.0)
        return np.exp(-height / _RAYLEIGH_HEIGHT), np.exp(-height / _HAZE_HEIGHT), ozone

    @property
    def haze(self) -> Float64[np.ndarray, "3"]:
        """Extinction of haze at sea level, 1/km."""
        thickness = (self.turbidity - 1.0) * _RAYLEIGH[1] * _RAYLEIGH_HEIGHT
        return thickness / _HAZE_HEIGHT * _HAZE_COLOUR

    def coefficients(self, radius: Values) -> tuple[Colours, Colours, Colours]:
        """What air and what haze scatter, and extinction of all, (..., 3), 1/km."""
        air, haze, ozone = (density[..., None] for density in self.densities(radius))
        scattered = air * _RAYLEIGH
        hazy = haze * self.haze
        return scattered, _HAZE_SCATTERS * hazy, scattered + hazy + ozone * _OZONE

    def transmittance(self, radius: Values, cosine: Values) -> Colours:
        """Of the air between points and the sun, (..., 3), ``cosine`` its zenith angle's there; 0 behind the earth."""
        radius = np.clip(radius, GROUND, TOP)
        reach = np.sqrt(radius**2 - GROUND**2)
        to_top = _to_sphere(radius, cosine, TOP)
        nearest = TOP - radius
        y = reach / _HORIZON_REACH * (len(self._sun) - 1)
        x = (to_top - nearest) / np.maximum(reach + _HORIZON_REACH - nearest, 1e-9)
        found = _bilinear(self._sun, y, np.clip(x, 0.0, 1.0) * (self._sun.shape[1] - 1))
        return found * self._is_up(radius, cosine)[..., None]

    @staticmethod
    def _is_up(radius: Values, cosine: Values) -> Values:
        """1 where the sun stands above the horizon, 0 where the earth is before it, over the width of its disc."""
        horizon = -np.sqrt(np.maximum(1.0 - (GROUND / radius) ** 2, 0.0))
        return np.clip((cosine - horizon) / 0.0093 + 0.5, 0.0, 1.0)

    @cached_property
    def _sun(self) -> Colours:
        """Transmittance by height (rows) and by distance to the top of the air (columns)."""
        rows, columns = 48, 128
        reach = np.linspace(0.0, 1.0, rows)[:, None] * _HORIZON_REACH
        radius = np.sqrt(reach**2 + GROUND**2)
        nearest = TOP - radius
        length = nearest + np.linspace(0.0, 1.0, columns) * (reach + _HORIZON_REACH - nearest)
        cosine = (TOP**2 - radius**2 - length**2) / np.maximum(2.0 * radius * length, 1e-9)
        depth = np.zeros((rows, columns, 3))
        for near, far in _steps(_SUN_STEPS):
            t = 0.5 * (near + far) * length
            along = np.sqrt(radius**2 + t**2 + 2.0 * radius * t * np.clip(cosine, -1.0, 1.0))
            depth += self.coefficients(along)[2] * ((far - near) * length)[..., None]
        return np.exp(-depth)

    @cached_property
    def _often(self) -> tuple[Values, Values, Colours]:
        """Heights, sines of the sun's elevation, and what was scattered more than once there. [Hillaire 5.5]"""
        heights = 100.0 * np.linspace(0.0, 1.0, 12) ** 2
        sines = np.concatenate([-0.35 + 0.25 * np.linspace(0, 1, 6)[:-1], np.linspace(-0.1, 0.2, 13)[:-1]])
        sines = np.concatenate([sines, np.linspace(0.2, 1.0, 9)])
        radius, sine = np.meshgrid(GROUND + np.maximum(heights, 0.001), sines, indexing="ij")
        around = _even_directions(48)
        once, share = np.zeros((*radius.shape, 3)), np.zeros((*radius.shape, 3))
        sun = np.stack([np.sqrt(np.maximum(1.0 - sine**2, 0.0)), sine], axis=-1)
        for x, y, _ in around:
            cosine = sun @ np.array([x, y])
            seen = self._marched(radius, np.full_like(radius, y), (sine, cosine), steps=_MANY_STEPS)
            once += seen[0] / len(around)
            share += seen[1] / len(around)
        return heights, sines, once / (1.0 - np.minimum(share, 0.99))

    def _marched(
        self, radius: Values, up: Values, sun: tuple[Values, Values], *, steps: int
    ) -> tuple[Colours, Colours]:
        """Along lines of sight: light scattered once with an isotropic phase, the ground's too, and what would come of
        unit light everywhere. ``up`` is the cosine to the zenith, ``sun`` those of sun and zenith, sun and line."""
        ground = _to_ground(radius, up)
        hits = np.isfinite(ground)
        length = np.where(hits, ground, _to_sphere(radius, up, TOP))
        once, share, through = np.zeros((*radius.shape, 3)), np.zeros((*radius.shape, 3)), 1.0
        for near, far in _steps(steps):
            t, dt = 0.5 * (near + far) * length, (far - near) * length
            at, sine = _along(radius, up, sun, t)
            air, haze, extinction = self.coefficients(at)
            passed = np.exp(-extinction * dt[..., None])
            part = (air + haze) * (1.0 - passed) / np.maximum(extinction, 1e-12) * through
            once += part * self.transmittance(at, sine) / (4.0 * np.pi)
            share += part
            through = through * passed
        at, sine = _along(radius, up, sun, length)
        lit = np.maximum(sine, 0.0)[..., None] * self.transmittance(at, sine) * np.array(self.ground) / np.pi
        return once + np.where(hits[..., None], lit * through, 0.0), share

    def seen(
        self,
        elevations: Float64[np.ndarray, "e"],
        cosines: Float64[np.ndarray, "e a"],
        *,
        sun_elevation: float,
    ) -> Scattered:
        """From sea level, (e, a, 3): by the elevation of lines of sight above the horizon, and their cosine to the
        sun."""
        from .atmosphere_kernels import scattered

        air = np.stack([_RAYLEIGH, _HAZE_SCATTERS * self.haze, self.haze, _OZONE])
        place = np.array([GROUND, TOP, _EYE, _RAYLEIGH_HEIGHT, _HAZE_HEIGHT, np.sin(sun_elevation)])
        out = np.empty((3, *cosines.shape, 3))
        given = (np.sin(np.maximum(elevations, 0.0)), cosines.ravel(), _SIGHT_ENDS, air, self._sun)
        scattered(*map(_frozen, given), tuple(map(_frozen, self._often)), _frozen(place), out)
        return Scattered(*out)


@lru_cache(maxsize=4)
def atmosphere(turbidity: float, ground: tuple[float, float, float]) -> Atmosphere:
    """One of the last few, with its tables."""
    return Atmosphere(turbidity, ground)


def _steps(count: int) -> list[tuple[float, float]]:
    """Parts of a line of sight, shorter near the eye, where the air is dense."""
    return list(pairwise((np.linspace(0.0, 1.0, count + 1) ** 2).tolist()))


def _along(radius: Values, up: Values, sun: tuple[Values, Values], t: Values) -> tuple[Values, Values]:
    """Distance from the earth's centre, and the sine of the sun's elevation, a way along the line of sight."""
    at = np.sqrt(radius**2 + t**2 + 2.0 * radius * t * up)
    return at, (radius * sun[0] + t * sun[1]) / at


def _to_sphere(radius: Values, cosine: Values, outer: float) -> Values:
    """From within, how far it is to a sphere."""
    return -radius * cosine + np.sqrt(np.maximum(outer**2 - radius**2 * (1.0 - cosine**2), 0.0))


def _to_ground(radius: Values, cosine: Values) -> Values:
    """How far it is to the ground; infinite where that is not in the way."""
    inside = GROUND**2 - radius**2 * (1.0 - cosine**2)
    hit = (cosine < 0.0) & (inside >= 0.0)
    return np.where(hit, -radius * cosine - np.sqrt(np.maximum(inside, 0.0)), np.inf)


def _even_directions(count: int) -> Float64[np.ndarray, "n 3"]:
    """Spread over the sphere (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    y, turn = 1.0 - 2.0 * i / count, np.pi * (3.0 - np.sqrt(5.0)) * i
    ring = np.sqrt(1.0 - y * y)
    return np.stack([ring * np.cos(turn), y, ring * np.sin(turn)], axis=-1)


def _bilinear(table: Colours, rows: Values, columns: Values) -> Colours:
    """At places between a table's entries."""
    i = np.minimum(rows.astype(np.int64), len(table) - 2)
    j = np.minimum(columns.astype(np.int64), table.shape[1] - 2)
    s, t = (rows - i)[..., None], (columns - j)[..., None]
    above = table[i, j] * (1.0 - t) + table[i, j + 1] * t
    return above * (1.0 - s) + (table[i + 1, j] * (1.0 - t) + table[i + 1, j + 1] * t) * s


def _frozen(a: np.ndarray) -> np.ndarray:
    view = np.ascontiguousarray(a).view()
    view.flags.writeable = False
    return view
