"""What rays meet first among bodies that move, and the light that matte surfaces send back along them.

A body has a tree of `box_tree_kernels` in coordinates of its own, within [−1, 1]; ``to_local`` (12,), a row of three
for each axis and its shift, brings a ray there without changing where along the ray things are. Trees lie behind each
other in common arrays, children numbered on.

References
----------
Möller and Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
Ramamoorthi and Hanrahan, An efficient representation for irradiance environment maps, 2001: nine numbers a colour.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from .box_tree_kernels import DEEPEST

CHUNK = 256  # rays a task
_FAR = np.float32(1e30)

_f4_1 = types.Array(types.float32, 1, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_i4_1 = types.Array(types.int32, 1, "C", readonly=True)
_i4_2 = types.Array(types.int32, 2, "C", readonly=True)
# bounds, children, corners; to_local, balls (centre, radius, radius of a ball that hides as much sky or 0), roots
_world = (_f4_2, _i4_2, _f4_2, _f4_2, _f4_2, _i4_1)
# of triangles, in the trees' order: colour, emission, corners' normals, corners' openness; of bodies: rotation
_looks = (_f4_2, _f4_2, _f4_2, _f4_2, _f4_2)
_light = (_f4_2, _f4_2, _f4_1)  # sky (9, 3), suns (n, 6: direction, irradiance), what surroundings send (3,)


@njit(cache=True)
def _enters(bounds, node, offset, ox, oy, oz, ix, iy, iz, limit):
    """Where a ray enters a box; beyond every distance if it does not before ``limit``. i: inverses of its direction."""
    a, b = (bounds[node, offset] - ox) * ix, (bounds[node, offset + 3] - ox) * ix
    near, far = (a, b) if a < b else (b, a)
    a, b = (bounds[node, offset + 1] - oy) * iy, (bounds[node, offset + 4] - oy) * iy
    low, high = (a, b) if a < b else (b, a)
    near, far = low if low > near else near, high if high < far else far
    a, b = (bounds[node, offset + 2] - oz) * iz, (bounds[node, offset + 5] - oz) * iz
    low, high = (a, b) if a < b else (b, a)
    near, far = low if low > near else near, high if high < far else far
    near, far = near if near > np.float32(0) else np.float32(0), far if far < limit else limit
    return near if near <= far else _FAR


@njit(cache=True)
def _meets(corners, t, ox, oy, oz, dx, dy, dz, limit, hit):
    """Whether a ray meets a triangle before ``limit``; hit: distance, barycentrics of its second and third corner."""
    ax, ay, az = corners[t, 0], corners[t, 1], corners[t, 2]
    px, py, pz = corners[t, 3] - ax, corners[t, 4] - ay, corners[t, 5] - az
    qx, qy, qz = corners[t, 6] - ax, corners[t, 7] - ay, corners[t, 8] - az
    nx, ny, nz = dy * qz - dz * qy, dz * qx - dx * qz, dx * qy - dy * qx
    determinant = px * nx + py * ny + pz * nz
    if abs(determinant) < np.float32(1e-20):
        return False
    inverse = np.float32(1) / determinant
    sx, sy, sz = ox - ax, oy - ay, oz - az
    u = (sx * nx + sy * ny + sz * nz) * inverse
    edge = np.float32(-1e-6)  # neighbours overlap by a millionth, so that nothing shows between them
    if u < edge or u > np.float32(1) - edge:
        return False
    rx, ry, rz = sy * pz - sz * py, sz * px - sx * pz, sx * py - sy * px
    v = (dx * rx + dy * ry + dz * rz) * inverse
    if v < edge or u + v > np.float32(1) - edge:
        return False
    distance = (qx * rx + qy * ry + qz * rz) * inverse
    if distance <= 0 or distance >= limit:
        return False
    hit[0], hit[1], hit[2] = distance, u, v
    return True


@njit(cache=True)
def _inverse(x):
    return np.float32(1e18) if abs(x) < np.float32(1e-18) else np.float32(1) / x


@njit(cache=True)
def _descend(bounds, children, corners, root, ox, oy, oz, dx, dy, dz, limit, anything, hit, stack):
    """The first triangle of one body before ``limit``, or any; −1 if there is none. ``stack`` is room to work in."""
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    found, node, waiting = -1, root, 0
    while True:
        into, later = -1, -1
        a = _enters(bounds, node, 0, ox, oy, oz, ix, iy, iz, limit)
        b = _enters(bounds, node, 6, ox, oy, oz, ix, iy, iz, limit)
        for turn in range(2):
            first = (turn == 0) == (a <= b)
            if (a if first else b) >= limit:
                continue
            child = children[node, 0 if first else 1]
            if child >= 0:
                if into < 0:
                    into = child
                else:
                    later = child
                continue
            begin = (-1 - child) // 8
            for t in range(begin, begin + (-1 - child) % 8 + 1):
                if _meets(corners, t, ox, oy, oz, dx, dy, dz, limit, hit):
                    limit, found = hit[0], t
                    if anything:
                        return found
        if later >= 0:
            stack[waiting] = later
            waiting += 1
        if into >= 0:
            node = into
        elif waiting > 0:
            waiting -= 1
            node = stack[waiting]
        else:
            return found


@njit(cache=True)
def _first(world, ox, oy, oz, dx, dy, dz, anything, hit, trial, stack):
    """Body and triangle that a ray meets first, or any; body −1 if none. ``hit`` is of that triangle."""
    bounds, children, corners, to_local, balls, roots = world
    limit, body, triangle = _FAR, -1, -1
    for k in range(len(roots)):
        x, y, z = balls[k, 0] - ox, balls[k, 1] - oy, balls[k, 2] - oz
        along, square = x * dx + y * dy + z * dz, x * x + y * y + z * z
        reach = balls[k, 3] * balls[k, 3]
        if square > reach and (along < 0 or square - along * along > reach):  # directions are unit
            continue
        m = to_local[k]
        t = _descend(
            bounds,
            children,
            corners,
            roots[k],
            m[0] * ox + m[1] * oy + m[2] * oz + m[3],
            m[4] * ox + m[5] * oy + m[6] * oz + m[7],
            m[8] * ox + m[9] * oy + m[10] * oz + m[11],
            m[0] * dx + m[1] * dy + m[2] * dz,
            m[4] * dx + m[5] * dy + m[6] * dz,
            m[8] * dx + m[9] * dy + m[10] * dz,
            limit,
            anything,
            trial,
            stack,
        )
        if t >= 0:
            body, triangle, limit = k, t, trial[0]
            hit[0], hit[1], hit[2] = trial[0], trial[1], trial[2]
            if anything:
                break
    return body, triangle


@njit(cache=True)
def _irradiance(sky, n, out):
    """Of the sky without its suns on a surface of normal n: a polynomial of the second degree."""
    x, y, z = n[0], n[1], n[2]
    for c in range(3):
        value = sky[0, c] + sky[1, c] * x + sky[2, c] * y + sky[3, c] * z
        value += sky[4, c] * x * y + sky[5, c] * y * z + sky[6, c] * z * x
        value += sky[7, c] * (x * x - y * y) + sky[8, c] * (np.float32(3) * z * z - np.float32(1))
        out[c] = value if value > 0 else np.float32(0)


@njit(cache=True)
def _open_past(balls, own, x, y, z, n):
    """How much of an even sky other small bodies leave open: each hides what a ball would, (r/d)²·cos."""
    free = np.float32(1)
    for k in range(len(balls)):
        reach = balls[k, 4] * balls[k, 4]
        if k == own or reach == 0:
            continue
        dx, dy, dz = balls[k, 0] - x, balls[k, 1] - y, balls[k, 2] - z
        square = dx * dx + dy * dy + dz * dz
        above = n[0] * dx + n[1] * dy + n[2] * dz
        if above > 0:
            hidden = above / np.sqrt(square)
            free *= np.float32(1) - hidden * (reach / square if square > reach else np.float32(1))
    return free


@njit(cache=True)
def _shade(world, looks, light, o, d, body, t, hit, work, out):
    """Radiance toward the eye of a matte surface that a ray has met: sky, suns with their shadows, its own."""
    colours, emission, normals, openness, rotations = looks
    sky, suns, around = light
    n, trial, other, stack = work
    u, v = hit[1], hit[2]
    w = np.float32(1) - u - v
    length = np.float32(0)
    for i in range(3):
        n[i] = np.float32(0)
        for j in range(3):
            local = w * normals[t, j] + u * normals[t, 3 + j] + v * normals[t, 6 + j]
            n[i] += rotations[body, 3 * i + j] * local
        length += n[i] * n[i]
    side = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    scale = (np.float32(-1) if side > 0 else np.float32(1)) / np.sqrt(max(length, np.float32(1e-30)))
    lift = np.float32(1e-4) * hit[0] + np.float32(1e-3)
    for i in range(3):
        n[i] *= scale
    x = o[0] + hit[0] * d[0] + lift * n[0]
    y = o[1] + hit[0] * d[1] + lift * n[1]
    z = o[2] + hit[0] * d[2] + lift * n[2]
    free = w * openness[t, 0] + u * openness[t, 1] + v * openness[t, 2]
    free *= _open_past(world[4], body, x, y, z, n)
    _irradiance(sky, n, out)
    for c in range(3):
        out[c] = free * out[c] + (np.float32(1) - free) * around[c]
    for s in range(len(suns)):
        sx, sy, sz = suns[s, 0], suns[s, 1], suns[s, 2]
        cosine = n[0] * sx + n[1] * sy + n[2] * sz
        if cosine > 0 and _first(world, x, y, z, sx, sy, sz, True, other, trial, stack)[0] < 0:
            for c in range(3):
                out[c] += cosine * suns[s, 3 + c]
    for c in range(3):
        out[c] = out[c] * colours[t, c] * np.float32(1 / np.pi) + emission[t, c]


@njit(cache=True)
def _look_some(world, looks, light, origins, directions, first, last, out):
    hit, trial, other = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    n, stack = np.empty(3, np.float32), np.empty(DEEPEST, np.int32)
    for i in range(first, last):
        o, d = origins[i if len(origins) > 1 else 0], directions[i]
        body, triangle = _first(world, o[0], o[1], o[2], d[0], d[1], d[2], False, hit, trial, stack)
        if body < 0:
            out[i, :] = np.float32(0)
            continue
        _shade(world, looks, light, o, d, body, triangle, hit, (n, trial, other, stack), out[i])
        out[i, 3] = np.float32(1)


@njit(
    [
        types.void(
            types.Tuple(_world), types.Tuple(_looks), types.Tuple(_light), _f4_2, _f4_2, types.float32[:, ::1]
        )
    ],
    parallel=True,
    cache=True,
    nogil=True,
)
def look(world, looks, light, origins, directions, out):
    """Radiance (n, 4): red, green, blue of what rays meet, and 1; zeros where they meet nothing.

    ``origins`` (n, 3), or (1, 3) for all; ``directions`` (n, 3) unit.
    """
    for chunk in prange((len(directions) + CHUNK - 1) // CHUNK):
        last = min(len(directions), (chunk + 1) * CHUNK)
        _look_some(world, looks, light, origins, directions, chunk * CHUNK, last, out)
