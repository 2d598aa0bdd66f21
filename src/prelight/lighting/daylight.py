"""Daylight: the sun and the clear sky of a place, a day and an hour, as an environment.

In W·sr⁻¹·m⁻² of 683 lm/W, so that luminance in cd/m² is 683 times the radiance's, and real lamps may stand beside it.
Twilight is the air's own; from 18° below the horizon on it is dark, exactly: there are no moon and no stars.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property

import numpy as np

from ..arrays import Float64, Picture
from . import quantities
from .atmosphere import Atmosphere, Scattered, atmosphere
from .disc import Disc
from .environment import Environment
from .layouts import LatLong
from .moment import Site
from .painting import LUMINANCE, every_direction, pointing
from .quantities import Triple
from .sun_position import SunPosition, sun_position

LUMENS_PER_WATT = 683.0
SOLAR_ILLUMINANCE = 127_500.0  # lux above the air, at one astronomical unit [IES 1984]
SUNLIGHT = np.array([1.098, 0.977, 0.936])  # its colour there: 5,900 K, at luminance one
NIGHT_DEG = -18.0
LOWEST_TURBIDITY, HIGHEST_TURBIDITY = 1.0, 10.0
HEIGHT, WIDTH = 180, 360  # of the sky's map
# A disc whose light is spread as the sun's, whose limb is darker (1 − 0.6·(1 − cos)): mean r² and mean r⁴ are the same.
LIMB_RADIUS, LIMB_SOFTNESS = 0.9273, 0.4826
_ELEVATIONS, _AZIMUTHS = 32, 25


@dataclass(frozen=True)
class Daylight:
    """Sun and sky. Raises InputError for what is out of range.

    Parameters
    ----------
    place, when
        On earth; the moment knows its zone.
    turbidity
        1 (no haze) to 10; 2 is a clear day (see ``atmosphere``).
    ground
        Albedo of the ground below the horizon, red, green and blue: endless, matte and level.
    north_deg
        Where north lies: an azimuth of the scene, from −Z towards +X. With 0 north is −Z and east +X.
    scale
        Factor of all radiance.
    """

    place: Site
    when: datetime
    turbidity: float = 2.0
    ground: Triple = (0.25, 0.25, 0.25)
    north_deg: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        turbidity = quantities.amount(
            "turbidity", self.turbidity, least=LOWEST_TURBIDITY, most=HIGHEST_TURBIDITY
        )
        put(self, "turbidity", turbidity)
        ground = quantities.colour("ground_albedo", self.ground)
        put(
            self,
            "ground",
            tuple(quantities.amount("ground_albedo", part, least=0.0, most=1.0) for part in ground),
        )
        put(self, "north_deg", quantities.amount("north_deg", self.north_deg))
        put(self, "scale", quantities.amount("scale", self.scale, least=0.0))

    def at(self, when: datetime) -> Daylight:
        """The same place and air at another moment."""
        return replace(self, when=when)

    @cached_property
    def position(self) -> SunPosition:
        """Of the sun."""
        return sun_position(
            self.when, latitude_deg=self.place.latitude_deg, longitude_deg=self.place.longitude_deg
        )

    @property
    def azimuth_deg(self) -> float:
        """Of the sun in the scene, from −Z towards +X, within ±180."""
        return (self.position.azimuth_deg + self.north_deg + 180.0) % 360.0 - 180.0

    @property
    def is_night(self) -> bool:
        """Whether it is dark, exactly."""
        return self.position.elevation_deg <= NIGHT_DEG

    @cached_property
    def sunlight(self) -> Float64[np.ndarray, "3"]:
        """Irradiance of a surface that faces the sun, by its disc alone; W·m⁻²."""
        elevation = math.radians(max(self.position.elevation_deg, 0.0))
        air = self._air.transmittance(np.array([6360.002]), np.array([max(math.sin(elevation), 0.0)]))[0]
        return self._outside * air * self._risen

    @property
    def sun(self) -> Disc | None:
        """The sun's disc; None below the horizon, or where nothing of its light arrives."""
        light = self.sunlight
        if not light.any():
            return None
        x, y, z = pointing(self.azimuth_deg, self.position.elevation_deg).tolist()
        radius = LIMB_RADIUS * self.position.radius_deg
        dark = Disc((x, y, z), radius, (1.0, 1.0, 1.0), LIMB_SOFTNESS)
        r, g, b = (light / dark.total).tolist()
        return replace(dark, radiance=(r, g, b))

    @cached_property
    def sky(self) -> Picture:
        """(180, 360, 3) a latitude-longitude map of the sky and the ground, without the sun's disc."""
        return self.sky_of(HEIGHT)

    def sky_of(self, height: int) -> Picture:
        """The same of any even height, (height, 2 · height, 3): a low one is made sooner."""
        if self.is_night or not self.scale:
            return np.zeros((height, 2 * height, 3), np.float32)
        half = height // 2
        directions = every_direction(height, 2 * height)[:half].astype(np.float64)
        towards = pointing(self.azimuth_deg, self.position.elevation_deg)
        picture = np.empty((height, 2 * height, 3))
        picture[:half] = self._scattered(height).radiance(directions @ towards) * self._outside
        weights = LatLong().solid_angles(height, 2 * height)[:half]
        fallen = np.einsum("ij,ijk->k", weights * directions[..., 1], picture[:half])
        fallen += self.sunlight * max(math.sin(math.radians(self.position.elevation_deg)), 0.0)
        picture[half:] = np.array(self.ground) * fallen / np.pi
        return picture.astype(np.float32)

    def environment(self, height: int = HEIGHT) -> Environment:
        """Sky, ground and the sun as a disc in front of them; ``height`` as of ``sky_of``."""
        sun = self.sun
        pixels = self.sky if height == HEIGHT else self.sky_of(height)
        pixels.setflags(write=False)
        found = Environment(pixels, "latlong", name="[sun]")
        return found if sun is None else found.with_disc(sun)

    @property
    def illuminance(self) -> tuple[float, float]:
        """Of level ground, lux: by the sun, and by the sky."""
        height = math.sin(math.radians(self.position.elevation_deg))
        sun = float(self.sunlight @ LUMINANCE) * max(height, 0.0)
        half = HEIGHT // 2
        up = every_direction(HEIGHT, WIDTH)[:half, :, 1] * LatLong().solid_angles(HEIGHT, WIDTH)[:half]
        sky = float(np.einsum("ij,ijk,k->", up, self.sky[:half].astype(np.float64), LUMINANCE))
        return LUMENS_PER_WATT * sun, LUMENS_PER_WATT * sky

    @property
    def _air(self) -> Atmosphere:
        return atmosphere(self.turbidity, self.ground)

    @property
    def _outside(self) -> Float64[np.ndarray, "3"]:
        """The sun's irradiance above the air, times the scale."""
        return self.scale * SOLAR_ILLUMINANCE / LUMENS_PER_WATT / self.position.distance**2 * SUNLIGHT

    @property
    def _risen(self) -> float:
        """How much of the sun's disc is above the horizon, 0 to 1."""
        t = min(max(self.position.elevation_deg / self.position.radius_deg, -1.0), 1.0)
        return (math.acos(-t) + t * math.sqrt(max(1.0 - t * t, 0.0))) / math.pi

    def _scattered(self, height: int) -> Scattered:
        """For the upper half of the map's pixels: the same on both sides of the sun."""
        half, width = height // 2, 2 * height
        elevation = 0.5 * np.pi * np.linspace(0.0, 1.0, _ELEVATIONS) ** 2
        azimuth = np.linspace(0.0, np.pi, _AZIMUTHS)
        sun = math.radians(self.position.elevation_deg)
        cosine = np.cos(elevation)[:, None] * np.cos(azimuth) * math.cos(sun)
        cosine += np.sin(elevation)[:, None] * math.sin(sun)
        seen = self._air.seen(elevation, np.clip(cosine, -1.0, 1.0), sun_elevation=sun)
        rows = _weights(elevation, 0.5 * np.pi * (1.0 - (np.arange(half) + 0.5) / half))
        off = 2.0 * np.pi * ((np.arange(width) + 0.5) / width - 0.5) - math.radians(self.azimuth_deg)
        columns = _weights(azimuth, np.abs(np.remainder(off + np.pi, 2.0 * np.pi) - np.pi))
        parts = np.concatenate([seen.air, seen.haze, seen.often], axis=2)
        whole = columns @ np.tensordot(rows, parts, axes=1)
        return Scattered(*np.split(whole, 3, axis=2))


def _weights(nodes: Float64[np.ndarray, "m"], places: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n m"]:
    """Rows that interpolate between nodes."""
    return np.stack([np.interp(places, nodes, row) for row in np.eye(len(nodes))], axis=1)
