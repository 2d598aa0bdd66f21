"""A wanted picture and its mask from files, and the bake that is to give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..lighting.rig_lights import read_linear_picture
from ..relighting.steerable_bake import SteerableBake
from ..relighting.stored_steerable import keeps_first_bounces, open_deep, open_steerable
from ..storage.bake import Bake
from .poses import Freedom, Light
from .search import Solution, solve
from .with_first_bounce import in_own_shapes, whole_layers


def solve_bake(
    bake: Bake | str | Path,
    target: str | Path,
    *,
    mask: str | Path | None = None,
    lights: Sequence[Light] | None = None,
    freedom: Freedom | None = None,
) -> Solution:
    """Lights for a bake whose picture is as near to a picture in a file as they come; see ``search.solve``.

    ``target``: EXR or HDR, linear, or PNG or JPEG, read as sRGB without a tone curve; of the bake's size. ``mask``: the
    same size, black where anything will do. Raises InputError, OutputError, DamagedBakeError.
    """
    opened = bake if isinstance(bake, Bake) else Bake.open(bake)
    layers = open_steerable(opened)
    if not layers:
        raise InputError(opened.path, "has no steerable layer; make one with prelight bake steerable")
    size = layers[0].size
    picture = _of_size(target, size).reshape(-1, 3)
    covered = None if mask is None else np.clip(_of_size(mask, size).mean(axis=-1).ravel(), 0.0, 1.0)
    if not keeps_first_bounces(opened):
        return solve(layers, picture, mask=covered, lights=lights, freedom=freedom)
    given = None if lights is None else in_own_shapes(lights, layers)
    whole = whole_layers(layers, open_deep(opened))
    found = solve(whole, picture, mask=covered, lights=given, freedom=freedom)
    return replace(found, error=_distance(opened, found.lights, picture, covered))


def _distance(bake: Bake, lights: Sequence[Light], picture: np.ndarray, mask: np.ndarray | None) -> float:
    """How far the picture of these lights is from a wanted one, first bounces exact; as `Solution` says it."""
    live = SteerableBake(bake)
    live.light(lights)
    weight = np.ones(len(picture)) if mask is None else mask
    left = float(weight @ np.square(live.radiance - picture, dtype=np.float64).sum(axis=1))
    return float(np.sqrt(left / (weight @ np.square(picture, dtype=np.float64).sum(axis=1))))


def _of_size(path: str | Path, size: tuple[int, int]) -> np.ndarray:
    picture = read_linear_picture(Path(path), signed=True)
    height, width = picture.shape[:2]
    if (width, height) != size:
        raise InputError(
            path, f"{width}×{height} pixels, the bake has {size[0]}×{size[1]}; scale it to that size"
        )
    return picture
