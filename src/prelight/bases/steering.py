"""Steering the direction of a light: the span in which light is recorded, and the sampled basis set.

*Span functions* are spherical harmonics up to degree N (all of them, or the bands of N's parity): what one pass of
tracing records. *Basis lights* are one shape f, aimed in M well-spread directions p_i: what the paper renders, what
any renderer can render, and what is compressed. With A the (M, S) matrix of the basis lights' coefficients, a light of
coefficients c is Σ w_i·L_i with Aᵀw = c, so w = pinv(Aᵀ)·c by the singular value decomposition ((MᵀM)⁻¹Mᵀ, as the
paper prints it, is singular there).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from . import spherical_harmonics as sh
from .sampled_set import SampledSet
from .well_spread import (
    SMALLEST_RATIO,
    Parity,
    checked_parity,
    has_band,
    largest_norm,
    of_full_rank,
    well_spread,
)


@dataclass(frozen=True, eq=False)
class SpotBasis(SampledSet):
    """Every distribution over directions that is a polynomial of at most a degree.

    Parameters
    ----------
    degree
        N, 0 to 40. A spot ((1 + ω·p)/2)^N is as narrow as a distribution of this basis gets without lobes.
    parity
        ``"all"``, or ``"even"`` or ``"odd"`` (as the degree is) for distributions with f(−ω) = ±f(ω).
    aims
        Directions (M, 3) of the basis lights; well-spread ones if not said. Perturbed if short of rank.
    factors
        λ_l (N + 1,) of their shape; the spot ((1 + ω·p)/2)^N, or (ω·p)^N where there is a parity.

    Raises
    ------
    InputError
        For anything else, and for a shape that lacks a band.
    """

    degree: int
    parity: Parity = "all"
    aims: np.ndarray | None = None
    factors: np.ndarray | Sequence[float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "degree", sh.checked_order(self.degree))
        checked_parity(self.parity, self.degree)
        if self.aims is not None:
            object.__setattr__(self, "aims", of_full_rank(self.aims, self.degree, parity=self.parity))
        needed = has_band(self.parity, self.degree)
        given = self.factors if self.factors is not None else self._own_factors()
        factors = np.asarray(given, np.float64)
        if factors.shape != needed.shape or not np.isfinite(factors).all() or (factors[needed] == 0.0).any():
            raise InputError(
                "factors", f"expected {len(needed)} numbers, none zero: λ_l of each band of the shape"
            )
        object.__setattr__(self, "factors", np.where(needed, factors, 0.0))

    def _own_factors(self) -> np.ndarray:
        if self.parity == "all":
            return sh.power_factors(self.degree)
        return sh.polynomial_factors([0.0] * self.degree + [1.0])

    @cached_property
    def kept(self) -> np.ndarray:
        """Which of the (N + 1)² harmonics are span functions, as indices (S,)."""
        return np.flatnonzero(has_band(self.parity, self.degree)[sh.bands(self.degree)])

    @property
    def functions(self) -> int:
        """S: (N + 1)², or (N + 1)(N + 2)/2."""
        return len(self.kept)

    @property
    def directions(self) -> Float64[np.ndarray, "lights 3"]:
        """p_i, where the basis lights are aimed."""
        return well_spread(self.degree, self.parity) if self.aims is None else self.aims

    @property
    def lights(self) -> int:
        """M: how many basis lights there are."""
        return len(self.directions)

    @property
    def largest_norm(self) -> float:
        """The largest ‖w(p)‖ over the sphere, for lights of the basis lights' own shape."""
        return _norm_of(self.degree, self.parity) if self.aims is None else self._norm

    @cached_property
    def _norm(self) -> float:
        return largest_norm(self.directions, self.degree, parity=self.parity)

    def components(self, x: Any, y: Any, z: Any) -> list[Any]:
        """The span functions at unit directions, as a list of S; coordinates of any arithmetic kind."""
        every = sh.components(self.degree, x, y, z)
        return [every[k] for k in self.kept]

    def evaluate(self, directions: np.ndarray) -> Float64[np.ndarray, "directions functions"]:
        """The span functions (n, S) at unit directions (n, 3)."""
        return sh.evaluate(self.degree, directions)[:, self.kept]

    @cached_property
    def to_lights(self) -> Float64[np.ndarray, "lights functions"]:
        """A (M, S): coefficients of the basis lights; basis images are A @ span images."""
        return sh.zonal(np.asarray(self.factors), self.directions)[:, self.kept]

    def coefficients(self, factors: np.ndarray, direction: np.ndarray) -> Float64[np.ndarray, "functions"]:
        """c (S,) of a light of at most this degree, Σ_l (2l + 1)/4π·λ_l·P_l(ω·p), aimed along a unit direction.

        Raises InputError where the light has a band that the basis lacks.
        """
        given = np.asarray(factors, np.float64)
        full = np.zeros(max(len(given), self.degree + 1))
        full[: len(given)] = given
        absent = np.append(~has_band(self.parity, self.degree), np.ones(len(full) - self.degree - 1, bool))
        if (np.abs(full[absent]) > 1e-9 * np.abs(full).max()).any():
            kind = "" if self.parity == "all" else f" {self.parity}"
            raise InputError(
                "distribution",
                f"is no{kind} polynomial of degree {self.degree}; take a lower one, or bake with a higher degree",
            )
        return sh.zonal(full[: self.degree + 1], np.asarray(direction, np.float64).reshape(1, 3))[
            0, self.kept
        ]

    def of_harmonics(self, coefficients: np.ndarray) -> Float64[np.ndarray, "functions ..."]:
        """The best approximation in the span of a function given by harmonics of any order, (n,) or (n, C)."""
        c = np.asarray(coefficients, np.float64)
        full = np.zeros((sh.count(self.degree), *c.shape[1:]))
        number = min(len(c), len(full))
        full[:number] = c[:number]
        return full[self.kept]

    def to_harmonics(self, coefficients: np.ndarray) -> Float64[np.ndarray, "harmonics ..."]:
        """The other way: (S, …) to all (N + 1)², those outside the span zero."""
        c = np.asarray(coefficients, np.float64)
        full = np.zeros((sh.count(self.degree), *c.shape[1:]))
        full[self.kept] = c
        return full

    def aimed(self, direction: np.ndarray) -> Float64[np.ndarray, "lights"]:
        """w(p) (M,): the basis lights' own shape, aimed along p."""
        return self.weights(self.coefficients(np.asarray(self.factors), direction))

    @property
    def conditioned(self) -> bool:
        """Whether A has full rank: every function of the span is a sum of basis lights."""
        values = np.linalg.svd(self.to_lights / np.abs(self.to_lights).max(axis=0), compute_uv=False)
        return bool(len(values) == self.functions and values[-1] > SMALLEST_RATIO * values[0])


@lru_cache(maxsize=32)
def _norm_of(degree: int, parity: Parity) -> float:
    return largest_norm(well_spread(degree, parity), degree, parity=parity)
