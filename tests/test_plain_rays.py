"""Shadow rays without a renderer: against exact arithmetic, closed meshes, and the renderer's own."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.rays.mitsuba import Occluders
from prelight.rays.plain import PlainOccluders, PlainVisibility
from prelight.scene.mitsuba_scene.tessellation import sphere
from prelight.scene.stock.catalogue import stock_scene
from prelight.transport.visibility import Visibility

FAR_AWAY = (148_376, 1_234, -223_423)


def unit(vectors: np.ndarray) -> np.ndarray:
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def exactly_visible(positions, triangles, origins, directions) -> np.ndarray:
    """Möller and Trumbore's, each ray with every triangle, in double precision."""
    a, b, c = (positions[triangles[:, k]].astype(float) for k in range(3))
    edge, other = b - a, c - a
    free = []
    for o, d in zip(origins.astype(float), directions.astype(float), strict=True):
        p = np.cross(d, other)
        determinant = (edge * p).sum(1)
        good = determinant != 0
        inverse = 1 / np.where(good, determinant, 1)
        q = np.cross(o - a, edge)
        u, v, t = ((o - a) * p).sum(1) * inverse, (q @ d) * inverse, (other * q).sum(1) * inverse
        free.append(not (good & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).any())
    return np.array(free)


def closed_mesh(shift=(0, 0, 0)) -> tuple[np.ndarray, np.ndarray]:
    """A bumpy ball without a seam."""
    ball = sphere()
    _, kept, same = np.unique(np.round(ball.positions, 9), axis=0, return_index=True, return_inverse=True)
    points = ball.positions[kept]
    points = points * (1 + 0.2 * np.sin(5 * points[:, :1]) * np.cos(4 * points[:, 1:2]))
    return (points + np.array(shift)).astype(np.float32), same.ravel()[ball.triangles].astype(np.int32)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_rays_through_a_heap_of_triangles_are_as_in_exact_arithmetic(size, rng):
    middle = rng.normal(size=(300, 1, 3))
    corners = (middle + 0.3 * rng.normal(size=(300, 3, 3))) * size
    positions = corners.reshape(-1, 3).astype(np.float32)
    triangles = np.arange(900, dtype=np.int32).reshape(-1, 3)
    origins = (size * 1.5 * rng.normal(size=(2000, 3))).astype(np.float32)
    directions = unit(rng.normal(size=(2000, 3)))
    directions[:6] = np.concatenate([np.eye(3), -np.eye(3)])
    directions[100:200] = directions[99]  # a run that goes together
    seen = PlainOccluders(positions, triangles).visible(origins, directions)
    expected = exactly_visible(positions, triangles, origins, directions)
    assert 0.2 < expected.mean() < 0.8
    assert np.array_equal(seen, expected)


