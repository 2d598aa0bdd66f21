"""Edges halved where direct light through portals breaks: no cracks, and less error for as many vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.baking.portals_refining import refined, suns_of
from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.errors import InputError
from prelight.lighting.environment import Environment
from prelight.scene.geometry import Scene
from prelight.scene.portals import PortalWish, areas_of
from prelight.scene.refinement import halved, unique_edges

from .portal_rooms import SIZE, under_glass, with_glass
from .rooms import rectangle

X, Y, Z = SIZE
POINTS = 3000


def floor_under_a_board(cells: int, *, glass: str = "clear glass") -> Scene:
    """A floor in the shadow of a board, under a skylight that is a quarter of the ceiling."""
    floor, board = rectangle((0, 0, 0), (0, 0, Z), (X, 0, 0), cells=cells), rectangle(
        (1.3, 0.3, 1.7), (0, 0, 1.6), (1.1, 0, 0), cells=1
    )  # fmt: skip
    ceiling = rectangle((-9, Y, -9), (25, 0, 0), (0, 0, 10.5), cells=1), rectangle(
        (-9, Y, 3.5), (25, 0, 0), (0, 0, 10), cells=1
    )  # fmt: skip
    sides = tuple(rectangle((x, Y, 1.5), (w, 0, 0), (0, 0, 2), cells=1) for x, w in ((-9, 10), (3, 10)))
    pane = rectangle((1, Y, 1.5), (2, 0, 0), (0, 0, 2), cells=1)
    return with_glass((floor, board, *ceiling, *sides), {glass: [pane]})


def lies_within(scene: Scene) -> int:
    """How many vertices lie strictly within an edge."""
    ends = unique_edges(scene.triangles)
    a, b = (scene.positions[ends[:, k]].astype(np.float64) for k in (0, 1))
    found, long = 0, np.linalg.norm(b - a, axis=1)
    for place in np.unique(scene.positions.astype(np.float64), axis=0):
        way = np.linalg.norm(place - a, axis=1) + np.linalg.norm(place - b, axis=1) - long
        ends_here = (place == a).all(axis=1) | (place == b).all(axis=1)
        found += int(((way < 1e-7 * long) & ~ends_here).any())
    return found


def test_no_vertex_lies_within_an_edge(rng) -> None:
    scene = under_glass(cells=2)
    # Where walls meet places are shared, vertices are not.
    for _ in range(3):
        edges = unique_edges(scene.triangles)
        before = areas_of(scene.positions[scene.triangles])
        finer, ends = halved(scene, edges[rng.choice(len(edges), 12, replace=False)])
        after = areas_of(finer.positions[finer.triangles])
        assert len(finer.positions) - len(scene.positions) == len(ends) > 12
        assert np.array_equal(finer.positions[: len(scene.positions)], scene.positions)
        middle = scene.positions[ends].astype(np.float64).mean(axis=1)
        assert np.abs(finer.positions[len(scene.positions) :] - middle).max() < 1e-6
        for m in np.unique(scene.material_of):
            assert after[finer.material_of == m].sum() == pytest.approx(before[scene.material_of == m].sum())
        scene = finer
    assert lies_within(scene) == lies_within(under_glass(cells=2)) == 0
    a, b, c = np.moveaxis(scene.positions[scene.triangles].astype(np.float64), 1, 0)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), scene.normals[scene.triangles[:, 0]]) > 0).all()


def test_angles_stay_wide_however_often_one_corner_is_halved() -> None:
    scene = under_glass(cells=2)
    for _ in range(8):
        edges = unique_edges(scene.triangles)
        near = np.linalg.norm(scene.positions[edges].mean(axis=1) - scene.positions[0], axis=1)
        scene, _ = halved(scene, edges[np.argsort(near)[:2]])
    p = scene.positions[scene.triangles].astype(np.float64)
    one, two = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    lengths = np.linalg.norm(one, axis=2) * np.linalg.norm(two, axis=2)
    cosines = np.einsum("ijk,ijk->ij", one, two) / lengths
    assert np.degrees(np.arccos(cosines.max())) > 15


def error_of(scene: Scene, truth: Scene) -> float:
    """Mean |difference| of direct light on the floor, between vertices too, over its mean."""
    rng, settings = np.random.default_rng(3), PortalsSettings(rays=4096)
    places = np.stack([rng.random(POINTS) * X, np.zeros(POINTS), rng.random(POINTS) * Z], axis=1)
    up = np.tile(np.float32([0, 1, 0]), (POINTS, 1))
    light = []
    for room, where, normals in (
        (PortalsRoom(truth, settings), places.astype(np.float32), up),
        (PortalsRoom(scene, settings), scene.positions, scene.normals),
    ):
        rays = room.rays_from(where, normals, resolution=8, rays=1024, alike=True)
        found = rays.trace(0, len(where))
        row = np.repeat(np.arange(len(where)), np.diff(found.starts))
        light.append(np.bincount(row, found.weight, minlength=len(where)))
    hit = PortalsRoom(scene, settings).occluders
    down = hit.mi.Ray3f(
        hit.mi.Point3f(*np.ascontiguousarray((places + up * 1e-3).T, np.float32)), hit.mi.Vector3f(0, -1, 0)
    )  # fmt: skip
    met = hit.scene.ray_intersect_preliminary(down)
    two = met.prim_uv.numpy().T
    of = PortalsRoom(scene, settings).open.triangles[met.prim_index.numpy()]
    ours = np.einsum("nk,nk->n", np.c_[1 - two.sum(axis=1), two], light[1][of])
    return float(np.abs(ours - light[0]).mean() / light[0].mean())


def test_less_error_than_a_uniform_mesh_of_as_many_vertices() -> None:
    coarse = floor_under_a_board(10)
    fine = refined(coarse, PortalsSettings(), factor=3.0)
    uniform = floor_under_a_board(20)
    assert len(coarse.positions) < len(fine.positions) <= len(uniform.positions)
    error, even = error_of(fine, coarse), error_of(uniform, coarse)
    assert error < 0.6 * even < 0.6 * error_of(coarse, coarse)
    assert "vertices added" in fine.notes[-1]
    again = refined(coarse, PortalsSettings(), factor=3.0)
    assert again.digest == fine.digest


def test_a_known_suns_patch_is_followed() -> None:
    sun = np.zeros((6, 32, 32, 3), np.float32) + 1
    sun[2, 16, 16] = 5000  # nearly above
    directions, power = suns_of(sun)
    assert len(directions) == 1
    assert directions[0, 1] > 0.99
    energy = 5000 * (2 / 32) ** 2  # of the cell, beside 4π of the sky
    assert power[0] == pytest.approx(4 * np.pi * energy / (energy + 4 * np.pi), rel=0.01)
    coarse = floor_under_a_board(10)
    shares = []
    for skies in ([sun], []):
        fine = refined(coarse, PortalsSettings(), factor=3.0, skies=skies)
        new = fine.positions[len(coarse.positions) :]
        x, _, z = new[new[:, 1] == 0].T
        # The skylight straight above lights x from 1 to 3 and z from 1.5 to 3.5.
        across = np.maximum(np.abs(x - 2), np.abs(z - 2.5)) - 1
        shares.append(float((np.abs(across) < 0.12).mean()))
    assert shares[0] > 2 * shares[1]
    assert shares[0] > 0.3


@pytest.mark.parametrize(("factor", "reason"), [
    (1.0, "above 1 and up to 16"), (17, "above 1"), (float("nan"), "above 1"), (True, "above 1"),
])  # fmt: skip
def test_wrong_factors_are_refused(factor, reason) -> None:
    with pytest.raises(InputError, match=reason):
        refined(under_glass(), PortalsSettings(), factor=factor)


def test_too_many_vertices_are_refused() -> None:
    scene = under_glass()
    many = replace(scene, positions=np.zeros((300_000, 3), np.float32))
    with pytest.raises(InputError, match="at most 4,000,000"):
        refined(many, PortalsSettings(PortalWish()), factor=16)


def test_a_dark_sky_has_no_suns() -> None:
    assert len(suns_of(np.zeros((6, 8, 8, 3), np.float32))[0]) == 0
    assert len(suns_of(Environment.stock("overcast").cube(32))[0]) == 0
