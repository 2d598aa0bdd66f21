"""The kernels of textured pictures: smaller copies of a texture, and its colour within a pixel (Numba).

Each level of a pyramid has half the rows and columns of the one before, its texels the means of linear light. A
pixel's footprint on the texture is the ellipse that the derivatives of the coordinates by the pixel's place
span: several lookups along its longer axis, each from the two levels nearest the shorter one's width (as in
McCormack et al., "Feline", 1999).
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from .raster import edge_planes

MOST_LOOKUPS = 16  # along a footprint; a longer one is looked up in a coarser level
BEYOND = 0.25  # of a triangle: how far outside it a pixel's middle may lie for its texture to be continued
_FULL = np.float32(65535.0)


@njit(cache=True)
def _weights(i: int, size: int):
    """How texels 2i, 2i + 1 and 2i + 2 of ``size`` make texel i of size // 2: equal shares of the length."""
    half = size // 2
    if size == 1:
        return 1.0, 0.0, 0.0
    if size % 2 == 0:
        return 0.5, 0.5, 0.0
    return (half - i) / size, half / size, (i + 1.0) / size


@njit(cache=True)
def _halve_row(source, table, row, out):
    height, width = source.shape[0], source.shape[1]
    down = _weights(row, height)
    for column in range(out.shape[1]):
        across = _weights(column, width)
        for c in range(3):
            total = 0.0
            for i in range(3):
                for j in range(3):
                    weight = down[i] * across[j]
                    if weight > 0.0:
                        total += weight * table[source[2 * row + i, 2 * column + j, c]]
            out[row, column, c] = np.uint16(total * _FULL + 0.5)


@njit(cache=True, parallel=True)
def halve(source, table, out):
    """Fill ``out`` (H', W', 3) uint16, linear light times 65535, with the means of ``source``.

    ``table`` gives the linear light, 0 to 1, of each value of ``source``.
    """
    for row in prange(len(out)):
        _halve_row(source, table, row, out)


@njit(cache=True)
def _texel(texels, table, coarser, levels, level, row, column, c):
    if level == 0:
        return table[texels[row, column, c]]
    return coarser[levels[level, 0] + row * levels[level, 2] + column, c] / _FULL


@njit(cache=True)
def _look_up(texels, table, coarser, levels, level, u, v, share, colour):
    """Add ``share`` times the bilinear colour at (u, v), repeating, of one level to ``colour``."""
    height, width = levels[level, 1], levels[level, 2]
    x, y = (u - np.floor(u)) * width - 0.5, (v - np.floor(v)) * height - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    fx, fy = x - left, y - top
    for i in range(2):
        for j in range(2):
            weight = (fy if i else 1.0 - fy) * (fx if j else 1.0 - fx) * share
            if weight > 0.0:
                row, column = (top + i) % height, (left + j) % width
                for c in range(3):
                    colour[c] += weight * _texel(texels, table, coarser, levels, level, row, column, c)


@njit(cache=True)
def _axes(p: float, q: float, r: float):
    """Of the ellipse of the matrix [[p, r], [r, q]]: longer and shorter half-axis, direction of the longer."""
    middle, d = 0.5 * (p + q), np.hypot(0.5 * (p - q), r)
    longer, shorter = middle + d, max(middle - d, 0.0)
    x, y = longer - q, r
    if abs(x) + abs(y) <= 1e-12 * longer:
        x, y = (1.0, 0.0) if p >= q else (0.0, 1.0)
    length = np.hypot(x, y)
    return np.sqrt(longer), np.sqrt(shorter), x / length, y / length


@njit(cache=True)
def _filtered(texels, table, coarser, levels, u, v, slopes, colour):
    """The mean colour about (u, v) over a pixel; ``slopes`` are du/dx, dv/dx, du/dy, dv/dy of coordinates."""
    height, width = levels[0, 1], levels[0, 2]
    xu, xv, yu, yv = slopes[0] * width, slopes[1] * height, slopes[2] * width, slopes[3] * height
    longer, shorter, along_x, along_y = _axes(xu * xu + yu * yu, xv * xv + yv * yv, xu * xv + yu * yv)
    last = len(levels) - 1
    lookups, level = 1, float(last)
    if longer < 1e9:  # neither infinite nor NaN
        lookups = int(min(max(np.floor(longer / max(shorter, 1.0) + 0.5), 1.0), MOST_LOOKUPS))
        level = min(np.log2(max(shorter, longer / lookups, 1.0)), level)
    else:
        longer = along_x = along_y = 0.0
    finer = min(int(level), last)
    blend = level - finer
    for n in range(lookups):
        s = ((n + 0.5) / lookups - 0.5) * longer
        at_u, at_v = u + s * along_x / width, v + s * along_y / height
        share = 1.0 / lookups
        _look_up(texels, table, coarser, levels, finer, at_u, at_v, (1.0 - blend) * share, colour)
        if blend > 0.0:
            _look_up(texels, table, coarser, levels, finer + 1, at_u, at_v, blend * share, colour)


@njit(cache=True)
def _corner_shares(planes, x, y, shares):
    """Barycentric coordinates where the ray through (x, y) meets the plane; returns their sum before division."""
    total = 0.0
    for i in range(3):
        shares[i] = planes[i, 0] * x + planes[i, 1] * y + planes[i, 2]
        total += shares[i]
    shares /= total if abs(total) > 1e-300 else 1e-300
    return total


