"""Sums of energy over square cells of a cube map."""

from __future__ import annotations

from numba import njit, prange, types

_f4_4 = types.Array(types.float32, 4, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)


@njit(cache=True)
def _row_of_cells(cube, omega, side, face, cell_row, energy):
    R = cube.shape[1]
    for row in range(cell_row * side, min((cell_row + 1) * side, R)):
        for column in range(R):
            cell = column // side
            for c in range(3):
                energy[cell, c] += cube[face, row, column, c] * omega[row, column]


@njit([types.void(_f4_4, _f4_2, types.int64, types.float64[:, :, :, ::1])], parallel=True, cache=True)
def cell_energies(cube, omega, side, energy):
    """energy (6, G, G, 3), written: Σ radiance · solid angle over side×side texels, G = ⌈R / side⌉."""
    G = energy.shape[1]
    for k in prange(6 * G):
        energy[k // G, k % G] = 0
        _row_of_cells(cube, omega, side, k // G, k % G, energy[k // G, k % G])
