"""What every map of radiance must satisfy, whatever file it came in."""

from __future__ import annotations

import numpy as np

from ..arrays import Picture
from ..errors import InputError

MAX_SIDE = 32_768
MAX_PIXELS = 192 * 1024 * 1024  # as many as a vertical cross with faces of 4,096² texels


def check_size(path: object, width: int, height: int) -> None:
    """Raises InputError unless a map of this size may be allocated."""
    if width < 1 or height < 1:
        raise InputError(path, f"the map is {width}×{height} pixels, expected at least 1×1")
    if width > MAX_SIDE or height > MAX_SIDE or width * height > MAX_PIXELS:
        raise InputError(
            path,
            f"the map is {width}×{height} pixels, at most {MAX_SIDE:,} a side and "
            f"{MAX_PIXELS / 1e6:.0f} million in all are read; make it smaller",
        )


def check_radiance(path: object, picture: Picture) -> None:
    """Raises InputError naming how many pixels are NaN, infinite or negative, and the first of them."""
    if picture.min() >= 0 and picture.max() < np.inf:  # NaN fails the first; nothing is allocated
        return
    kinds = {
        "NaN": np.isnan(picture).any(axis=-1),
        "infinite": np.isinf(picture).any(axis=-1),
        "negative": (picture < 0).any(axis=-1),
    }
    counts = [f"{np.count_nonzero(bad):,} {name}" for name, bad in kinds.items() if bad.any()]
    first = int(np.argmax(np.logical_or.reduce(list(kinds.values()))))
    row, column = divmod(first, picture.shape[1])
    raise InputError(
        path,
        f"pixels that no light has: {', '.join(counts)}; radiance must be finite and not negative, "
        "repair the map first",
        f"first at row {row}, column {column}",
    )
