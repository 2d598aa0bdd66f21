"""What a bounced part is made of: cells of light, modes in bytes, eigenvectors."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.light_cells import cell_samples, light_cells, smooth_lights, solid_angles_of
from prelight.bases.cube_map import face_coordinates
from prelight.bases.quadtree import LeafCover
from prelight.encoding.modes import grouped, in_bytes, ungrouped
from prelight.encoding.range_kernels import eigenvectors, gram, turned


@pytest.mark.parametrize("resolution", [1, 2, 7, 16, 50])
def test_cells_are_a_whole_quadtree_and_their_samples_lie_inside(resolution):
    cells = light_cells(resolution)
    assert LeafCover(cells, resolution).is_whole_tree
    assert len(cells) == 6 * min(resolution, 16) ** 2
    assert solid_angles_of(cells, resolution).sum() == pytest.approx(4 * np.pi)
    d, shares = cell_samples(cells, resolution)
    np.testing.assert_allclose(shares.sum(axis=1), 1, rtol=1e-5)
    face, u, v = face_coordinates(d.reshape(-1, 3).astype(np.float64))
    each = d.shape[1]
    assert (face.reshape(-1, each) == cells[:, :1]).all()
    row, column = (((t + 1) * resolution / 2).reshape(-1, each) for t in (v, u))
    assert ((row > cells[:, 1:2]) & (row < cells[:, 1:2] + cells[:, 3:4])).all()
    assert ((column > cells[:, 2:3]) & (column < cells[:, 2:3] + cells[:, 4:5])).all()
    assert np.isfinite(smooth_lights(cells, resolution)).all()


def test_modes_as_bytes(rng):
    values = rng.normal(size=(70, 5)).astype(np.float32) * [1, 10, 1e-3, 0, 1]
    bytes_, scale = in_bytes(values.astype(np.float32))
    assert (np.abs(bytes_ * scale - values) <= 0.5001 * scale + 1e-12).all()
    assert scale[3] == 0
    assert not bytes_[:, 3].any()
    np.testing.assert_array_equal(ungrouped(grouped(bytes_))[:70], bytes_)


def test_eigenvectors_are_numpys(rng):
    rows = rng.normal(size=(200, 40)).astype(np.float32) * np.linspace(1, 10, 40, dtype=np.float32)
    C = gram(rows)
    np.testing.assert_allclose(C, rows.astype(np.float64).T @ rows, rtol=1e-9, atol=1e-6)
    values, vectors = eigenvectors(C)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(C)[::-1], rtol=1e-9)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(40), atol=1e-9)
    np.testing.assert_allclose(C @ vectors, vectors * values, atol=1e-6 * values[0])
    np.testing.assert_allclose(turned(rows, vectors), rows @ vectors, atol=1e-3)
