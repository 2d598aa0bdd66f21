"""Environments: radiance from everywhere around the scene, infinitely far away.

An ``Environment`` is a radiance map (``layouts`` says which pixel looks where) with a turn about +Y, a scale
and a tint, or a blend of several; regions of it may be painted, and disc lights stand in front of it. It never
changes: ``rotated``, ``scaled``, ``tinted``, ``blended``, ``painted`` and ``with_discs`` give new ones that
share the pixels.

    light = Environment.open("grace_cross.hdr").rotated(30).scaled(2)
    light = light.with_disc(Disc.at(-60, 35, radius_deg=3, radiance=(40, 36, 30), softness=0.5))
    l = light.cube(256)          # (6, 256, 256, 3), what relighting multiplies with (times solid angles)
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from pathlib import Path

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Radiance
from ..bases import cube_map
from ..errors import InputError
from . import quantities, sky
from .disc import Disc, add_discs
from .radiance_map import RadianceMap, checked_pixels
from .regions import Paint, Region

STOCK_PREFIX = "stock:"
_LARGEST = 0.25 * float(np.finfo(np.float32).max)  # room for rounding in sums and means
_WEIGHED_AT = 256  # R at which what is painted over is weighed


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from infinitely far away: maps of radiance, painted regions, and discs.

    Parameters
    ----------
    pixels
        Scene-linear Rec.709 radiance, W·sr⁻¹·m⁻² up to a common exposure; finite, not negative:
        a picture (H, W, 3), or the faces (6, R, R, 3) of a cube map. Copied unless read-only float32.
    layout
        How they lie: ``latlong``, ``angular``, ``cross``, … (see ``layouts``) or ``cube``.
    rotation_deg
        Turn of the map about +Y, counter-clockwise seen from above: light from d comes from R_y·d.
    scale, tint
        Factors of the map's radiance, for all channels and for red, green and blue; not negative.
    name
        What messages call it.
    parts
        Environments added to the map, each with its own turn, scale and tint (``blended``).
    paints
        Regions mixed with a colour, one after another, over the map and the parts (``painted``).
    discs
        Disc lights, added in front of all that (``with_discs``); directions are the scene's.

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
    parts: tuple[Environment, ...] = ()
    paints: tuple[Paint, ...] = ()
    discs: tuple[Disc, ...] = ()
    _map: RadianceMap | None = field(default=None, repr=False)  # shared by all that ``replace`` makes

    def __post_init__(self) -> None:
        def put(attribute: str, value: object) -> None:
            object.__setattr__(self, attribute, value)

        put("rotation_deg", quantities.amount(f"{self.name}: rotation", self.rotation_deg) % 360.0)
        put("scale", quantities.amount(f"{self.name}: scale", self.scale, least=0.0))
        put("tint", quantities.colour(f"{self.name}: tint", self.tint))
        for attribute, kind in (("parts", Environment), ("paints", Paint), ("discs", Disc)):
            put(attribute, _all_of(kind, getattr(self, attribute), name=f"{self.name}: {attribute}"))
        known = self._map
        if known is None or known.pixels is not self.pixels or known.layout != self.layout:
            pixels = checked_pixels(self.pixels, self.layout, self.name)
            known = RadianceMap(pixels, self.layout)
            put("_map", known)
            put("pixels", pixels)
        if max(known.brightest, self._brightest) > _LARGEST:
            raise InputError(
                self.name, f"radiance above {_LARGEST:.0e}; lower the scale, the tint or the map"
            )

    # ---- Where environments come from --------------------------------------------------------------------

    @classmethod
    def open(cls, path: str | Path, layout: str | None = None) -> Environment:
        """The environment in a file (.hdr or .exr), or ``stock:NAME``, one of our own (``sky``).

        The layout is recognised by the picture's proportions (2:1 lat-long, 1:1 angular map, 3:4 vertical
        cross, 4:3 horizontal cross, 6:1 and 1:6 strips, within 1 %) unless given. Six pictures of faces are
        a folder of them, or a name such as ``sky_{face}.hdr`` (``opening``). Raises InputError.
        """
        if isinstance(path, str) and path.startswith(STOCK_PREFIX):
            if layout not in (None, "latlong"):
                raise InputError(path, f"layout {layout!r}, but stock environments are latlong")
            return cls.stock(path.removeprefix(STOCK_PREFIX))
        from .opening import read_map

        pixels, layout = read_map(path, layout)
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
        colour = np.array(quantities.colour("radiance", radiance))
        return cls(np.tile(colour, (6, 1, 1, 1)), "cube", name="constant")

    @classmethod
    def dark(cls) -> Environment:
        """No light at all: where discs are to be the only ones."""
        return cls(np.zeros((6, 1, 1, 3), np.float32), "cube", name="dark")

    @classmethod
    def from_cube(cls, faces: CubeMap) -> Environment:
        """The faces (6, R, R, 3) of a cube map, laid out as in ``bases.cube_map``."""
        return cls(faces, "cube", name="cube map")

    # ---- What a designer sets: each as a new environment -------------------------------------------------

    def rotated(self, degrees: float) -> Environment:
        """Turned further about +Y, counter-clockwise seen from above: what was at −Z moves towards −X.

        Everything turns: the map, the parts of a blend, what is painted, the discs.
        """
        degrees = quantities.amount("rotation", degrees)
        return replace(
            self,
            rotation_deg=self.rotation_deg + degrees,
            parts=tuple(part.rotated(degrees) for part in self.parts),
            paints=tuple(paint.turned(degrees) for paint in self.paints),
            discs=tuple(disc.turned(degrees) for disc in self.discs),
        )

    def scaled(self, factor: float) -> Environment:
        """``factor`` times as bright, altogether."""
        factor = quantities.amount("scale", factor, least=0.0)
        return self._times((factor, factor, factor), scale=self.scale * factor)

    def tinted(self, tint: Sequence[float]) -> Environment:
        """Red, green and blue of everything multiplied by three factors."""
        red, green, blue = quantities.colour("tint", tint)
        own = (self.tint[0] * red, self.tint[1] * green, self.tint[2] * blue)
        return self._times((red, green, blue), tint=own)

    def _times(self, factors: quantities.Triple, **own: object) -> Environment:
        return replace(
            self,
            parts=tuple(part.tinted(factors) for part in self.parts),
            paints=tuple(paint.times(factors) for paint in self.paints),
            discs=tuple(disc.times(factors) for disc in self.discs),
            **own,
        )

    def blended(self, other: Environment, share: float) -> Environment:
        """(1 − share) of this environment and ``share`` (0 to 1) of another, added.

        Each keeps its turn, scale, tint, paint and discs; totals add in the same shares.
        """
        share = quantities.amount("share", share, least=0.0, most=1.0)
        if not isinstance(other, Environment):
            raise quantities.refused("blend", other, "an Environment")
        if share in (0.0, 1.0):
            return other if share else self
        first, second = self.scaled(1.0 - share), other.scaled(share)
        return replace(
            Environment.dark(),
            name=f"{self.name} and {other.name}",
            parts=first._added_parts + second._added_parts,
            discs=first.discs + second.discs,
        )

    def painted(self, region: Region, radiance: Sequence[float], *, opacity: float = 1.0) -> Environment:
        """A region (``regions.Cap`` or ``Window``, directions as the scene's) replaced by a colour.

        With an opacity below 1 it is mixed: (1 − opacity) of what was there, and opacity of the colour.
        Discs stand in front of what is painted, whichever came first.
        """
        paint = Paint(region, quantities.colour("radiance", radiance), opacity)
        return replace(self, paints=(*self.paints, paint))

    def with_disc(self, disc: Disc) -> Environment:
        """With one more disc light."""
        return replace(self, discs=(*self.discs, disc))

    def with_discs(self, discs: Iterable[Disc]) -> Environment:
        """With these disc lights and no others; ``with_discs([])`` is the environment behind them."""
        return replace(self, discs=tuple(discs))

    # ---- What it gives -----------------------------------------------------------------------------------

    @property
    def gain(self) -> Float64[np.ndarray, "3"]:
        """Scale times tint."""
        return self.scale * np.array(self.tint)

    @property
    def _checked(self) -> RadianceMap:
        assert self._map is not None  # set by __post_init__
        return self._map

    @property
    def _added_parts(self) -> tuple[Environment, ...]:
        """What a blend adds up: a blend is taken apart, so that blends of blends do not nest."""
        return self.parts if self.parts and not self.paints else (self.with_discs(()),)

    @property
    def _brightest(self) -> float:
        """No less than the largest radiance in any direction."""
        painted = max((max(paint.radiance) for paint in self.paints), default=0.0)
        added = sum(part._brightest for part in self.parts) + sum(max(disc.radiance) for disc in self.discs)
        return max(self._checked.brightest * self.scale * max(self.tint), painted) + added

    @property
    def total(self) -> Float64[np.ndarray, "3"]:
        """∫ L dω over the sphere: by the exact solid angle of every pixel, and of every disc.

        Where regions are painted, what is behind the discs is weighed as a cube map of R=256.
        """
        if self.paints:
            whole = np.einsum("fijk,ij->k", self.with_discs(()).cube(_WEIGHED_AT), _areas(), dtype=np.float64)
        else:
            whole = sum((part.total for part in self.parts), self._checked.total * self.gain)
        return sum((disc.total for disc in self.discs), whole)

    def same_behind_discs(self, other: Environment) -> bool:
        """Whether two environments differ in nothing but their discs: their cube maps before the discs are the
        same bits. Maps count as the same only where they share the pixels."""
        return (
            self._checked is other._checked
            and (self.rotation_deg, self.scale, self.tint) == (other.rotation_deg, other.scale, other.tint)
            and self.paints == other.paints
            and len(self.parts) == len(other.parts)
            and all(a.same_behind_discs(b) for a, b in zip(self.parts, other.parts, strict=True))
        )

    def cube(self, resolution: int) -> CubeMap:
        """The mean radiance (6, R, R, 3) of each texel of a cube map (``bases.cube_map``), as turned.

        In every channel Σ radiance · solid angle is ``total`` (to float32), and light stays where it was to
        a texel or a pixel of the map, whichever is larger. An unturned cross is given back bit for bit
        where R is the side of its faces.

        It is, bit for bit, ``with_discs([]).cube(R)`` to which ``disc.add_discs`` adds the discs: for each in
        turn, for each of ``disc.texels(R)``, ``cube[face, rows, columns] += radiance`` in float32.

        Raises
        ------
        InputError
            Unless 1 ≤ resolution ≤ 4096.
        """
        side = quantities.resolution(resolution)
        if self.gain.any():
            out = self._checked.cube(side, self.rotation_deg)
            if not np.array_equal(self.gain, np.ones(3)):
                out *= self.gain.astype(np.float32)
        else:
            out = np.zeros((6, side, side, 3), np.float32)
        for part in self.parts:
            out += part.cube(side)
        for paint in self.paints:
            for face, rows, columns, share in paint.region.cover(side):
                m = (paint.opacity * share[..., None]).astype(np.float32)
                texels = out[face, rows, columns]
                texels += m * (np.array(paint.radiance, np.float32) - texels)
        add_discs(out, self.discs)
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
        for part in self.parts:
            out += part.radiance_along(d)
        if self.paints or self.discs:
            length = np.linalg.norm(d.astype(np.float64), axis=1, keepdims=True)
            unit = np.divide(d, length, out=np.zeros(d.shape), where=length > 0.0)
            for paint in self.paints:
                m = (paint.opacity * paint.region.along(unit)).astype(np.float32)[:, None]
                out += m * (np.array(paint.radiance, np.float32) - out)
            for disc in self.discs:
                out += disc.region.along(unit).astype(np.float32)[:, None] * np.array(
                    disc.radiance, np.float32
                )
        return out


def _areas() -> Float64[np.ndarray, "row column"]:
    edges = np.linspace(-1.0, 1.0, _WEIGHED_AT + 1)
    return cube_map.rectangle_solid_angles(edges, edges)


def _all_of(kind: type, values: object, *, name: str) -> tuple:
    found = tuple(values) if isinstance(values, Iterable) else (values,)
    for value in found:
        if not isinstance(value, kind):
            raise quantities.refused(name, value, f"each a {kind.__name__}")
    return found
