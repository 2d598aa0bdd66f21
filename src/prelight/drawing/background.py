"""What is behind the objects of a picture: a colour, or light from the direction each pixel looks in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Directions, Float32, Float64, Radiance
from ..arrays import Picture as Pixels
from ..camera import Camera
from ..errors import InputError

Background = Callable[[Directions], Radiance] | tuple[float, float, float] | Float32[np.ndarray, "3"] | None


def directions_through(
    camera: Camera,
    x: Float64[np.ndarray, "n"],
    y: Float64[np.ndarray, "n"],
    *,
    width: int,
    height: int,
) -> Directions:
    """Unit directions (n, 3) through points of the picture, in pixels from its upper left corner."""
    focal = height / (2 * np.tan(np.radians(camera.vertical_fov_deg) / 2))  # pixels
    right, up = (x - width / 2) / focal, (height / 2 - y) / focal
    d = np.stack([right, up, -np.ones_like(right)], axis=-1) @ camera.axes().astype(np.float64)
    return (d / np.linalg.norm(d, axis=-1, keepdims=True)).astype(np.float32)


def fill_behind(
    background: Background,
    behind: Pixels,
    *,
    coverage: Float32[np.ndarray, "rows width"],
    camera: Camera | None,
    height: int,
    first_row: int = 0,
) -> None:
    """Write the background to ``behind`` (rows, width, 3), the part of a picture from ``first_row`` on.

    A function is only asked where ``coverage`` is below 1. Raises InputError for what is no background.
    """
    if background is None:
        behind[:] = 0
        return
    if not callable(background):
        behind[:] = _checked_colour(background)
        return
    behind[:] = 0
    row, column = np.nonzero(coverage < 1)
    if len(row) == 0:
        return
    if camera is None:
        raise InputError("camera", "a background that depends on the direction needs one")
    x, y = column + 0.5, first_row + row + 0.5
    light = np.asarray(background(directions_through(camera, x, y, width=coverage.shape[1], height=height)))
    if light.shape != (len(row), 3):
        raise InputError("background", f"returned shape {light.shape}, expected ({len(row)}, 3)")
    if not np.isfinite(light).all():
        raise InputError("background", "returned values that are not finite numbers")
    behind[row, column] = light


def _checked_colour(colour: object) -> Float32[np.ndarray, "3"]:
    try:
        value = np.asarray(colour, np.float32)
    except (TypeError, ValueError):
        value = np.empty(0, np.float32)
    if value.shape != (3,) or not np.isfinite(value).all():
        raise InputError("background", f"{colour!r}, expected None, three finite numbers or a function")
    return value
