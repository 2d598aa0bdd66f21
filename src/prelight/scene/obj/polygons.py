"""Polygons cut into triangles: convex ones as fans, others ear by ear, all of a size at once."""

from __future__ import annotations

import numpy as np

_FLAT = 1e-9  # sine of a corner, below which it counts as straight
_LARGEST_CONCAVE = 256  # corners; larger ones are cut as fans
_TOUCHING = 1e-12  # twice an area, of polygons about one unit large
_MOST_TESTS = 50_000_000  # corners against points, of all concave polygons of a file
_TESTS_AT_ONCE = 1_000_000


def triangles_of(corners: np.ndarray, sizes: np.ndarray, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Cut every polygon into its size less two triangles, in the order of the polygons.

    Parameters
    ----------
    corners
        (C, 3) float64, the places of the corners of all polygons one after another.
    sizes
        (F,) how many corners each polygon has, at least 3.
    notes
        Gets a line if polygons were too large to be cut well.

    Returns
    -------
    (T, 3) numbers of corners, wound as the polygons, and (T,) the polygon of each.

    References
    ----------
    Meisters, Polygons Have Ears, 1975; normals after Newell (Sutherland, Sproull and Schumacker 1974).
    """
    starts, made = np.cumsum(sizes) - sizes, sizes - 2
    first = np.cumsum(made) - made
    triangles = np.empty((int(made.sum()), 3), np.int64)
    tests = uncut = 0
    for size in np.unique(sizes).tolist():
        of = np.flatnonzero(sizes == size)
        local = np.broadcast_to(_fan(size), (len(of), size - 2, 3))
        if size > 3:
            points = corners[starts[of, None] + np.arange(size)]
            concave = np.flatnonzero(~_is_strictly_convex(points))
            cost = size**3 // 3
            able = 0 if size > _LARGEST_CONCAVE else max(0, (_MOST_TESTS - tests) // cost)
            uncut += len(concave[able:])
            concave = concave[:able]
            tests += len(concave) * cost
            if len(concave):
                local = local.copy()
                local[concave] = _ears_of_all(points[concave])
        triangles[first[of, None] + np.arange(size - 2)] = starts[of, None, None] + local
    if uncut:
        notes.append(f"concave faces too many or too large to cut well, cut as fans: {uncut:,}")
    return triangles, np.repeat(np.arange(len(sizes)), made)


def _fan(size: int) -> np.ndarray:
    k = np.arange(1, size - 1)
    return np.stack([np.zeros_like(k), k, k + 1], axis=1)


def _newell(points: np.ndarray) -> np.ndarray:
    """(m, 3) normals of polygons (m, n, 3), twice their area long."""
    centred = points - points[:, :1]
    return np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)


def _is_strictly_convex(points: np.ndarray) -> np.ndarray:
    """(m,) whether every corner turns to the same side, none of them straight."""
    normal = _newell(points)
    normal = np.divide(normal, np.linalg.norm(normal, axis=1, keepdims=True))
    ahead = np.roll(points, -1, axis=1) - points
    behind = np.roll(ahead, 1, axis=1)
    turn = np.einsum("mnk,mk->mn", np.cross(behind, ahead), normal)
    lengths = np.linalg.norm(ahead, axis=2)
    return (turn > _FLAT * lengths * np.roll(lengths, 1, axis=1)).all(axis=1)


def _ears_of_all(points: np.ndarray) -> np.ndarray:
    """As many polygons at a time as memory allows."""
    at_once = max(1, _TESTS_AT_ONCE // points.shape[1] ** 2)
    blocks = [points[k : k + at_once] for k in range(0, len(points), at_once)]
    return np.concatenate([_ears(_flattened(block)) for block in blocks])


def _flattened(points: np.ndarray) -> np.ndarray:
    """(m, n, 2): along the axis nearest to each polygon's normal, counter-clockwise, one unit large."""
    points = points - points.mean(axis=1, keepdims=True)
    points = np.divide(points, np.abs(points).max(axis=(1, 2), keepdims=True))
    normal = _newell(points)
    axis = np.argmax(np.abs(normal), axis=1)
    sign = np.where(np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] < 0, -1, 1)
    across, up = (np.take_along_axis(points, ((axis + k) % 3)[:, None, None], axis=2)[..., 0] for k in (1, 2))
    return np.stack([across * sign[:, None], up], axis=-1)


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed area of the triangles a, b, c."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
        c[..., 0] - a[..., 0]
    )


def _ears(flat: np.ndarray) -> np.ndarray:
    """(m, n - 2, 3): in every round each polygon loses its best-shaped ear, so all keep the same size.

    A polygon without an ear (it crosses itself) loses its least bad corner.
    """
    m, n = flat.shape[:2]
    live = np.broadcast_to(np.arange(n), (m, n)).copy()
    found = np.empty((m, n - 2, 3), np.int64)
    rows = np.arange(m)
    for left in range(n, 2, -1):
        here = np.take_along_axis(flat, live[..., None], axis=1)
        a, b, c = np.roll(here, 1, axis=1), here, np.roll(here, -1, axis=1)
        sides = sum(((p - q) ** 2).sum(axis=-1) for p, q in ((a, b), (b, c), (c, a)))
        shape = np.divide(_cross(a, b, c), sides)
        ear = (shape > _FLAT) & ~_holds_a_corner(here, a, c)
        best = np.argmax(np.where(ear, shape, shape - 2), axis=1)  # shape is at most 1/√3·½
        before, after = (best - 1) % left, (best + 1) % left
        found[:, n - left] = np.stack([live[rows, before], live[rows, best], live[rows, after]], axis=1)
        stays = np.ones((m, left), bool)
        stays[rows, best] = False
        live = live[stays].reshape(m, left - 1)
    return found


def _holds_a_corner(here: np.ndarray, a: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(m, k) whether some other corner lies in or on the triangle a, b, c of each corner b."""
    points = np.concatenate([here, np.ones_like(here[..., :1])], axis=-1).transpose(0, 2, 1)  # (m, 3, k)
    sides = [_line(p, q) @ points > -_TOUCHING for p, q in ((a, here), (here, c), (c, a))]
    polygon, corner, point = np.nonzero(sides[0] & sides[1] & sides[2])
    place = here[polygon, point]
    # A corner of the triangle, or a place named twice, does not stand in its own way.
    apart = [(place != other[polygon, corner]).any(axis=1) for other in (a, here, c)]
    other = apart[0] & apart[1] & apart[2]
    found = np.zeros(here.shape[:2], bool)
    found[polygon[other], corner[other]] = True
    return found


def _line(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(m, k, 3) what gives twice the area of p, q, x when multiplied with (x, y, 1)."""
    across, up = -(q[..., 1] - p[..., 1]), q[..., 0] - p[..., 0]
    return np.stack([across, up, -(across * p[..., 0] + up * p[..., 1])], axis=-1)
