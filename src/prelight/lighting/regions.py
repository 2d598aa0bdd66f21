"""Regions of the sphere that light comes from, or that are painted: round ones, and windows of a lat-long map.

A region says how much of every texel of a cube map it covers, rectangle by rectangle, and turns about +Y.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import Float64
from ..bases import cube_map
from . import quantities
from .painting import pointing
from .quantities import Triple

SMALLEST_RADIUS_DEG, LARGEST_RADIUS_DEG = 0.001, 90.0
_DEEPEST = 1.5  # 1 − cos 120°: no soft edge reaches further
_FEWEST, _ACROSS, _MOST = (
    8,
    256,
    2048,
)  # samples of a side of a texel on the edge of a window, of a side of a face

Directions64 = Float64[np.ndarray, "directions 3"]
Shares = Float64[np.ndarray, "directions"]


class Covered(NamedTuple):
    """A rectangle of texels, and how much of each is covered, 0 to 1."""

    face: int
    rows: slice
    columns: slice
    share: Float64[np.ndarray, "row column"]


@dataclass(frozen=True)
class Cap:
    """A round region with a hard or soft edge.

    With w = 1 − cos(angle to its middle) and W = 1 − cos(radius), the share is 1 up to w = (1 − softness)·W,
    0 from w = (1 + softness)·W, and 1 − 3y² + 2y³ in between, where y goes from 0 to 1; at the radius it is
    one half. So its solid angle, ∫ share dω, is 2π·(1 − cos radius) whatever the softness. Above 75° the
    soft edge reaches to 120° at most.

    Parameters
    ----------
    direction
        Of the middle; need not be unit.
    radius_deg
        0.001 to 90.
    softness
        0 (a hard edge) to 1 (falling off from the middle).
    """

    direction: Triple
    radius_deg: float
    softness: float = 0.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "direction", quantities.unit("direction", self.direction))
        radius = quantities.amount(
            "radius", self.radius_deg, least=SMALLEST_RADIUS_DEG, most=LARGEST_RADIUS_DEG
        )
        put(self, "radius_deg", radius)
        put(self, "softness", quantities.amount("softness", self.softness, least=0.0, most=1.0))

    @cached_property
    def depths(self) -> tuple[float, float]:
        """1 − cos of the angles where the share begins to fall, and where it is zero."""
        middle = 2.0 * math.sin(0.5 * math.radians(self.radius_deg)) ** 2
        soft = self.softness * min(middle, _DEEPEST - middle)
        return middle - soft, middle + soft

    @property
    def solid_angle(self) -> float:
        """∫ share dω, steradians."""
        return math.pi * sum(self.depths)

    def turned(self, degrees: float) -> Cap:
        """Turned about +Y, counter-clockwise seen from above."""
        return replace(self, direction=quantities.turned(self.direction, degrees))

    def along(self, directions: Directions64) -> Shares:
        """The share (n,) along unit directions (n, 3)."""
        inner, outer = self.depths
        w = 0.5 * ((directions - np.array(self.direction)) ** 2).sum(axis=1)
        if inner == outer:
            return np.where(w < inner, 1.0, 0.0)
        y = np.clip((w - inner) / (outer - inner), 0.0, 1.0)
        return 1.0 - y * y * (3.0 - 2.0 * y)

    def cover(self, resolution: int) -> list[Covered]:
        """The rectangles of a cube map's texels that it touches, in the order of the faces.

        Each texel's share is exact to rounding (``cap_kernels``), and Σ share · solid angle of the texel is
        ``solid_angle`` for any radius and resolution. Only what it touches is computed. Raises InputError.
        """
        from . import cap_kernels

        side, edge = quantities.resolution(resolution), self.depths
        reach = math.acos(1.0 - edge[1])
        frame = self._frame
        beyond = min(reach + 1.5 * 2.0 / side, math.pi)
        beyond = 2.0 * math.sin(0.5 * beyond) ** 2 if beyond < math.pi else 3.0
        found = []
        for face, rows, columns in _touched(
            np.array(self.direction), math.sin(min(reach, 0.5 * math.pi)), side
        ):
            share = np.empty((rows.stop - rows.start, columns.stop - columns.start))
            axes = [
                tuple((frame @ table[face]).tolist()) for table in (cube_map.U, cube_map.V, cube_map.AXIS)
            ]
            cap_kernels.cover(share, tuple(axes), (rows.start, columns.start), side, edge, beyond)
            found.append(_trimmed(face, rows, columns, share))
        return [covered for covered in found if covered.share.size]

    @cached_property
    def _frame(self) -> Float64[np.ndarray, "3 3"]:
        """Rows: two directions across, and the middle; right-handed."""
        c = np.array(self.direction)
        across = np.zeros(3)
        across[np.abs(c).argmin()] = 1.0
        across -= (across @ c) * c
        across /= np.linalg.norm(across)
        return np.stack([across, np.cross(c, across), c])


def _touched(c: Float64[np.ndarray, "3"], sine: float, side: int) -> Iterator[tuple[int, slice, slice]]:
    """Rectangles of texels that a cone around c may touch; ``sine`` 1: any of them.

    On the plane of AXIS and U a cone spans the angle of its axis ± asin(sine / length of its axis there).
    """
    for face in range(6):
        ranges = []
        for across in (cube_map.V[face], cube_map.U[face]):
            x, y = float(c @ cube_map.AXIS[face]), float(c @ across)
            length = math.hypot(x, y)
            start, stop = 0, side
            if length > sine:
                middle, spread = math.atan2(y, x), math.asin(min(sine / length, 1.0)) + 1e-12
                low = max(middle - spread, -0.25 * math.pi)
                high = min(middle + spread, 0.25 * math.pi)
                if low > high:
                    break
                start = min(max(math.floor(0.5 * side * (1.0 + math.tan(low)) - 1e-6), 0), side - 1)
                stop = max(min(math.ceil(0.5 * side * (1.0 + math.tan(high)) + 1e-6), side), start + 1)
            ranges.append(slice(start, stop))
        if len(ranges) == 2:
            yield face, ranges[0], ranges[1]


def _trimmed(face: int, rows: slice, columns: slice, share: Float64[np.ndarray, "row column"]) -> Covered:
    """Without the rows and columns at its edges that are not covered at all."""
    touched = share > 0.0
    i, j = np.flatnonzero(touched.any(axis=1)), np.flatnonzero(touched.any(axis=0))
    if not len(i):
        return Covered(face, slice(0, 0), slice(0, 0), share[:0, :0])
    inner = share[i[0] : i[-1] + 1, j[0] : j[-1] + 1]
    top, left = rows.start + int(i[0]), columns.start + int(j[0])
    return Covered(face, slice(top, top + len(inner)), slice(left, left + inner.shape[1]), inner)


@dataclass(frozen=True)
class Window:
    """A rectangle of a lat-long map: a range of azimuths and one of elevations.

    Parameters
    ----------
    azimuth_deg
        From, to: 0 is −Z, 90 is +X; within ±360, at most 360 apart.
    elevation_deg
        From, to: −90 (straight down) to 90 (straight up).
    """

    azimuth_deg: tuple[float, float]
    elevation_deg: tuple[float, float]

    def __post_init__(self) -> None:
        azimuth = quantities.pair("azimuth", self.azimuth_deg, least=-720.0, most=720.0)
        object.__setattr__(self, "azimuth_deg", (azimuth[0], min(azimuth[1], azimuth[0] + 360.0)))
        elevation = quantities.pair("elevation", self.elevation_deg, least=-90.0, most=90.0)
        object.__setattr__(self, "elevation_deg", elevation)

    @property
    def solid_angle(self) -> float:
        """Steradians."""
        low, high = (math.sin(math.radians(e)) for e in self.elevation_deg)
        return math.radians(self.azimuth_deg[1] - self.azimuth_deg[0]) * (high - low)

    def turned(self, degrees: float) -> Window:
        """Turned about +Y, counter-clockwise seen from above."""
        low, high = self.azimuth_deg
        start = (low - degrees + 360.0) % 720.0 - 360.0
        return replace(self, azimuth_deg=(start, start + (high - low)))

    @property
    def _limits(self) -> tuple[float, float, float, float]:
        """Middle and half width in azimuth, radians; sines of the elevations."""
        low, high = (math.radians(a) for a in self.azimuth_deg)
        bottom, top = (math.sin(math.radians(e)) for e in self.elevation_deg)
        return 0.5 * (low + high), 0.5 * (high - low) + 1e-12, bottom, top

    def along(self, directions: Directions64) -> Shares:
        """1 or 0 along unit directions (n, 3)."""
        middle, half, bottom, top = self._limits
        x, y, z = directions.T
        off = np.abs(np.remainder(np.arctan2(x, -z) - middle + np.pi, 2.0 * np.pi) - np.pi)
        return np.where((off <= half) & (y >= bottom) & (y <= top), 1.0, 0.0)

    def cover(self, resolution: int) -> list[Covered]:
        """The rectangles of a cube map's texels that it touches, one a face; raises InputError.

        Texels on its edges are weighed by samples: 8×8 or more, and 256 or more across a face.
        """
        from . import window_kernels

        side = quantities.resolution(resolution)
        narrowest, samples, cone = self._sampling(side)
        found = []
        for face in range(6):
            share = np.empty((side, side))
            axes = tuple(tuple(table[face].tolist()) for table in (cube_map.U, cube_map.V, cube_map.AXIS))
            window_kernels.cover(share, axes, self._limits, cone, (samples, 2.0 / side < narrowest))
            found.append(_trimmed(face, slice(0, side), slice(0, side), share))
        return [covered for covered in found if covered.share.size]

    def _sampling(self, side: int) -> tuple[float, int, tuple[float, float, float, float]]:
        """How wide the window or the gap beside it is where narrowest, radians; samples a side of a texel;
        and a cone around it: its axis, and the cosine below which no middle of a touched texel lies."""
        low, high = (math.radians(e) for e in self.elevation_deg)
        azimuths = math.radians(self.azimuth_deg[1] - self.azimuth_deg[0])
        widest_ring = 1.0 if low < 0.0 < high else max(math.cos(low), math.cos(high))
        gap = 2.0 * math.pi - azimuths
        narrowest = min(high - low, azimuths * widest_ring, gap * widest_ring if gap > 1e-9 else math.inf)
        least = max(_FEWEST, math.ceil(_ACROSS / side))
        samples = min(math.ceil(8.0 * 2.0 / side / narrowest), max(math.ceil(_MOST / side), least))
        reach = 0.5 * azimuths * widest_ring + 0.5 * (high - low) + 2.0 / side
        x, y, z = pointing(0.5 * sum(self.azimuth_deg), 0.5 * sum(self.elevation_deg)).tolist()
        return narrowest, max(samples, least), (x, y, z, math.cos(reach) if reach < math.pi else -2.0)


Region = Cap | Window


@dataclass(frozen=True)
class Paint:
    """A region of an environment's map mixed with a colour: (1 − m)·map + m·radiance, m = opacity · share.

    Parameters
    ----------
    region
        A ``Cap`` or a ``Window``.
    radiance
        Linear red, green, blue, not negative.
    opacity
        0 (nothing is changed) to 1 (replaced).
    """

    region: Region
    radiance: Triple
    opacity: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.region, Cap | Window):
            raise quantities.refused("region", self.region, "a Cap or a Window")
        object.__setattr__(self, "radiance", quantities.colour("radiance", self.radiance))
        object.__setattr__(self, "opacity", quantities.amount("opacity", self.opacity, least=0.0, most=1.0))

    def turned(self, degrees: float) -> Paint:
        """Turned about +Y, counter-clockwise seen from above."""
        return replace(self, region=self.region.turned(degrees))

    def times(self, factors: Sequence[float]) -> Paint:
        """Its red, green and blue multiplied."""
        r, g, b = (value * factor for value, factor in zip(self.radiance, factors, strict=True))
        return replace(self, radiance=(r, g, b))
