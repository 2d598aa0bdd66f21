"""Gaps narrower than the mesh: what is in one, and that light at its edge is not interpolated into it."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.transport.gap_rays import Gaps
from prelight.transport.gathering import Gathering
from prelight.transport.vantage import vantage_points

from .rooms import box, rectangle, room, scene_of_rectangles

GAP, HALF = 0.003, 0.35  # metres


def slab_on_floor() -> Scene:
    """A floor in cells of 10 cm, and 3 mm above it a slab, whose edges are amid the cells."""
    floor = rectangle((-1.0, 0.0, -1.0), (0, 0, 2.0), (2.0, 0, 0), cells=20)
    return scene_of_rectangles(floor, *box((-HALF, GAP, -HALF), (HALF, 0.1, HALF), cells=5), albedo=0.8)


@pytest.fixture(scope="module")
def slab() -> tuple[Scene, Occluders, np.ndarray, Gaps]:
    scene = slab_on_floor()
    occluders = Occluders(scene.positions, scene.triangles)
    origins = vantage_points(scene, occluders)
    return scene, occluders, origins, Gaps.of(scene, occluders, origins)


def test_what_is_between_the_slab_and_the_floor_is_in_a_gap(slab) -> None:
    scene, _, _, gaps = slab
    p, up = scene.positions, scene.normals[:, 1]
    inside = (np.abs(p[:, [0, 2]]) < HALF + 1e-4).all(axis=1)
    between = inside & (((p[:, 1] == 0) & (up > 0.9)) | ((p[:, 1] < 2 * GAP) & (up < -0.9)))
    assert gaps.shut[between].all()
    assert not gaps.shut[~between & (np.abs(p[:, [0, 2]]).max(axis=1) > HALF + 0.05)].any()
    assert not gaps.shut[p[:, 1] > 0.05].any()


def test_no_light_is_interpolated_into_it(slab) -> None:
    """5 cm inside of the 3 mm there is next to nothing of what falls outside; much of it by the light at the edge."""
    scene, occluders, origins, gaps = slab
    p = scene.positions
    lit = ~gaps.shut | (np.abs(p[:, [0, 2]]).max(axis=1) > HALF - 1e-3)
    light = np.repeat(lit.astype(np.float32)[:, None, None], 3, axis=2)
    plain, followed = (
        Gathering.trace(scene, occluders, origins=origins, rays=256, gaps=g).bounce(light)[:, 0, 0]
        for g in (None, gaps)
    )
    floor = np.flatnonzero((p[:, 1] == 0) & (np.abs(p[:, [0, 2]]).max(axis=1) < 0.31))
    assert plain[floor].max() > 0.3
    assert followed[floor].max() < 0.04
    open_floor = (p[:, 1] == 0) & ~gaps.shut
    np.testing.assert_allclose(followed[open_floor].mean(), plain[open_floor].mean(), rtol=0.02)


def test_where_no_gap_is_nothing_changes() -> None:
    scene = room(cells=5)
    occluders = Occluders(scene.positions, scene.triangles)
    origins = vantage_points(scene, occluders)
    gaps = Gaps.of(scene, occluders, origins)
    assert not gaps.shut.any()
    tiles = [
        next(iter(Gathering.trace(scene, occluders, origins=origins, rays=64, gaps=g).tiles()))
        for g in (None, gaps)
    ]
    np.testing.assert_array_equal(tiles[0].columns, tiles[1].columns)
    np.testing.assert_array_equal(tiles[0].values, tiles[1].values)