@pytest.mark.parametrize("shift", [(0, 0, 0), FAR_AWAY])
def test_no_ray_leaves_a_closed_mesh(shift, rng):
    positions, triangles = closed_mesh(shift)
    occluders = PlainOccluders(positions, triangles)
    count = 1_000_000
    origin = (np.array(shift) + rng.uniform(-0.1, 0.1, 3)).astype(np.float32)
    origins = np.broadcast_to(origin, (count, 3))
    # At nothing, at points of edges, at vertices.
    toward = rng.normal(size=(count, 3))
    third, points = count // 3, positions.astype(float)
    edge = triangles[rng.integers(len(triangles), size=third)]
    share = rng.random((third, 1))
    toward[:third] = points[edge[:, 0]] * share + points[edge[:, 1]] * (1 - share) - origin
    toward[third : 2 * third] = points[rng.integers(len(points), size=third)] - origin
    assert occluders.visible(origins, unit(toward)).sum() == 0
    outside = origin + np.float32(5) * unit(toward[: count // 10])
    assert occluders.visible(outside, unit(toward[: count // 10])).all()


def test_a_grid_has_no_holes_along_its_own_lines():
    line = np.linspace(-1, 1, 33)
    x, z = np.meshgrid(line, line, indexing="ij")
    positions = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3).astype(np.float32)
    i = np.arange(33 * 33).reshape(33, 33)
    a, b, c, d = i[:-1, :-1], i[1:, :-1], i[:-1, 1:], i[1:, 1:]
    triangles = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (b, d, c))]).astype(
        np.int32
    )
    occluders = PlainOccluders(positions, triangles)
    above = positions + np.float32([0, 1, 0])
    down, up = np.float32([[0, -1, 0]]), np.float32([[0, 1, 0]])
    assert not occluders.visible(above, np.repeat(down, len(above), axis=0)).any()
    assert occluders.visible(above, np.repeat(up, len(above), axis=0)).all()
    assert occluders.visible(positions, np.repeat(up, len(above), axis=0)).all()  # on it, not behind it


def test_rays_from_very_far_away_find_the_scene(rng):
    positions, triangles = closed_mesh()
    occluders = PlainOccluders(positions, triangles)
    directions = unit(rng.normal(size=(500, 3)))
    origins = -1e6 * directions.astype(float)
    assert not occluders.visible(origins, directions).any()
    assert occluders.visible(origins, -directions).all()
    beside = origins + 2 * unit(np.cross(directions, rng.normal(size=(500, 3))))
    assert occluders.visible(beside, directions).all()


def test_the_renderer_sees_the_same(rng):
    scene = stock_scene("sculpture-small")
    directions = unit(rng.normal(size=(200, 3)))
    given = {"origins": scene.positions, "normals": scene.normals}
    ours = PlainVisibility(PlainOccluders(scene.positions, scene.triangles), **given)
    theirs = Visibility(Occluders(scene.positions, scene.triangles), **given)
    (bits, rays), (expected, their_rays) = ours.trace(directions), theirs.trace(directions)
    assert rays.sum() > 200_000
    assert 0.2 < np.unpackbits(expected).sum() / rays.sum() < 0.95
    assert np.abs(rays - their_rays).max() <= 1
    assert np.unpackbits(bits ^ expected).sum() <= 2e-5 * rays.sum()


def test_bits_are_of_receivers_in_their_order():
    """Under a roof over one half; 11 receivers, of which the last faces down."""
    roof = np.float32([(0, 1, -9), (9, 1, -9), (9, 1, 9), (0, 1, 9)])
    occluders = PlainOccluders(roof, np.int32([(0, 1, 2), (0, 2, 3)]))
    x = np.array([3, -3, 3, 3, -3, -3, 3, -3, -3, 3, -3])
    origins = np.stack([x, 0 * x, 0 * x], axis=-1).astype(np.float32)
    normals = np.tile(np.float32([0, 1, 0]), (11, 1))
    normals[10] = -normals[10]
    up, down = (0, 1, 0), (0, -1, 0)
    bits, rays = PlainVisibility(occluders, origins=origins, normals=normals).trace(np.float32([up, down]))
    open_sky = (x < 0) & (normals[:, 1] > 0)
    assert np.unpackbits(bits[0], bitorder="little")[:11].tolist() == open_sky.astype(int).tolist()
    assert np.unpackbits(bits[1], bitorder="little")[:11].tolist() == [0] * 10 + [1]
    assert rays.tolist() == [10, 1]
    assert bits.shape == (2, 2)


@pytest.mark.parametrize(
    "triangles",
    [
        np.zeros((1, 3), int),  # a point
        np.array([[0, 1, 2]]),
        np.array([[0, 1, 2]] * 1000),  # no plane parts them
        np.array([[0, 1, 1]] * 50 + [[0, 1, 2]]),  # lines
    ],
)
def test_odd_heaps_are_built_and_traced(triangles):
    positions = np.float32([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    occluders = PlainOccluders(positions, triangles.astype(np.int32))
    free = occluders.visible(np.float32([(0.2, 0.2, 1), (0.9, 0.9, 1)]), np.float32([(0, 0, -1)] * 2))
    assert free.tolist() == [not (triangles == 2).any(), True]


def test_a_row_of_ever_smaller_triangles_makes_no_endless_tree():
    size = (0.5 ** np.arange(120))[:, None, None]
    corners = size * np.array([[(1, 0, 0), (1.5, 0, 0), (1, 0.5, 0)]])
    occluders = PlainOccluders(
        corners.reshape(-1, 3).astype(np.float32), np.arange(360, dtype=np.int32).reshape(-1, 3)
    )
    x = np.float32([1.1, 0.55, 0.275, 1.45])
    origins = np.stack([x, 0.1 * x, 0 * x + 1], axis=-1)
    assert occluders.visible(origins, np.float32([(0, 0, -1)] * 4)).tolist() == [False, False, False, True]


@pytest.mark.parametrize(
    ("positions", "triangles"),
    [
        (np.zeros((3, 3)), np.zeros((0, 3), int)),
        (np.zeros((3, 3)), np.array([[0, 1, 3]])),
        (np.zeros((3, 3)), np.array([[0, 1, -1]])),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]])),
        (np.zeros((3, 2)), np.array([[0, 1, 2]])),
    ],
)
def test_what_cannot_be_is_refused(positions, triangles):
    with pytest.raises(InputError):
        PlainOccluders(positions, triangles)


def test_rays_that_cannot_be_are_refused():
    occluders = PlainOccluders(*closed_mesh())
    for origins, directions in (
        (np.zeros((2, 3)), np.zeros((1, 3))),
        (np.zeros((1, 3)), np.zeros((1, 3))),
        (np.zeros(3), np.ones(3)),
    ):
        with pytest.raises(InputError):
            occluders.visible(origins, directions)
    assert occluders.visible(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_no_renderer_is_needed():
    asked = "import sys, prelight.rays.plain as p; print(sorted({'mitsuba', 'drjit'} & set(sys.modules)))"
    answer = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
