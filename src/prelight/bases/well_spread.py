"""Directions spread so well over the sphere that steering between them multiplies nothing.

Lights of one shape aimed in (N + 1)² directions span the harmonics up to degree N. Their weights for another aim p
are w(p) = G⁻¹·k(p), with G_ij = K(p_i·p_j) and k_i = K(p·p_i) for the kernel K(t) = Σ (2l + 1)/4π·P_l(t) over the
bands of the basis: the same for every shape. Random directions make ‖w‖ as large as 10⁴ at N = 9, and errors grow with
it; directions that make det G largest keep it below 2.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.polynomial import legendre

from ..arrays import Float64
from ..errors import InputError

Parity = Literal["all", "even", "odd"]
TARGET = 2.0  # of ‖w‖: below it more steps would be wasted
_STEPS, _LOOK_EVERY, _ATTEMPTS = 400, 20, 8
SMALLEST_RATIO = 1e-9  # of singular values: below it a set of directions is short of rank


def has_band(parity: Parity, degree: int) -> np.ndarray:
    """Which of the bands 0 … degree a basis has, (degree + 1,) bool; those of the degree's parity if not all."""
    every = np.arange(degree + 1)
    return np.ones(degree + 1, bool) if parity == "all" else (degree - every) % 2 == 0


def checked_parity(parity: str, degree: int) -> Parity:
    """``all``, or the parity that the degree has; raises InputError."""
    known: dict[str, Parity] = {"all": "all", "even": "even", "odd": "odd"}
    if parity not in known:
        raise InputError("parity", f"{parity!r}, expected one of {', '.join(known)}")
    if parity != "all" and (degree % 2 == 0) != (parity == "even"):
        raise InputError("parity", f"{parity}, but degree {degree} is not; take a degree one higher or lower")
    return known[parity]


def spiral(number: int) -> Float64[np.ndarray, "directions 3"]:
    """Nearly uniform unit directions along a golden spiral."""
    i = np.arange(number) + 0.5
    height = 1.0 - 2.0 * i / number
    azimuth, radius = np.pi * (1.0 + 5.0**0.5) * i, np.sqrt(1.0 - height * height)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1)


def _kernel(cosines: np.ndarray, degree: int, parity: Parity) -> tuple[np.ndarray, np.ndarray]:
    """K and dK/dt."""
    series = (2.0 * np.arange(degree + 1) + 1.0) / (4.0 * np.pi) * has_band(parity, degree)
    slope = legendre.legder(series) if degree else np.zeros(1)
    return legendre.legval(cosines, series), legendre.legval(cosines, slope)


def largest_norm(directions: np.ndarray, degree: int, *, parity: Parity = "all", looks: int = 4096) -> float:
    """The largest ‖w(p)‖ over ``looks`` aims p spread over the sphere, for lights of one shape."""
    d = np.asarray(directions, np.float64)
    gram, _ = _kernel(d @ d.T, degree, parity)
    toward, _ = _kernel(d @ spiral(looks).T, degree, parity)
    inverse = np.linalg.pinv(gram, rcond=SMALLEST_RATIO**2, hermitian=True)
    return float(np.linalg.norm(inverse @ toward, axis=0).max())


def singular_ratio(directions: np.ndarray, degree: int, *, parity: Parity = "all") -> float:
    """Smallest over largest singular value of the functions' values at the directions; 0 if there are too few."""
    functions = int(((2 * np.arange(degree + 1) + 1) * has_band(parity, degree)).sum())
    if len(directions) < functions:
        return 0.0
    gram, _ = _kernel(directions @ directions.T, degree, parity)
    values = np.linalg.eigvalsh(gram)[-functions:]
    return float(np.sqrt(max(values[0], 0.0) / values[-1]))


def spread(
    start: np.ndarray, degree: int, *, parity: Parity = "all", target: float = TARGET
) -> Float64[np.ndarray, "directions 3"]:
    """Move directions until no ‖w‖ is above ``target``, or det G does not grow any more."""
    p = np.asarray(start, np.float64)
    gram, slope = _kernel(p @ p.T, degree, parity)
    best = np.linalg.slogdet(gram)[1]
    step = 0.1 / np.sqrt(len(p))
    for n in range(_STEPS):
        if n % _LOOK_EVERY == 0 and largest_norm(p, degree, parity=parity, looks=1024) <= target:
            break
        uphill = (np.linalg.pinv(gram, hermitian=True) * slope) @ p  # of log det G
        uphill -= (uphill * p).sum(axis=1, keepdims=True) * p
        longest = np.linalg.norm(uphill, axis=1).max()
        if longest == 0.0 or step < 1e-9:
            break
        moved = p + step / longest * uphill
        moved /= np.linalg.norm(moved, axis=1, keepdims=True)
        new_gram, new_slope = _kernel(moved @ moved.T, degree, parity)
        volume = np.linalg.slogdet(new_gram)[1]
        if volume > best:
            p, gram, slope, best, step = moved, new_gram, new_slope, volume, 1.2 * step
        else:
            step *= 0.5
    return p


def of_full_rank(
    directions: np.ndarray, degree: int, *, parity: Parity = "all", seed: int = 0
) -> Float64[np.ndarray, "directions 3"]:
    """The directions, made unit, and perturbed and tried again while they are short of rank (the paper's rule).

    Raises InputError for what are no directions, too few of them, or where no perturbation helps.
    """
    d = np.asarray(directions, np.float64)
    if d.ndim != 2 or d.shape[1] != 3 or not np.isfinite(d).all() or not np.linalg.norm(d, axis=1).all():
        raise InputError("directions", "expected rows of three finite numbers, none of them all zero")
    needed = int(((2 * np.arange(degree + 1) + 1) * has_band(parity, degree)).sum())
    if len(d) < needed:
        raise InputError("directions", f"{len(d)} of them, degree {degree} needs at least {needed}")
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    random, nudge = np.random.default_rng((seed, degree)), 0.01
    for _ in range(_ATTEMPTS):
        if singular_ratio(d, degree, parity=parity) > SMALLEST_RATIO:
            return d
        d = d + nudge * random.standard_normal(d.shape)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        nudge *= 2.0
    raise InputError("directions", f"do not span degree {degree}, nor perturbed; spread them over the sphere")


@lru_cache(maxsize=32)
def well_spread(degree: int, parity: Parity = "all") -> Float64[np.ndarray, "directions 3"]:
    """(N + 1)² directions, or (N + 1)(N + 2)/2 of the half sphere for odd and even; the same every time. Read-only."""
    number = (degree + 1) ** 2
    start = spiral(number)
    if parity != "all":
        number = (degree + 1) * (degree + 2) // 2
        start = spiral(2 * number)[:number]
    found = of_full_rank(
        spread(of_full_rank(start, degree, parity=parity), degree, parity=parity), degree, parity=parity
    )
    found.setflags(write=False)
    return found
