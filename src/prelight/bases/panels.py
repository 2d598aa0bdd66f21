"""Steering the position of a light: products of sinusoids that fit a rectangle in whole periods.

Coordinates run from 0 to 1 over the rectangle (a *panel*; a box, in three dimensions). On each axis stand 1 and
√2·cos 2πkx, √2·sin 2πkx for k = 1 … n: orthonormal, and shifted exactly by turning each pair of cosine and sine.
Because they are periodic, what is shifted over one edge comes back at the opposite one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from .sampled_set import SampledSet
from .spherical_harmonics import checked_order

MOST_HARMONICS = 20
_ROOT = math.sqrt(2.0)


def axis_components(harmonics: int, cosine: Any, sine: Any) -> list[Any]:
    """The 2n + 1 functions of one axis from cos 2πx and sin 2πx, of any arithmetic kind."""
    values = [1.0 + 0.0 * cosine]
    c, s = cosine, sine
    for _ in range(harmonics):
        values += [_ROOT * c, _ROOT * s]
        c, s = c * cosine - s * sine, s * cosine + c * sine
    return values


def axis_functions(harmonics: int, x: np.ndarray) -> Float64[np.ndarray, "points functions"]:
    """The functions (n, 2·harmonics + 1) of one axis at coordinates (n,)."""
    angle = 2.0 * np.pi * np.asarray(x, np.float64)
    return np.stack(axis_components(harmonics, np.cos(angle), np.sin(angle)), axis=-1)


def axis_shift(harmonics: int, by: float) -> Float64[np.ndarray, "functions functions"]:
    """The matrix that takes the coefficients of f(x) to those of f(x − by)."""
    shift = np.eye(2 * harmonics + 1)
    for k in range(1, harmonics + 1):
        c, s = math.cos(2.0 * math.pi * k * by), math.sin(2.0 * math.pi * k * by)
        shift[2 * k - 1 : 2 * k + 1, 2 * k - 1 : 2 * k + 1] = (c, -s), (s, c)
    return shift


@dataclass(frozen=True, eq=False)
class PanelBasis(SampledSet):
    """Every distribution over a panel made of up to so many whole periods on each axis.

    Span functions are products over the axes, the last axis running fastest. Basis lights are shifted copies of one
    shape, ((1 + cos 2πx)/2)^n on each axis, at positions k/(2n + 1): non-negative, and ‖w(p)‖ = 1 for all positions.

    Parameters
    ----------
    harmonics
        n of each axis, 0 to 20: two numbers for a panel, three for a box of light.

    Raises
    ------
    InputError
        For anything else.
    """

    harmonics: tuple[int, ...]

    def __post_init__(self) -> None:
        given = tuple(self.harmonics) if isinstance(self.harmonics, tuple | list) else ()
        if len(given) not in (1, 2, 3):
            raise InputError(
                "harmonics", f"{self.harmonics!r}, expected two numbers for a panel, three for a box"
            )
        checked = tuple(checked_order(n, name="harmonics", most=MOST_HARMONICS) for n in given)
        object.__setattr__(self, "harmonics", checked)

    @property
    def functions(self) -> int:
        """S: the product of 2n + 1 over the axes; 81 for n = 4, 4."""
        return math.prod(2 * n + 1 for n in self.harmonics)

    @property
    def lights(self) -> int:
        """M: as many as span functions."""
        return self.functions

    @property
    def largest_norm(self) -> float:
        """The largest ‖w(p)‖ of a basis light shifted anywhere: 1, the interpolation is orthogonal."""
        return 1.0

    @cached_property
    def positions(self) -> Float64[np.ndarray, "lights axes"]:
        """Where the middles of the basis lights are, in [0, 1) on each axis."""
        axes = [np.arange(2 * n + 1) / (2 * n + 1) for n in self.harmonics]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))

    def components(self, cosines: list[Any], sines: list[Any]) -> list[Any]:
        """The span functions from cos 2πx and sin 2πx of each axis, as a list of S, of any arithmetic kind."""
        values: list[Any] = [1.0]
        for n, c, s in zip(self.harmonics, cosines, sines, strict=True):
            own = axis_components(n, c, s)
            values = [a * b for a in values for b in own]
        return values

    def evaluate(self, points: np.ndarray) -> Float64[np.ndarray, "points functions"]:
        """The span functions (n, S) at coordinates (n, axes)."""
        x = np.asarray(points, np.float64).reshape(-1, len(self.harmonics))
        angle = 2.0 * np.pi * x.T
        return np.stack(self.components(list(np.cos(angle)), list(np.sin(angle))), axis=-1)

    def product(self, per_axis: list[np.ndarray]) -> Float64[np.ndarray, "functions"]:
        """Coefficients (S,) of a product of one function of each axis, from its coefficients (2n + 1,)."""
        found = np.ones(1)
        for own in per_axis:
            found = np.multiply.outer(found, np.asarray(own, np.float64)).ravel()
        return found

    def shifted(self, coefficients: np.ndarray, by: np.ndarray) -> Float64[np.ndarray, "functions ..."]:
        """Coefficients (S, …) of f(x − by), exactly; ``by`` (axes,) in parts of the panel."""
        c = self.checked(coefficients)
        sizes = [2 * n + 1 for n in self.harmonics]
        found = c.reshape(*sizes, *c.shape[1:])
        for axis, (n, step) in enumerate(zip(self.harmonics, by, strict=True)):
            found = np.moveaxis(np.tensordot(axis_shift(n, float(step)), found, axes=(1, axis)), 0, axis)
        return found.reshape(c.shape)

    @cached_property
    def own_shape(self) -> Float64[np.ndarray, "functions"]:
        """Coefficients of a basis light whose middle is at 0."""
        return self.product([power_coefficients(n, n) for n in self.harmonics])

    @cached_property
    def to_lights(self) -> Float64[np.ndarray, "lights functions"]:
        """A (M, S): coefficients of the basis lights; basis images are A @ span images."""
        found = np.ones((1, 1))
        for n in self.harmonics:
            own = np.stack(
                [axis_shift(n, k / (2 * n + 1)) @ power_coefficients(n, n) for k in range(2 * n + 1)]
            )
            found = np.kron(found, own)
        return found


def power_coefficients(power: float, harmonics: int) -> Float64[np.ndarray, "functions"]:
    """Coefficients of ((1 + cos 2πx)/2)^power = |cos πx|^(2·power) on one axis; exact for a whole power ≤ harmonics.

    For a whole power n it is 4⁻ⁿ·(C(2n, n) + 2·Σ_k C(2n, n − k)·cos 2πkx); the same with Γ for any other.
    """
    found = np.zeros(2 * harmonics + 1)
    share = math.exp(math.lgamma(2.0 * power + 1.0) - 2.0 * math.lgamma(power + 1.0) - power * math.log(4.0))
    found[0] = share
    for k in range(harmonics):
        share *= (power - k) / (power + k + 1.0)
        found[2 * k + 1] = _ROOT * share
    return found


def raised_cosine_coefficients(width: float, harmonics: int) -> Float64[np.ndarray, "functions"]:
    """Coefficients of (1 + cos(2πx/width))/2 for |x| < width/2, zero elsewhere: the best approximation on one axis.

    c_k = ∫ f(x)·cos 2πkx dx = sin(πkw)/(2πk·(1 − (kw)²)), and w/4 where kw = 1.
    """
    found = np.zeros(2 * harmonics + 1)
    for k in range(harmonics + 1):
        t = k * width
        share = width / 4.0 if abs(t - 1.0) < 1e-9 else width * np.sinc(t) / (2.0 * (1.0 - t * t))
        found[max(2 * k - 1, 0)] = share if k == 0 else _ROOT * share
    return found


def box_coefficients(width: float, harmonics: int) -> Float64[np.ndarray, "functions"]:
    """Coefficients of 1 for |x| < width/2, zero elsewhere: the best approximation on one axis; it rings."""
    k = np.arange(harmonics + 1)
    share = width * np.sinc(k * width)
    found = np.zeros(2 * harmonics + 1)
    found[0], found[1::2] = share[0], _ROOT * share[1:]
    return found
