"""Environments: radiance from everywhere around the scene, infinitely far away.

An ``Environment`` is a radiance map (``layouts`` says which pixel looks where) with a turn about +Y, a scale
and a tint. It never changes; ``rotated``, ``scaled`` and ``tinted`` give new ones that share the pixels.

    light = Environment.open("grace_cross.hdr").rotated(30).scaled(2)
    l = light.cube(256)          # (6, 256, 256, 3), what relighting multiplies with (times solid angles)
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Radiance
from ..bases import cube_map
from ..errors import InputError
from ..images.map_checks import check_radiance
from . import layouts, sky
from .layouts import PICTURE_LAYOUTS, AngularMap, Faces

STOCK_PREFIX = "stock:"
_LARGEST = 0.25 * float(np.finfo(np.float32).max)  # room for rounding in sums and means


def _amount(name: str, value: object, *, least: float | None = None) -> float:
    try:
        number = float(value)  # ty: ignore[invalid-argument-type]
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number) or (least is not None and number < least):
        raise InputError(
            name,
            f"{value!r}, expected a finite number" + ("" if least is None else f" of at least {least:g}"),
        )
    return number


def _colour(name: str, value: object) -> tuple[float, float, float]:
    parts = list(value) if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str) else []
    if len(parts) != 3:
        raise InputError(name, f"{value!r}, expected three numbers: linear red, green, blue")
    red, green, blue = (_amount(name, part, least=0.0) for part in parts)
    return red, green, blue


def _checked_pixels(pixels: object, layout: str, name: str) -> Float32[np.ndarray, "... 3"]:
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


@dataclass(frozen=True, eq=False)
class _CheckedMap:
    """Pixels that have been checked, and what is found out about them once for all turns and tints."""

    pixels: Float32[np.ndarray, "... 3"]
    layout: str
    brightest: float

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


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from infinitely far away, given as a map of radiance.

    Parameters
    ----------
    pixels
        Scene-linear Rec.709 radiance, W·sr⁻¹·m⁻² up to a common exposure; finite, not negative:
        a picture (H, W, 3), or the faces (6, R, R, 3) of a cube map. Copied unless read-only float32.
    layout
        How they lie: ``latlong``, ``angular``, ``cross`` (see ``layouts``) or ``cube``.
    rotation_deg
        Turn about +Y, counter-clockwise seen from above: light from d comes from R_y(rotation_deg)·d.
    scale, tint
        Factors of the radiance, for all channels and for red, green and blue; not negative.
    name
        What messages call it.

    Raises
    ------
    InputError
        For shapes that do not fit the layout, NaN, infinite or negative values anywhere.
    """

    pixels: Float32[np.ndarray, "... 3"] = field(repr=False)
    layout: str
    _: KW_ONLY
    rotation_deg: float = 0.0
    scale: float = 1.0
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    name: str = "environment"
    _map: _CheckedMap | None = field(default=None, repr=False)  # shared by all that ``replace`` makes

    def __post_init__(self) -> None:
        def put(attribute: str, value: object) -> None:
            object.__setattr__(self, attribute, value)

        put("rotation_deg", _amount(f"{self.name}: rotation", self.rotation_deg) % 360.0)
        put("scale", _amount(f"{self.name}: scale", self.scale, least=0.0))
        put("tint", _colour(f"{self.name}: tint", self.tint))
        known = self._map
        if known is None or known.pixels is not self.pixels or known.layout != self.layout:
            pixels = _checked_pixels(self.pixels, self.layout, self.name)
            known = _CheckedMap(pixels, self.layout, float(pixels.max()))
            put("_map", known)
            put("pixels", pixels)
        if known.brightest * max(1.0, self.scale * max(self.tint)) > _LARGEST:
            raise InputError(
                self.name, f"radiance above {_LARGEST:.0e}; lower the scale, the tint or the map"
            )

    # ---- Where environments come from --------------------------------------------------------------------

    @classmethod
    def open(cls, path: str | Path, layout: str | None = None) -> Environment:
        """The environment in a file (.hdr or .exr), or ``stock:NAME``, one of our own (``sky``).

        The layout is recognised by the picture's proportions (2:1 lat-long, 1:1 angular map, 3:4 vertical
        cross, within 1 %) unless given. Raises InputError.
        """
        if isinstance(path, str) and path.startswith(STOCK_PREFIX):
            if layout not in (None, "latlong"):
                raise InputError(path, f"layout {layout!r}, but stock environments are latlong")
            return cls.stock(path.removeprefix(STOCK_PREFIX))
        from ..images.formats import read_radiance_map

        if layout is not None and layout not in PICTURE_LAYOUTS:
            raise InputError(path, f"layout {layout!r} is not known; known are {', '.join(PICTURE_LAYOUTS)}")
        pixels = read_radiance_map(path)
        height, width = pixels.shape[:2]
        layout = layout or layouts.recognised(height, width)
        if layout is None:
            known = ", ".join(f"{n} {k.ratio[0]}:{k.ratio[1]}" for n, k in PICTURE_LAYOUTS.items())
            raise InputError(
                path,
                f"{width}×{height} pixels, not the proportions of a known layout ({known}); "
                "crop it, or say which it is with --layout",
            )
        pixels.setflags(write=False)
        return cls(pixels, layout, name=Path(path).name)

    @classmethod
    def stock(cls, name: str) -> Environment:
        """One of the environments that Prelight paints itself; raises InputError naming those there are."""
        pixels = sky.paint(name)
        pixels.setflags(write=False)
        return cls(pixels, "latlong", name=STOCK_PREFIX + name)

    @classmethod
    def constant(cls, radiance: Sequence[float]) -> Environment:
        """The same linear red, green and blue from everywhere."""
        colour = np.array(_colour("radiance", radiance))
        return cls(np.tile(colour, (6, 1, 1, 1)), "cube", name="constant")

    @classmethod
    def from_cube(cls, faces: CubeMap) -> Environment:
        """The faces (6, R, R, 3) of a cube map, laid out as in ``bases.cube_map``."""
        return cls(faces, "cube", name="cube map")

    # ---- What a designer sets ----------------------------------------------------------------------------

    def rotated(self, degrees: float) -> Environment:
        """Turned further about +Y, counter-clockwise seen from above: what was at −Z moves towards −X."""
        return replace(self, rotation_deg=self.rotation_deg + _amount("rotation", degrees))

    def scaled(self, factor: float) -> Environment:
        """``factor`` times as bright."""
        return replace(self, scale=self.scale * _amount("scale", factor, least=0.0))

    def tinted(self, tint: Sequence[float]) -> Environment:
        """Red, green and blue multiplied by three factors."""
        red, green, blue = _colour("tint", tint)
        return replace(self, tint=(self.tint[0] * red, self.tint[1] * green, self.tint[2] * blue))

    # ---- What it gives -----------------------------------------------------------------------------------

    @property
    def gain(self) -> Float64[np.ndarray, "3"]:
        """Scale times tint."""
        return self.scale * np.array(self.tint)

    @property
    def _checked(self) -> _CheckedMap:
        assert self._map is not None  # set by __post_init__
        return self._map

    @property
    def total(self) -> Float64[np.ndarray, "3"]:
        """∫ L dω over the sphere, by the exact solid angle of every pixel; scale and tint included."""
        return self._checked.total * self.gain

    def cube(self, resolution: int) -> CubeMap:
        """The mean radiance (6, R, R, 3) of each texel of a cube map (``bases.cube_map``), as turned.

        In every channel Σ radiance · solid angle is ``total`` (to float32), and light stays where it was to
        a texel or a pixel of the map, whichever is larger. An unturned cross is given back bit for bit
        where R is the side of its faces.

        Raises
        ------
        InputError
            Unless 1 ≤ resolution ≤ 4096.
        """
        try:
            side = operator.index(resolution)
        except TypeError:
            side = 0
        if not 1 <= side <= cube_map.MAX_RESOLUTION:
            expected = f"expected a whole number from 1 to {cube_map.MAX_RESOLUTION}"
            raise InputError("resolution", f"{resolution!r}, {expected}")
        from .resampling import resampled

        pixels, layout = self._checked.sampled
        out = resampled(pixels, side, layout=layout, degrees=self.rotation_deg, total=self._checked.total)
        if not np.array_equal(self.gain, np.ones(3)):
            out *= self.gain.astype(np.float32)
        return out

    def radiance_along(self, directions: Directions) -> Radiance:
        """The radiance (n, 3) seen along directions (n, 3), which need not be unit; bilinear, as turned.

        Raises InputError for another shape, NaN or infinite values. The zero vector sees some direction.
        """
        with np.errstate(over="ignore"):
            d = np.ascontiguousarray(directions, np.float32)
        if d.ndim != 2 or d.shape[1] != 3 or not np.isfinite(d).all():
            raise InputError("directions", f"an array of shape {d.shape}, expected finite numbers (n, 3)")
        from . import lookup

        pixels, layout = self._checked.sampled
        out = np.empty((len(d), 3), np.float32)
        kernels = {
            "latlong": lookup.along_latlong,
            "angular": lookup.along_angular,
            "cube": lookup.along_faces,
        }
        kernels[layout](pixels, d, math.radians(self.rotation_deg), out)
        out *= self.gain.astype(np.float32)
        return out
