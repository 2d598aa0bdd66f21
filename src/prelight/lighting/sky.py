"""Environments of our own, painted when asked for: no files, no rights of others.

Exposure: a white diffuse surface that faces the key light has a radiance of about one. Each is 1024×512,
lat-long; the camera of the stock scenes looks along −Z, so a key light on its left is at azimuths near −90°.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..arrays import Picture
from ..errors import InputError
from .painting import (
    add_light,
    angle_to,
    by_elevation,
    cie_clear,
    cie_overcast,
    disc,
    every_direction,
    hue,
    lay_ground,
    mixed,
    pointing,
    soft_box,
)

HEIGHT, WIDTH = 512, 1024


def _overcast(d: Picture) -> Picture:
    """The CIE overcast sky, a little cool: soft light from above, no shadow with an edge."""
    picture = cie_overcast(d)[..., None] * (1.35 * hue(0.90, 0.97, 1.10))
    lay_ground(picture, (0.24, 0.23, 0.21))
    return picture


def _noon(d: Picture) -> Picture:
    """A clear blue sky and a sharp sun, high on the left, in front of the scene."""
    sun = pointing(-104.0, 42.0)
    low = np.exp(-np.maximum(d[..., 1], 0.0) / 0.22)
    picture = mixed(hue(0.24, 0.46, 1.0), hue(0.72, 0.86, 1.0), low)
    picture *= (0.16 * cie_clear(d, sun))[..., None]
    add_light(picture, disc(d, sun, 1.0), 2.75 * hue(1.0, 0.95, 0.86))
    lay_ground(picture, (0.30, 0.26, 0.21))
    return picture


def _sunset(d: Picture) -> Picture:
    """The sun just above the horizon on the left: orange there, rose and deep blue away from it."""
    sun = pointing(-84.0, 9.0)
    towards = by_elevation(HEIGHT, (
        (0.0, (1.00, 0.38, 0.10)), (6.0, (0.80, 0.37, 0.16)), (16.0, (0.40, 0.25, 0.25)),
        (34.0, (0.11, 0.14, 0.27)), (90.0, (0.035, 0.070, 0.21)),
    ))  # fmt: skip
    away = by_elevation(HEIGHT, (
        (0.0, (0.10, 0.11, 0.21)), (7.0, (0.15, 0.13, 0.24)), (13.0, (0.21, 0.15, 0.25)),
        (28.0, (0.09, 0.12, 0.28)), (90.0, (0.035, 0.070, 0.21)),
    ))  # fmt: skip
    level = np.array([sun[0], 0.0, sun[2]], np.float32) / np.float32(np.hypot(sun[0], sun[2]))
    picture = mixed(towards, away, 0.5 - 0.5 * (d @ level))
    aureole = np.exp(angle_to(d, sun) / -0.16)
    add_light(picture, aureole, 0.22 * hue(1.0, 0.50, 0.17))
    add_light(picture, disc(d, sun, 1.0), 2.9 * hue(1.0, 0.50, 0.18))
    lay_ground(picture, (0.22, 0.18, 0.16), haze=0.5)
    return picture


def _studio(d: Picture) -> Picture:
    """A dark room with three soft boxes: a large key, front left; a strip, back right; a weak fill."""
    picture = np.empty_like(d)
    picture[:] = (0.010 + 0.010 * np.maximum(d[..., 1], 0.0))[..., None] * hue(1.0, 0.98, 0.95)
    add_light(picture, soft_box(d, pointing(-114.0, 36.0), 44.0, 36.0), 2.9 * hue(1.0, 0.93, 0.84))
    add_light(picture, soft_box(d, pointing(52.0, 24.0), 9.0, 64.0), 2.3 * hue(0.84, 0.95, 1.10))
    add_light(picture, soft_box(d, pointing(126.0, 8.0), 36.0, 48.0), 0.14 * hue(0.92, 0.98, 1.08))
    lay_ground(picture, (0.10, 0.10, 0.10), haze=0.9, reach_deg=15.0)
    return picture


def _stage(d: Picture) -> Picture:
    """Coloured spots in the dark: magenta from the left, teal from behind, amber high in front."""
    picture = np.empty_like(d)
    picture[:] = (0.012, 0.014, 0.030)
    add_light(picture, disc(d, pointing(-98.0, 20.0), 7.0, 3.0), (2.7, 0.05, 1.5))
    add_light(picture, disc(d, pointing(64.0, 24.0), 8.0, 3.0), (0.03, 1.35, 1.55))
    add_light(picture, disc(d, pointing(-152.0, 50.0), 5.0, 3.0), 0.75 * hue(1.0, 0.54, 0.14))
    lay_ground(picture, (0.07, 0.07, 0.08), haze=0.9, reach_deg=15.0)
    return picture


class StockSky(NamedTuple):
    """What a stock environment is, in a line, and how it is painted from unit directions (H, W, 3)."""

    title: str
    paint: Callable[[Picture], Picture]


STOCK_SKIES: dict[str, StockSky] = {
    "overcast": StockSky("an overcast sky, soft from above", _overcast),
    "noon": StockSky("a clear blue sky, a sharp sun high on the left", _noon),
    "sunset": StockSky("a low warm sun on the left, orange to deep blue", _sunset),
    "studio": StockSky("a dark room, three soft boxes", _studio),
    "stage": StockSky("amber, magenta and teal spots in the dark", _stage),
}


def paint(name: str) -> Picture:
    """The lat-long map of a stock environment, (512, 1024, 3) scene-linear; raises InputError."""
    if name not in STOCK_SKIES:
        raise InputError(f"stock:{name}", f"no such stock environment; there are {', '.join(STOCK_SKIES)}")
    return STOCK_SKIES[name].paint(every_direction(HEIGHT, WIDTH)).astype(np.float32)
