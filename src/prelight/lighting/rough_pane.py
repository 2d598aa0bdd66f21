"""A pane of glass that is rough on one side: by how much it turns light, and how much it lets through at each angle.

Rays are followed through the pane, its rough face of GGX microfacets with their shadowing, one scattering at a time
(Walter, Marschner, Li and Torrance, Microfacet Models for Refraction through Rough Surfaces, 2007), normals chosen
among the visible ones (Heitz, Sampling the GGX Distribution of Visible Normals, 2018). Its other face is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..arrays import Float64

IOR = 1.5
LEAST_ROUGH, LARGEST_ROUGH = 0.02, 1.0
_ANGLES_DEG = np.array([0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 86.0])
_PATHS, _MOST = 1 << 14, 12  # rays at each angle, and faces that one meets
_STAGE = 74

_Vectors = Float64[np.ndarray, "n 3"]


@dataclass(frozen=True)
class RoughPane:
    """What a pane of some roughness does.

    Attributes
    ----------
    turned_deg
        Standard deviation of the angle, in a plane, by which light straight through is turned.
    shares
        ``(k,)`` of light that gets through at each of ``angles_deg`` between its way and the normal; 0 at 90°.
    """

    turned_deg: float
    angles_deg: Float64[np.ndarray, "k"]
    shares: Float64[np.ndarray, "k"]

    def share(self, cosine: np.ndarray) -> np.ndarray:
        """Of directions at these cosines to the normal; below 0 as at 90°."""
        return np.interp(np.degrees(np.arccos(np.clip(cosine, 0, 1))), self.angles_deg, self.shares)

    @property
    def mean(self) -> float:
        """Of light that comes alike from all sides."""
        cosine = np.sqrt((np.arange(256) + 0.5) / 256)
        return float(self.share(cosine).mean())


@lru_cache(maxsize=64)
def rough_pane(alpha: float) -> RoughPane:
    """Of GGX roughness ``alpha``, as renderers have it."""
    rng = np.random.default_rng(np.random.SeedSequence([_STAGE]))
    shares, turned = [], 0.0
    for angle in np.radians(_ANGLES_DEG):
        way = np.array([np.sin(angle), 0.0, -np.cos(angle)])
        weight, out = _through(np.tile(way, (_PATHS, 1)), alpha, rng)
        shares.append(float(weight.mean()))
        if angle == 0:
            off = np.arccos(np.clip(out @ way, -1, 1))
            turned = float(np.sqrt((weight * off**2).sum() / max(weight.sum(), 1e-300) / 2))
    return RoughPane(
        float(np.degrees(turned)), np.append(_ANGLES_DEG, 90.0), np.minimum(np.append(shares, 0.0), 1.0)
    )


def _through(d: _Vectors, alpha: float, rng: np.random.Generator) -> tuple[np.ndarray, _Vectors]:
    """Weights and directions of rays from above the rough face once they are below the smooth one; 0 of others."""
    weight, out = np.ones(len(d)), d.copy()
    done = np.zeros(len(d), bool)
    d, within, passed = _at_rough(d, 1 / IOR, alpha, rng)
    weight *= passed
    alive = within & (weight > 0)
    for _ in range(_MOST):
        down = np.flatnonzero(alive)
        if not len(down):
            break
        # The smooth face, from inside.
        cosine = -d[down, 2]
        reflected = rng.random(len(down)) < _fresnel(cosine, IOR)
        gone = down[~reflected]
        out[gone] = np.concatenate([d[gone, :2] * IOR, d[gone, 2:]], axis=1)
        out[gone, 2] = -np.sqrt(np.maximum(1 - (out[gone, :2] ** 2).sum(axis=1), 0))
        done[gone], alive[gone] = True, False
        up = down[reflected]
        d[up, 2] *= -1
        # The rough face, from inside: seen with its normal turned, the ray comes down on it.
        flipped = d[up] * [1, 1, -1]
        found, outside, passed = _at_rough(flipped, IOR, alpha, rng)
        weight[up] *= passed
        d[up] = found * [1, 1, -1]
        alive[up] = ~outside & (weight[up] > 0)
    return np.where(done, weight, 0.0), out


def _at_rough(
    d: _Vectors, ratio: float, alpha: float, rng: np.random.Generator
) -> tuple[_Vectors, np.ndarray, np.ndarray]:
    """Where rays that come down on a rough face go on, whether through it, and what shadowing leaves of each.

    ``ratio`` is the refractive index above over that below.
    """
    back, two = -d, rng.random((2, len(d)))
    m = _visible_normals(back, alpha, *two)
    cosine = np.einsum("ij,ij->i", back, m)
    reflected = rng.random(len(d)) < _fresnel(cosine, ratio)
    square = np.maximum(1 - ratio**2 * (1 - cosine**2), 0)
    straight = ratio * d + (ratio * cosine - np.sqrt(square))[:, None] * m
    mirrored = d + 2 * cosine[:, None] * m
    out = np.where(reflected[:, None], mirrored, straight)
    right = np.where(reflected, out[:, 2] > 0, out[:, 2] < 0)
    slope = alpha**2 * (1 - out[:, 2] ** 2) / np.maximum(out[:, 2] ** 2, 1e-12)
    return out, ~reflected, np.where(right, 2 / (1 + np.sqrt(1 + slope)), 0.0)


def _visible_normals(view: _Vectors, alpha: float, u: np.ndarray, v: np.ndarray) -> _Vectors:
    stretched = view * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    flat = stretched[:, :2] / np.maximum(np.linalg.norm(stretched[:, :2], axis=1, keepdims=True), 1e-12)
    upright = np.linalg.norm(stretched[:, :2], axis=1) < 1e-9
    first = np.where(
        upright[:, None], [1.0, 0.0, 0.0], np.stack([-flat[:, 1], flat[:, 0], np.zeros(len(flat))], axis=1)
    )
    second = np.cross(stretched, first)
    radius, turn = np.sqrt(u), 2 * np.pi * v
    a, b = radius * np.cos(turn), radius * np.sin(turn)
    share = 0.5 * (1 + stretched[:, 2])
    b = (1 - share) * np.sqrt(np.maximum(1 - a * a, 0)) + share * b
    rest = np.sqrt(np.maximum(1 - a * a - b * b, 0))
    normal = a[:, None] * first + b[:, None] * second + rest[:, None] * stretched
    normal *= [alpha, alpha, 1.0]
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _fresnel(cosine: np.ndarray, ratio: float) -> np.ndarray:
    """Reflectance of unpolarised light; ``ratio`` of the index it comes from over the other."""
    square = 1 - ratio**2 * (1 - cosine**2)
    other = np.sqrt(np.maximum(square, 0))
    one = (ratio * cosine - other) / np.maximum(ratio * cosine + other, 1e-12)
    two = (cosine - ratio * other) / np.maximum(cosine + ratio * other, 1e-12)
    return np.where(square <= 0, 1.0, 0.5 * (one**2 + two**2))
