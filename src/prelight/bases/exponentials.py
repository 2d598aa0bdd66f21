"""The largest family that is steered by shifting: exponentials times polynomials, e^(αx)·x^k for complex α.

Sinusoids of whole periods are its best-known members (``panels.py``); the others have no copies that wrap around, but
their light ends at the panel's edges, wherever it is shifted. Coordinates run from 0 to 1 over the panel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from .sampled_set import SampledSet

Term = tuple[complex, int]  # α and the highest power k
_MOST_POWER, _LARGEST_RATE, _NODES = 12, 200.0, 96


def _checked(term: object) -> Term:
    try:
        alpha, power = complex(term[0]), int(term[1])  # ty: ignore[not-subscriptable]
    except (TypeError, ValueError, IndexError, OverflowError):
        raise InputError("terms", f"{str(term)[:60]}, expected pairs of a complex rate and a power") from None
    if not (
        abs(alpha.real) <= _LARGEST_RATE and abs(alpha.imag) <= _LARGEST_RATE and 0 <= power <= _MOST_POWER
    ):
        raise InputError(
            "terms", f"{str(term)[:60]}, expected |rate| ≤ {_LARGEST_RATE:g}, power 0 to {_MOST_POWER}"
        )
    return alpha, power


@dataclass(frozen=True, eq=False)
class ExponentialAxis:
    """The functions of one axis: for every term (α, n) all e^(αx)·x^k, k ≤ n; cosine and sine where α is complex.

    Raises InputError for rates or powers that float64 cannot hold, and for terms that are not independent.
    """

    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "terms", tuple(_checked(term) for term in self.terms))
        if not self.terms:
            raise InputError("terms", "none given, expected pairs of a complex rate and a power")
        node, _ = _rule()
        values = self.evaluate(node)
        scaled = np.linalg.svd(values / np.abs(values).max(axis=0), compute_uv=False)
        if scaled[-1] <= 1e-10 * scaled[0]:
            raise InputError("terms", "depend on each other over the panel; take fewer powers or other rates")

    @property
    def functions(self) -> int:
        """How many functions there are."""
        return sum((power + 1) * (1 if alpha.imag == 0.0 else 2) for alpha, power in self.terms)

    def evaluate(self, x: np.ndarray) -> Float64[np.ndarray, "points functions"]:
        """Values (n, functions) at coordinates (n,)."""
        t = np.asarray(x, np.float64)
        found = []
        for alpha, power in self.terms:
            for k in range(power + 1):
                wave = np.exp(alpha * t) * t**k
                found += [wave.real] if alpha.imag == 0.0 else [wave.real, wave.imag]
        return np.stack(found, axis=-1)

    def shift(self, by: float) -> Float64[np.ndarray, "functions functions"]:
        """The matrix that takes the coefficients of f(x) to those of f(x − by)."""
        found = np.zeros((self.functions, self.functions))
        first = 0
        for alpha, power in self.terms:
            wide = 1 if alpha.imag == 0.0 else 2
            for k in range(power + 1):
                for j in range(k + 1):  # (x − p)^k = Σ_j C(k, j)·(−p)^(k−j)·x^j
                    factor = np.exp(-alpha * by) * math.comb(k, j) * (-by) ** (k - j)
                    block = np.array([[factor.real, factor.imag], [-factor.imag, factor.real]])
                    to, of = first + j * wide, first + k * wide
                    found[to : to + wide, of : of + wide] = block[:wide, :wide]
            first += (power + 1) * wide
        return found

    def fitted(
        self, shape: Callable[[np.ndarray], np.ndarray]
    ) -> tuple[Float64[np.ndarray, "functions"], float]:
        """Coefficients of the least-squares approximation over the panel, and its relative RMS error.

        The functions are not orthogonal: a pseudo-inverse at the nodes of Gauss's rule finds them.
        """
        node, weight = _rule()
        root, wanted = np.sqrt(weight), shape(node)
        values = self.evaluate(node) * root[:, None]
        found = np.linalg.pinv(values, rcond=1e-12) @ (wanted * root)
        left = np.linalg.norm(values @ found - wanted * root)
        return found, float(left / max(np.linalg.norm(wanted * root), 1e-300))


def _rule() -> tuple[np.ndarray, np.ndarray]:
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    return 0.5 * (node + 1.0), 0.5 * weight


@dataclass(frozen=True, eq=False)
class ExponentialBasis(SampledSet):
    """Products of one function of each axis, the last axis running fastest; two axes for a panel, three for a box.

    Basis lights are shifted copies of one shape, the sum of the highest function of every term; or ``orthonormal``
    ones, which no lamp is, but whose weights are no larger than the light itself: what a bake is compressed in.
    """

    axes: tuple[ExponentialAxis, ...]
    orthonormal: bool = False

    @property
    def functions(self) -> int:
        """S."""
        return math.prod(axis.functions for axis in self.axes)

    @cached_property
    def positions(self) -> Float64[np.ndarray, "lights axes"]:
        """How far the basis lights are shifted, in parts of the panel: Chebyshev's points on each axis."""
        per_axis = [
            0.5 - 0.5 * np.cos(np.pi * (np.arange(a.functions) + 0.5) / a.functions) for a in self.axes
        ]
        return np.stack(np.meshgrid(*per_axis, indexing="ij"), axis=-1).reshape(-1, len(self.axes))

    @cached_property
    def largest_norm(self) -> float:
        """The largest ‖w(p)‖ of a basis light shifted by 0 to 1 on each axis; 1 of orthonormal ones."""
        if self.orthonormal:
            return 1.0
        largest = 1.0
        for axis, own in zip(self.axes, self._per_axis, strict=True):
            inverse = np.linalg.pinv(own.T, rcond=1e-14)
            shifts = np.stack([axis.shift(p) @ _own_shape(axis) for p in np.linspace(0.0, 1.0, 101)])
            largest *= float(np.linalg.norm(shifts @ inverse.T, axis=1).max())
        return largest

    @cached_property
    def _per_axis(self) -> list[np.ndarray]:
        found = []
        for axis in self.axes:
            if self.orthonormal:
                found.append(_orthonormal(axis))
                continue
            steps = 0.5 - 0.5 * np.cos(np.pi * (np.arange(axis.functions) + 0.5) / axis.functions)
            found.append(np.stack([axis.shift(float(p)) @ _own_shape(axis) for p in steps]))
        return found

    @cached_property
    def to_lights(self) -> Float64[np.ndarray, "lights functions"]:
        """A (M, S): coefficients of the basis lights."""
        found = np.ones((1, 1))
        for own in self._per_axis:
            found = np.kron(found, own)
        return found

    def evaluate(self, points: np.ndarray) -> Float64[np.ndarray, "points functions"]:
        """The span functions (n, S) at coordinates (n, axes)."""
        x = np.asarray(points, np.float64).reshape(-1, len(self.axes))
        found = np.ones((len(x), 1))
        for axis, coordinate in zip(self.axes, x.T, strict=True):
            found = (found[:, :, None] * axis.evaluate(coordinate)[:, None, :]).reshape(len(x), -1)
        return found

    def shifted(self, coefficients: np.ndarray, by: np.ndarray) -> Float64[np.ndarray, "functions ..."]:
        """Coefficients (S, …) of f(x − by), exactly; ``by`` (axes,) in parts of the panel."""
        c = self.checked(coefficients)
        found = c.reshape(*(axis.functions for axis in self.axes), *c.shape[1:])
        for n, (axis, step) in enumerate(zip(self.axes, by, strict=True)):
            found = np.moveaxis(np.tensordot(axis.shift(float(step)), found, axes=(1, n)), 0, n)
        return found.reshape(c.shape)


def _own_shape(axis: ExponentialAxis) -> np.ndarray:
    found, first = np.zeros(axis.functions), 0
    for alpha, power in axis.terms:
        wide = 1 if alpha.imag == 0.0 else 2
        found[first + power * wide] = 1.0
        first += (power + 1) * wide
    return found


def _orthonormal(axis: ExponentialAxis) -> np.ndarray:
    """Rows are coefficients of functions that are orthonormal over the panel: f·R⁻¹ where √w·f = Q·R."""
    node, weight = _rule()
    triangle = np.linalg.qr(axis.evaluate(node) * np.sqrt(weight)[:, None], mode="r")
    return np.linalg.inv(triangle).T
