"""Where rays of vertices begin: off the corners of rooms, before what they stick through, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.rays.mitsuba import Occluders
from prelight.rays.offset import ray_offset
from prelight.scene.geometry import Scene
from prelight.transport.gathering import Gathering
from prelight.transport.vantage import vantage_points
from prelight.transport.visibility import Visibility

from .rooms import SIZE, box, rectangle, room, scene_of_rectangles
from .scenes import ball_on_floor, plane


def seen_from(scene: Scene) -> np.ndarray:
    return vantage_points(scene, Occluders(scene.positions, scene.triangles))


def moved(scene: Scene) -> np.ndarray:
    """(V,) how far, in offsets of a ray's origin."""
    points = seen_from(scene)
    assert points.dtype == np.float32
    return np.linalg.norm(points - scene.positions, axis=1) / ray_offset(scene.positions)


def test_vertices_on_the_edges_of_a_room_look_from_inside_it():
    scene = room(8)
    on_edge = (np.isclose(scene.positions, 0) | np.isclose(scene.positions, SIZE)).sum(axis=1) > 1
    distance = moved(scene)
    assert (distance[~on_edge] == 0).all()
    assert ((distance[on_edge] > 3) & (distance[on_edge] < 8)).all()
    inside = np.minimum(seen_from(scene), np.float32(SIZE) - seen_from(scene))
    walls = np.sort(inside, axis=1)[on_edge]
    assert (walls[:, 1] > 3 * ray_offset(scene.positions)).all()  # only its own wall is near


def test_no_sky_leaks_in_at_the_edges():
    scene = room(6)
    occluders = Occluders(scene.positions, scene.triangles)
    sky = np.random.default_rng(2).normal(size=(64, 3)).astype(np.float32)
    bits, _ = Visibility(occluders, origins=vantage_points(scene, occluders), normals=scene.normals).trace(
        sky
    )
    assert not bits.any()
    bits, _ = Visibility(occluders, origins=scene.positions, normals=scene.normals).trace(sky)
    assert bits.any()  # from the vertices themselves it does


@pytest.mark.parametrize("sink", [0.03, 0.3])
def test_vertices_just_below_a_floor_look_from_above_it(sink):
    scene = room(8, sink=sink)
    height = seen_from(scene)[:, 1]
    below = scene.positions[:, 1] < -1e-3
    assert below.any()
    assert (height[below] > 0).all()
    assert height[below].max() < 0.02
    assert (height[~below] >= 0).all()


def test_what_lies_far_below_stays():
    scene = room(24, sink=0.5)  # rows 0.15 m apart: the uppermost of those below reaches through the floor
    below = np.flatnonzero(scene.positions[:, 1] < -0.2)
    height = seen_from(scene)[below, 1]
    assert (height[scene.positions[below, 1] < -0.3] < 0).all()


@pytest.mark.parametrize("scene", [plane(6), ball_on_floor()], ids=["plane", "ball on a floor"])
def test_open_edges_and_smooth_surfaces_stay(scene):
    assert (moved(scene) == 0).all()


def test_a_box_seen_from_outside_stays():
    scene = scene_of_rectangles(*box((0, 0, 0), (1, 2, 3)))
    out = np.einsum("ij,ij->i", scene.normals, scene.positions - np.float32([0.5, 1, 1.5]))
    assert (out > 0).all()
    assert (moved(scene) == 0).all()


def test_a_floor_that_runs_on_under_a_block_looks_from_beside_it():
    """The block's sides stand exactly on a row of the floor's vertices."""
    floor = rectangle((0, 0, 0), (0, 0, 4), (4, 0, 0), cells=8)
    scene = scene_of_rectangles(floor, *box((0.5, 0, 1), (2.5, 1, 3)))
    occluders = Occluders(scene.positions, scene.triangles)
    found = Gathering.trace(scene, occluders, rays=256)
    x, _, z = scene.positions[:81].T
    side = np.isclose(x, 2.5) & (z > 1.2) & (z < 2.8)
    assert side.sum() == 3
    points = vantage_points(scene, occluders)
    assert (points[:81][side, 0] > 2.5).all()
    assert (found.backs[:81][side] == 0).all()
    assert found.sky[:81][side] == pytest.approx(0.5, abs=0.02)  # the block's side fills the other half
    far = (x < 0.4) | (x > 2.6) | (z < 0.9) | (z > 3.1)
    assert (np.linalg.norm(points - scene.positions, axis=1)[:81][far] == 0).all()


def test_a_post_through_the_middle_of_an_edge_moves_nothing():
    floor = rectangle((0, 0, 0), (0, 0, 4), (4, 0, 0), cells=4)
    post = box((1.4, -1, 1.9), (1.6, 1, 2.1))  # between the floor's vertices at x = 1 and 2
    assert (moved(scene_of_rectangles(floor, *post))[:25] == 0).all()


@pytest.mark.parametrize("slant", [1.0, 3.0])
def test_a_vertex_that_only_slanting_edges_lead_to_looks_from_before_the_surface(slant):
    """The middle of a floor of four triangles, a wall standing on it: as in the plane of a window's glass."""
    corners = np.array(
        [[0, 0, 0], [0, 0, 2 * slant], [2, 0, 2 * slant], [2, 0, 0], [1, 0, slant]], np.float64
    )
    fan = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], np.int32)
    floor = corners, np.tile([0.0, 1.0, 0.0], (5, 1)), fan
    wall = rectangle((1, -1, -1), (0, 0, 2 * slant + 2), (0, 3, 0), cells=1)  # seen from x < 1
    scene = scene_of_rectangles(floor, wall)
    assert scene.normals[5, 0] == -1
    points = seen_from(scene)
    assert (points[:2] == scene.positions[:2]).all()
    before = (1 - points[4, 0]) / ray_offset(scene.positions)
    assert before == pytest.approx(4, abs=0.1)


def test_the_bunny_stays_where_the_tables_were_made(data):
    from prelight.scene.floor import with_floor
    from prelight.scene.loading import load_scene

    scene = with_floor(load_scene(data / "bunny" / "bun_zipper.ply"), 3.0)
    assert (moved(scene) > 0).sum() <= 2  # its lowest vertex, and that of the floor which it touches
