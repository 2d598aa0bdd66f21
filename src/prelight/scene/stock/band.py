"""A closed band: an ellipse that travels round a closed curve, turns about it and changes its size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...arrays import Float64
from .parts import Part, split_quads

Along = Callable[[np.ndarray], np.ndarray]  # of u in [0, 2π), the way along the curve, with period 2π

_DIFFERENCE = 1e-5  # of u and v, for derivatives: errors near 1e-10
_TABLE = 4096


@dataclass(frozen=True)
class Band:
    """The surface S(u, v) = C(u) + a(u) cos v · W(u) + b(u) sin v · D(u).

    W and D are the axes across the curve, turned by ``angle``: at 0, W is horizontal along z where the curve is
    upright in the xy plane; at 90° it lies in that plane. The curve must nowhere run along z.
    """

    curve: Along  # (n,) -> (n, 3) metres
    half_width: Along  # a, metres
    half_thickness: Along  # b, metres
    angle: Along  # radians; over one round it may gain whole turns

    def point(self, u: np.ndarray, v: np.ndarray) -> Float64[np.ndarray, "n 3"]:
        tangent = self.curve(u + _DIFFERENCE) - self.curve(u - _DIFFERENCE)
        tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
        outward = np.cross(tangent, [0.0, 0.0, 1.0])
        outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
        depth = np.cross(tangent, outward)
        c, s = np.cos(self.angle(u))[..., None], np.sin(self.angle(u))[..., None]
        wide, thin = c * depth + s * outward, c * outward - s * depth
        across = (self.half_width(u) * np.cos(v))[..., None] * wide
        return self.curve(u) + across + (self.half_thickness(u) * np.sin(v))[..., None] * thin

    def normal(self, u: np.ndarray, v: np.ndarray) -> Float64[np.ndarray, "n 3"]:
        """∂S/∂u × ∂S/∂v, normalised; outward."""
        h = _DIFFERENCE
        along_u = self.point(u + h, v) - self.point(u - h, v)
        along_v = self.point(u, v + h) - self.point(u, v - h)
        normal = np.cross(along_u, along_v)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def part(self, *, along: int, around: int) -> Part:
        """``along`` × ``around`` vertices: even along the curve, and around it denser where the band is sharp."""
        u = _spread(self._speed_along, along)
        v = _spread(self._speed_around, around)
        uu, vv = (x.ravel() for x in np.meshgrid(u, v, indexing="ij"))
        positions = self.point(uu, vv)
        i, j = np.divmod(np.arange(along * around), around)
        i_next, j_next = (i + 1) % along, (j + 1) % around
        quads = np.stack(
            [i * around + j, i_next * around + j, i_next * around + j_next, i * around + j_next], axis=1
        )
        return Part(positions, self.normal(uu, vv), split_quads(positions, quads))

    def _speed_along(self, u: np.ndarray) -> np.ndarray:
        return np.linalg.norm(self.curve(u + _DIFFERENCE) - self.curve(u - _DIFFERENCE), axis=-1)

    def _speed_around(self, v: np.ndarray) -> np.ndarray:
        """Halfway between even lengths and even angles, for the mean ellipse."""
        u = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
        a, b = self.half_width(u).mean(), self.half_thickness(u).mean()
        length = np.hypot(a * np.sin(v), b * np.cos(v))
        return length / length.mean() + 1.0


def _spread(speed: Along, count: int) -> Float64[np.ndarray, "count"]:
    """Parameters in [0, 2π) with the same integral of ``speed`` between each two."""
    t = np.linspace(0.0, 2 * np.pi, _TABLE + 1)
    travelled = np.concatenate([[0.0], np.cumsum(speed((t[1:] + t[:-1]) / 2))])
    return np.interp(np.arange(count) / count * travelled[-1], travelled, t)
