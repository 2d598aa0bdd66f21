"""Where the pixels of a latitude-longitude map fall on a cube map, remembered for a size and a turn.

Skies of two hours differ in their pixels only, and so do maps that are turned by moving their columns. Light that is
given to remembered places comes to the same bits as light that is scattered (``scattering``), and much sooner.
"""

from __future__ import annotations

from functools import lru_cache
from math import radians
from typing import NamedTuple

import numpy as np

from ..arrays import Float64, Picture
from .remembered_places_kernels import add_up, give, split_all
from .scattering import Places, Slab, Vector, scatter_latlong

MOST_PIXELS, MOST_RESOLUTION = 1 << 17, 64  # some ten megabytes
_REMEMBERED = 24  # sizes and turns: four of each layer that a hand turns, and those of exact answers
_PARTS = 4  # of a column
Frames = tuple[tuple[Vector, Vector, Vector], ...]  # U, V, AXIS of each face


class _Key(NamedTuple):
    height: int
    width: int
    resolution: int
    degrees: float


class LatLongPlaces:
    """Of one size and turn, face by face; made when it is asked for a second time."""

    def __init__(self, key: _Key) -> None:
        self._key, self._asked = key, 0
        self._faces: list[tuple[Places, Float64[np.ndarray, "texels"]]] | None = None

    def are_there(self, axes: Frames, *, at_once: bool = False) -> bool:
        """Whether there are places; the first who asks is told that there are none, and better scatters. ``at_once``:
        find them now."""
        self._asked += 1
        if (self._asked > 1 or at_once) and self._faces is None:
            self._faces = [self._found(face, axes) for face in range(6)]
        return self._faces is not None

    def _found(self, face: int, axes: Frames) -> tuple[Places, Float64[np.ndarray, "texels"]]:
        height, width, side, degrees = self._key
        shape = np.zeros((height, width, 3), np.float32)
        room = height * width  # nearly always enough for one face of six
        while True:
            places = Places(
                np.empty(room, np.int32), np.empty(room, np.int32), np.empty(room), np.zeros(1, np.int64)
            )
            scatter_latlong(Slab(face, 0, side, side, *axes[face], places), shape, radians(degrees), None)
            if (count := int(places.count[0])) <= room:
                break
            room = count
        texels, pixels, shares = (part[:count].copy() for part in places[:3])
        places = Places(texels, pixels, shares, places.count)
        areas = np.zeros(side * side)
        add_up(places, areas)
        return places, areas

    def sums(self, face: int, light: Float64[np.ndarray, "pixels 6"]) -> Float64[np.ndarray, "row column 7"]:
        """What falls on a face of light as ``split`` gives it."""
        assert self._faces is not None  # the caller has asked
        places, areas = self._faces[face]
        sums, side = np.zeros((len(areas), 7)), self._key.resolution
        sums[:, 6] = areas
        give(places, light, sums)
        return sums.reshape(side, side, 7)


def split(pixels: Picture, highest: Vector) -> Float64[np.ndarray, "pixels 6"]:
    """Floor and peak of every pixel."""
    out = np.empty((pixels.shape[0] * pixels.shape[1], 6))
    split_all(pixels, highest, out)
    return out


@lru_cache(maxsize=_REMEMBERED)
def latlong_places(height: int, width: int, resolution: int, degrees: float) -> LatLongPlaces | None:
    """Of a map of so many pixels on a cube map of R = ``resolution``; None where that is too much to remember."""
    if height * width > MOST_PIXELS or resolution > MOST_RESOLUTION:
        return None
    return LatLongPlaces(_Key(height, width, resolution, degrees))


def rests(width: int) -> list[float]:
    """The degrees that ``turned_columns`` may leave."""
    return [part * 360.0 / (_PARTS * width) for part in range(_PARTS)]


def turned_columns(pixels: Picture, degrees: float) -> tuple[Picture, float]:
    """A latitude-longitude map turned by whole columns, and the degrees it has still to turn: quarters of a column, so
    that few turns are to be remembered. Within an eighth of a column of ``degrees``."""
    quarters = round(degrees / 360.0 * pixels.shape[1] * _PARTS)
    whole, part = divmod(quarters, _PARTS)
    return np.roll(pixels, -whole, axis=1), rests(pixels.shape[1])[part]
