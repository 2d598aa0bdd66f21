"""How a light shines over the directions: shapes in a frame of their own, and how well a basis can hold them.

The frame is the lamp's: x to the *left* of somebody who looks along the beam, y up, z along the beam. A basis holds
polynomials up to its degree exactly; of anything else it holds the least-squares approximation, and how far that is
off is said here, before anything is traced.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from ..arrays import Float64
from ..bases import spherical_harmonics as sh
from ..bases.steering import SpotBasis
from ..errors import InputError
from . import quantities

_LOOKS = 128  # degree of the rule that looks at a distribution between the harmonics


@dataclass(frozen=True)
class Fit:
    """A distribution as a basis holds it, in the lamp's frame.

    ``harmonics`` ((N + 1)², C), C 1 or 3; ``error`` RMS over the sphere, relative to the RMS of the distribution;
    ``worst`` and ``lowest``: the largest difference and the lowest value, relative to the largest value.
    """

    harmonics: Float64[np.ndarray, "harmonics channels"]
    error: float
    worst: float
    lowest: float

    @property
    def words(self) -> str:
        """The error in words."""
        return (
            f"{100 * self.error:.2g} % RMS, at worst {100 * self.worst:.2g} % of the peak,"
            f" lowest {100 * self.lowest:.2g} %"
        )


class Distribution(Protocol):
    """Relative intensity over directions, in the lamp's frame."""

    def along(self, directions: np.ndarray) -> np.ndarray:
        """Values (n, C), C 1 or 3, of unit directions (n, 3)."""
        ...

    def harmonics(self, degree: int) -> np.ndarray:
        """Coefficients ((degree + 1)², C) of the best approximation."""
        ...


def fitted(distribution: Distribution, basis: SpotBasis) -> Fit:
    """A distribution as this basis holds it."""
    kept = basis.to_harmonics(basis.of_harmonics(distribution.harmonics(basis.degree)))
    nodes, weights = sh.quadrature(max(_LOOKS, 2 * basis.degree))
    wanted = distribution.along(nodes)
    left = wanted - sh.evaluate(basis.degree, nodes) @ kept
    peak = max(float(np.abs(wanted).max()), 1e-300)
    whole = float(weights @ np.square(wanted).sum(axis=1))
    error = math.sqrt(float(weights @ np.square(left).sum(axis=1)) / max(whole, 1e-300))
    lowest = float((wanted - left).min()) / peak
    return Fit(kept, error, float(np.abs(left).max()) / peak, lowest)


@dataclass(frozen=True)
class Power:
    """((1 + ω·p)/2)^ν: one along the beam. A basis of degree N holds whole ν ≤ N exactly, others below N nearly so."""

    power: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "power", quantities.amount("power", self.power, least=0.0, most=1e4))

    @classmethod
    def of_width(cls, width_deg: float) -> Power:
        """By the full angle at whose edge the intensity is half: cos(width/4)^(2ν) = ½."""
        width = quantities.amount("width_deg", width_deg, least=1.0, most=350.0)
        return cls(math.log(0.5) / (2.0 * math.log(math.cos(math.radians(width) / 4.0))))

    @property
    def width_deg(self) -> float:
        """The full angle at whose edge the intensity is half; 360 where it never falls so low."""
        if self.power <= 0.0:
            return 360.0
        return math.degrees(4.0 * math.acos(min(0.5 ** (0.5 / self.power), 1.0)))

    def along(self, directions: np.ndarray) -> np.ndarray:
        """Values (n, 1)."""
        return np.maximum(0.5 + 0.5 * np.asarray(directions, np.float64)[:, 2:3], 0.0) ** self.power

    def harmonics(self, degree: int) -> np.ndarray:
        """Coefficients, in closed form."""
        return sh.zonal(sh.power_factors(self.power, degree), np.array([[0.0, 0.0, 1.0]])).T


@dataclass(frozen=True)
class Polynomial:
    """Σ c_p·(ω·p)^p, for coefficients (c₀, c₁, …): at most 41 of them."""

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        given = tuple(self.coefficients) if isinstance(self.coefficients, Sequence | np.ndarray) else ()
        if not 1 <= len(given) <= sh.MAX_ORDER + 1:
            raise InputError(
                "polynomial", f"{len(given)} coefficients, expected 1 to {sh.MAX_ORDER + 1}: c₀, c₁, …"
            )
        checked = tuple(quantities.amount("polynomial", c, least=-1e6, most=1e6) for c in given)
        object.__setattr__(self, "coefficients", checked)

    def along(self, directions: np.ndarray) -> np.ndarray:
        """Values (n, 1)."""
        cosine = np.asarray(directions, np.float64)[:, 2:3]
        return np.polynomial.polynomial.polyval(cosine, self.coefficients)

    def harmonics(self, degree: int) -> np.ndarray:
        """Coefficients, in closed form."""
        factors = np.zeros(max(degree, len(self.coefficients) - 1) + 1)
        factors[: len(self.coefficients)] = sh.polynomial_factors(self.coefficients)
        return sh.zonal(factors[: degree + 1], np.array([[0.0, 0.0, 1.0]])).T


