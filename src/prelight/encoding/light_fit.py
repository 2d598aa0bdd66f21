"""Which lights of a cloud stand for another: the paper's kernel, and weights fitted to the light that falls.

Indirect light is a linear function of direct light. So weights whose direct light brings what the lamp's does give its
indirect light, wherever the lamp is and whatever is in its way; what no weights give is a remainder, mode by mode.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Float64, Int32, Int64

NEAREST = 8  # lights of the paper's kernel
FITTED = 24  # lights whose weights are fitted
_REIN = 0.015  # how firmly fitted weights are held to the kernel's, as a share of the lights' own squares
_RIM = 1e-6


def nearest(
    positions: Float64[np.ndarray, "lights 3"], place: Float64[np.ndarray, "3"], count: int
) -> tuple[Int64[np.ndarray, "count"], Float64[np.ndarray, "count"]]:
    """The ``count`` nearest lights, the nearest first, and how far they are.

    Every light is looked at: of a few thousand that takes less than walking a tree.
    """
    square = ((positions - place) ** 2).sum(axis=1)
    count = min(count, len(square))
    found = np.argpartition(square, count - 1)[:count]
    found = found[np.argsort(square[found], kind="stable")]
    return found, np.sqrt(square[found])


def kernel(distances: Float64[np.ndarray, "n"], reach: float) -> Float64[np.ndarray, "n"]:
    """(1 − d / r)⁴, the paper's; 0 beyond r (Silverman 1986)."""
    return np.maximum(1.0 - distances / max(reach, 1e-12), 0.0) ** 4


def prior(distances: Float64[np.ndarray, "n"], shape: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """Weights before anything is known of the lamp's light: a lamp where a light is, is that light (Shepard 1968)."""
    if not len(distances):
        return np.zeros(0)
    least = 1e-6 * max(float(distances[-1]), 1e-9)
    return normalised(shape / np.maximum(distances, least) ** 2)


def normalised(weights: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """Summing to one; the first light has all the weight where there is none at all."""
    total = weights.sum()
    if total > 0:
        return weights / total
    alone = np.zeros_like(weights)
    alone[:1] = 1.0
    return alone


def fitted(
    target: Float64[np.ndarray, "numbers"],
    brought: Float32[np.ndarray, "lights numbers"],
    prior: Float64[np.ndarray, "lights"],
    freedom: Float64[np.ndarray, "lights"],
) -> Float64[np.ndarray, "lights"]:
    """Weights of lights that together bring what is nearest to ``target``, in least squares.

    Parameters
    ----------
    target
        What the lamp's direct light brings of each mode (or patch).
    brought
        What the lights' does.
    prior
        Weights that are held to, of a light as bright as the lamp: scaled by how much of its light falls anywhere.
    freedom
        0 to 1: how far each light's weight may leave its prior; none at the rim, so that weights are continuous
        as the lamp moves and others become its neighbours.
    """
    F = brought.astype(np.float64)
    of_prior = prior @ F
    squares = float(of_prior @ of_prior)
    start = prior * min(1.0, max(0.0, float(target @ of_prior) / squares)) if squares > 0 else 0 * prior
    moving = freedom > _RIM
    if not moving.any():
        return start
    G = F[moving] @ F[moving].T
    size = float(np.trace(G)) / len(G)
    if not size > 0:
        return start
    G[np.diag_indices_from(G)] += _REIN * size / freedom[moving]
    out = start.copy()
    out[moving] += np.linalg.solve(G, F[moving] @ (target - start @ F))
    return out


def bounded(direct: np.ndarray, areas: Float32[np.ndarray, "vertices"]) -> np.ndarray:
    """Direct irradiance / π (vertices, …) of lamps of 1 W/sr, no more than the surface around a vertex can have.

    A lamp that touches a surface sends half of its light there, 2π W, which spread over the vertex's area (m²) is an
    irradiance / π of 2 / area; the vertex itself, as near to the lamp as you like, would say any number.
    """
    most = 2 / np.maximum(areas, 1e-12).astype(np.float32)
    return np.minimum(direct, most.reshape(-1, *[1] * (direct.ndim - 1)))


def patch_flux(
    direct: np.ndarray, areas: Float32[np.ndarray, "vertices"], patch_of: Int32[np.ndarray, "vertices"],
    patches: int,
) -> Float64[np.ndarray, "patches"]:  # fmt: skip
    """What falls on each patch: Σ area · irradiance / π."""
    return np.bincount(patch_of, weights=areas * direct.astype(np.float64), minlength=patches)
