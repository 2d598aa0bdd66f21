"""The sky as the reference asks for it: half of the directions toward points of the window, half by radiance.

Mitsuba chooses directions of a sky by its radiance, and nearly all of them meet the wall beside a window. Both ways of
choosing are weighed by their common density, so that the mean stays what it was, and the noise falls.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from prelight.transport.cube_emitter import cube_emitter


def through_window(mi: ModuleType, cube: np.ndarray, *, low: float, high: float) -> Any:
    """An emitter for places at x > 0, whose sky is seen through the square x = 0, y and z from ``low`` to ``high``."""
    import drjit as dr

    plain, size = cube_emitter(mi, cube), high - low

    class Through(type(plain)):
        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            to_window = sample.x < 0.5
            first = dr.select(to_window, 2 * sample.x, 2 * sample.x - 1)
            ds, _ = super().sample_direction(it, mi.Point2f(dr.minimum(first, 0.99999994), sample.y), active)
            place = mi.Point3f(0, low + size * first, low + size * sample.y)
            ds.d = dr.select(to_window, dr.normalize(place - it.p), ds.d)
            ds.p, ds.n = it.p + ds.d * ds.dist, -ds.d
            ds.pdf = self.pdf_direction(it, ds, active)
            return ds, self.eval_direction(it, ds, active) / ds.pdf

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            d, p = ds.d, it.p
            way = -p.x / d.x
            y, z = p.y + way * d.y, p.z + way * d.z
            inside = (way > 0) & (y >= low) & (y <= high) & (z >= low) & (z <= high)
            window = dr.select(inside, way * way / (size * size * dr.maximum(dr.abs(d.x), 1e-9)), 0)
            return 0.5 * (window + super().pdf_direction(it, ds, active))

    made = Through(mi.Properties())
    return made


def lit_sides(cube: np.ndarray, outward: np.ndarray) -> np.ndarray:
    """The sky without what lies behind the window's plane, which nothing in the room can see."""
    from prelight.bases import cube_map

    n = cube.shape[1]
    d = cube_map.texel_directions(np.arange(6 * n * n, dtype=np.int32), n).reshape(*cube.shape[:3], 3)
    return np.where((d @ outward > -0.1)[..., None], cube, np.float32(0)).astype(np.float32)