@dataclass(frozen=True, eq=False)
class Gobo:
    """A picture in front of the lamp, as the beam throws it: upright, its middle along the beam; dark around it.

    Parameters
    ----------
    picture
        (height, width, 3) linear, not negative.
    spread_deg
        The angle from its left edge to its right one, 1 to 170.
    source
        The file it was read from, if any.
    """

    picture: np.ndarray
    spread_deg: float
    source: str = ""

    def __post_init__(self) -> None:
        p = np.asarray(self.picture)
        if p.ndim != 3 or p.shape[2] != 3 or not p.size or not np.isfinite(p).all() or p.min() < 0.0:
            raise InputError(
                "picture", f"shape {p.shape}, expected (height, width, 3), finite and not negative"
            )
        spread = quantities.amount("spread_deg", self.spread_deg, least=1.0, most=170.0)
        object.__setattr__(self, "spread_deg", spread)

    def along(self, directions: np.ndarray) -> np.ndarray:
        """Values (n, 3), between the pixels' centres linearly."""
        d = np.asarray(directions, np.float64)
        height, width = self.picture.shape[:2]
        ahead = d[:, 2] > 1e-6
        scale = 0.5 * width / math.tan(math.radians(0.5 * self.spread_deg)) / np.where(ahead, d[:, 2], 1.0)
        x, y = (
            0.5 * width - 0.5 - d[:, 0] * scale,
            0.5 * height - 0.5 - d[:, 1] * scale,
        )  # x of the frame is left
        inside = (
            ahead
            & (np.abs(x - 0.5 * width + 0.5) <= 0.5 * width)
            & (np.abs(y - 0.5 * height + 0.5) <= 0.5 * height)
        )
        found = np.zeros((len(d), 3))
        x, y = np.clip(x[inside], 0.0, width - 1.0), np.clip(y[inside], 0.0, height - 1.0)
        column, row = (
            np.minimum(x.astype(int), max(width - 2, 0)),
            np.minimum(y.astype(int), max(height - 2, 0)),
        )
        s, t = (x - column)[:, None], (y - row)[:, None]
        right, below = np.minimum(column + 1, width - 1), np.minimum(row + 1, height - 1)
        p = self.picture
        upper = p[row, column] * (1.0 - s) + p[row, right] * s
        lower = p[below, column] * (1.0 - s) + p[below, right] * s
        found[inside] = upper * (1.0 - t) + lower * t
        return found

    def harmonics(self, degree: int) -> np.ndarray:
        """Coefficients by a fine rule over the sphere."""
        return measured_harmonics(self, degree, detail=self.picture.shape[1] * 360.0 / self.spread_deg)


@lru_cache(maxsize=32)
def measured_harmonics(distribution: Distribution, degree: int, *, detail: float) -> np.ndarray:
    """Coefficients of a distribution known by its values alone; ``detail``: samples around the circle that show all.

    Kept, because a light that is dragged asks for them at every step.
    """
    fine = int(np.clip(2.0 * detail, 4 * degree + 64, 360))
    nodes, _ = sh.quadrature(fine)
    return sh.project(distribution.along(nodes), degree, degree=fine)


def frame(direction: np.ndarray, roll_deg: float = 0.0) -> Float64[np.ndarray, "3 3"]:
    """The rotation from the lamp's frame to the scene: its columns are left, up and the beam in the scene.

    Without roll the lamp's up is as near +Y as the beam allows; −Z where it points straight down, +Z straight up.
    ``roll_deg`` turns about the beam, clockwise for somebody who looks along it.
    """
    z = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    up = np.array([0.0, 1.0, 0.0])
    if np.hypot(z[0], z[2]) < 1e-6:
        up = np.array([0.0, 0.0, math.copysign(1.0, z[1])])
    left = np.cross(up, z)
    left /= np.linalg.norm(left)
    above = np.cross(z, left)
    c, s = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    return np.stack([c * left + s * above, c * above - s * left, z], axis=1)
