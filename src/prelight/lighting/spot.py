"""Spots: lights at a place that was baked, whose aim, shape and colour are free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float64
from ..bases import spherical_harmonics as sh
from ..bases.steering import SpotBasis
from ..errors import InputError
from . import quantities
from .distributions import Distribution, Fit, Power, fitted, frame
from .places import Place
from .quantities import Triple

NOTICED = 0.03  # relative RMS error of a distribution from which people are told


@dataclass(frozen=True)
class Spot:
    """A light that is aimed.

    Parameters
    ----------
    intensity
        Linear red, green, blue where the distribution is 1 (along the beam of the usual ones), W/sr; a sky's is
        radiance.
    direction
        Where it points; where the light comes from, for a sky. Need not be unit. Or ``target``, a point it points at.
    distribution
        Its shape; None for the basis lights' own, ((1 + ω·p)/2)^N.
    roll_deg
        Turn about the beam, clockwise for somebody who looks along it.
    layer
        The name of the layer that has its place; may be left out where there is one.

    Raises
    ------
    InputError
        For anything else.
    """

    intensity: Triple
    direction: Triple | None = None
    target: Triple | None = None
    distribution: Distribution | None = None
    roll_deg: float = 0.0
    layer: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "intensity", quantities.strength("intensity", self.intensity))
        if (self.direction is None) == (self.target is None):
            raise InputError("direction", "expected either a direction or a target")
        if self.direction is not None:
            object.__setattr__(self, "direction", quantities.unit("direction", self.direction))
        else:
            object.__setattr__(
                self, "target", quantities.triple("target", self.target, what="x, y, z in metres")
            )
        object.__setattr__(self, "roll_deg", quantities.amount("roll_deg", self.roll_deg))

    def aim(self, place: Place) -> Float64[np.ndarray, "3"]:
        """The unit direction in which it points. Raises InputError where its target is its own place, or a sky's."""
        if self.direction is not None:
            return np.array(self.direction)
        if place.kind == "sky":
            raise InputError("target", "a light from all around has no target; expected a direction")
        assert self.target is not None
        return place.toward(self.target)

    def fit(self, basis: SpotBasis) -> Fit | None:
        """How well a basis holds its shape; None for the basis lights' own, which it holds exactly."""
        return None if self.distribution is None else fitted(self.distribution, basis)

    def shape(self, basis: SpotBasis, place: Place) -> Float64[np.ndarray, "functions channels"]:
        """Coefficients (S, 1 or 3) of its distribution as it is aimed, without its colour."""
        aim = self.aim(place)
        if self.distribution is None:
            return basis.coefficients(np.asarray(basis.factors), aim)[:, None]
        if isinstance(self.distribution, Power):
            factors = sh.power_factors(self.distribution.power, basis.degree)
            return sh.zonal(factors, aim[None])[0, basis.kept][:, None]
        harmonics = self.distribution.harmonics(basis.degree)
        return basis.of_harmonics(sh.rotated(harmonics, frame(aim, self.roll_deg)))

    def coefficients(self, basis: object, place: Place) -> Float64[np.ndarray, "functions 3"]:
        """Coefficients (S, 3) in a spot's basis. Raises InputError where the layer is that of a panel."""
        if not isinstance(basis, SpotBasis):
            what = "its layer" if self.layer is None else f"the layer {self.layer}"
            raise InputError("spot", f"{what} is that of a panel; expected [[panel]] for it")
        return self.shape(basis, place) * np.array(self.intensity)

    def notes(self, basis: object, place: Place) -> list[str]:
        """What somebody who lights with it should know: a shape that this layer holds only roughly."""
        if not isinstance(basis, SpotBasis):
            return []
        fit = self.fit(basis)
        if fit is None:
            return []
        if fit.error < NOTICED:
            dark = f"its shape falls to {100 * fit.lowest:.0f} % of its peak: it takes light away there"
            return [dark] if fit.lowest < -NOTICED else []
        return [f"its shape is approximated by degree {basis.degree}: {fit.words}"]
