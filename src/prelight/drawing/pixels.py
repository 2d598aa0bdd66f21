"""Pictures whose pixels are receivers themselves: nothing is interpolated, only what is behind comes in."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Radiance
from ..camera import Camera
from ..errors import InputError
from .background import Background, fill_behind
from .picture import Picture

MAX_ENLARGEMENT = 64
_MOST_PIXELS = 1 << 28  # 16384²


def pixel_picture(
    radiance: Radiance,
    coverage: Float32[np.ndarray, "height width"],
    *,
    camera: Camera | None = None,
    background: Background = None,
    enlarge: int = 1,
) -> Picture:
    """The picture of pixels that are receivers.

    Parameters
    ----------
    radiance
        (height·width, 3) linear, row by row from the top: the mean over each pixel's samples, those that see
        nothing counted as black.
    coverage
        (height, width) the part of each pixel's samples that see the scene, 0 to 1.
    camera
        The layer's eye; only a background that is a function needs it.
    background
        A linear colour, a function from unit directions (n, 3) to radiance (n, 3), or None for black.
    enlarge
        Repeat each pixel this often along each side, 1 to 64, for a display.

    Raises InputError for arrays that do not fit together, values not finite, or an enlargement out of range.
    """
    coverage = np.asarray(coverage, np.float32)
    if coverage.ndim != 2 or not coverage.size or not ((coverage >= 0) & (coverage <= 1)).all():
        raise InputError("coverage", f"shape {coverage.shape}, expected (height, width) parts of 0 to 1")
    height, width = coverage.shape
    seen = np.asarray(radiance, np.float32)
    if seen.shape != (height * width, 3) or not np.isfinite(seen).all():
        raise InputError("radiance", f"shape {seen.shape}, expected ({height * width}, 3) finite numbers")
    if isinstance(enlarge, bool) or not isinstance(enlarge, int | np.integer):
        raise InputError("enlarge", f"{enlarge!r}, expected a whole number such as 2")
    if not 1 <= enlarge <= MAX_ENLARGEMENT or height * width * int(enlarge) ** 2 > _MOST_PIXELS:
        raise InputError(
            "enlarge", f"{enlarge}, expected 1 to {MAX_ENLARGEMENT} and at most {_MOST_PIXELS:,} pixels"
        )
    behind = np.empty((height, width, 3), np.float32)
    fill_behind(background, behind, coverage=coverage, camera=camera, height=height)
    linear = seen.reshape(height, width, 3) + (1 - coverage[..., None]) * behind
    linear, coverage, behind = (_enlarged(part, int(enlarge)) for part in (linear, coverage, behind))
    return Picture(linear, coverage, None if background is None else behind)


def _enlarged(pixels: np.ndarray, times: int) -> np.ndarray:
    return pixels if times == 1 else pixels.repeat(times, axis=0).repeat(times, axis=1)
