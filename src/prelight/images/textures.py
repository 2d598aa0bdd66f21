"""Textures: pictures on surfaces, 8 bits a channel, read from PNG and JPEG and looked up at coordinates."""

from __future__ import annotations

import numpy as np

from ..arrays import Float64, Texture, TextureCoordinates


def sample(texture: Texture, uv: TextureCoordinates) -> Float64[np.ndarray, "n 3"]:
    """Bilinear lookup of coordinates (n, 2), repeating; 0 to 255, in the texture's own encoding.

    u runs to the right, v down from the first row; the middle of the first texel is at half a texel.
    """
    height, width = texture.shape[:2]
    uv = np.asarray(uv, np.float64)
    x, y = (uv[:, 0] % 1) * width - 0.5, (uv[:, 1] % 1) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - left)[:, None], (y - top)[:, None]
    corners = [texture[(top + j) % height, (left + i) % width] for j in (0, 1) for i in (0, 1)]
    upper = corners[0] * (1 - fx) + corners[1] * fx
    lower = corners[2] * (1 - fx) + corners[3] * fx
    return upper * (1 - fy) + lower * fy
