"""Steerable layers whose pictures are known in closed form: a floor with a hole of shadow, under a spot or a panel."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from prelight.bases.panels import PanelBasis
from prelight.bases.steering import SpotBasis
from prelight.camera import Camera
from prelight.encoding.principal_components import Keep
from prelight.lighting.places import Place
from prelight.relighting.steerable_layer import SteerableLayer
from prelight.relighting.takers import STEERABLE

SIDE = 40  # pixels; not a multiple of a block
ABOVE = (0.0, 1.5, 0.0)


def floor() -> np.ndarray:
    """Points (pixels, 3) of a square of 3 m."""
    z, x = np.mgrid[:SIDE, :SIDE] * (3.0 / (SIDE - 1)) - 1.5
    return np.stack([x, 0.0 * x, z], axis=-1).reshape(-1, 3)


def albedo() -> np.ndarray:
    return np.random.default_rng(7).random((SIDE * SIDE, 3)) * 0.4 + 0.3


def from_spot(position=ABOVE, hole=(0.5, 0.2)) -> tuple[np.ndarray, np.ndarray]:
    """Directions (pixels, 3) in which a spot's light leaves it, and radiance (pixels, 3) for 1 W/sr."""
    way = floor() - np.array(position)
    r = np.linalg.norm(way, axis=1)
    way /= r[:, None]
    seen = np.hypot(floor()[:, 0] - hole[0], floor()[:, 2] - hole[1]) > 0.4
    return way, (seen * -way[:, 1] / r**2 / np.pi)[:, None] * albedo()


def spot_layer(
    degree: int = 5, *, name: str = "key", position=ABOVE, hole=(0.5, 0.2), keep: Keep | str | None = "all"
) -> SteerableLayer:
    basis = SpotBasis(degree)
    way, unit = from_spot(position, hole)
    span = (basis.evaluate(way)[:, None] * unit[:, :, None]).transpose(2, 0, 1).astype(np.float32)
    place = Place("spot", position)
    return SteerableLayer.of_images(name, span, basis=basis, place=place, size=(SIDE, SIDE), keep=keep)


@cache
def _from_panel(side: int) -> np.ndarray:
    """What each of side² points of the panel of ``panel_layer`` brings (points, pixels), without albedo."""
    found = []
    for u, v in panel_points(side):
        way = floor() - np.array([-1.0 + 2.0 * u, 1.2, -1.0 + 2.0 * v])
        r = np.linalg.norm(way, axis=1)
        cosine = -way[:, 1] / r
        seen = np.hypot(floor()[:, 0] - 0.5 * u, floor()[:, 2]) > 0.2
        found.append(seen * cosine * cosine / r**2 / np.pi)
    return np.stack(found) * 4.0 / side**2


def panel_light(values: np.ndarray) -> np.ndarray:
    """Radiance (pixels, 3) under lights of these radiances at ``panel_points()``."""
    return (values @ _from_panel(16))[:, None] * albedo()


def panel_points(side: int = 16) -> np.ndarray:
    at = (np.arange(side) + 0.5) / side
    return np.stack(np.meshgrid(at, at, indexing="ij"), -1).reshape(-1, 2)


def panel_layer(harmonics: int = 2, *, name: str = "soft", keep: Keep | str | None = "all") -> SteerableLayer:
    basis, points = PanelBasis((harmonics, harmonics)), panel_points()
    functions = basis.evaluate(points)
    span = np.stack([panel_light(own) for own in functions.T]).astype(np.float32)
    place = Place("panel", (-1.0, 1.2, -1.0), ((2.0, 0.0, 0.0), (0.0, 0.0, 2.0)))
    return SteerableLayer.of_images(name, span, basis=basis, place=place, size=(SIDE, SIDE), keep=keep)


def bake_of(name: str) -> SimpleNamespace:
    """What commands ask of an opened bake with one steerable layer, whose components come from elsewhere."""
    eye = SimpleNamespace(name="front", view=Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)).to_dict())
    layer = SimpleNamespace(kind=STEERABLE, camera=eye)
    return SimpleNamespace(path=Path("a.prelight"), layers={name: layer}, manifest=SimpleNamespace(arrays={}))
