"""How radiance maps lie in pictures: the direction of every pixel, and its solid angle.

Right is +X, up is +Y, the centre of a picture looks along −Z. With x from the left and y from the top
edge of the picture, both in [0, 1]:

``latlong``  2:1, azimuth a = 2π(x − ½) from −Z towards +X, polar angle t = πy from +Y:
             d = (sin t sin a, cos t, −sin t cos a).
``angular``  1:1, with p = 2x − 1, q = 1 − 2y, r = √(p² + q²) ≤ 1: the angle to −Z is πr, so
             d = (p sin πr / r, q sin πr / r, −cos πr); what lies outside the disc is ignored. [Debevec1998]
``cross``    3:4, a vertical cross of square faces; rows from the top: +Y / −X −Z +X / −Y / +Z upside down.
``horizontal-cross``  4:3: +Y above / −X −Z +X +Z / −Y below −Z; every face upright, as seen from the middle.
``strip``    6:1, and ``tall-strip`` 1:6: +X −X +Y −Y −Z +Z (right, left, top, bottom, front, back), each as
             seen from the middle; the lower edge of the top and the upper one of the bottom touch the front.
``cube``     no picture but the faces themselves, (6, R, R, 3), as in ``bases.cube_map``.

The first two are written out below; whatever consists of six square faces is a row of a table.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, pi

import numpy as np

from ..arrays import CubeMap, Float64, Picture

Fractions = Float64[np.ndarray, "..."] | np.float64

_PERMITTED_RATIO_ERROR = 0.01  # 1024×511 is still 2:1
_SINC_SERIES = [(-(pi**2)) ** k / factorial(2 * k + 1) for k in range(14)]  # good to 1e-15 for r² up to 1


@dataclass(frozen=True)
class LatLong:
    """Latitude and longitude; the poles are the first and last row."""

    ratio: tuple[int, int] = (2, 1)
    title: str = "latitude-longitude"

    def directions(self, x: Fractions, y: Fractions) -> Float64[np.ndarray, "... 3"]:
        """Unit directions of points of the picture, x and y in [0, 1]."""
        azimuth, polar = 2.0 * np.pi * (np.asarray(x) - 0.5), np.pi * np.asarray(y)
        ring = np.sin(polar)
        return np.stack(
            np.broadcast_arrays(ring * np.sin(azimuth), np.cos(polar), -ring * np.cos(azimuth)), axis=-1
        )

    def solid_angles(self, height: int, width: int) -> Float64[np.ndarray, "height width"]:
        """Exact solid angle of every pixel in steradians; all rows together 4π."""
        middle = (np.arange(height) + 0.5) * np.pi / height
        row = (2.0 * np.pi / width) * 2.0 * np.sin(middle) * np.sin(0.5 * np.pi / height)
        return np.broadcast_to(row[:, None], (height, width))


@dataclass(frozen=True)
class AngularMap:
    """The picture of a mirrored ball, unrolled: distance from the centre is the angle to −Z."""

    ratio: tuple[int, int] = (1, 1)
    title: str = "angular map"

    def directions(self, x: Fractions, y: Fractions) -> Float64[np.ndarray, "... 3"]:
        """Unit directions of points of the picture; points outside the disc have the zero vector."""
        p, q = np.broadcast_arrays(2.0 * np.asarray(x) - 1.0, 1.0 - 2.0 * np.asarray(y))
        r = np.hypot(p, q)
        reach = np.pi * np.sinc(r)  # sin πr / r, also at r = 0
        return np.where(
            r[..., None] > 1.0, 0.0, np.stack([p * reach, q * reach, -np.cos(np.pi * r)], axis=-1)
        )

    @staticmethod
    def _density(r2: Fractions) -> Fractions:
        """sin πr / πr of r², by its power series; π² times it is solid angle per area of the unit disc."""
        out = np.full_like(r2, _SINC_SERIES[-1])
        for coefficient in _SINC_SERIES[-2::-1]:
            out *= r2
            out += coefficient
        return out

    @staticmethod
    def inward(rows: np.ndarray, columns: np.ndarray, *, height: int, width: int) -> np.ndarray:
        """Row · width + column of pixels; one centred outside the disc gives way to a neighbour further in.

        Such pixels are black in real probes, though a corner of them may lie inside the disc.
        """
        p, q = (2.0 * columns + 1.0) / width - 1.0, (2.0 * rows + 1.0) / height - 1.0
        r = np.hypot(p, q)
        shrink = np.where(r > 1.0, (1.0 - 2.0 / min(height, width)) / np.maximum(r, 1.0), 1.0)
        row = np.clip(np.floor((q * shrink + 1.0) * 0.5 * height), 0, height - 1)
        return (row * width + np.clip(np.floor((p * shrink + 1.0) * 0.5 * width), 0, width - 1)).astype(
            np.int64
        )

    def solid_angles(self, height: int, width: int) -> Float64[np.ndarray, "height width"]:
        """Solid angle of the part of every pixel inside the disc, in steradians; together 4π.

        Corners inside the disc of pixels centred outside count for the pixel further in (``inward``).
        """
        finer = max(1, 64 // min(height, width) + 1)
        nodes = ((np.arange(finer)[:, None] + 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)) / finer).ravel()
        down, across = (height + 1) // 2, (width + 1) // 2  # one quarter; the others are its mirror images
        quarter = np.zeros((down, across))
        p2 = (2.0 * (np.arange(across) + nodes[:, None]) / width - 1.0) ** 2
        for shift in nodes:  # two-point Gauss in both axes: the density is smooth
            q2 = (2.0 * (np.arange(down) + shift) / height - 1.0) ** 2
            for row in p2:
                quarter += self._density(q2[:, None] + row)
        quarter *= 4.0 * pi**2 / (height * width * nodes.size**2)
        rows, columns = np.arange(height), np.arange(width)
        table = quarter[np.ix_(np.minimum(rows, rows[::-1]), np.minimum(columns, columns[::-1]))]
        self._weigh_rim(table, steps=16 * finer)
        return table

    def _weigh_rim(self, table: Float64[np.ndarray, "height width"], *, steps: int) -> None:
        """Weigh the pixels the disc's edge runs through by fine steps, and empty those outside."""
        height, width = table.shape
        p, q = np.abs(2.0 * np.arange(width) + 1.0 - width), np.abs(2.0 * np.arange(height) + 1.0 - height)
        far = np.hypot(((p + 1.0) / width)[None, :], ((q + 1.0) / height)[:, None])
        near = np.hypot(np.maximum(p - 1.0, 0.0)[None, :] / width, np.maximum(q - 1.0, 0.0)[:, None] / height)
        table[near >= 1.0] = 0.0
        rows, columns = np.nonzero((far > 1.0) & (near < 1.0))
        table[rows, columns] = 0.0
        step = (np.arange(steps) + 0.5) / steps
        p2 = (2.0 * (columns[:, None] + step) / width - 1.0) ** 2
        part = np.zeros(rows.size)
        for shift in step:
            r2 = p2 + ((2.0 * (rows + shift) / height - 1.0) ** 2)[:, None]
            part += np.where(r2 < 1.0, self._density(r2), 0.0).sum(axis=1)
        part *= 4.0 * np.pi**2 / (height * width * steps**2)
        np.add.at(table.reshape(-1), self.inward(rows, columns, height=height, width=width), part)


