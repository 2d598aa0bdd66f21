"""A view: what a camera sees of a mesh, and the picture of it under any radiance of its vertices.

Which triangles a pixel sees, and how much of each vertex, depends on the camera alone. So a picture is a sparse
product: per pixel a few triangles with the weights of their three vertices, found once (``View``) and applied to
each new radiance in milliseconds. ``draw`` does both for one picture and keeps nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numba import get_num_threads

from ..arrays import Directions, Float32, Float64, Int32, Positions, Radiance, Triangles
from ..arrays import Picture as Pixels
from ..camera import Camera
from ..errors import InputError
from . import raster
from .picture import Picture

Background = Callable[[Directions], Radiance] | tuple[float, float, float] | Float32[np.ndarray, "3"] | None

MAX_SIDE = 16384
MAX_SAMPLES_PER_SIDE = 8
_SAMPLES_AT_ONCE = 1 << 24  # samples whose triangles are held at a time: 64 MiB
_NEAREST = 1e-3  # the near plane, in distances from the eye to the target


@dataclass(frozen=True)
class _Strip:
    """A few rows of the picture: triangles and weights, pixel by pixel."""

    first_row: int
    rows: int
    starts: np.ndarray  # (rows·width + 1,) int64: where each pixel's entries begin
    seen: np.ndarray  # (n,) int32 triangles
    weights: np.ndarray  # (n, 3) float32 of the triangle's vertices
    coverage: np.ndarray  # (rows, width) float32


class View:
    """What ``camera`` sees of a mesh in a picture of ``width`` × ``height`` pixels, ready to be relit.

    Each pixel is the mean of ``samples_per_side``² samples under a tent two pixels wide. Triangles are seen from
    both sides. What is nearer than a thousandth of the camera's distance to its target is not drawn. Kept are 16
    bytes for each triangle a pixel sees: some 30 MB for a mesh of 50,000 triangles at 1280×720.

    Raises InputError for sizes out of range (1 to 16384 pixels a side, 1 to 8 samples), arrays of another shape,
    positions that are not finite, or indices outside them.
    """

    def __init__(
        self,
        positions: Positions,
        triangles: Triangles,
        *,
        camera: Camera,
        width: int,
        height: int,
        samples_per_side: int = 3,
    ) -> None:
        self._frame = _Frame(positions, triangles, camera, width, height, samples_per_side)
        self._strips = list(self._frame.strips())

    @property
    def coverage(self) -> Float32[np.ndarray, "height width"]:
        """The part of each pixel that the mesh fills, 0 to 1."""
        return np.concatenate([strip.coverage for strip in self._strips])

    def draw(self, radiance: Radiance, *, background: Background = None) -> Picture:
        """The picture for one radiance (V, 3), linear, a vertex; ``background`` as in ``draw``."""
        return self._frame.picture(self._strips, radiance, background)


def draw(  # noqa: PLR0913 - a picture in one call needs all of them
    positions: Positions,
    triangles: Triangles,
    radiance: Radiance,
    camera: Camera,
    *,
    width: int,
    height: int,
    background: Background = None,
    samples_per_side: int = 3,
) -> Picture:
    """The picture of a mesh whose vertices have linear ``radiance`` (V, 3).

    ``background`` is a linear colour, or a function from unit directions (n, 3) to radiance (n, 3) (such as an
    environment's ``radiance_along``), or None for black. Memory beyond the picture's own does not grow with its
    size. Raises InputError as ``View`` does, and for radiance of another shape or not finite.
    """
    frame = _Frame(positions, triangles, camera, width, height, samples_per_side)
    return frame.picture(frame.strips(), radiance, background)


class _Frame:
    """A mesh in the pixel space of one camera and one picture size (see ``raster``)."""

    def __init__(self, positions, triangles, camera, width, height, samples_per_side) -> None:
        _check_size(width, height, samples_per_side)
        positions, triangles = _checked_mesh(positions, triangles)
        self.camera, self.width, self.height = camera, int(width), int(height)
        self.vertices, self.triangles = len(positions), triangles
        self.offsets = sample_offsets(samples_per_side)
        self.axes = camera.axes().astype(np.float64)
        self.focal = self.height / (2 * np.tan(np.radians(camera.vertical_fov_deg) / 2))  # pixels
        x, y, back = self.axes @ (positions.astype(np.float64) - camera.eye).T
        x, y = self.focal * x - self.width / 2 * back, -self.focal * y - self.height / 2 * back
        self.q = np.stack([x, y, -back], axis=1)

    def strips(self) -> Iterator[_Strip]:
        """The picture from top to bottom, a few rows at a time."""
        near = _NEAREST * float(np.linalg.norm(np.subtract(self.camera.target, self.camera.eye)))
        ends = self.offsets.min(axis=0), self.offsets.max(axis=0)
        bounds = raster.pixel_bounds(self.q, self.triangles, near, *ends, self.width, self.height)
        starts, order = raster.bands_of_triangles(bounds, -(-self.height // raster.BAND))
        step = max(1, _SAMPLES_AT_ONCE // (self.width * len(self.offsets) * raster.BAND)) * raster.BAND
        for first in range(0, self.height, step):
            rows = min(step, self.height - first)
            winners = np.empty((rows, self.width, len(self.offsets)), np.int32)
            scene = self.q, self.triangles, bounds, starts, order
            raster.visible_triangles(*scene, first, self.offsets, near, get_num_threads(), winners)
            yield self._weighed(winners, first)

    def _weighed(self, winners: Int32[np.ndarray, "rows column samples"], first: int) -> _Strip:
        counts, hits = raster.count_seen(winners)
        starts = np.concatenate([[0], np.cumsum(counts)])
        seen, weights = np.empty(starts[-1], np.int32), np.empty((starts[-1], 3), np.float32)
        raster.mean_weights(self.q, self.triangles, winners, first, self.offsets, starts, seen, weights)
        coverage = (hits / np.float32(len(self.offsets))).astype(np.float32).reshape(winners.shape[:2])
        return _Strip(first, len(winners), starts, seen, weights, coverage)

    def picture(self, strips, radiance: Radiance, background: Background) -> Picture:
        radiance = _checked_radiance(radiance, self.vertices)
        linear = np.empty((self.height, self.width, 3), np.float32)
        coverage = np.empty((self.height, self.width), np.float32)
        behind = np.zeros_like(linear)
        if background is not None and not callable(background):
            behind[:] = _checked_colour(background)
        for strip in strips:
            here = slice(strip.first_row, strip.first_row + strip.rows)
            coverage[here] = strip.coverage
            if callable(background):
                self._look_behind(background, strip, behind[here])
            entries = strip.starts, strip.seen, strip.weights, self.triangles
            raster.interpolate(*entries, radiance, strip.coverage, behind[here], linear[here])
        return Picture(linear, coverage, None if background is None else behind)

    def _look_behind(self, background: Callable, strip: _Strip, behind: Pixels) -> None:
        row, column = np.nonzero(strip.coverage < 1)
        if len(row) == 0:
            return
        light = np.asarray(background(self.directions(column + 0.5, strip.first_row + row + 0.5)))
        if light.shape != (len(row), 3):
            raise InputError("background", f"returned shape {light.shape}, expected ({len(row)}, 3)")
        if not np.isfinite(light).all():
            raise InputError("background", "returned values that are not finite numbers")
        behind[row, column] = light

    def directions(self, x: Float64[np.ndarray, "n"], y: Float64[np.ndarray, "n"]) -> Directions:
        """Unit directions through points of the picture, in pixels from its upper left corner."""
        right, up = (x - self.width / 2) / self.focal, (self.height / 2 - y) / self.focal
        d = np.stack([right, up, -np.ones_like(right)], axis=-1) @ self.axes
        return (d / np.linalg.norm(d, axis=-1, keepdims=True)).astype(np.float32)


def sample_offsets(per_side: int) -> Float64[np.ndarray, "samples 2"]:
    """Where a pixel's samples lie, in pixels from its upper left corner.

    A sheared grid: each of per_side² samples has a row and a column of its own, so that an edge near the
    horizontal or the vertical passes them one by one. Their density is a tent two pixels wide, which makes the
    plain mean a tent filter: over edges of any slope its error is 4.4 % RMS with 9 samples, 3.0 % with 16.
    """
    n = per_side
    i, j = np.divmod(np.arange(n * n), n)
    even = np.stack([(i + (j + 0.5) / n) / n, (j + (n - i - 0.5) / n) / n], axis=1)
    tent = np.where(even < 0.5, np.sqrt(2 * even) - 1, 1 - np.sqrt(2 * (1 - even)))
    return 0.5 + tent


def _check_size(width: object, height: object, samples_per_side: object) -> None:
    for name, value, most in (
        ("width", width, MAX_SIDE),
        ("height", height, MAX_SIDE),
        ("samples_per_side", samples_per_side, MAX_SAMPLES_PER_SIDE),
    ):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 1 <= value <= most:
            raise InputError(name, f"{value!r}, expected a whole number from 1 to {most}")


def _checked_mesh(positions: object, triangles: object) -> tuple[Positions, Triangles]:
    positions, triangles = np.asarray(positions), np.asarray(triangles)
    if positions.ndim != 2 or positions.shape[1] != 3 or positions.dtype.kind != "f":
        raise InputError("positions", f"shape {positions.shape}, expected (vertices, 3) numbers")
    if not np.isfinite(positions).all():
        raise InputError("positions", "some are not finite numbers; remove these vertices")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise InputError("triangles", f"shape {triangles.shape}, expected (triangles, 3) whole numbers")
    if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(positions):
        raise InputError(
            "triangles",
            f"indices {triangles.min()} to {triangles.max()}, expected 0 to {len(positions) - 1}",
        )
    return positions, np.ascontiguousarray(triangles, np.int32)


def _checked_radiance(radiance: object, vertices: int) -> Radiance:
    radiance = np.ascontiguousarray(radiance, np.float32)
    if radiance.shape != (vertices, 3):
        raise InputError("radiance", f"shape {radiance.shape}, expected ({vertices}, 3), one colour a vertex")
    if not np.isfinite(radiance).all():
        raise InputError("radiance", "some values are not finite numbers")
    return radiance


def _checked_colour(colour: object) -> Float32[np.ndarray, "3"]:
    try:
        value = np.asarray(colour, np.float32)
    except (TypeError, ValueError):
        value = np.empty(0, np.float32)
    if value.shape != (3,) or not np.isfinite(value).all():
        raise InputError("background", f"{colour!r}, expected None, three finite numbers or a function")
    return value
