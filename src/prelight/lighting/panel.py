"""Panels: lights that slide over a rectangle (or through a box) that was baked, and change their size."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from ..arrays import Float64
from ..bases.exponentials import ExponentialAxis, ExponentialBasis
from ..bases.panels import PanelBasis, axis_functions, power_coefficients, raised_cosine_coefficients
from ..bases.products import ProductBasis
from ..errors import InputError
from . import quantities
from .places import Place
from .quantities import Triple
from .spot import NOTICED, Spot

Shape = Literal["raised-cosine", "soft"]
_DARK = 0.01  # of the middle: below it nobody sees a copy
_LOOKS = 4096


@dataclass(frozen=True)
class AxisFit:
    """A shape on one axis as so many harmonics hold it; errors as in ``distributions.Fit``.

    ``reach``: how far from its middle it is brighter than a hundredth, in parts of the panel.
    """

    coefficients: Float64[np.ndarray, "functions"]
    error: float
    worst: float
    lowest: float
    reach: float


def soft_power(width: float) -> float:
    """ν of |cos πx|^(2ν) that is half at x = ±width/2."""
    return math.log(0.5) / (2.0 * math.log(math.cos(0.5 * math.pi * width)))


def axis_shape(shape: Shape, width: float, x: np.ndarray) -> Float64[np.ndarray, "..."]:
    """A shape at distances from its middle, in parts of the panel, as it is: 1 in its middle, no copies."""
    if shape == "soft":
        inside = np.abs(x) < 0.5
        return np.where(inside, np.abs(np.cos(np.pi * x)) ** (2.0 * soft_power(0.5 * width)), 0.0)
    return np.where(np.abs(x) < 0.5 * width, 0.5 + 0.5 * np.cos(2.0 * np.pi * x / width), 0.0)


def exponential_fit(axis: ExponentialAxis, shape: Shape, width: float, at: float) -> AxisFit:
    """A shape with its middle at ``at`` as an axis of exponentials times polynomials holds it best over the panel."""
    found, error = axis.fitted(lambda x: axis_shape(shape, width, x - at))
    x = (np.arange(_LOOKS) + 0.5) / _LOOKS
    held, wanted = axis.evaluate(x) @ found, axis_shape(shape, width, x - at)
    return AxisFit(found, error, float(np.abs(held - wanted).max()), float(held.min()), 0.0)


def axis_fit(shape: Shape, width: float, harmonics: int) -> AxisFit:
    """A shape of this width, in parts of the panel, around 0.

    ``raised-cosine``: (1 + cos(2πx/width))/2, dark from ±width/2 on, approximated. ``soft``: |cos πx|^(2ν), half at
    ±width/4 so that it looks as wide; exact for whole ν up to the number of harmonics.
    """
    x = (np.arange(_LOOKS) + 0.5) / _LOOKS - 0.5
    wanted = axis_shape(shape, width, x)
    if shape == "soft":
        found = power_coefficients(soft_power(0.5 * width), harmonics)
    else:
        found = raised_cosine_coefficients(width, harmonics)
    held = axis_functions(harmonics, x) @ found
    left = held - wanted
    reach = float(np.abs(x[wanted > _DARK]).max())
    error = float(np.sqrt(np.square(left).mean() / np.square(wanted).mean()))
    return AxisFit(found, error, float(np.abs(left).max()), float(held.min()), reach)


@dataclass(frozen=True)
class Panel:
    """A soft light that is moved over a panel.

    Parameters
    ----------
    position
        Of its middle in parts of the panel, 0 to 1 along each edge: two numbers, three in a box.
    width
        Full width from dark to dark, in parts of the panel, above 0 to 1 along each edge.
    radiance
        Linear red, green, blue of its middle, W·sr⁻¹·m⁻².
    shape
        ``"raised-cosine"``, as the paper's, or ``"soft"``, with longer tails.
    beam
        Where the layer can be turned as well: direction, distribution and roll of what leaves each point, relative to
        ``radiance`` (its intensity multiplies). None for the basis lights' own shape, straight ahead.
    layer
        The name of the layer that has its place; may be left out where there is one.

    Raises
    ------
    InputError
        For anything else.
    """

    position: tuple[float, ...]
    width: tuple[float, ...]
    radiance: Triple
    shape: Shape = "raised-cosine"
    beam: Spot | None = None
    layer: str | None = None

    def __post_init__(self) -> None:
        for name, least, most in (("position", -1.0, 2.0), ("width", 0.01, 1.0)):
            given = getattr(self, name)
            if not isinstance(given, tuple | list) or len(given) not in (2, 3):
                raise InputError(name, f"{str(given)[:60]}, expected two numbers, three in a box of light")
            checked = tuple(quantities.amount(name, part, least=least, most=most) for part in given)
            object.__setattr__(self, name, checked)
        if len(self.position) != len(self.width):
            raise InputError("width", f"{len(self.width)} numbers, but position has {len(self.position)}")
        object.__setattr__(self, "radiance", quantities.strength("radiance", self.radiance))
        if self.shape not in get_args(Shape):
            raise InputError(
                "shape", f"{str(self.shape)[:40]!r}, expected one of {', '.join(get_args(Shape))}"
            )

    def shape_at(self, points: np.ndarray) -> Float64[np.ndarray, "points"]:
        """Its true shape at coordinates (n, axes), without its colour; nothing comes back at the opposite edge."""
        found = np.ones(len(points))
        for x, at, width in zip(points.T, self.position, self.width, strict=True):
            found *= axis_shape(self.shape, width, x - at)
        return found

    def fits(self, basis: PanelBasis | ExponentialBasis) -> list[AxisFit]:
        """Its shape on each axis. Raises InputError where the panel has another number of axes."""
        axes = len(basis.harmonics) if isinstance(basis, PanelBasis) else len(basis.axes)
        if axes != len(self.width):
            raise InputError("position", f"{len(self.width)} numbers, this layer's light has {axes} axes")
        if isinstance(basis, ExponentialBasis):
            return [
                exponential_fit(axis, self.shape, w, at)
                for axis, w, at in zip(basis.axes, self.width, self.position, strict=True)
            ]
        return [axis_fit(self.shape, w, n) for w, n in zip(self.width, basis.harmonics, strict=True)]

    def free_range(self, basis: PanelBasis) -> list[tuple[float, float]]:
        """On each axis, from where to where its middle may be before a copy comes in at the opposite edge."""
        return [(fit.reach, 1.0 - fit.reach) for fit in self.fits(basis)]

    def placed(self, basis: PanelBasis | ExponentialBasis) -> Float64[np.ndarray, "functions"]:
        """Coefficients (S,) of its shape where it is, without its colour."""
        if isinstance(basis, ExponentialBasis):
            own = np.ones(1)
            for fit in self.fits(basis):
                own = np.multiply.outer(own, fit.coefficients).ravel()
            return own
        shape = basis.product([fit.coefficients for fit in self.fits(basis)])
        return basis.shifted(shape, np.array(self.position))

    def coefficients(self, basis: object, place: Place) -> Float64[np.ndarray, "functions 3"]:
        """Coefficients (S, 3). Raises InputError where the layer is that of a spot."""
        panel = basis.panel if isinstance(basis, ProductBasis) else basis
        if not isinstance(panel, PanelBasis | ExponentialBasis):
            what = "its layer" if self.layer is None else f"the layer {self.layer}"
            raise InputError("panel", f"{what} is that of a spot; expected [[spot]] for it")
        placed = self.placed(panel)[:, None] * np.array(self.radiance)
        if not isinstance(basis, ProductBasis):
            if self.beam is not None:
                raise InputError(
                    "direction", "this layer's light is baked with one beam; leave direction out"
                )
            return placed
        beam = self.beam or Spot((1.0, 1.0, 1.0), direction=self.ahead(place))
        turned = beam.shape(basis.spot, place) * np.array(beam.intensity)
        return (placed[:, None] * turned[None]).reshape(basis.functions, 3)

    @staticmethod
    def ahead(place: Place) -> Triple:
        """Straight out of a panel."""
        first, second = np.array(place.edges[0]), np.array(place.edges[1])
        x, y, z = np.cross(first, second).tolist()
        return x, y, z

    def notes(self, basis: object, place: Place) -> list[str]:
        """What somebody who lights with it should know: copies at the other edge, a shape held only roughly."""
        panel = basis.panel if isinstance(basis, ProductBasis) else basis
        if not isinstance(panel, PanelBasis | ExponentialBasis):
            return []
        found, wraps = [], isinstance(panel, PanelBasis)
        for axis, (at, fit) in enumerate(zip(self.position, self.fits(panel), strict=True)):
            low, high = fit.reach, 1.0 - fit.reach
            if wraps and not low - 1e-9 <= at <= high + 1e-9:
                found.append(
                    f"position {at:g} along axis {axis + 1} is outside {low:.2f} to {high:.2f}:"
                    " a part comes back at the opposite edge"
                )
            if fit.error >= NOTICED:
                found.append(
                    f"along axis {axis + 1} its shape is approximated: {100 * fit.error:.2g} % RMS, at worst"
                    f" {100 * fit.worst:.2g} % of its middle; a mirror shows it"
                )
        if self.beam is not None and isinstance(basis, ProductBasis):
            found += self.beam.notes(basis.spot, place)
        return found

    def moved(self, position: tuple[float, ...]) -> Panel:
        """The same elsewhere."""
        return replace(self, position=position)
