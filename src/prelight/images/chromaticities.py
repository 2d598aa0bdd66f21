"""Other colour spaces to linear Rec.709, the only one inside Prelight.

Primaries and white are CIE 1931 xy chromaticities in the order red, green, blue, white: eight numbers,
as in the header of an OpenEXR or Radiance file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Float64, Picture
from ..errors import InputError

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
EQUAL_ENERGY = (1 / 3, 1 / 3)
_ALIKE = 0.02  # Radiance's own primaries and rounded ones are taken as Rec.709, as every renderer does
_BRADFORD = np.array([(0.8951, 0.2664, -0.1614), (-0.7502, 1.7135, 0.0367), (0.0389, -0.0685, 1.0296)])

Matrix = Float64[np.ndarray, "3 3"]


def _xyz(x: float, y: float) -> Float64[np.ndarray, "3"]:
    return np.array([x / y, 1.0, (1.0 - x - y) / y])


def _rgb_to_xyz(chromaticities: Sequence[float]) -> Matrix:
    """Columns: tristimulus values of the primaries, scaled so that (1, 1, 1) is the white with Y = 1."""
    red, green, blue, white = (_xyz(*chromaticities[i : i + 2]) for i in range(0, 8, 2))
    primaries = np.stack([red, green, blue], axis=1)
    return primaries * np.linalg.solve(primaries, white)


def _adaptation(white: Sequence[float]) -> Matrix:
    """Bradford's transform of a white to that of Rec.709, D65."""
    given, wanted = _BRADFORD @ _xyz(*white), _BRADFORD @ _xyz(*REC709[6:])
    return np.linalg.solve(_BRADFORD, (wanted / given)[:, None] * _BRADFORD)


def xyz_to_rec709(white: Sequence[float] = EQUAL_ENERGY) -> Matrix:
    """CIE XYZ in which ``white`` is meant to look white, to linear Rec.709."""
    return np.linalg.solve(_rgb_to_xyz(REC709), _adaptation(white))


def rgb_to_rec709(chromaticities: Sequence[float], path: object) -> Matrix | None:
    """The matrix from these primaries and white to linear Rec.709; None where they are as good as Rec.709.

    White stays white: it is adapted to D65. Raises InputError where the numbers span no colour space.
    """
    if len(chromaticities) == 8 and np.isfinite(chromaticities).all():
        if np.abs(np.subtract(chromaticities[:6], REC709[:6])).max() <= _ALIKE:
            return None
        if min(chromaticities[1::2]) > 1e-6 and abs(np.linalg.det(_rgb_columns(chromaticities))) > 1e-4:
            return xyz_to_rec709(chromaticities[6:]) @ _rgb_to_xyz(chromaticities)
    shown = " ".join(f"{c:.4g}" for c in chromaticities)
    raise InputError(
        path, f"chromaticities {shown} span no colour space; expected xy of red, green, blue and white"
    )


def _rgb_columns(chromaticities: Sequence[float]) -> Matrix:
    xy = np.reshape(chromaticities[:6], (3, 2))
    return np.column_stack([xy, 1.0 - xy.sum(axis=1)])


def convert(picture: Picture, matrix: Matrix) -> None:
    """Apply a colour matrix in place; colours outside Rec.709 (a negative component) are moved to its edge."""
    per_block = max(1, (1 << 20) // picture.shape[1])  # a second copy of a large map would not fit
    for start in range(0, len(picture), per_block):
        block = picture[start : start + per_block]
        np.maximum(block @ matrix.T.astype(np.float32), 0.0, out=block)
