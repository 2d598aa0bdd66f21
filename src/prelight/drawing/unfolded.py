"""The cube of an environment, unfolded as a vertical cross, with the clusters drawn on it (paper, figure 6)."""

from __future__ import annotations

from typing import cast

import numpy as np
from numba import njit

from ..arrays import CubeMap, Int32, UInt8
from ..errors import InputError
from ..images.tonemap import exposure_for, tonemap
from ..lighting.layouts import PICTURE_LAYOUTS, Faces
from . import lettering

_CROSS = cast(Faces, PICTURE_LAYOUTS["cross"])
_LARGE, _SMALL = np.array([250.0, 249.0, 246.0]), np.array([112.0, 150.0, 190.0])  # fills by a cluster's size
_LINE = np.array([38.0, 52.0, 70.0])


def unfolded_clusters(
    rectangles: Int32[np.ndarray, "clusters 5"],
    resolution: int,
    *,
    cube: CubeMap | None = None,
    face_pixels: int = 320,
    exposure: float | None = None,
) -> UInt8[np.ndarray, "height width 3"]:
    """A picture (4·p, 3·p, 3), sRGB, of the six faces with the outline of each cluster.

    +Y above −X −Z +X, then −Y, then +Z upside down: an environment's vertical cross, looked at from the inside.

    Parameters
    ----------
    rectangles
        (C, 5) face, row, column, height, width in texels of faces of ``resolution``².
    cube
        (6, S, S, 3) linear radiance to draw the outlines over, of any S; without it small clusters are darker.
    face_pixels
        p, 16 to 2048.
    exposure
        Stops for the cube; metered if None.

    Raises InputError for rectangles outside the cube, or sizes out of range.
    """
    if not 16 <= face_pixels <= 2048:
        raise InputError("face_pixels", f"{face_pixels!r}, expected 16 to 2048")
    rectangles = np.ascontiguousarray(rectangles, np.int32)
    if rectangles.ndim != 2 or rectangles.shape[1] != 5 or not _inside(rectangles, resolution):
        raise InputError("rectangles", f"are not (clusters, 5) within 6 faces of {resolution}² texels")
    label = np.full((6, face_pixels, face_pixels), -1, np.int32)
    _paint(rectangles, resolution, label)
    if cube is None:
        filled = _by_size(rectangles, resolution)[label]
        line = np.broadcast_to(_LINE, filled.shape)
    else:
        filled = _shown(cube, face_pixels, exposure).astype(np.float64)
        light = filled @ (0.2126, 0.7152, 0.0722) > 118
        line = filled + np.where(light[..., None], 0.62 * (0.0 - filled), 0.55 * (255.0 - filled))
    edge = _edges(label)[..., None]
    picture = np.rint(np.where(edge, line, filled)).astype(np.uint8)
    return _lettered(_CROSS.unfold(picture.astype(np.float32)), face_pixels)


def _inside(rectangles: np.ndarray, resolution: int) -> bool:
    face, row, column, height, width = rectangles.astype(np.int64).T
    R = resolution
    return bool(
        ((face >= 0) & (face < 6) & (row >= 0) & (column >= 0) & (height > 0) & (width > 0)).all()
        and ((row + height <= R) & (column + width <= R)).all()
    )


@njit(cache=True)
def _paint(rectangles, resolution, label):
    """Each pixel gets the cluster of the texel under its middle."""
    pixels = label.shape[1]
    for c in range(len(rectangles)):
        face = rectangles[c, 0]
        top = int(np.ceil(rectangles[c, 1] * pixels / resolution - 0.5))
        left = int(np.ceil(rectangles[c, 2] * pixels / resolution - 0.5))
        bottom = int(np.ceil((rectangles[c, 1] + rectangles[c, 3]) * pixels / resolution - 0.5))
        right = int(np.ceil((rectangles[c, 2] + rectangles[c, 4]) * pixels / resolution - 0.5))
        label[face, top:bottom, left:right] = c


def _by_size(rectangles: np.ndarray, resolution: int) -> np.ndarray:
    """A colour for each cluster: its side on a logarithmic scale; the last row is for no cluster."""
    side = np.sqrt(rectangles[:, 3].astype(np.float64) * rectangles[:, 4]) / resolution
    smallest = min(1 / 64, float(side.min())) if len(side) else 1 / 64
    t = np.log2(side / smallest) / np.log2(1 / smallest) if smallest < 1 else np.ones_like(side)
    return np.concatenate([_SMALL + t[:, None] * (_LARGE - _SMALL), _LARGE[None]])


def _shown(cube: CubeMap, pixels: int, exposure: float | None) -> np.ndarray:
    """The faces at another size, each pixel the mean of the texels it covers or the nearest, tone-mapped."""
    cube = np.asarray(cube, np.float32)
    if cube.ndim != 4 or cube.shape[0] != 6 or cube.shape[1] != cube.shape[2] or cube.shape[3] != 3:
        raise InputError("cube", f"shape {cube.shape}, expected (6, R, R, 3)")
    R = cube.shape[1]
    first = np.minimum(np.arange(pixels) * R // pixels, R - 1)
    if pixels < R:
        count = np.diff(np.append(first, R)).astype(np.float32)
        cube = np.add.reduceat(np.add.reduceat(cube, first, axis=1), first, axis=2)
        cube = cube / (count[:, None, None] * count[:, None])
    else:
        cube = cube[:, first][:, :, first]
    flat = cube.reshape(6 * pixels, pixels, 3)
    stops = exposure_for(flat) - 1.0 if exposure is None else exposure  # darker: lines show on it
    return tonemap(flat, exposure=stops).reshape(6, pixels, pixels, 3)


def _edges(label: np.ndarray) -> np.ndarray:
    """Pixels whose right or lower neighbour belongs to another cluster, and the face's own border."""
    edge = np.zeros(label.shape, bool)
    edge[:, :, :-1] |= label[:, :, :-1] != label[:, :, 1:]
    edge[:, :-1] |= label[:, :-1] != label[:, 1:]
    edge[:, [0, -1]] = True
    edge[:, :, [0, -1]] = True
    return edge


def _lettered(cross: np.ndarray, pixels: int) -> UInt8[np.ndarray, "height width 3"]:
    """White around the cross, and the faces' names beside them."""
    from PIL import Image, ImageDraw

    cross = np.rint(cross).astype(np.uint8)
    covered = _CROSS.unfold(np.ones((6, pixels, pixels, 3), np.float32)) > 0
    sheet = Image.fromarray(np.where(covered, cross, np.uint8(255)))
    draw = ImageDraw.Draw(sheet)
    size = max(9, pixels // 18)
    pad = size // 2
    beside = (("+Y", 0, 1), ("-Y", 2, 1), ("+Z", 3, 1))  # whose right neighbour is empty
    for name, row, column in beside:
        x, y = (column + 1) * pixels + pad, (row + 0.5) * pixels
        lettering.write(draw, (x, y), name, size=size, anchor="lm", colour=lettering.QUIET)
    for name, column in (("-X", 0), ("+X", 2)):
        x, y = (column + 0.5) * pixels, 2 * pixels + pad
        lettering.write(draw, (x, y), name, size=size, anchor="ma", colour=lettering.QUIET)
    lettering.write(
        draw,
        (0.98 * pixels, 1.0 * pixels - pad),
        "-Z",
        size=size,
        anchor="rd",
        colour=lettering.QUIET,
    )
    return np.asarray(sheet)
