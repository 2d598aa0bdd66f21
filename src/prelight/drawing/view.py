"""A view: what a camera sees of a mesh, and the picture of it under any radiance of its vertices.

Which triangles a pixel sees, and how much of each vertex, depends on the camera alone. So a picture is a sparse
product: per pixel a few triangles with the weights of their three vertices, found once (``View``) and applied to
each new radiance in milliseconds. ``draw`` does both for one picture and keeps nothing.

Where a surface is textured a pixel shows its own albedo, found with the triangles, times the irradiance of the
vertices: a texture is as sharp as the picture, however few vertices there are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numba import get_num_threads

from ..arrays import Float32, Int32, Positions, Radiance, Triangles
from ..camera import Camera, sample_offsets
from ..errors import InputError
from . import raster
from .background import Background, fill_behind
from .picture import Picture
from .surface import Surface
from .texture_kernels import interpolate_textured

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
    albedo: np.ndarray | None  # (n, 3) float32 where the triangle is textured; None if none is


class View:
    """What ``camera`` sees of a mesh in a picture of ``width`` × ``height`` pixels, ready to be relit.

    Each pixel is the mean of ``samples_per_side``² samples under a tent two pixels wide. Triangles are seen from
    both sides. What is nearer than a thousandth of the camera's distance to its target is not drawn. Kept are 16
    bytes for each triangle a pixel sees, 28 with textures: some 30 MB for a mesh of 50,000 triangles at 1280×720.

    ``surface`` says which triangles are textured, and with what.

    Raises InputError for sizes out of range (1 to 16384 pixels a side, 1 to 8 samples), arrays of another shape,
    positions that are not finite, indices outside them, or a surface of another mesh.
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
        surface: Surface | None = None,
    ) -> None:
        self._frame = _Frame(positions, triangles, camera, width, height, samples_per_side, surface)
        self._strips = list(self._frame.strips())

    @property
    def coverage(self) -> Float32[np.ndarray, "height width"]:
        """The part of each pixel that the mesh fills, 0 to 1."""
        return np.concatenate([strip.coverage for strip in self._strips])

    @property
    def triangles_seen(self) -> Int32[np.ndarray, "n"]:
        """Those that some pixel sees, ascending."""
        return np.unique(np.concatenate([strip.seen for strip in self._strips]))

    def seen(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, tuple[int, int]]]:
        """Of some rows of the picture after the other: where each pixel's entries begin (pixels + 1,), the triangle
        (n,) and the weights (n, 3) of its corners in each entry, and how many rows and columns these are.
        """
        for strip in self._strips:
            yield strip.starts, strip.seen, strip.weights, strip.coverage.shape

    @property
    def places(self) -> tuple[Int32[np.ndarray, "n"], Float32[np.ndarray, "n 3"]]:
        """What pixels see of triangles, pixel after pixel: triangles, and weights of their vertices, whose sum is the
        part of the pixel."""
        found = [(strip.seen, strip.weights) for strip in self._strips]
        seen, weights = (np.concatenate(part) for part in zip(*found, strict=True))
        return seen, weights

    def lit(self, picture: Picture, light: Radiance, albedo: Radiance) -> Picture:
        """A picture with more light: irradiance / π at ``places`` (n, 3), reflected by the texture or the vertices'
        ``albedo`` (V, 3)."""
        linear, start = picture.linear.copy(), 0
        for strip in self._strips:
            here = slice(start, start := start + len(strip.seen))
            parts = strip.weights.sum(axis=1, keepdims=True)
            colour = np.einsum("nk,nkc->nc", strip.weights, albedo[self._frame.triangles[strip.seen]])
            if strip.albedo is not None and self._frame.surface is not None:
                worn = (self._frame.surface.texture_of[strip.seen] >= 0)[:, None]
                colour = np.where(worn, strip.albedo * parts, colour)
            pixel = np.repeat(np.arange(len(strip.starts) - 1), np.diff(strip.starts))
            rows = linear[strip.first_row : strip.first_row + strip.rows].reshape(-1, 3)
            for c in range(3):
                rows[:, c] += np.bincount(pixel, colour[:, c] * light[here, c], minlength=len(rows))
        return replace(picture, linear=linear)

    def draw(
        self, radiance: Radiance, *, irradiance: Radiance | None = None, background: Background = None
    ) -> Picture:
        """The picture for one radiance (V, 3), linear, a vertex; ``background`` as in ``draw``.

        ``irradiance`` (V, 3), divided by π, is what textured triangles reflect; without it they show the
        radiance of their vertices too.
        """
        return self._frame.picture(self._strips, radiance, background, irradiance)


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

    def __init__(self, positions, triangles, camera, width, height, samples_per_side, surface=None) -> None:
        _check_size(width, height, samples_per_side)
        positions, triangles = _checked_mesh(positions, triangles)
        self.surface = _checked_surface(surface, positions, triangles)
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
        place = self.q, self.triangles, winners, first, self.offsets, starts, seen
        albedo = None if self.surface is None else self.surface.albedo(*place)
        return _Strip(first, len(winners), starts, seen, weights, coverage, albedo)

    def picture(
        self, strips, radiance: Radiance, background: Background, irradiance: Radiance | None = None
    ) -> Picture:
        radiance = _checked_radiance(radiance, self.vertices)
        if irradiance is not None:
            irradiance = _checked_radiance(irradiance, self.vertices, name="irradiance")
        linear = np.empty((self.height, self.width, 3), np.float32)
        coverage = np.empty((self.height, self.width), np.float32)
        behind = np.empty_like(linear)
        for strip in strips:
            here = slice(strip.first_row, strip.first_row + strip.rows)
            coverage[here] = strip.coverage
            fill_behind(
                background, behind[here], coverage=strip.coverage, camera=self.camera, height=self.height,
                first_row=strip.first_row,
            )  # fmt: skip
            entries = strip.starts, strip.seen, strip.weights, self.triangles
            place = strip.coverage, behind[here], linear[here]
            if strip.albedo is None or irradiance is None or self.surface is None:
                raster.interpolate(*entries, radiance, *place)
            else:
                mapped = self.surface.texture_of
                interpolate_textured(*entries, radiance, irradiance, strip.albedo, mapped, *place)
        return Picture(linear, coverage, None if background is None else behind)


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


def _checked_surface(surface: Surface | None, positions: Positions, triangles: Triangles) -> Surface | None:
    """None where no triangle is textured, so that pictures take no time for it."""
    if surface is None:
        return None
    if len(surface.texture_of) != len(triangles) or len(surface.uv) != len(positions):
        of = f"{len(surface.uv)} vertices and {len(surface.texture_of)} triangles"
        raise InputError("surface", f"is of {of}, expected {len(positions)} and {len(triangles)}")
    return surface if surface.is_textured else None


def _checked_radiance(radiance: object, vertices: int, *, name: str = "radiance") -> Radiance:
    radiance = np.ascontiguousarray(radiance, np.float32)
    if radiance.shape != (vertices, 3):
        raise InputError(name, f"shape {radiance.shape}, expected ({vertices}, 3), one colour a vertex")
    if not np.isfinite(radiance).all():
        raise InputError(name, "some values are not finite numbers")
    return radiance
