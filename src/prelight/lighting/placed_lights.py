"""Lights with a place of their own in the scene: lamps, spots and panels that may be moved anywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from . import quantities
from .distributions import frame
from .places import Place
from .quantities import Triple
from .spot import Spot

RADIUS = 0.02  # metres, of a lamp that says nothing of its size
LARGEST_RADIUS, LARGEST_SIDE = 100.0, 1000.0  # metres
FARTHEST = 1e6  # metres from the middle of the scene's axes


@dataclass(frozen=True)
class Lamp:
    """A ball that shines, or a point.

    Parameters
    ----------
    position
        Its middle, metres.
    beam
        Its light: intensity in W/sr where the distribution is 1, where it points, its shape. Without a distribution
        it shines alike in all directions.
    radius
        Metres; 0 is a point. A ball's radiance is intensity / πr² all over, so that its intensity does not depend on
        its radius; the shape is taken as seen from its middle.
    name
        For people.

    Raises
    ------
    InputError
        For anything else.
    """

    position: Triple
    beam: Spot
    radius: float = RADIUS
    name: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", _position(self.position))
        radius = quantities.amount("radius", self.radius, least=0.0, most=LARGEST_RADIUS)
        object.__setattr__(self, "radius", radius)
        _aim(self.position, self.beam)  # says what is wrong with it

    @classmethod
    def of_power(cls, position: Triple, watts: Triple, *, radius: float = RADIUS) -> Lamp:
        """A lamp that shines alike all around, by its radiant power for red, green and blue."""
        red, green, blue = quantities.strength("power_w", watts)
        intensity = red / (4 * math.pi), green / (4 * math.pi), blue / (4 * math.pi)
        return cls(position, Spot(intensity, direction=(0.0, -1.0, 0.0)), radius)

    @property
    def colour(self) -> Triple:
        """What the light of a lamp of intensity 1 is multiplied by."""
        return self.beam.intensity

    @property
    def axes(self) -> Float64[np.ndarray, "3 3"]:
        """Left, up and the beam in the scene, as columns."""
        return frame(_aim(self.position, self.beam), self.beam.roll_deg)


@dataclass(frozen=True)
class PlacedPanel:
    """A rectangle that shines from one side, evenly.

    Parameters
    ----------
    position
        Its middle, metres.
    size
        Width and height, metres: along the left and the up of ``distributions.frame`` of the direction it faces.
    beam
        Its light: ``intensity`` is the radiance, W·sr⁻¹·m⁻²; where it faces, and its roll. It has no distribution:
        radiance is the same in all directions in front.
    name
        For people.

    Raises
    ------
    InputError
        For anything else.
    """

    position: Triple
    size: tuple[float, float]
    beam: Spot
    name: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", _position(self.position))
        given = self.size
        if not isinstance(given, tuple | list) or len(given) != 2:
            raise InputError("size", f"{str(given)[:60]}, expected two numbers: width and height in metres")
        sides = tuple(quantities.amount("size", side, least=1e-4, most=LARGEST_SIDE) for side in given)
        object.__setattr__(self, "size", sides)
        if self.beam.distribution is not None:
            raise InputError("panel", "has a shape over the directions; one with a place shines evenly")
        _aim(self.position, self.beam)

    @property
    def colour(self) -> Triple:
        """What the light of a panel of radiance 1 is multiplied by."""
        return self.beam.intensity

    @property
    def normal(self) -> Float64[np.ndarray, "3"]:
        """The unit direction that it faces."""
        return _aim(self.position, self.beam)

    @property
    def corners(self) -> Float64[np.ndarray, "4 3"]:
        """Counter-clockwise for somebody in front of it."""
        left, up, _ = frame(self.normal, self.beam.roll_deg).T
        w, h = 0.5 * self.size[0] * left, 0.5 * self.size[1] * up
        return np.array(self.position) + np.array([-w - h, w - h, w + h, h - w])


PlacedLight = Lamp | PlacedPanel


def _position(value: object) -> Triple:
    x, y, z = quantities.triple("position", value, what="x, y, z in metres")
    if max(abs(x), abs(y), abs(z)) > FARTHEST:
        raise InputError(
            "position", f"({x:g}, {y:g}, {z:g}), expected at most {FARTHEST:g} m from the middle"
        )
    return x, y, z


def _aim(position: Triple, beam: Spot) -> Float64[np.ndarray, "3"]:
    """Raises InputError where its target is its own place, and where it names a layer."""
    if beam.layer is not None:
        raise InputError("layer", f"{beam.layer!r}, but it has a position in the scene; leave layer out")
    return beam.aim(Place("spot", position))
