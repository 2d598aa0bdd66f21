"""Rooms with windows, small enough for tests: boxes of walls with panes of glass in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from prelight.baking.portals import bake_portals
from prelight.baking.portals_settings import PortalsSettings
from prelight.material import Material
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.scene.portals import PortalWish

from .rooms import rectangle, scene_of_rectangles

SIZE = (4.0, 3.0, 5.0)
WHITE, RED = (1.0, 1.0, 1.0), (0.9, 0.2, 0.1)
QUICK = {"rays": 1024, "gather_rays": 256}


def with_glass(walls: tuple, panes: dict[str, list[tuple]], *, albedo=0.6, tints=None) -> Scene:
    """Opaque rectangles, and rectangles of glass of some names."""
    parts, names = list(walls), [""] * len(walls)
    for name, rows in panes.items():
        parts += rows
        names += [name] * len(rows)
    kinds = ["", *panes]
    scene = scene_of_rectangles(*parts, albedo=albedo)
    material_of = np.repeat([kinds.index(name) for name in names], [len(t) for _, _, t in parts]).astype(
        np.int32
    )
    glass = [Material(name, (tints or {}).get(name, WHITE), transmission=1.0, specular=1.0) for name in panes]
    return replace(scene, materials=(Material("plaster"), *glass), material_of=material_of)


def wall_with_hole(corner, first, second, *, hole, cells: int) -> tuple:
    """A rectangle's four parts around a hole, from (s0, t0) to (s1, t1) of its sides."""
    corner, first, second = (np.array(v, np.float64) for v in (corner, first, second))
    (s0, t0), (s1, t1) = hole
    parts = [((0, 0), (1, t0)), ((0, t1), (1, 1)), ((0, t0), (s0, t1)), ((s1, t0), (1, t1))]
    return tuple(
        rectangle(corner + a * first + b * second, (c - a) * first, (d - b) * second, cells=cells)
        for (a, b), (c, d) in parts
    )


def pane(corner, first, second, *, hole) -> tuple:
    """The hole's glass."""
    corner, first, second = (np.array(v, np.float64) for v in (corner, first, second))
    (s0, t0), (s1, t1) = hole
    return rectangle(corner + s0 * first + t0 * second, (s1 - s0) * first, (t1 - t0) * second, cells=2)


def under_glass(*, albedo=0.6, cells: int = 6, tint=WHITE, name: str = "clear glass") -> Scene:
    """Floor and four walls under a ceiling that is all glass."""
    X, Y, Z = SIZE
    sides = (
        ((0, 0, 0), (0, 0, Z), (X, 0, 0)), ((0, 0, 0), (0, Y, 0), (0, 0, Z)), ((X, 0, 0), (0, 0, Z), (0, Y, 0)),
        ((0, 0, 0), (X, 0, 0), (0, Y, 0)), ((0, 0, Z), (0, Y, 0), (X, 0, 0)),
    )  # fmt: skip
    walls = tuple(rectangle(*side, cells=cells) for side in sides)
    return with_glass(
        walls,
        {name: [rectangle((0, Y, 0), (X, 0, 0), (0, 0, Z), cells=2)]},
        albedo=albedo,
        tints={name: tint},
    )


def two_windows(*, cells: int = 6, albedo=0.6, tints=None, slab: bool = False) -> Scene:
    """A closed room with a window in each of two walls that face each other: "left glass" and "right glass"."""
    X, Y, Z = SIZE
    left, right = ((0, 0, 0), (0, Y, 0), (0, 0, Z)), ((X, 0, 0), (0, 0, Z), (0, Y, 0))
    holes = ((0.3, 0.2), (0.8, 0.6)), ((0.5, 0.35), (0.8, 0.8))
    whole = (
        ((0, 0, 0), (0, 0, Z), (X, 0, 0)), ((0, Y, 0), (X, 0, 0), (0, 0, Z)), ((0, 0, 0), (X, 0, 0), (0, Y, 0)),
        ((0, 0, Z), (0, Y, 0), (X, 0, 0)),
    )  # fmt: skip
    walls = tuple(rectangle(*side, cells=cells) for side in whole)
    for side, hole in zip((left, right), holes, strict=True):
        walls += wall_with_hole(*side, hole=hole, cells=max(2, cells // 2))
    panes = {"left glass": [pane(*left, hole=holes[0])], "right glass": [pane(*right, hole=holes[1])]}
    if slab:  # a second sheet of the left one's, a little inside
        p, n, t = panes["left glass"][0]
        panes["left glass"].append((p + np.array([0.02, 0, 0]), n, t))
    return with_glass(walls, panes, albedo=albedo, tints=tints)


def portals_of(scene: Scene, path: Path, *, wish: PortalWish | None = None, **settings) -> PortalsRelighter:
    """Baked and opened."""
    asked = PortalsSettings(wish or PortalWish(), **(QUICK | settings))
    return PortalsRelighter(bake_portals(scene, path, settings=asked, force=True))


def rectangle_form_factor(a: float, b: float, height: float) -> float:
    """From a horizontal point to a parallel rectangle a × b above it, one corner straight above (Howell, B-3)."""
    X, Y = a / height, b / height
    one, two = np.sqrt(1 + X * X), np.sqrt(1 + Y * Y)
    return (X / one * np.arctan(Y / one) + Y / two * np.arctan(X / two)) / (2 * np.pi)


def skylight_form_factor(points: np.ndarray, low, high, height: float) -> np.ndarray:
    """From points (n, 2) of the floor to the rectangle from ``low`` to ``high`` above: four corners, with signs."""
    out = []
    for x, z in points:
        total = 0.0
        for sx, ex in ((1, high[0] - x), (-1, low[0] - x)):
            for sz, ez in ((1, high[1] - z), (-1, low[1] - z)):
                sign = sx * sz * np.sign(ex) * np.sign(ez)
                if ex and ez:
                    total += sign * rectangle_form_factor(abs(ex), abs(ez), height)
        out.append(total)
    return np.array(out)