@njit(cache=True)
def _place(planes, row, column, seen_by, t, offsets, shares):
    """Fill the barycentric coordinates where a pixel looks at triangle t; returns their sum before division.

    The pixel's middle, as long as that is not far outside: two triangles that share the pixel then continue one
    another's texture. Else the mean of the samples that see it.
    """
    total = _corner_shares(planes, column + 0.5, row + 0.5, shares)
    if total > 0.0 and min(shares[0], shares[1], shares[2]) >= -BEYOND:
        return total
    x = y = 0.0
    count = 0
    for s in range(len(offsets)):
        if seen_by[s] == t:
            x, y, count = x + offsets[s, 0], y + offsets[s, 1], count + 1
    return _corner_shares(planes, column + x / max(count, 1), row + y / max(count, 1), shares)


@njit(cache=True)
def _slopes(planes, corners, uv, u, v, total, slopes):
    """Derivatives of the perspective-correct coordinates (u, v) by the place in the picture."""
    rise_x = rise_y = 0.0
    for i in range(3):
        rise_x += planes[i, 0]
        rise_y += planes[i, 1]
    slopes[0], slopes[1], slopes[2], slopes[3] = -u * rise_x, -v * rise_x, -u * rise_y, -v * rise_y
    for i in range(3):
        a, b = uv[corners[i], 0], uv[corners[i], 1]
        slopes[0] += planes[i, 0] * a
        slopes[1] += planes[i, 0] * b
        slopes[2] += planes[i, 1] * a
        slopes[3] += planes[i, 1] * b
    slopes /= total if total > 1e-300 else 1e-300


@njit(cache=True)
def _colour_pixel(q, triangles, row, column, seen_by, first_row, offsets, entries, seen, mapped,
                  texture, uv, tint, texels, table, coarser, levels, scratch, albedo):  # fmt: skip
    planes, slopes, shares, colour = scratch
    for entry in range(entries[0], entries[1]):
        t = seen[entry]
        if mapped[t] != texture:
            continue
        corners = triangles[t]
        edge_planes(q, corners, planes)
        total = _place(planes, first_row + row, column, seen_by, t, offsets, shares)
        u = v = 0.0
        for i in range(3):
            u += shares[i] * uv[corners[i], 0]
            v += shares[i] * uv[corners[i], 1]
        _slopes(planes, corners, uv, u, v, total, slopes)
        colour[:] = 0.0
        _filtered(texels, table, coarser, levels, u, v, slopes, colour)
        for c in range(3):
            tinted = 0.0
            for i in range(3):
                tinted += shares[i] * tint[corners[i], c]
            albedo[entry, c] = colour[c] * max(tinted, 0.0)


@njit(cache=True, parallel=True)
def colour_entries(q, triangles, winners, first_row, offsets, starts, seen, mapped,
                   texture, uv, tint, texels, table, coarser, levels, albedo):  # fmt: skip
    """Fill ``albedo`` (n, 3) of the entries whose triangle is ``mapped`` (F,) with one ``texture``.

    The texture's mean over a pixel's width, times the tint there. ``texels`` is the texture, ``table`` the linear
    light of its bytes, ``coarser`` (m, 3) and ``levels`` (L, 3: where in ``coarser``, rows, columns) its smaller
    copies.
    """
    rows, width, _ = winners.shape
    for row in prange(rows):
        scratch = np.empty((3, 3)), np.empty(4), np.empty(3), np.empty(3)
        for column in range(width):
            pixel = row * width + column
            _colour_pixel(q, triangles, row, column, winners[row, column], first_row, offsets,
                          starts[pixel : pixel + 2], seen, mapped, texture, uv, tint,
                          texels, table, coarser, levels, scratch, albedo)  # fmt: skip


@njit(cache=True, parallel=True)
def interpolate_textured(
    starts, seen, weights, triangles, radiance, irradiance, albedo, mapped, coverage, behind, picture
):
    """As ``raster.interpolate``; a ``mapped`` triangle shows its ``albedo`` times the irradiance/π."""
    rows, width, _ = picture.shape
    for row in prange(rows):
        for column in range(width):
            through = np.float32(1.0) - coverage[row, column]
            red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            if through > 0.0:
                red = through * behind[row, column, 0]
                green = through * behind[row, column, 1]
                blue = through * behind[row, column, 2]
            pixel = row * width + column
            for n in range(starts[pixel], starts[pixel + 1]):
                t = seen[n]
                if mapped[t] < 0:
                    for i in range(3):
                        v, weight = triangles[t, i], weights[n, i]
                        red += weight * radiance[v, 0]
                        green += weight * radiance[v, 1]
                        blue += weight * radiance[v, 2]
                else:
                    r, g, b = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                    for i in range(3):
                        v, weight = triangles[t, i], weights[n, i]
                        r += weight * irradiance[v, 0]
                        g += weight * irradiance[v, 1]
                        b += weight * irradiance[v, 2]
                    red += albedo[n, 0] * r
                    green += albedo[n, 1] * g
                    blue += albedo[n, 2] * b
            picture[row, column, 0] = red
            picture[row, column, 1] = green
            picture[row, column, 2] = blue