@dataclass(frozen=True)
class Faces:
    """Six square faces in a picture: for +X −X +Y −Y +Z −Z their row and column, and whether they are
    mirrored left-right and top-bottom against the faces of ``bases.cube_map``."""

    ratio: tuple[int, int]
    title: str
    places: tuple[tuple[int, int, bool, bool], ...]

    def faces(self, pixels: Picture) -> CubeMap:
        """The six faces of a picture, (6, R, R, 3); what lies outside them is left behind."""
        side = pixels.shape[1] // self.ratio[0]
        out = np.empty((6, side, side, 3), np.float32)
        for face, (row, column, mirrored, upended) in enumerate(self.places):
            part = pixels[row * side : (row + 1) * side, column * side : (column + 1) * side]
            out[face] = part[:: -1 if upended else 1, :: -1 if mirrored else 1]
        return out

    def put(self, faces: CubeMap, place: int, picture: Picture) -> None:
        """Lay the picture of one face, counted along the rows of the layout, into the faces (6, R, R, 3)."""
        order = sorted(range(6), key=lambda face: self.places[face][:2])
        mirrored, upended = self.places[order[place]][2:]
        faces[order[place]] = picture[:: -1 if upended else 1, :: -1 if mirrored else 1]

    def unfold(self, faces: CubeMap) -> Picture:
        """The picture of six faces; the inverse of ``faces``, black outside them."""
        side = faces.shape[1]
        out = np.zeros((self.ratio[1] * side, self.ratio[0] * side, 3), np.float32)
        for face, (row, column, mirrored, upended) in enumerate(self.places):
            part = faces[face][:: -1 if upended else 1, :: -1 if mirrored else 1]
            out[row * side : (row + 1) * side, column * side : (column + 1) * side] = part
        return out


def quarter_turned(faces: CubeMap, quarters: int) -> CubeMap:
    """Faces turned by quarters · 90° about +Y, counter-clockwise seen from above; texels move, values stay."""
    for _ in range(quarters % 4):
        right, left, top, bottom, back, front = faces
        faces = np.stack([back, front, np.rot90(top), np.rot90(bottom, -1), left, right])
    return faces


# Faces in a row, each as seen from the middle: right, left, top, bottom, front (−Z), back. Against
# ``bases.cube_map``, whose faces are those of a left-handed space, sides are mirrored, top and bottom upended.
FACE_PICTURES = Faces(
    ratio=(6, 1),
    title="strip",
    places=(
        (0, 0, True, False), (0, 1, True, False), (0, 2, False, True),
        (0, 3, False, True), (0, 5, True, False), (0, 4, True, False),
    ),
)  # fmt: skip

PICTURE_LAYOUTS: dict[str, LatLong | AngularMap | Faces] = {
    "latlong": LatLong(),
    "angular": AngularMap(),
    "cross": Faces(
        ratio=(3, 4),
        title="vertical cross",
        places=(
            (1, 2, True, False), (1, 0, True, False), (0, 1, False, True),
            (2, 1, False, True), (3, 1, False, True), (1, 1, True, False),
        ),
    ),
    "horizontal-cross": Faces(
        ratio=(4, 3),
        title="horizontal cross",
        places=(
            (1, 2, True, False), (1, 0, True, False), (0, 1, False, True),
            (2, 1, False, True), (1, 3, True, False), (1, 1, True, False),
        ),
    ),
    "strip": FACE_PICTURES,
    "tall-strip": Faces(
        ratio=(1, 6),
        title="tall strip",
        places=tuple((j, i, mirrored, upended) for i, j, mirrored, upended in FACE_PICTURES.places),
    ),
}  # fmt: skip


def recognised(height: int, width: int) -> str | None:
    """The layout that a picture of this size has by its ratio, within 1 %; None if there is none."""
    for name, layout in PICTURE_LAYOUTS.items():
        across, down = layout.ratio
        if abs(width * down - height * across) <= _PERMITTED_RATIO_ERROR * height * across:
            return name
    return None
