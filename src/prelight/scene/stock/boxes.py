"""Plain pieces of streets and cars: boxes, bent panels with holes, rings and wheels."""

from __future__ import annotations

import numpy as np

from ...arrays import Float64
from .openings import of_grid, ticks
from .parts import Part, together

Corners = Float64[np.ndarray, "4 3"]  # of a panel: lower left, lower right, upper left, upper right
Hole = tuple[tuple[float, float], tuple[float, float]]  # shares of a panel's width and height
_X, _Y, _Z = np.eye(3)


def box(low: tuple[float, float, float], high: tuple[float, float, float], *, step: float = 1e9) -> Part:
    """A closed box between two corners, metres, in cells of about ``step``."""
    low_, high_ = np.array(low), np.array(high)
    faces = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        s, t = (ticks(low_[k], high_[k], step=step) for k in (first, second))
        for sign, at in ((-1.0, low_[axis]), (1.0, high_[axis])):
            grid = np.empty((len(t), len(s), 3))
            grid[..., axis], grid[..., first], grid[..., second] = at, s[None, :], t[:, None]
            faces.append(of_grid(grid, np.broadcast_to(sign * np.eye(3)[axis], grid.shape)))
    return together(faces)


def bilinear(
    corners: Corners, s: Float64[np.ndarray, "..."], t: Float64[np.ndarray, "..."]
) -> Float64[np.ndarray, "... 3"]:
    """Points of a panel at shares of its width and height."""
    s, t = s[..., None], t[..., None]
    lower, upper = (1 - s) * corners[0] + s * corners[1], (1 - s) * corners[2] + s * corners[3]
    return (1 - t) * lower + t * upper


def panel(corners: Corners, toward: np.ndarray, *, step: float, holes: tuple[Hole, ...] = ()) -> Part:
    """A flat panel seen from ``toward``'s side, without its holes."""
    wide = float(np.linalg.norm(corners[1] - corners[0]))
    tall = float(np.linalg.norm(corners[2] - corners[0]))
    s = ticks(0.0, 1.0, step=step / wide, through=tuple(sorted({e for hole in holes for e in hole[0]})))
    t = ticks(0.0, 1.0, step=step / tall, through=tuple(sorted({e for hole in holes for e in hole[1]})))
    normal = _normal(corners, toward)
    grid = bilinear(corners, *np.meshgrid(s, t))
    whole = of_grid(grid, np.broadcast_to(normal, grid.shape))
    if not holes:
        return whole
    ss, tt = (share.ravel() for share in np.meshgrid(s, t))
    middle_s, middle_t = (share[whole.triangles].mean(axis=1) for share in (ss, tt))
    keep = np.ones(len(whole.triangles), bool)
    for (a, b), (c, d) in holes:
        keep &= ~((middle_s > a) & (middle_s < b) & (middle_t > c) & (middle_t < d))
    used, triangles = np.unique(whole.triangles[keep], return_inverse=True)
    return Part(whole.positions[used], whole.normals[used], triangles.reshape(-1, 3).astype(np.int32))


def hole_of(corners: Corners, hole: Hole) -> Corners:
    """The corners of a hole."""
    (a, b), (c, d) = hole
    return bilinear(corners, np.array([a, b, a, b]), np.array([c, c, d, d]))


def rim(inner: Corners, outer: Corners, *, step: float) -> Part:
    """The four strips between the same hole of two panels, seen from the hole's middle."""
    middle = 0.5 * (inner.mean(axis=0) + outer.mean(axis=0))
    parts = []
    for one, other in ((0, 1), (1, 3), (3, 2), (2, 0)):
        strip = np.stack([inner[one], inner[other], outer[one], outer[other]])
        parts.append(panel(strip, middle - strip.mean(axis=0), step=step))
    return together(parts)


def ring(radius: float, thickness: float, *, around: int, across: int) -> Part:
    """A torus about the z axis: the radius of its middle line, and half its thickness."""
    a, b = (2 * np.pi * np.arange(n + 1) / n for n in (around, across))
    u, v = np.meshgrid(a, b, indexing="ij")
    out = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1)
    middle = np.stack([np.cos(u), np.sin(u), np.zeros_like(u)], axis=-1)
    return of_grid(radius * middle + thickness * out, out)


def wheel(radius: float, width: float, *, around: int) -> Part:
    """A closed cylinder about the x axis."""
    turn = 2 * np.pi * np.arange(around + 1) / around
    circle = np.stack([np.zeros_like(turn), np.cos(turn), np.sin(turn)], axis=-1)
    sides = np.stack([radius * circle + x * _X for x in (-width / 2, width / 2)])
    parts = [of_grid(sides, np.broadcast_to(circle, sides.shape))]
    for sign in (-1.0, 1.0):
        disc = np.stack([r * circle + sign * width / 2 * _X for r in (0.0, radius)])
        parts.append(of_grid(disc, np.broadcast_to(sign * _X, disc.shape)))
    return together(parts)


def _normal(corners: Corners, toward: np.ndarray) -> Float64[np.ndarray, "3"]:
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    if np.linalg.norm(normal) < 1e-12:
        normal = np.cross(corners[3] - corners[2], corners[3] - corners[1])
    normal /= np.linalg.norm(normal)
    return normal if normal @ toward > 0 else -normal
