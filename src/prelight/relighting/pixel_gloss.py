"""Gloss pixel by pixel: a mesh's vertices are too far apart for what is as sharp as a highlight.

What falls on a pixel is known between vertices (as its diffuse light is); where it is mirrored to follows from the
pixel's own normal and place. So each corner of its triangle is asked for the direction that mirrors what the pixel
mirrors, and single lights are mirrored by the BRDF at the pixel itself.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Float32, Normals, Positions, Triangles
from ..drawing.view import View
from ..lighting.quantities import Triple
from ..receivers import Receivers
from .exitant import Coefficients, Exitant, Lights
from .pixel_light import smooth_places

_AT_ONCE = 1 << 19  # points times lights, or points

LightsAt = Callable[[Positions, Normals], Lights]  # of points of surfaces and their normals


def pixel_gloss(
    view: View,
    exitant: Exitant,
    triangles: Triangles,
    *,
    eye: Triple,
    coefficients: Coefficients,
    lights: Lights | None,
    lights_at: tuple[LightsAt, Receivers] | None = None,
) -> Float32[np.ndarray, "height width 3"]:
    """What glossy surfaces send toward ``eye`` beside their matt part, as ``view`` sees it.

    ``coefficients`` and ``lights`` as of ``Exitant.shine``. Triangles that are glossy at some of their corners alone,
    or of several materials, show what their vertices send.
    """
    rows = np.full(int(triangles.max(initial=0)) + 1, -1, np.int64)
    rows[exitant.rows] = np.arange(len(exitant.rows))
    of_vertex = np.zeros((len(rows), 3), np.float32)
    of_vertex[exitant.rows] = exitant.shine(eye, coefficients, lights=lights)
    step = max(1, _AT_ONCE // max(1, 0 if lights is None else lights[0].shape[1]))
    parts = []
    for starts, seen, weights, shape in view.seen():
        corners = triangles[seen]
        share = weights.sum(axis=1, keepdims=True)
        colour = np.einsum("nk,nkc->nc", weights, of_vertex[corners])
        found = rows[corners]
        whole = np.flatnonzero((found >= 0).all(axis=1) & exitant.are_alike(found))
        for first in range(0, len(whole), step):
            these = whole[first : first + step]
            inside = weights[these] / np.maximum(share[these], np.float32(1e-20))
            between, there = lights, None
            if lights_at is not None and lights is not None:
                where = smooth_places(corners[these], inside, lights_at[1].positions, lights_at[1].normals)
                between, there = None, lights_at[0](*where)
            shine = exitant.shine_between(
                eye, found[these], inside, coefficients=coefficients, lights=between, there=there
            )
            colour[these] = share[these] * shine
        total = np.zeros((len(starts) - 1, 3), np.float32)
        filled = np.flatnonzero(np.diff(starts))
        if len(filled):
            total[filled] = np.add.reduceat(colour, starts[filled], axis=0)
        parts.append(total.reshape(*shape, 3))
    return np.concatenate(parts)
