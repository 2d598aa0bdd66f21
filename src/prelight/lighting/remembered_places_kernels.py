"""The compiled loops that give light to remembered places (``remembered_places``)."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Float64, Picture
from .scattering import Places, Vector, split


@njit(cache=True, nogil=True)
def split_all(pixels: Picture, highest: Vector, out: Float64[np.ndarray, "pixels 6"]) -> None:
    """Floor and peak of every pixel of a latitude-longitude map."""
    height, width = pixels.shape[:2]
    for row in range(height):
        rows = (max(row - 1, 0), row, min(row + 1, height - 1))
        for column in range(width):
            columns = ((column - 1) % width, column, (column + 1) % width)
            light = split(pixels, (row, column), rows, columns, highest)
            own = out[row * width + column]
            own[0], own[1], own[2], own[3], own[4], own[5] = light


@njit(cache=True, nogil=True)
def add_up(places: Places, areas: Float64[np.ndarray, "texels"]) -> None:
    """The last of the sums of every texel, one after another as scattering adds them."""
    for n in range(len(places.shares)):
        areas[places.texels[n]] += places.shares[n]


@njit(cache=True, nogil=True)
def give(
    places: Places, light: Float64[np.ndarray, "pixels 6"], sums: Float64[np.ndarray, "texels 7"]
) -> None:
    """The light of pixels to where they fall: all but the last of ``sums``, which the places alone decide."""
    for n in range(len(places.shares)):
        texel, own, share = sums[places.texels[n]], light[places.pixels[n]], places.shares[n]
        for k in range(6):
            texel[k] += own[k] * share
