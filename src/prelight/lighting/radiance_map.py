"""The pixels of an environment: checked once, and what is found out about them kept for all turns and tints."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..arrays import CubeMap, Float32, Float64
from ..bases import cube_map
from ..errors import InputError
from ..images.map_checks import check_radiance
from . import layouts
from .layouts import PICTURE_LAYOUTS, AngularMap, Faces

_LARGEST_KEPT = 1024  # R of the cube map that is kept: 75 MB


def checked_pixels(pixels: object, layout: str, name: str) -> Float32[np.ndarray, "... 3"]:
    """Float32, contiguous and read-only; raises InputError for a wrong shape or radiance no light has."""
    if not isinstance(pixels, np.ndarray) or pixels.dtype.kind not in "fiu":
        raise InputError(name, "expected an array of numbers as pixels")
    known = [*PICTURE_LAYOUTS, "cube"]
    if layout not in known:
        raise InputError(name, f"layout {layout!r} is not known; known are {', '.join(known)}")
    shape, wanted = pixels.shape, "(6, R, R, 3)" if layout == "cube" else "(height, width, 3)"
    fits = (
        len(shape) == 4 and shape[0] == 6 and shape[1] == shape[2]
        if layout == "cube" else len(shape) == 3
    )  # fmt: skip
    if not fits or shape[-1] != 3 or 0 in shape:
        raise InputError(name, f"pixels of shape {shape}, expected {wanted} for the layout {layout}")
    if layout != "cube":
        _check_proportions(shape[0], shape[1], layout=layout, name=name)
    shared = pixels.dtype == np.float32 and pixels.flags.c_contiguous and not pixels.flags.writeable
    with np.errstate(over="ignore"):  # what float32 cannot hold is found as infinite just below
        out = pixels if shared else np.array(pixels, np.float32, order="C")
    check_radiance(name, out.reshape(-1, *shape[-2:]))
    out.setflags(write=False)
    return out


def _check_proportions(height: int, width: int, *, layout: str, name: str) -> None:
    kind = PICTURE_LAYOUTS[layout]
    if isinstance(kind, Faces) and (width % kind.ratio[0] or width * kind.ratio[1] != height * kind.ratio[0]):
        across, down = kind.ratio
        raise InputError(
            name,
            f"{width}×{height} pixels do not make a {kind.title} of {across}×{down} square faces; "
            f"crop it to a width of {across}·R and a height of {down}·R",
        )
    if isinstance(kind, AngularMap) and layouts.recognised(height, width) != layout:
        raise InputError(name, f"{width}×{height} pixels, expected a square for an {kind.title}; crop it")


@dataclass(eq=False)
class RadianceMap:
    """Pixels as ``checked_pixels`` gives them."""

    pixels: Float32[np.ndarray, "... 3"]
    layout: str
    _kept: tuple[int, float, CubeMap] | None = field(default=None, repr=False)

    @cached_property
    def brightest(self) -> float:
        """The largest value."""
        return float(self.pixels.max())

    @cached_property
    def sampled(self) -> tuple[Float32[np.ndarray, "... 3"], str]:
        """The pixels in use and their layout, where a picture of faces has become a cube."""
        kind = PICTURE_LAYOUTS.get(self.layout)
        return (kind.faces(self.pixels), "cube") if isinstance(kind, Faces) else (self.pixels, self.layout)

    @cached_property
    def total(self) -> Float64[np.ndarray, "3"]:
        """∫ L dω by the exact solid angle of every pixel."""
        pixels, layout = self.sampled
        kind = PICTURE_LAYOUTS.get(layout)
        if kind is None or isinstance(kind, Faces):
            edges = np.linspace(-1.0, 1.0, pixels.shape[1] + 1)
            weights = cube_map.rectangle_solid_angles(edges, edges)
            return sum((np.einsum("ij,ijk->k", weights, face) for face in pixels), np.zeros(3))
        weights = kind.solid_angles(*pixels.shape[:2])
        return sum((row @ line for row, line in zip(weights, pixels, strict=True)), np.zeros(3))

    def cube(self, side: int, degrees: float) -> CubeMap:
        """The mean radiance of each texel of a cube map of the turned map; the caller's own.

        The last one up to R = 1024 is kept: another scale, tint or share of a blend resamples nothing.
        """
        from .resampling import resampled

        kept = self._kept
        if kept is not None and kept[:2] == (side, degrees):
            return kept[2].copy()
        pixels, layout = self.sampled
        out = resampled(pixels, side, layout=layout, degrees=degrees, total=self.total)
        if side <= _LARGEST_KEPT:
            self._kept = (side, degrees, out.copy())
        return out
