"""Portals: the openings through which light reaches a room, as triangles with names and colours.

They are found from the glass of a scene (materials that transmit, dielectrics, names), or given by the names of
materials or as polygons in a small file (``portal_file``). Glass of one material is one portal, or one for each
window; portals that are too large for what moves outside are cut (``portal_cutting``).

Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic Environment
Illumination, 2009, sections 3.1 and 6.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import Float32, Float64, Int32
from ..errors import InputError
from ..material import Material
from .geometry import Scene
from .mesh import short_name
from .portal_cutting import cut_to_size
from .portal_file import GivenPortal, read_portal_file
from .portal_windows import windows_of

GROUPS = ("material", "window", "one")
MOST_PORTALS = 1024
_DIELECTRICS = frozenset({"dielectric", "thindielectric", "roughdielectric", "principledthin", "null"})
_GLASS = re.compile(
    r"glass|window[ _-]?pane|windscreen|windshield|skylight|(?<![a-z])portal|vitre|verre|vetro|vidrio|vidro|"
    r"staklo|szklo|(?<![a-z])glas(?![a-z])|fenster|scheibe"
)
_NO_GLASS = re.compile(r"fibre|fiber|frame|rahmen")
_WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Portals:
    """Triangles through which light comes in, grouped into portals.

    A *pane* is the part of a portal that has one colour baked in; where glass may change it is the whole portal, and
    its colour white.

    Attributes
    ----------
    corners
        ``(T, 3, 3)`` metres, none without area.
    pane_of
        ``(T,)`` the pane of each triangle, ascending.
    portal_of_pane, pane_tints
        ``(N,)``, ascending, and ``(N, 3)`` transmittance that is baked.
    names, tints
        Of the portals; ``tints (P, 3)`` the transmittance of the glass as built, which a rig may replace.
    glass
        Indices of the scene's triangles that are the portals' glass, and ``portal_of_glass`` which portal's.
    notes
        Lines for people.
    """

    corners: Float32[np.ndarray, "triangles 3 3"]
    pane_of: Int32[np.ndarray, "triangles"]
    portal_of_pane: Int32[np.ndarray, "panes"]
    pane_tints: Float32[np.ndarray, "panes 3"]
    names: tuple[str, ...]
    tints: Float32[np.ndarray, "portals 3"]
    glass: Int32[np.ndarray, "some"]
    portal_of_glass: Int32[np.ndarray, "some"]
    notes: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.names)

    def keeping(self, portals: Int32[np.ndarray, "some"]) -> Portals:
        """Some of them, in ascending order."""
        pane = np.isin(self.portal_of_pane, portals)
        kept, glass = pane[self.pane_of], np.isin(self.portal_of_glass, portals)
        renumbered = np.searchsorted(portals, np.arange(len(self))).astype(np.int32)
        return Portals(
            self.corners[kept], (np.cumsum(pane) - 1).astype(np.int32)[self.pane_of[kept]],
            renumbered[self.portal_of_pane[pane]], self.pane_tints[pane], tuple(self.names[p] for p in portals),
            self.tints[portals], self.glass[glass], renumbered[self.portal_of_glass[glass]], self.notes,
        )  # fmt: skip

    @property
    def portal_of(self) -> Int32[np.ndarray, "triangles"]:
        """Of each triangle."""
        return self.portal_of_pane[self.pane_of]

    @property
    def triangle_areas(self) -> Float64[np.ndarray, "triangles"]:
        """m²."""
        return areas_of(self.corners)

    @property
    def areas(self) -> Float64[np.ndarray, "portals"]:
        """m²."""
        return np.bincount(self.portal_of, self.triangle_areas, minlength=len(self))

    @property
    def centres(self) -> Float64[np.ndarray, "portals 3"]:
        """The middle of each portal's area: where its shell is seen from."""
        weight, middle = self.triangle_areas, self.corners.astype(np.float64).mean(axis=1)
        sums = [np.bincount(self.portal_of, weight * middle[:, k], minlength=len(self)) for k in range(3)]
        return np.stack(sums, axis=1) / self.areas[:, None]

    @property
    def extents(self) -> Float64[np.ndarray, "portals"]:
        """l: the largest distance between any two points of each portal, metres."""
        return np.array([extent_of(self.corners[self.portal_of == p]) for p in range(len(self))])


