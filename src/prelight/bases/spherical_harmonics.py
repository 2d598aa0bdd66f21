"""Real spherical harmonics: values, exact rotation, and functions of the angle to an axis.

Order n has (n+1)² functions, orthonormal over the sphere; function (l, m) stands at l(l+1)+m and there is no
Condon–Shortley sign, so Y₁₋₁, Y₁₀, Y₁₁ = √(3/4π)·(y, z, x). Everything is exact to rounding: harmonics are
polynomials of x, y, z, and Gauss's rule integrates those.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Float64
from ..errors import InputError

_STRIP = 8192  # nodes at a time: all functions of all nodes would be gigabytes
MAX_ORDER = 40  # 1681 functions; beyond it nothing of this size would be traced


def count(order: int) -> int:
    """How many functions there are up to an order: (order + 1)²."""
    return (order + 1) ** 2


def checked_order(order: int, *, name: str = "degree", most: int = MAX_ORDER) -> int:
    """An order as a whole number; raises InputError unless 0 ≤ order ≤ ``most``."""
    if isinstance(order, bool) or not isinstance(order, int | np.integer) or not 0 <= order <= most:
        raise InputError(name, f"{order!r}, expected a whole number from 0 to {most}")
    return int(order)


def bands(order: int) -> np.ndarray:
    """The band l of each function, (count,) int64."""
    return np.repeat(np.arange(order + 1), 2 * np.arange(order + 1) + 1)


def components(order: int, x: Any, y: Any, z: Any) -> list[Any]:
    """Every function at unit directions (x, y, z), in order: a list of (order + 1)² values.

    Additions and multiplications alone, so the coordinates may be arrays of any kind that has them (NumPy's, a
    tracer's) or plain numbers. Normalised Legendre functions by their recurrence in l, times the real and
    imaginary part of (x + iy)^m.
    """
    values: list[Any] = [None] * count(order)
    cosine: Any = 1.0 + 0.0 * x  # of m·azimuth, times sin^m of the polar angle
    sine: Any = 0.0 * x
    diagonal = math.sqrt(1.0 / (4.0 * math.pi))
    for m in range(order + 1):
        before: Any = 0.0
        here: Any = diagonal + 0.0 * z
        for band in range(m, order + 1):
            values[band * (band + 1) + m] = here * cosine
            if m:
                values[band * (band + 1) - m] = here * sine
            following = band + 1
            square = following * following
            a = math.sqrt((4.0 * square - 1.0) / (square - m * m))
            b = (
                math.sqrt(((following - 1.0) ** 2 - m * m) / (4.0 * (following - 1.0) ** 2 - 1.0))
                if band > m
                else 0.0
            )
            before, here = here, (z * here - b * before) * a
        cosine, sine = cosine * x - sine * y, sine * x + cosine * y
        diagonal *= math.sqrt((2.0 * m + 3.0) / (2.0 * m + 2.0)) * (math.sqrt(2.0) if m == 0 else 1.0)
    return values


def evaluate(order: int, directions: np.ndarray) -> Float64[np.ndarray, "directions functions"]:
    """Values (n, (order + 1)²) float64 at unit directions (n, 3)."""
    d = np.asarray(directions, np.float64).reshape(-1, 3)
    if len(d) == 1:  # plain numbers are ten times faster than arrays of one
        return np.array([components(order, *d[0].tolist())])
    return np.stack(components(order, d[:, 0], d[:, 1], d[:, 2]), axis=1)


@lru_cache(maxsize=16)
def quadrature(degree: int) -> tuple[Float64[np.ndarray, "nodes 3"], Float64[np.ndarray, "nodes"]]:
    """Unit directions and weights that integrate polynomials of x, y, z up to ``degree`` exactly; Σ weights = 4π.

    Gauss–Legendre in z, equal steps of azimuth. Read-only arrays.
    """
    height, weight = np.polynomial.legendre.leggauss(degree // 2 + 1)
    around = degree + 1
    azimuth = 2.0 * np.pi * (np.arange(around) + 0.5) / around
    radius = np.sqrt(1.0 - height * height)
    x, y = np.multiply.outer(radius, np.cos(azimuth)), np.multiply.outer(radius, np.sin(azimuth))
    nodes = np.stack([x, y, np.broadcast_to(height[:, None], x.shape)], axis=-1).reshape(-1, 3)
    weights = np.repeat(weight * (2.0 * np.pi / around), around)
    nodes.setflags(write=False)
    weights.setflags(write=False)
    return nodes, weights


def project(values: np.ndarray, order: int, *, degree: int) -> Float64[np.ndarray, "functions ..."]:
    """Coefficients ∫ f·Y of a function known at the nodes of ``quadrature(degree)``: values (nodes,) or (nodes, C).

    Exact where f is a polynomial of at most ``degree − order``; the least-squares approximation otherwise.
    """
    nodes, weights = quadrature(degree)
    f = np.asarray(values, np.float64)
    weighted = f * weights.reshape(-1, *[1] * (f.ndim - 1))
    found = np.zeros((count(order), *f.shape[1:]))
    for first in range(0, len(nodes), _STRIP):
        found += evaluate(order, nodes[first : first + _STRIP]).T @ weighted[first : first + _STRIP]
    return found


def rotated(coefficients: np.ndarray, rotation: np.ndarray) -> Float64[np.ndarray, "functions ..."]:
    """Coefficients of f(R⁻¹ω): the function turned by a rotation R (3, 3). Exact; any number of columns.

    Raises InputError where R is no rotation, or the number of coefficients no square.
    """
    c = np.asarray(coefficients, np.float64)
    order = math.isqrt(len(c)) - 1
    if order < 0 or count(order) != len(c):
        raise InputError("coefficients", f"{len(c)} of them, expected (n + 1)² for an order n")
    R = np.asarray(rotation, np.float64)
    proper = R.shape == (3, 3) and np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0
    if not proper:
        raise InputError("rotation", "expected a rotation: three orthonormal, right-handed rows")
    nodes, _ = quadrature(2 * order)
    return project(evaluate(order, nodes @ R) @ c, order, degree=2 * order)


def power_factors(power: float, degree: int | None = None) -> Float64[np.ndarray, "bands"]:
    """λ_l of ((1 + ω·p)/2)^power: its coefficients are λ_l·Y_lm(p). (degree + 1,), degree = power if not said.

    λ_l = 4π·Γ(ν + 1)² / (Γ(ν − l + 1)·Γ(ν + l + 2)), from ∫(1 + t)^ν·P_l(t) dt: positive for l ≤ ν, zero beyond a
    whole ν, alternating and small beyond any other.
    """
    factors = [4.0 * math.pi / (power + 1.0)]  # λ₀, the light's power
    for band in range(int(power) if degree is None else degree):
        factors.append(factors[-1] * (power - band) / (power + band + 2.0))
    return np.array(factors)


def polynomial_factors(coefficients: Sequence[float] | np.ndarray) -> Float64[np.ndarray, "bands"]:
    """λ_l of Σ c_p·(ω·p)^p, for coefficients (c₀, c₁, …)."""
    legendre = np.polynomial.legendre.poly2leg(np.asarray(coefficients, np.float64))
    return legendre * 4.0 * math.pi / (2.0 * np.arange(len(legendre)) + 1.0)


def profile_factors(
    profile: Callable[[np.ndarray], np.ndarray], order: int, *, breaks: Sequence[float] = ()
) -> Float64[np.ndarray, "bands"]:
    """λ_l = 2π·∫ f(t)·P_l(t) dt of any function f of t = ω·p (Funk and Hecke), by Gauss's rule.

    ``breaks``: where in (−1, 1) f or its derivative jumps; between them it should be smooth.
    """
    edges = np.unique(np.concatenate([[-1.0, 1.0], np.clip(breaks, -1.0, 1.0)]))
    node, weight = np.polynomial.legendre.leggauss(order + 64)
    half = 0.5 * np.diff(edges)[:, None]
    t = (edges[:-1, None] + half * (node + 1.0)).ravel()
    legendre = np.polynomial.legendre.legvander(t, order)
    return 2.0 * np.pi * ((half * weight).ravel() * profile(t)) @ legendre


def zonal(factors: np.ndarray, directions: np.ndarray) -> Float64[np.ndarray, "directions functions"]:
    """Coefficients λ_l·Y_lm(p) of a function of the angle to p, for each of the axes p: (n, (bands)²)."""
    order = len(factors) - 1
    return evaluate(order, directions) * np.asarray(factors, np.float64)[bands(order)]
