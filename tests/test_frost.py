"""Frosted glass: the quick blur of a shell against a Gaussian that is summed in full."""

from __future__ import annotations

import math

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.lighting.frost import frosted

CELLS = 8
_TEXELS = np.arange(6 * CELLS**2, dtype=np.int32)


def summed(shell: np.ndarray, degrees: float, outward: np.ndarray | None) -> np.ndarray:
    """Each direction the mean of those around it, of every pair of cells."""
    towards = cube_map.texel_directions(_TEXELS, CELLS).astype(np.float64)
    angle = np.arccos(np.clip(towards @ towards.T, -1, 1))
    sigma = math.radians(degrees)
    weight = np.where(angle < 4 * sigma, np.exp(-0.5 * (angle / sigma) ** 2), 0)
    weight = weight * np.tile(cube_map.solid_angles(CELLS).ravel(), 6)
    if outward is not None:
        weight = weight * (towards @ outward >= 0)
    total = weight.sum(axis=1, keepdims=True)
    found = weight @ shell.reshape(-1, 3) / np.where(total > 0, total, 1)
    return found.reshape(shell.shape)


@pytest.mark.parametrize("degrees", [6.0, 14.0, 28.0, 29.0, 44.0, 60.0])
@pytest.mark.parametrize("outward", [None, np.array((0.48, 0.6, 0.64), np.float32)])
def test_a_blur_is_the_gaussian_mean(degrees: float, outward: np.ndarray | None, rng) -> None:
    """With a sun a thousand times as bright as the sky: far from it nothing of it may be where it is not."""
    shell = rng.uniform(0, 1, (6, CELLS, CELLS, 3)).astype(np.float32)
    shell[2, 3, 5] = 1000
    found = frosted(shell, degrees, outward, cells_per_sigma=100.0)
    expected = summed(shell, degrees, outward)
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-5 * expected.max())


@pytest.mark.parametrize("degrees", [1e-6, 1e-4, 0.002, 0.005, 0.02])
@pytest.mark.parametrize("cells", [16, 32, 64])
def test_hardly_any_frost_changes_hardly_anything(degrees: float, cells: int, rng) -> None:
    """Angles that are lost in float32 had made cells black, and no numbers at all."""
    shell = rng.uniform(0, 1, (6, cells, cells, 3)).astype(np.float32)
    for roughly in ({}, {"cells_per_sigma": 1.5, "most_cells": 64}):
        np.testing.assert_allclose(frosted(shell, degrees, **roughly), shell, atol=1e-4)
