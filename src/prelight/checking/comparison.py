"""How far a relit bake is from a reference: the figures of ``prelight compare``.

A path tracer's reference is noisy and says by how much (its variance), exact integration is not (None). Two
kinds of figures answer two questions: how large the difference is, noise included, and whether it is more than
the noise explains.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from ..errors import InputError
from ..images import metrics
from .statistics import sidak_z

Z_DETECTED = 3.5  # a pooled |z| beyond this is no accident: one in two thousand


@dataclass(frozen=True)
class Figures:
    """Of radiance with its reference; relative to the reference as a whole, never to single receivers."""

    relative_rms: float  # √mean((a − b)²) / √mean(b²), the reference's noise included
    mean_difference: float  # mean |a − b| / mean |b|
    signed_mean: float  # mean(a − b) / mean |b|: above 0 where the bake is brighter
    worst: float  # max |a − b| / mean |b|
    noise: float  # the relative_rms that the reference's variance alone explains; 0 without variance
    detectable_bias: float  # the least |signed_mean| that this reference tells from 0; 0 without variance
    z_rejected_share: float  # of values with |a − b| > tolerance + z·σ, Šidák's z for all of them at 1 %
    pooled_z: float  # Σ(a − b) / √Σσ²; the colours of a receiver share their noise; 0 without variance

    @property
    def is_unbiased(self) -> bool:
        """Whether the pooled test lets it pass: what an estimate without bias must, and a lossy bake need not."""
        return abs(self.pooled_z) < Z_DETECTED

    def to_dict(self, *, reference_seconds: float) -> dict[str, float | None]:
        """What ``compare --json`` tells; JSON knows no infinity, so those become null."""
        figures = asdict(self) | {"reference_seconds": float(reference_seconds)}
        return {name: value if math.isfinite(value) else None for name, value in figures.items()}


def compare(
    radiance: np.ndarray,
    reference: np.ndarray,
    variance: np.ndarray | None = None,
    *,
    tolerance: float = 0.0,
) -> Figures:
    """Hold ``radiance`` (receivers, 3) against ``reference`` and the variance of its means.

    ``tolerance``, in the units of radiance, is what the bake is allowed to lose. Without a variance
    ``z_rejected_share`` is the share of values beyond it.

    Raises
    ------
    InputError
        Arrays of different shapes or without values, values that are not finite, a variance below 0.
    """
    figures = {name: getattr(metrics, name)(radiance, reference) for name in _METRICS}
    difference = np.asarray(radiance, np.float64) - np.asarray(reference, np.float64)
    if not np.isfinite(difference).all():
        raise InputError("comparison", "some values are not finite numbers")
    sigma2 = np.zeros(difference.shape) if variance is None else np.asarray(variance, np.float64)
    if sigma2.shape != difference.shape or not (np.isfinite(sigma2) & (sigma2 >= 0)).all():
        raise InputError(
            "comparison", f"a variance of shape {sigma2.shape}, expected {difference.shape}, 0 or more"
        )
    wide = np.asarray(reference, np.float64)
    allowed = tolerance + sidak_z(difference.size) * np.sqrt(sigma2)
    rounding = 1e-6 * float(np.abs(wide).max())  # float32 against float64
    # One path lights red, green and blue: their errors go together, and their deviations add, not the variances.
    spread = math.sqrt(float((np.sqrt(sigma2).sum(axis=-1) ** 2).sum()))
    whole, power = float(np.abs(wide).sum()), float(np.square(wide).sum())
    return Figures(
        **figures,
        noise=math.sqrt(float(sigma2.sum()) / power) if power else 0.0,
        detectable_bias=Z_DETECTED * spread / whole if whole else 0.0,
        z_rejected_share=float((np.abs(difference) > allowed + rounding).mean()),
        pooled_z=_pooled(float(difference.sum()), spread, without_noise=variance is None, rounding=rounding),
    )


def _pooled(total: float, spread: float, *, without_noise: bool, rounding: float) -> float:
    """Infinite where a reference says that it has no noise at all, and is another."""
    if spread:
        return total / spread
    return 0.0 if without_noise or abs(total) <= rounding else math.copysign(math.inf, total)


_METRICS = ("relative_rms", "mean_difference", "signed_mean", "worst")
