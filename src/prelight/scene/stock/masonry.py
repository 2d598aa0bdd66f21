"""Paving and other patterns of the chapel and the town, drawn by formula."""

from __future__ import annotations

import numpy as np

from ...arrays import Texture
from ...images.tonemap import srgb_encode

# Linear Rec.709.
_PALE, _WARM, _DARK = (
    np.array((0.60, 0.55, 0.47)),
    np.array((0.47, 0.37, 0.28)),
    np.array((0.16, 0.13, 0.105)),
)
_SEED = 11


def paving(side: int = 512) -> Texture:
    """Square slabs in two tones, four by four, each a little different, with joints between them; repeats."""
    rng = np.random.default_rng(_SEED)
    v, u = np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2, indexing="ij")
    i, j = np.floor(4 * v).astype(int), np.floor(4 * u).astype(int)
    tone = rng.uniform(-0.09, 0.09, (4, 4))[i, j]
    chequer = ((i + j) % 2)[..., None]
    colour = (1 - chequer) * _PALE + chequer * _WARM
    colour = colour * (1.0 + tone + 0.05 * _grain(u, v, rng))[..., None]
    edge = np.minimum(np.abs(4 * v - np.rint(4 * v)), np.abs(4 * u - np.rint(4 * u)))
    joint = np.clip((0.018 - edge) / 0.01, 0.0, 1.0)[..., None]
    colour = (1 - joint) * colour + joint * _DARK
    return np.rint(srgb_encode(np.clip(colour, 0.0, 1.0)) * 255).astype(np.uint8)


def _grain(u: np.ndarray, v: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Smooth noise within ±1 that repeats both ways."""
    total = np.zeros_like(u)
    for _ in range(12):
        a, b = rng.integers(-17, 18, 2)
        total += np.sin(2 * np.pi * (a * u + b * v + rng.uniform()))
    return np.tanh(total / 3)