@dataclass(frozen=True)
class PortalWish:
    """Which portals are wanted.

    Parameters
    ----------
    materials
        Names of materials that are portals; if none, glass is looked for.
    file
        A small file of portals (``portal_file``), instead of looking for glass.
    group
        "material" (one portal for each), "window" (one for each window and material), or "one": a single portal,
        with the colours of its glass baked in.
    exterior_distance
        r: no moving thing outside comes nearer to a portal, metres; infinite where all is far away.
    theta_deg
        θ_M: portals are cut until l/(2r) < θ_M.
    """

    materials: tuple[str, ...] = ()
    file: str | None = None
    group: str = "material"
    exterior_distance: float = math.inf
    theta_deg: float = 5.0

    def __post_init__(self) -> None:
        if self.group not in GROUPS:
            raise InputError("group", f"{self.group!r}, expected {', '.join(GROUPS)}")
        if self.materials and self.file is not None:
            raise InputError("portals", "given by --portal and by --portals; choose one of them")
        for name, value, most in (
            ("exterior-distance", self.exterior_distance, math.inf), ("theta", self.theta_deg, 45.0),
        ):  # fmt: skip
            if not 0 < value <= most:
                what = f"{value!r}, expected a number above 0"
                raise InputError(name, what if math.isinf(most) else f"{what} and at most {most:g}")
        if self.group == "one" and math.isfinite(self.exterior_distance):
            raise InputError(
                "group", "one portal for all needs everything outside far away; leave --exterior-distance out"
            )

    @property
    def longest(self) -> float:
        """What l may be, metres."""
        return 2 * self.exterior_distance * math.radians(self.theta_deg)


def find_portals(scene: Scene, wish: PortalWish | None = None) -> Portals:
    """The portals of a scene. Raises InputError where there is none, saying what was looked for."""
    wish = wish or PortalWish()
    given = None if wish.file is None else read_portal_file(wish.file)
    parts = _from_glass(scene, wish) if given is None else _from_file(scene, given, str(wish.file))
    if wish.group == "one":
        return _as_one(parts)
    if wish.group == "window":
        parts = _by_window(parts)
    parts = _numbered([piece for part in parts for piece in _cut(part, wish)])
    if len(parts) > MOST_PORTALS:
        what = f"{len(parts):,} of them, at most {MOST_PORTALS:,} are handled; a larger --exterior-distance or --theta"
        raise InputError("portals", what + " makes fewer, or --group material")
    return _gathered(parts)


