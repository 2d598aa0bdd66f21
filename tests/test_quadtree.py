"""Quadtrees of any size: they tile the face, sample what they should, and find what an edit touches."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases import quadtree
from prelight.bases.cube_map import mean_directions, solid_angles, texel_directions
from prelight.bases.quadtree import LeafCover


def random_leaves(resolution: int, rng: np.random.Generator) -> np.ndarray:
    nodes = quadtree.roots(resolution)
    for _ in range(6):
        opened = (rng.random(len(nodes)) < 0.6) & (quadtree.texel_counts(nodes) > 1)
        parts = [quadtree.split(n[None])[0] if o else n[None] for n, o in zip(nodes, opened, strict=True)]
        nodes = np.concatenate(parts)
    return nodes


def painted(leaves: np.ndarray, resolution: int) -> np.ndarray:
    """Leaf index of every texel; asserts that no two leaves overlap."""
    owner = np.full((6, resolution, resolution), -1)
    for index, (face, row, column, height, width) in enumerate(leaves):
        place = owner[face, row : row + height, column : column + width]
        assert (place == -1).all()
        place[...] = index
    return owner


@pytest.mark.parametrize("resolution", [1, 2, 3, 7, 64, 100])
def test_leaves_tile_the_cube_and_every_prefix_can_be_resumed(resolution, rng):
    leaves = random_leaves(resolution, rng)
    assert (painted(leaves, resolution) >= 0).all()
    assert LeafCover(leaves, resolution).is_complete
    for count in {0, 1, len(leaves) // 3, len(leaves)}:
        rest, parents = LeafCover(leaves[:count], resolution).uncovered()
        owner = painted(np.concatenate([leaves[:count], rest]), resolution)
        assert (owner >= 0).all()
        inside = (
            (parents[:, 1] <= rest[:, 1])
            & (parents[:, 2] <= rest[:, 2])
            & (parents[:, 1] + parents[:, 3] >= rest[:, 1] + rest[:, 3])
            & (parents[:, 2] + parents[:, 4] >= rest[:, 2] + rest[:, 4])
        )
        assert inside.all()


@pytest.mark.parametrize("resolution", [3, 7, 64, 100])
def test_an_edit_finds_exactly_the_leaves_it_touches(resolution, rng):
    leaves = random_leaves(resolution, rng)
    owner, cover = painted(leaves, resolution), LeafCover(leaves, resolution)
    for _ in range(60):
        face = int(rng.integers(6))
        top, bottom = np.sort(rng.choice(resolution + 1, 2, replace=False))
        left, right = np.sort(rng.choice(resolution + 1, 2, replace=False))
        found = cover.intersecting(face, slice(top, bottom), slice(left, right))
        np.testing.assert_array_equal(found, np.unique(owner[face, top:bottom, left:right]))


@pytest.mark.parametrize("samples_per_side", [2, 3, 5])
def test_samples_lie_inside_with_the_outermost_texels_among_them(samples_per_side, rng):
    resolution, s = 100, samples_per_side
    leaves = random_leaves(resolution, rng)
    owner = painted(leaves, resolution).ravel()
    samples = quadtree.sample_texels(leaves, s, resolution)
    for index, (leaf, row) in enumerate(zip(leaves, samples, strict=True)):
        texels = row[row >= 0]
        assert len(np.unique(texels)) == len(texels)
        assert (owner[texels] == index).all()
        count = leaf[3] * leaf[4]
        if count < s * s:
            assert len(texels) == count
        else:
            rows, columns = texels % resolution**2 // resolution, texels % resolution
            assert (rows.min(), rows.max()) == (leaf[1], leaf[1] + leaf[3] - 1)
            assert (columns.min(), columns.max()) == (leaf[2], leaf[2] + leaf[4] - 1)


def test_samples_of_a_whole_face_are_the_papers():
    samples = quadtree.sample_texels(quadtree.roots(256)[:1], 3, 256)[0]
    assert set(samples // 256) == {0, 128, 255}
    assert set(samples % 256) == {0, 128, 255}


def test_mean_direction_is_the_solid_angle_integral(rng):
    resolution = 64
    leaves = random_leaves(resolution, rng)
    omega = solid_angles(resolution).astype(np.float64)
    d = texel_directions(np.arange(6 * resolution**2), resolution).reshape(6, resolution, resolution, 3)
    mean = mean_directions(leaves, resolution)
    for leaf, expected in zip(leaves[::5], mean[::5], strict=True):
        face, row, column, height, width = leaf
        weight = omega[row : row + height, column : column + width, None]
        sum_ = (d[face, row : row + height, column : column + width] * weight).sum(axis=(0, 1))
        np.testing.assert_allclose(sum_ / weight.sum(), expected, atol=2e-4)
    # A whole face: ∫ω dω of the flux through a cube's face is π over six faces' worth of 2π/3 solid angle.
    assert np.linalg.norm(mean_directions(quadtree.roots(1), 1)[0]) < 1
