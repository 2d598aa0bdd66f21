"""How far one picture, or any array, is from a reference: four figures, the same wherever they are quoted.

All are computed in float64 over every element (so each colour channel counts), and are relative to the
reference as a whole, never to single elements: dark pixels would outweigh everything else. Where the
reference is 0 everywhere they are 0 for equal arrays and infinite for others; a NaN anywhere gives NaN.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Float32
from ..errors import InputError

Values = Float32[np.ndarray, "..."]


def _difference(a: Values, reference: Values) -> tuple[np.ndarray, np.ndarray]:
    """Both in float64: a − reference, and the reference."""
    if np.shape(a) != np.shape(reference):
        raise InputError(
            "comparison", f"shapes {np.shape(a)} and {np.shape(reference)} differ, expected the same"
        )
    if np.size(a) == 0:
        raise InputError("comparison", "there is nothing to compare, expected at least one value")
    wide = np.asarray(reference, np.float64)
    return np.asarray(a, np.float64) - wide, wide


def _ratio(part: float, whole: float) -> float:
    if whole == 0 and not math.isnan(part):
        return math.copysign(math.inf, part) if part else 0.0
    return part / whole if whole else math.nan


def relative_rms(a: Values, reference: Values) -> float:
    """√mean((a − reference)²) / √mean(reference²): the difference in the L2 norm."""
    difference, wide = _difference(a, reference)
    return _ratio(math.sqrt(np.square(difference).mean()), math.sqrt(np.square(wide).mean()))


def mean_difference(a: Values, reference: Values) -> float:
    """mean|a − reference| / mean|reference|."""
    difference, wide = _difference(a, reference)
    return _ratio(float(np.abs(difference).mean()), float(np.abs(wide).mean()))


def signed_mean(a: Values, reference: Values) -> float:
    """mean(a − reference) / mean|reference|: above 0 where a is brighter."""
    difference, wide = _difference(a, reference)
    return _ratio(float(difference.mean()), float(np.abs(wide).mean()))


def worst(a: Values, reference: Values) -> float:
    """max|a − reference| / mean|reference|."""
    difference, wide = _difference(a, reference)
    return _ratio(float(np.abs(difference).max()), float(np.abs(wide).mean()))
