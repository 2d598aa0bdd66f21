"""Pictures on the still life, drawn by formula: brush strokes on glazed ware, the grain of an oak board."""

from __future__ import annotations

import numpy as np

from ...arrays import Float64, Texture
from ...images.tonemap import srgb_encode

# Linear Rec.709.
_GLAZE = (0.80, 0.785, 0.74)
_COBALT = (0.022, 0.055, 0.27)
_OAK_LIGHT = (0.46, 0.275, 0.135)
_OAK_DARK = (0.25, 0.125, 0.052)
_SEED = 7


def glazed(width: int = 1024, height: int = 512) -> Texture:
    """Cobalt on a pale glaze, for the outside and inside of a bowl: leaves, waves and lines; repeats across.

    v = 0 is the middle of the inside, v = 1 that of the foot; the lip is near 0.45.
    """
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    ink = np.zeros((height, width))
    for at, thick in ((0.395, 0.006), (0.50, 0.005), (0.525, 0.010), (0.80, 0.010), (0.825, 0.004)):
        ink = np.maximum(ink, _line(v - at, thick))
    ink = np.maximum(ink, _leaves(u, v, count=14, middle=0.655, half=0.115))
    ink = np.maximum(ink, _wave(u, v, count=28, middle=0.435, swing=0.014))
    washed = ink * (0.80 + 0.20 * _clouds(u, v))
    colour = np.multiply.outer(1 - washed, _GLAZE) + np.multiply.outer(washed, _COBALT)
    return _bytes(colour)


def oak(side: int = 1024) -> Texture:
    """Boards along u, five across v, each with its own grain."""
    v, u = np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2, indexing="ij")
    board = np.floor(v * 5)
    across = v * 5 - board
    shift = np.modf(np.sin(board * 12.9898 + 3.1) * 43758.5453)[0]
    drift = 0.35 * _clouds(u + shift, v, scale=1) + 0.05 * np.sin(2 * np.pi * (u + shift))
    rings = across * 2.2 + 0.9 * shift + drift
    grain = 0.5 + 0.5 * np.sin(2 * np.pi * 3.0 * rings)
    fibres = _clouds(u * 1.0 + shift, v * 40, scale=4)
    tone = np.clip(0.30 * grain**3 + 0.34 * fibres + 0.45 * np.abs(shift), 0, 1)
    seam = _line(np.minimum(across, 1 - across), 0.008)
    colour = np.multiply.outer(1 - tone, _OAK_LIGHT) + np.multiply.outer(tone, _OAK_DARK)
    return _bytes(colour * (1 - 0.7 * seam[..., None]))


def _line(distance: np.ndarray, thick: float) -> np.ndarray:
    """1 within ``thick`` of the line, softly falling to 0."""
    return np.clip((thick - np.abs(distance)) / 0.0025 + 0.5, 0, 1)


def _leaves(u: np.ndarray, v: np.ndarray, *, count: int, middle: float, half: float) -> np.ndarray:
    """Upright pointed leaves side by side, outlined, with a vein, and a dot between each two."""
    x = (u * count) % 1 - 0.5
    y = (v - middle) / half
    reach = 0.40 * np.clip(1 - y * y, 0, 1) * (1 + 0.25 * y)
    inside = np.clip((reach - np.abs(x)) / 0.02, 0, 1)
    core = np.clip((0.72 * reach - 0.05 - np.abs(x)) / 0.02, 0, 1)
    vein = np.clip((0.018 - np.abs(x)) / 0.01, 0, 1) * inside
    dot_x, dot_y = ((u * count + 0.5) % 1 - 0.5), np.abs(y) - 0.78
    dot = np.clip((0.10 - np.hypot(dot_x, dot_y * 0.55)) / 0.02, 0, 1)
    return np.maximum.reduce([inside - core, vein, 0.55 * core, dot])


def _wave(u: np.ndarray, v: np.ndarray, *, count: int, middle: float, swing: float) -> np.ndarray:
    return _line(v - middle - swing * np.sin(2 * np.pi * count * u), 0.0045)


def _clouds(u: np.ndarray, v: np.ndarray, *, scale: int = 5) -> np.ndarray:
    """Smooth noise of 0 to 1 that repeats with u: a few sines of random direction and phase."""
    rng = np.random.default_rng(_SEED)
    total: Float64[np.ndarray, "..."] = np.zeros_like(u)
    for k in range(1, 9):
        across, down = rng.integers(-k, k + 1) * scale // 2, rng.uniform(-k, k) * scale
        total += np.sin(2 * np.pi * (across * u + down * v + rng.uniform())) / np.sqrt(k)
    return 0.5 + 0.5 * np.tanh(total / 2)


def _bytes(linear: np.ndarray) -> Texture:
    return np.rint(srgb_encode(linear) * 255).astype(np.uint8)
