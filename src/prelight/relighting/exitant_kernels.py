"""Light that arrives at glossy vertices, into exitant harmonics: sorted by its angle, then through a lobe table."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

ROWS = 16  # of one thread at a time
SINES = 4096  # steps of the cosine that tell the angle of incidence

_QUARTER = np.float32(0.25)
f4, i4, i8, u4 = types.float32, types.int32, types.int64, types.uint32


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _sort_in(bins, used, waves, step_of, x, y, z, r, g, b):
    """Add light from a direction of the row's frame (irradiance on what faces it) to its bin, times its waves."""
    length = np.sqrt(x * x + y * y)
    cosine, sine = np.float32(1), np.float32(0)
    if length > 0:
        cosine, sine = x / length, y / length
    c, s = np.float32(1), np.float32(0)
    waves[0] = c
    for m in range(1, (len(waves) + 1) // 2):
        c, s = c * cosine - s * sine, s * cosine + c * sine
        waves[2 * m - 1], waves[2 * m] = c, s
    k = step_of[min(int(z * np.float32(SINES)), SINES - 1)]
    used[k] = True
    r, g, b = r * z, g * z, b * z
    for j in range(len(waves)):  # whole indices: a slice costs more than all of this
        wave = waves[j]
        bins[k, 0, j] += r * wave
        bins[k, 1, j] += g * wave
        bins[k, 2, j] += b * wave


@njit(cache=True)
def _reflect(sorted_, table, strength, sums, out, begin, end):
    """out (rows, 3, (n + 1)²) of rows ``begin`` … ``end`` of a block = strength × Σ over bins of table × waves."""
    order = (sorted_.shape[2] - 1) // 2
    for channel in range(3):
        p = 0
        for m in range(order + 1):
            for l in range(m, order + 1):
                for odd in range(2 if m else 1):
                    sums[:] = 0
                    wave = 2 * m - 1 + odd if m else 0
                    for k in range(len(sorted_)):
                        lobe, light = table[k, channel, p], sorted_[k, channel, wave]
                        for row in range(ROWS):
                            sums[row] += lobe * light[row]
                    place = l * (l + 1) + (-m if odd else m)
                    for row in range(begin, end):
                        out[row, channel, place] = sums[row] * strength[row, channel]
                p += 1


@njit(cache=True)
def _sorted(row, seen, cells, sources, frames, lights, step_of, bins, used, waves):
    """Light that arrives at a row, by its angle of incidence, times the waves of its azimuth."""
    starts, texels, codes = seen
    d, omega = cells
    sky, B = sources
    directions, energies = lights
    for e in range(starts[row], starts[row + 1]):
        k, code = texels[e], codes[e]
        z = frames[row, 2, 0] * d[k, 0] + frames[row, 2, 1] * d[k, 1] + frames[row, 2, 2] * d[k, 2]
        if z <= 0:
            continue
        share = _QUARTER * np.float32(code >> 28)
        r, g, b = share * sky[k, 0], share * sky[k, 1], share * sky[k, 2]
        surface = (code >> 25) & 7
        if surface:
            of, v = _QUARTER * np.float32(surface) * omega[k], code & 0x1FFFFFF
            r, g, b = r + of * B[v, 0], g + of * B[v, 1], b + of * B[v, 2]
        if r == 0 and g == 0 and b == 0:
            continue
        x = frames[row, 0, 0] * d[k, 0] + frames[row, 0, 1] * d[k, 1] + frames[row, 0, 2] * d[k, 2]
        y = frames[row, 1, 0] * d[k, 0] + frames[row, 1, 1] * d[k, 1] + frames[row, 1, 2] * d[k, 2]
        _sort_in(bins, used, waves, step_of, x, y, z, r, g, b)
    for j in range(directions.shape[1]):
        a, h, t = directions[row, j, 0], directions[row, j, 1], directions[row, j, 2]
        z = frames[row, 2, 0] * a + frames[row, 2, 1] * h + frames[row, 2, 2] * t
        if z > 0:
            x = frames[row, 0, 0] * a + frames[row, 0, 1] * h + frames[row, 0, 2] * t
            y = frames[row, 1, 0] * a + frames[row, 1, 1] * h + frames[row, 1, 2] * t
            r, g, b = energies[row, j, 0], energies[row, j, 1], energies[row, j, 2]
            _sort_in(bins, used, waves, step_of, x, y, z, r, g, b)


@njit(cache=True)
def _some_rows(seen, cells, sources, surfaces, lights, lobes, step_of, out, first, last):
    frames, lobe_of, strength = surfaces
    width = 2 * int(np.sqrt(out.shape[2]) - 0.5) + 1
    bins = np.zeros((lobes.shape[1], 3, width), np.float32)
    used = np.zeros(len(bins), np.bool_)
    waves = np.empty(width, np.float32)
    sorted_ = np.zeros((len(bins), 3, width, ROWS), np.float32)  # of a block of rows, side by side
    sums = np.empty(ROWS, np.float32)
    for row in range(first, last):
        _sorted(row, seen, cells, sources, frames, lights, step_of, bins, used, waves)
        for k in range(len(bins)):
            if used[k]:
                for channel in range(3):
                    for j in range(width):
                        sorted_[k, channel, j, row - first] = bins[k, channel, j]
                bins[k] = 0
                used[k] = False
    begin = first
    while begin < last:  # rows of one material together
        end = begin + 1
        while end < last and lobe_of[end] == lobe_of[begin]:
            end += 1
        _reflect(
            sorted_,
            lobes[lobe_of[begin]],
            strength[first:last],
            sums,
            out[first:last],
            begin - first,
            end - first,
        )
        begin = end


@njit(cache=True)
def _highlight(tables, at, x, y, z, a, b, c):
    """f cos cos of directions (x, y, z) and (a, b, c), above the horizon, between the nodes of table ``at``."""
    hx, hy, hz = x + a, y + b, z + c
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / length, hy / length, hz / length
    square = hx * hx + hy * hy
    d = min(x * hx + y * hy + z * hz, np.float32(1))
    below = square * (1 - d * d)
    ahead = d * hz - z
    azimuth = min(ahead * ahead / below, np.float32(1)) if below > np.float32(1e-12) else np.float32(0)
    u = np.sqrt(np.sqrt(square)) * np.float32(tables.shape[1] - 1)
    v, w = d * np.float32(tables.shape[2] - 1), azimuth * np.float32(tables.shape[3] - 1)
    i = min(int(u), tables.shape[1] - 2)
    j = min(max(int(v), 0), tables.shape[2] - 2)
    k = min(int(w), tables.shape[3] - 2)
    u, v, w = u - np.float32(i), v - np.float32(j), w - np.float32(k)
    red = green = blue = np.float32(0)
    for p in range(2):
        for q in range(2):
            for o in range(2):
                share = (u if p else 1 - u) * (v if q else 1 - v) * (w if o else 1 - w)
                red += share * tables[at, i + p, j + q, k + o, 0]
                green += share * tables[at, i + p, j + q, k + o, 1]
                blue += share * tables[at, i + p, j + q, k + o, 2]
    return red, green, blue


@njit(cache=True)
def _some_eyes(seen, cells, sources, surfaces, lights, highlights, toward, out, first, last):
    starts, texels, codes = seen
    d, omega = cells
    sky, B = sources
    frames, lobe_of, strength = surfaces
    directions, energies = lights
    for row in range(first, last):
        at, ex, ey, ez = lobe_of[row], toward[row, 0], toward[row, 1], toward[row, 2]
        count = starts[row + 1] - starts[row] if len(sky) else 0
        red = green = blue = np.float32(0)
        for e in range(count + directions.shape[1]):
            if e < count:
                k, code = texels[starts[row] + e], codes[starts[row] + e]
                a, h, t = d[k, 0], d[k, 1], d[k, 2]
                share = _QUARTER * np.float32(code >> 28)
                r, g, b = share * sky[k, 0], share * sky[k, 1], share * sky[k, 2]
                surface = (code >> 25) & 7
                if surface:
                    of, v = _QUARTER * np.float32(surface) * omega[k], code & 0x1FFFFFF
                    r, g, b = r + of * B[v, 0], g + of * B[v, 1], b + of * B[v, 2]
            else:
                j = e - count
                a, h, t = directions[row, j, 0], directions[row, j, 1], directions[row, j, 2]
                r, g, b = energies[row, j, 0], energies[row, j, 1], energies[row, j, 2]
            z = frames[row, 2, 0] * a + frames[row, 2, 1] * h + frames[row, 2, 2] * t
            if z <= 0 or (r == 0 and g == 0 and b == 0):
                continue
            x = frames[row, 0, 0] * a + frames[row, 0, 1] * h + frames[row, 0, 2] * t
            y = frames[row, 1, 0] * a + frames[row, 1, 1] * h + frames[row, 1, 2] * t
            fr, fg, fb = _highlight(highlights, at, x, y, z, ex, ey, ez)
            red, green, blue = red + r * fr, green + g * fg, blue + b * fb
        out[row, 0] = red * strength[row, 0] / ez
        out[row, 1] = green * strength[row, 1] / ez
        out[row, 2] = blue * strength[row, 2] / ez


_seen = types.Tuple((_read_only(i8, 1), _read_only(u4, 1), _read_only(i4, 1)))
_cells = types.Tuple((_read_only(f4, 2), _read_only(f4, 1)))
_sources = types.Tuple((f4[:, ::1], f4[:, ::1]))
_surfaces = types.Tuple((_read_only(f4, 3), _read_only(i4, 1), _read_only(f4, 2)))
_lights = types.Tuple((f4[:, :, ::1], f4[:, :, ::1]))


@njit(
    [types.void(_seen, _cells, _sources, _surfaces, _lights, _read_only(f4, 4), _read_only(i8, 1), f4[:, :, ::1])],
    parallel=True,
    cache=True,
)  # fmt: skip
def exitant_coefficients(seen, cells, sources, surfaces, lights, lobes, step_of, out):
    """out (G, 3, (n + 1)²), written: what leaves each row, in harmonics of its own frame.

    seen: starts, cells and codes of ``transport.exitant.Seen``, cells 6 · 16² · pane + texel. cells: their directions
    and solid angles. sources: ∫ L dω of
    each cell's sky (C, 3), radiance of every vertex (V, 3). surfaces: frames (G, 3, 3), rows tangent, bitangent,
    normal; table of each row; strength (G, 3). lights: directions (G, K, 3) and the irradiance (G, K, 3) that a
    surface facing them gets. lobes (L, bins, 3, functions); step_of: the bin of each of SINES steps of the cosine.
    """
    for part in prange((len(out) + ROWS - 1) // ROWS):
        _some_rows(
            seen, cells, sources, surfaces, lights, lobes, step_of, out, part * ROWS,
            min(len(out), (part + 1) * ROWS),
        )  # fmt: skip


@njit(
    [types.void(_seen, _cells, _sources, _surfaces, _lights, _read_only(f4, 5), f4[:, ::1], f4[:, ::1])],
    parallel=True,
    cache=True,
)
def exitant_toward(seen, cells, sources, surfaces, lights, highlights, toward, out):
    """out (G, 3), written: radiance toward unit directions ``toward`` (G, 3) of each row's frame, z above 0.

    The other arguments are those of ``exitant_coefficients``; no cells are looked at where the sky (0, 3) has none.
    highlights (L, …, 3): ``bases.exitant.highlight_table``.
    """
    for part in prange((len(out) + ROWS - 1) // ROWS):
        _some_eyes(
            seen, cells, sources, surfaces, lights, highlights, toward, out, part * ROWS,
            min(len(out), (part + 1) * ROWS),
        )  # fmt: skip
