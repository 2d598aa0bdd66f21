"""Does one set of numbers agree with a noisy reference? Corrected for how many are compared."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..images.metrics import relative_rms


def _normal_quantile(p: float) -> float:
    """z with Φ(z) = p, by bisection on the error function."""
    low, high = -40.0, 40.0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if 0.5 * math.erfc(-middle / math.sqrt(2)) < p else (low, middle)
    return (low + high) / 2


def sidak_z(count: int, *, alpha: float = 0.01) -> float:
    """How many standard deviations one of ``count`` differences may show, two-sided, at level ``alpha`` for all."""
    each = -math.expm1(math.log1p(-alpha) / max(count, 1))  # 1 − (1 − α)^(1/n)
    return -_normal_quantile(each / 2)


@dataclass(frozen=True)
class Agreement:
    """Of values with a reference of known variance."""

    passing_share: float  # |a − b| ≤ tolerance + z·σ with Šidák's z
    pooled_z: float  # Σ(a − b) / √Σσ², the one test that sees a small bias everywhere
    relative_rms: float
    noise: float  # what relative_rms the reference's variance alone explains


def agreement(
    values: np.ndarray, reference: np.ndarray, variance: np.ndarray, *, tolerance: float = 0.0
) -> Agreement:
    """Compare arrays of one shape; ``tolerance`` is absolute, for lossy values."""
    difference = values - reference
    allowed = tolerance + sidak_z(values.size) * np.sqrt(variance)
    spread = math.sqrt(float(variance.sum()))
    return Agreement(
        passing_share=float((np.abs(difference) <= allowed + 1e-12).mean()),
        pooled_z=float(difference.sum()) / spread if spread else math.copysign(math.inf, difference.sum()),
        relative_rms=relative_rms(values, reference),
        noise=math.sqrt(float(variance.mean() / (reference**2).mean())),
    )
