"""Least squares whose unknowns are not negative: colours of lights."""

from __future__ import annotations

import numpy as np

from ..arrays import Float64

_TOLERANCE = 1e-11


def nonnegative(gram: np.ndarray, toward: np.ndarray) -> Float64[np.ndarray, "unknowns"]:
    """x ≥ 0 that makes xᵀGx − 2·xᵀb smallest, for G (n, n) of AᵀA and b (n,) of Aᵀt.

    The active-set method of Lawson and Hanson (1974), on the normal equations: n is the number of lights.
    """
    n = len(toward)
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))  # lights of any strength count alike
    G, b = gram / np.outer(scale, scale), toward / scale
    x, free = np.zeros(n), np.zeros(n, bool)
    enough = _TOLERANCE * max(float(np.abs(b).max(initial=0.0)), 1e-300)
    for _ in range(10 * n + 10):
        slope = b - G @ x
        slope[free] = -np.inf
        if not n or slope.max() <= enough:
            break
        free[int(slope.argmax())] = True
        while True:
            trial = np.zeros(n)
            trial[free] = np.linalg.lstsq(G[np.ix_(free, free)], b[free], rcond=1e-13)[0]
            below = free & (trial <= 0.0)
            if not below.any():
                break
            steps = x[below] / np.maximum(x[below] - trial[below], 1e-300)
            x = x + steps.min() * (trial - x)
            free &= ~(below & (x <= _TOLERANCE * max(x.max(), 1e-300)))
            x[~free] = 0.0
            if not free.any():
                trial = np.zeros(n)
                break
        x = trial
    return x / scale
