"""Position times direction: lights that slide over a panel and turn, from one set of basis lights.

The span functions are all products of a panel's and a spot's; function p·S_spot + s is the panel's p times the spot's
s. A light that is separable is steered first in one and then in the other, so no matrix of the product is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Float64
from .exponentials import ExponentialBasis
from .panels import PanelBasis
from .sampled_set import SampledSet
from .steering import SpotBasis


@dataclass(frozen=True, eq=False)
class ProductBasis(SampledSet):
    """Every sum of products of a panel's and a spot's functions: 25 × 16 = 400 lights in the paper's example."""

    panel: PanelBasis | ExponentialBasis
    spot: SpotBasis

    @property
    def functions(self) -> int:
        """S, the product of both."""
        return self.panel.functions * self.spot.functions

    @property
    def lights(self) -> int:
        """M, the product of both."""
        return self.panel.lights * self.spot.lights

    @property
    def largest_norm(self) -> float:
        """The largest ‖w‖ of a basis light moved and turned anywhere."""
        return self.panel.largest_norm * self.spot.largest_norm

    @cached_property
    def to_lights(self) -> Float64[np.ndarray, "lights functions"]:
        """A (M, S), the Kronecker product of both; (M·S) numbers, so only for a modest basis."""
        return np.kron(self.panel.to_lights, self.spot.to_lights)

    def coefficients(self, panel: np.ndarray, spot: np.ndarray) -> Float64[np.ndarray, "functions"]:
        """Those of a separable light f_x·f_ω from the coefficients of both factors."""
        return np.multiply.outer(self.panel.checked(panel), self.spot.checked(spot)).ravel()

    def weights(self, coefficients: np.ndarray) -> Float64[np.ndarray, "lights ..."]:
        """w (M, …): first by position, then by direction."""
        c = self.checked(coefficients)
        split = c.reshape(self.panel.functions, self.spot.functions, -1)
        placed = self.panel.weights(split.reshape(self.panel.functions, -1))
        placed = placed.reshape(self.panel.lights, self.spot.functions, -1).transpose(1, 0, 2)
        turned = self.spot.weights(placed.reshape(self.spot.functions, -1))
        turned = turned.reshape(self.spot.lights, self.panel.lights, -1).transpose(1, 0, 2)
        return turned.reshape(self.lights, *c.shape[1:])

    def evaluate(self, points: np.ndarray, directions: np.ndarray) -> Float64[np.ndarray, "points functions"]:
        """The span functions (n, S) at coordinates (n, axes) and unit directions (n, 3)."""
        own, other = self.panel.evaluate(points), self.spot.evaluate(directions)
        return (own[:, :, None] * other[:, None, :]).reshape(len(own), -1)
