"""What of a light may change while a picture is looked for: aim or position, and width, as a few numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..arrays import Float64
from ..bases.panels import PanelBasis
from ..bases.products import ProductBasis
from ..bases.spherical_harmonics import power_factors
from ..bases.steering import SpotBasis
from ..bases.well_spread import spiral
from ..lighting.distributions import Power
from ..lighting.panel import Panel, Shape, axis_fit
from ..lighting.spot import Spot
from .picture_target import Layer

Light = Spot | Panel
_WHITE = (1.0, 1.0, 1.0)
_MOST_AIMS = 192  # 15° apart
_HELD = 0.05  # the largest error of a shape that is tried


@dataclass(frozen=True)
class Freedom:
    """What may change besides the colour."""

    aim: bool = True
    width: bool = True


def whitened(light: Light) -> Light:
    """The light with colour one: what its colour multiplies."""
    if isinstance(light, Spot):
        return replace(light, intensity=_WHITE)
    return replace(light, radiance=_WHITE)


def coloured(light: Light, colour: Sequence[float]) -> Light:
    """The light in another colour."""
    r, g, b = (float(c) for c in colour)
    if isinstance(light, Spot):
        return replace(light, intensity=(r, g, b))
    return replace(light, radiance=(r, g, b))


@lru_cache(maxsize=64)
def narrowest_power(degree: int) -> float:
    """The largest ν whose ((1 + ω·p)/2)^ν the polynomials up to a degree hold to 5 % (RMS).

    Of its square integral 4π/(2ν + 1), the bands up to N hold Σ (2l + 1)/4π·λ_l².
    """
    band = 2.0 * np.arange(degree + 1) + 1.0
    low, high = 0.0, 4.0 * (degree + 1.0) ** 2
    for _ in range(40):
        middle = 0.5 * (low + high)
        held = (band / (4.0 * np.pi) * np.square(power_factors(middle, degree))).sum()
        error = 1.0 - held * (2.0 * middle + 1.0) / (4.0 * np.pi)
        low, high = (middle, high) if error <= _HELD**2 else (low, middle)
    return low


@lru_cache(maxsize=64)
def narrowest_width(shape: Shape, harmonics: int) -> float:
    """The smallest width of a panel's shape on an axis that so many harmonics hold to 5 %; 1 if none."""
    widths = np.linspace(0.02, 1.0, 99)
    held = [axis_fit(shape, float(w), harmonics).error <= _HELD for w in widths]
    return float(widths[int(np.argmax(held))]) if any(held) else 1.0


class Knobs:
    """The free numbers of one light in one layer, and the light for any values of them.

    A spot has two of its aim (steps on the sphere) and the logarithm of ν where its shape is a power; a panel its
    position on each axis and the logarithm of each width. Bounds keep it where the basis holds it.
    """

    def __init__(self, light: Light, layer: Layer, freedom: Freedom) -> None:
        self.light, self.layer = light, layer
        self._aim_free, self._width_free = freedom.aim, freedom.width
        basis = layer.basis
        if isinstance(light, Spot):
            known = (
                isinstance(light.distribution, Power)
                and isinstance(basis, SpotBasis)
                and basis.parity == "all"
            )
            self._width_free &= known
            self._narrowest = narrowest_power(basis.degree) if isinstance(basis, SpotBasis) else 0.0
            return
        panel = basis.panel if isinstance(basis, ProductBasis) else basis
        if not isinstance(panel, PanelBasis):
            self._aim_free = self._width_free = False
            return
        self._limits = [narrowest_width(light.shape, n) for n in panel.harmonics]

    @property
    def number(self) -> int:
        """How many numbers."""
        return len(self.steps)

    @property
    def steps(self) -> Float64[np.ndarray, "numbers"]:
        """How far each is changed to see what it does."""
        if isinstance(self.light, Spot):
            return np.array([1e-4] * (2 * self._aim_free) + [1e-4] * self._width_free)
        axes = len(self.light.position)
        return np.array([1e-4] * (axes * self._aim_free) + [1e-4] * (axes * self._width_free))

    def turned(self, by: np.ndarray) -> Knobs:
        """The light with these steps taken; what leads over a bound ends there."""
        found = object.__new__(Knobs)
        found.__dict__ = dict(self.__dict__)
        found.light = (
            self._moved_spot(by) if isinstance(self.light, Spot) else self._moved_panel(self.light, by)
        )
        return found

    def _moved_spot(self, by: np.ndarray) -> Spot:
        light = self.light
        assert isinstance(light, Spot)
        if self._aim_free:
            aim = light.aim(self.layer.place)
            across = np.cross(aim, np.eye(3)[int(np.abs(aim).argmin())])
            across /= np.linalg.norm(across)
            sideways = by[0] * across + by[1] * np.cross(aim, across)
            angle = min(float(np.linalg.norm(sideways)), 0.5)
            if angle > 0.0:
                way = sideways / np.linalg.norm(sideways)
                aim = math.cos(angle) * aim + math.sin(angle) * way
            x, y, z = aim.tolist()
            light = replace(light, direction=(x, y, z), target=None)
        if self._width_free and isinstance(light.distribution, Power):
            power = max(light.distribution.power, 0.05) * math.exp(float(np.clip(by[-1], -0.7, 0.7)))
            light = replace(light, distribution=Power(min(max(power, 0.05), self._narrowest)))
        return light

    def _moved_panel(self, light: Panel, by: np.ndarray) -> Panel:
        axes = len(light.position)
        position, width = light.position, light.width
        if self._aim_free:
            step = np.clip(by[:axes], -0.25, 0.25)
            position = tuple(min(max(p + s, 0.0), 1.0) for p, s in zip(position, step.tolist(), strict=True))
        if self._width_free:
            factors = np.exp(np.clip(by[-axes:], -0.5, 0.5)).tolist()
            width = tuple(
                min(max(w * f, least), 1.0) for w, f, least in zip(width, factors, self._limits, strict=True)
            )
        return replace(light, position=position, width=width)


def first_guesses(layer: Layer, light: Light | None, freedom: Freedom) -> list[Light]:
    """Lights spread over what a layer can do, to begin from; with a light given, it alone where its aim is kept."""
    name = layer.name
    if light is not None and not freedom.aim:
        return [light]
    if isinstance(layer.basis, SpotBasis):
        if isinstance(light, Spot):
            shapes = [light.distribution]
        else:
            narrow = narrowest_power(layer.basis.degree)
            powers = [Power(narrow * share) for share in (0.15, 0.4, 0.8)]
            shapes = powers if layer.basis.parity == "all" else [None]
        aims = spiral(min(max(3 * layer.basis.lights, 48), _MOST_AIMS)).tolist()
        roll = light.roll_deg if isinstance(light, Spot) else 0.0
        return [
            Spot(_WHITE, direction=(a[0], a[1], a[2]), distribution=shape, roll_deg=roll, layer=name)
            for a in aims
            for shape in shapes
        ]
    panel = layer.basis.panel if isinstance(layer.basis, ProductBasis) else layer.basis
    axes = len(panel.harmonics) if isinstance(panel, PanelBasis) else len(panel.axes)
    per_axis = np.linspace(0.1, 0.9, 9 if axes == 2 else 5)
    places = np.stack(np.meshgrid(*[per_axis] * axes, indexing="ij"), -1).reshape(-1, axes)
    if isinstance(light, Panel):
        return [light.moved(tuple(place)) for place in places.tolist()]
    return [Panel(tuple(p), (w,) * axes, _WHITE, layer=name) for p in places.tolist() for w in (0.4, 0.7)]
