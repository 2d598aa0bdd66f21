"""Soft disc lights: round lights infinitely far away, added to an environment's map."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import CubeMap, Float32, Float64
from . import quantities
from .painting import pointing
from .quantities import Triple
from .regions import Cap


class Texels(NamedTuple):
    """A rectangle of a cube map's texels, and the radiance that a disc adds to each."""

    face: int
    rows: slice
    columns: slice
    radiance: Float32[np.ndarray, "row column 3"]


@dataclass(frozen=True)
class Disc:
    """A round light of a direction, a radius and a radiance. It adds to what is behind it.

    Its edge is that of ``regions.Cap``: at the radius radiance is one half, and the light's whole,
    ∫ L dω = radiance · 2π·(1 − cos radius), does not depend on the softness.

    Parameters
    ----------
    direction
        Where the light comes from; need not be unit.
    radius_deg
        0.001 to 90; the sun's is 0.27.
    radiance
        Linear red, green, blue, W·sr⁻¹·m⁻² as the map's; not negative.
    softness
        0 (a hard edge) to 1 (falling off from the middle, out to √2 of a small radius).

    Raises
    ------
    InputError
        For anything else.
    """

    direction: Triple
    radius_deg: float
    radiance: Triple
    softness: float = 0.0

    def __post_init__(self) -> None:
        region = Cap(self.direction, self.radius_deg, self.softness)
        for attribute in ("direction", "radius_deg", "softness"):
            object.__setattr__(self, attribute, getattr(region, attribute))
        object.__setattr__(self, "radiance", quantities.colour("radiance", self.radiance))

    @classmethod
    def at(
        cls,
        azimuth_deg: float,
        elevation_deg: float,
        *,
        radius_deg: float,
        radiance: Sequence[float],
        softness: float = 0.0,
    ) -> Disc:
        """By azimuth, from −Z (ahead) towards +X (right), and elevation above the horizon."""
        azimuth = quantities.amount("azimuth", azimuth_deg)
        elevation = quantities.amount("elevation", elevation_deg, least=-90.0, most=90.0)
        x, y, z = pointing(azimuth, elevation).tolist()
        return cls((x, y, z), radius_deg, quantities.colour("radiance", radiance), softness)

    @cached_property
    def region(self) -> Cap:
        """What it covers."""
        return Cap(self.direction, self.radius_deg, self.softness)

    @property
    def total(self) -> Float64[np.ndarray, "3"]:
        """∫ L dω, in closed form: the irradiance of a surface that faces it, for a small disc."""
        return self.region.solid_angle * np.array(self.radiance)

    def turned(self, degrees: float) -> Disc:
        """Turned about +Y, counter-clockwise seen from above."""
        return replace(self, direction=quantities.turned(self.direction, degrees))

    def times(self, factors: Sequence[float]) -> Disc:
        """Its red, green and blue multiplied."""
        r, g, b = (value * factor for value, factor in zip(self.radiance, factors, strict=True))
        return replace(self, radiance=(r, g, b))

    def texels(self, resolution: int) -> list[Texels]:
        """What it adds to a cube map: rectangles in the order of the faces, at most one a face.

        Every texel gets radiance × the covered share of it, exact to rounding, so Σ radiance · solid angle is
        ``total`` for any radius and resolution. Texels of these rectangles that it does not touch get zero.
        Raises InputError unless 1 ≤ resolution ≤ 4096.
        """
        radiance = np.array(self.radiance)
        return [
            Texels(face, rows, columns, (share[..., None] * radiance).astype(np.float32))
            for face, rows, columns, share in self.region.cover(resolution)
        ]


def add_discs(cube: CubeMap, discs: Iterable[Disc]) -> None:
    """Add discs to a cube map in place: one after another, each one's rectangles in order, in float32."""
    for disc in discs:
        for face, rows, columns, radiance in disc.texels(cube.shape[1]):
            cube[face, rows, columns] += radiance