def areas_of(corners: np.ndarray) -> Float64[np.ndarray, "triangles"]:
    """m² of triangles (T, 3, 3)."""
    a, b, c = np.moveaxis(np.asarray(corners, np.float64), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def extent_of(corners: np.ndarray) -> float:
    """The largest distance between two points of triangles, by those farthest out in 400 directions."""
    points = np.unique(np.asarray(corners, np.float64).reshape(-1, 3), axis=0)
    if len(points) > 800:
        k = np.arange(400) + 0.5
        z, turn = 1 - k / 200, k * math.pi * (1 + 5**0.5)
        around = np.sqrt(1 - z * z)
        d = np.stack([around * np.cos(turn), around * np.sin(turn), z])
        points = points[np.unique((points @ d).argmax(axis=0))]
    return float(np.linalg.norm(points[:, None] - points[None], axis=2).max())


@dataclass(frozen=True)
class _Part:
    """A portal to be."""

    name: str
    corners: Float64[np.ndarray, "triangles 3 3"]
    tint: tuple[float, float, float]
    source: Int32[np.ndarray, "triangles"]  # of the scene, −1 of none


def _glass_materials(scene: Scene) -> list[int]:
    used = np.unique(scene.material_of)
    return [int(m) for m in used if is_glass(scene.materials[m])]


def is_glass(material: Material) -> bool:
    """Whether light goes through a material: it transmits, is a dielectric, or is called so."""
    name = material.name.lower()
    named = _GLASS.search(name) is not None and _NO_GLASS.search(name) is None
    return material.transmission > 0 or _is_dielectric(material.bsdf or {}) or named


def _is_dielectric(bsdf: Mapping[str, Any]) -> bool:
    inner = [v for v in bsdf.values() if isinstance(v, Mapping)]
    return bsdf.get("type") in _DIELECTRICS or any(_is_dielectric(part) for part in inner)


def tint_of(material: Material) -> tuple[float, float, float]:
    """What a material lets through: the colour of glass that transmits or is called so, white of a BSDF's own."""
    if material.bsdf is not None:
        return _WHITE
    red, green, blue = material.colour
    return red, green, blue


def _from_glass(scene: Scene, wish: PortalWish) -> list[_Part]:
    names = [m.name for m in scene.materials]
    if wish.materials:
        low = {name.lower(): k for k, name in enumerate(names)}
        missing = [name for name in wish.materials if name.lower() not in low]
        if missing:
            known = ", ".join(short_name(n) for n in names[:12]) + (", …" if len(names) > 12 else "")
            raise InputError("--portal", f"{scene.name} has no material {missing[0]!r}; it has {known}")
        chosen = list(dict.fromkeys(low[name.lower()] for name in wish.materials))
    else:
        chosen = _glass_materials(scene)
    parts = [part for m in chosen if (part := _of_material(scene, m)) is not None]
    if not parts and wish.materials:
        raise InputError("--portal", f"no triangle of {scene.name} is made of {', '.join(wish.materials)}")
    if not parts:
        what = (
            f"no portal found in {scene.name}: looked for materials that transmit light, dielectrics, and names such "
            "as glass or window pane; name a material with --portal, or give polygons with --portals FILE"
        )
        raise InputError("portals", what)
    return parts


def _of_material(scene: Scene, m: int, tint: tuple[float, float, float] | None = None) -> _Part | None:
    of = np.flatnonzero(scene.material_of == m)
    corners = scene.positions[scene.triangles[of]].astype(np.float64)
    flat = areas_of(corners) <= 0
    of, corners = of[~flat], corners[~flat]
    if not len(of):
        return None
    material = scene.materials[m]
    return _Part(material.name, corners, tint or tint_of(material), of.astype(np.int32))


def _from_file(scene: Scene, given: Sequence[GivenPortal], path: str) -> list[_Part]:
    by_name = {material.name.lower(): m for m, material in enumerate(scene.materials)}
    parts: dict[str, _Part] = {}
    for k, portal in enumerate(given):
        pointer = f"/portal/{k}"
        if portal.material is not None:
            if portal.material.lower() not in by_name:
                known = ", ".join(short_name(m.name) for m in scene.materials[:12])
                raise InputError(
                    path, f"{scene.name} has no material {portal.material!r}; it has {known}", pointer
                )
            part = _of_material(scene, by_name[portal.material.lower()], portal.tint)
            if part is None:
                raise InputError(path, f"no triangle of {scene.name} is made of {portal.material!r}", pointer)
        else:
            none = np.full(len(portal.triangles), -1, np.int32)
            part = _Part(portal.name, portal.triangles, portal.tint or _WHITE, none)
        part = _Part(portal.name or part.name, part.corners, part.tint, part.source)
        other = parts.get(part.name)
        if other is not None and other.tint != part.tint:
            raise InputError(
                path, f"two tints for portals called {part.name!r}; give them names of their own", pointer
            )
        parts[part.name] = part if other is None else _joined(other, part)
    return list(parts.values())


def _joined(one: _Part, other: _Part) -> _Part:
    return _Part(
        one.name,
        np.concatenate([one.corners, other.corners]),
        one.tint,
        np.concatenate([one.source, other.source]),
    )


def _by_window(parts: list[_Part]) -> list[_Part]:
    """For every window, whatever glass is in it, a part of each of its materials."""
    window = windows_of(np.concatenate([part.corners for part in parts]))
    ends = np.cumsum([len(part.corners) for part in parts])
    return [
        _Part(part.name, part.corners[own], part.tint, part.source[own])
        for part, of in zip(parts, np.split(window, ends[:-1]), strict=True)
        for own in (of == w for w in np.unique(of))
    ]


def _cut(part: _Part, wish: PortalWish) -> list[_Part]:
    if not math.isfinite(wish.longest):
        return [part]
    pieces = cut_to_size(
        part.corners, part.source, longest=wish.longest, most=MOST_PORTALS, extent_of=extent_of
    )
    return [_Part(part.name, corners, part.tint, source) for corners, source in pieces]


def _numbered(parts: list[_Part]) -> list[_Part]:
    """Names of their own: NAME, or NAME 1, NAME 2, … of several."""
    names = [part.name for part in parts]
    taken: dict[str, int] = {}
    out = []
    for part in parts:
        taken[part.name] = taken.get(part.name, 0) + 1
        name = part.name if names.count(part.name) == 1 else f"{part.name} {taken[part.name]}"
        out.append(_Part(name, part.corners, part.tint, part.source))
    return out


def _solid(part: _Part) -> _Part:
    """Without triangles that have no area when places are rounded to float32."""
    there = areas_of(part.corners.astype(np.float32)) > 0
    return _Part(part.name, part.corners[there], part.tint, part.source[there])


def _gathered(parts: list[_Part]) -> Portals:
    parts = [part for part in map(_solid, parts) if len(part.corners)]
    counts = [len(part.corners) for part in parts]
    of = np.repeat(np.arange(len(parts), dtype=np.int32), counts)
    glass, portal_of_glass = _glass_of(np.concatenate([part.source for part in parts]), of)
    return Portals(
        corners=np.concatenate([part.corners for part in parts]).astype(np.float32),
        pane_of=of,
        portal_of_pane=np.arange(len(parts), dtype=np.int32),
        pane_tints=np.ones((len(parts), 3), np.float32),
        names=tuple(part.name for part in parts),
        tints=np.array([part.tint for part in parts], np.float32),
        glass=glass,
        portal_of_glass=portal_of_glass,
    )


def _as_one(parts: list[_Part]) -> Portals:
    """One portal, a pane for every colour."""
    parts = [part for part in map(_solid, parts) if len(part.corners)]
    tints = list(dict.fromkeys(part.tint for part in parts))
    parts = sorted(parts, key=lambda part: tints.index(part.tint))
    counts = [len(part.corners) for part in parts]
    pane = np.repeat([tints.index(part.tint) for part in parts], counts).astype(np.int32)
    glass, portal_of_glass = _glass_of(np.concatenate([part.source for part in parts]), np.zeros_like(pane))
    return Portals(
        corners=np.concatenate([part.corners for part in parts]).astype(np.float32),
        pane_of=pane,
        portal_of_pane=np.zeros(len(tints), np.int32),
        pane_tints=np.array(tints, np.float32),
        names=("all",),
        tints=np.ones((1, 3), np.float32),
        glass=glass,
        portal_of_glass=portal_of_glass,
    )


def _glass_of(source: np.ndarray, portal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each triangle of the scene once, with the first portal that a piece of it is in."""
    there = source >= 0
    glass, first = np.unique(source[there], return_index=True)
    return glass.astype(np.int32), portal[there][first].astype(np.int32)
