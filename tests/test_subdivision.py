"""Subdivision: the same surface in smaller triangles, without cracks, each part in its parent's material."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from prelight.errors import InputError
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene
from prelight.scene.mesh import MeshAsRead, scene_from
from prelight.scene.subdivision import estimated_vertices, subdivided


def edges(triangles: np.ndarray) -> np.ndarray:
    return np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)


def lengths(scene: Scene) -> np.ndarray:
    a, b = scene.positions[edges(scene.triangles)].astype(float).transpose(1, 0, 2)
    return np.linalg.norm(a - b, axis=1)


def areas(scene: Scene) -> np.ndarray:
    """(F, 3) vectors as long as the area, along the normal."""
    a, b, c = scene.positions[scene.triangles].astype(float).transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


def loose_edges(scene: Scene) -> int:
    """Edges that one triangle has and no other, told by place: what a crack would add to."""
    names = [tuple(map(bytes, pair)) for pair in scene.positions[edges(scene.triangles)]]
    return sum(n == 1 for n in Counter(tuple(sorted(pair)) for pair in names).values())


def plain(positions: object, triangles: object, **options: object) -> Scene:
    return scene_from(MeshAsRead(np.array(positions, float), np.array(triangles), **options), name="x")


def cube(rng: np.random.Generator) -> Scene:
    """Its faces do not share vertices, and each is cut along either diagonal; corners are moved at random."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) + rng.uniform(
        -0.3, 0.3, (8, 3)
    )
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    positions = np.concatenate([corners[list(face)] for face in faces]) * rng.uniform(0.01, 10, 3)
    cuts = [[(0, 1, 2), (0, 2, 3)] if rng.integers(2) else [(0, 1, 3), (1, 2, 3)] for _ in faces]
    triangles = np.concatenate([np.array(cut) + 4 * k for k, cut in enumerate(cuts)])
    return plain(
        positions,
        triangles,
        material_of=np.arange(12) // 2,
        materials=tuple(Material(f"{k}") for k in range(6)),
    )


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(0.03, 1.2))
def test_the_surface_stays_and_every_edge_is_short(seed: int, share: float) -> None:
    scene = cube(np.random.default_rng(seed))
    longest = float(lengths(scene).max()) * share
    finer = subdivided(scene, longest)
    assert lengths(finer).max() <= longest
    assert loose_edges(finer) == loose_edges(scene) == 0
    count = len(scene.positions)
    np.testing.assert_array_equal(finer.positions[:count], scene.positions)
    np.testing.assert_array_equal(finer.normals[:count], scene.normals)
    assert len(np.unique(finer.triangles)) == len(finer.positions)
    whole, parts = areas(scene), areas(finer)
    for k in range(6):  # area and direction of every material's two triangles
        np.testing.assert_allclose(
            parts[finer.material_of == k].sum(axis=0),
            whole[2 * k : 2 * k + 2].sum(axis=0),
            rtol=1e-5,
            atol=1e-5 * np.abs(whole).max(),
        )
    assert np.linalg.norm(parts, axis=1).sum() == pytest.approx(np.linalg.norm(whole, axis=1).sum(), rel=1e-5)
    np.testing.assert_allclose(np.linalg.norm(finer.normals, axis=1), 1, atol=1e-6)
    assert (np.diff(finer.material_of) >= 0).all()  # parts stand where their triangle stood


@pytest.mark.parametrize("longest", [1.5, 0.7, 0.3, 0.1])
def test_a_mesh_stays_joined(longest: float) -> None:
    """A tetrahedron of four vertices: every edge, by its indices, belongs to two triangles in either direction."""
    corners = [(1, 1, 1), (1, -1, -2), (-1, 1, -1), (-1, -1, 1)]
    finer = subdivided(plain(corners, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]), longest)
    directed = np.stack([finer.triangles, np.roll(finer.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    assert set(map(tuple, directed)) == set(map(tuple, directed[:, ::-1]))
    assert len(set(map(tuple, directed))) == len(directed)
    assert len(finer.positions) == len(finer.triangles) // 2 + 2  # Euler
    assert len(finer.positions) == len(np.unique(finer.positions, axis=0))


def test_nothing_to_split_gives_the_scene_itself() -> None:
    scene = plain([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    assert subdivided(scene, math.sqrt(2)) is scene
    assert subdivided(scene, 1e30) is scene


def test_a_right_triangle_by_hand() -> None:
    """Only the hypotenuse is longer than 1.2; at 0.9 all three are, and the halves of 0.71 stay."""
    scene = plain([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    one = subdivided(scene, 1.2)
    np.testing.assert_array_equal(one.positions[3:], [(0.5, 0.5, 0)])
    np.testing.assert_array_equal(one.triangles, [(1, 3, 0), (3, 2, 0)])
    four = subdivided(scene, 0.9)
    np.testing.assert_array_equal(four.positions[3:], [(0.5, 0, 0), (0.5, 0.5, 0), (0, 0.5, 0)])
    np.testing.assert_array_equal(four.triangles, [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
    assert four.notes == ("edges longer than 0.9 m split: 3 vertices added",)


def test_slivers_become_strips() -> None:
    """Halving both long sides again and again would give 3⁷ triangles; a strip has one for each part of a side."""
    scene = plain([(0, 0, 0), (100, 0.3, 0), (100, -0.3, 0)], [(0, 2, 1)])
    finer = subdivided(scene, 1)
    assert len(finer.triangles) == 2 * 128 - 1
    x, y, _ = finer.positions.T  # every vertex lies on one of the two sides
    np.testing.assert_allclose(np.abs(y), 0.003 * x, atol=1e-5)
    assert (areas(finer)[:, 2] > 0).all()
    obtuse = plain([(0, 0, 0), (100, 0, 0), (45, 0.3, 0)], [(0, 1, 2)])
    assert len(subdivided(obtuse, 1).triangles) < 1000
    uneven = plain([(0, 0, 0), (8.1, 0, 0), (7.9, 0.9, 0)], [(0, 1, 2)])  # sixteen parts and eight
    assert (areas(subdivided(uneven, 1))[:, 2] > 0).all()


def test_normals_are_interpolated_and_zero_ones_add_nothing() -> None:
    """Vertex 1 has no normal, so the middle takes the other end's; opposite ends leave none."""
    scene = plain([(0, 0, 0), (2, 0, 0), (0, 2, 0)], [(0, 1, 2)])
    normals = np.array([(0, 0, 1), (0, 0, 0), (1, 0, 0)], np.float32)
    four = subdivided(replace(scene, normals=normals), 1.9)
    half = math.sqrt(0.5)
    np.testing.assert_allclose(four.normals[3:], [(0, 0, 1), (1, 0, 0), (half, 0, half)], atol=1e-7)
    opposite = replace(
        scene, normals=normals * np.float32(0) + np.float32([(0, 0, 1), (0, 0, -1), (0, 0, 1)])
    )
    np.testing.assert_array_equal(subdivided(opposite, 1.9).normals[3:], [(0, 0, 0), (0, 0, 0), (0, 0, 1)])


def test_colours_are_looked_up_in_the_texture_anew() -> None:
    """Black at both ends, white in the middle: interpolation would miss it."""
    texture = np.zeros((1, 4, 3), np.uint8)
    texture[0, 1:3] = 255
    tint = np.array([(1, 0.5, 0), (0, 0.5, 0), (1, 0.5, 0)])
    scene = plain(
        [(0, 0, 0), (2, 0, 0), (0, 1.1, 0)], [(0, 1, 2)], albedo=tint,
        uv=np.array([(0.125, 0.5), (0.875, 0.5), (0.125, 0.5)]),
        materials=(Material(colour_texture=0),), textures=(texture,),
    )  # fmt: skip
    altered = scene.albedo + np.float32(0.25)  # what the loader gave is kept, whatever it is
    finer = subdivided(replace(scene, albedo=altered), 1.2)
    np.testing.assert_array_equal(finer.albedo[:3], altered)
    np.testing.assert_allclose(finer.uv[3:], [(0.5, 0.5), (0.5, 0.5)])
    np.testing.assert_allclose(finer.tint[3:], [(0.5, 0.5, 0)] * 2)
    np.testing.assert_allclose(finer.albedo[3:], [(0.5, 0.5, 0)] * 2, atol=1e-6)


@pytest.mark.parametrize("longest", [0.5, 0.1, 0.02])
def test_the_estimate_is_near(longest: float, rng: np.random.Generator) -> None:
    triangles = rng.uniform(0, 1, (60, 3, 3)) * np.exp(rng.uniform(-2, 1, (60, 1, 1)))
    triangles[:20, :, 0] *= 0.02  # slivers
    scene = plain(triangles.reshape(-1, 3), np.arange(180).reshape(-1, 3))
    made, expected = len(subdivided(scene, longest).positions), estimated_vertices(scene, longest)
    assert 0.5 < expected / made < 2


def test_what_would_be_too_much_is_refused_before_it_is_done() -> None:
    scene = plain([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    with pytest.raises(
        InputError, match=r"^subdivide: edges of at most 1e-05 m would make about \S+e\+\d+ vertices"
    ):
        subdivided(scene, 1e-5)
    for bad in (0, -1, math.nan, math.inf, "1", True, None):
        with pytest.raises(InputError, match=r"^subdivide: is .*expected a length in metres"):
            subdivided(scene, bad)


def test_edges_that_float32_cannot_halve_stay() -> None:
    """Far from the origin the places are 8 m apart: nothing shorter can be made, and it ends."""
    far = np.float32(1e8)
    scene = plain([(far, 0, 0), (far + 8, 0, 0), (far, 8, 0)], [(0, 1, 2)])
    finer = subdivided(scene, 1.0)
    assert 3 < len(finer.positions) < 1000
    assert np.isfinite(finer.positions).all()


def test_loading_subdivides_before_the_floor_is_put_under(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_bytes(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene = load_scene(path, subdivide=0.5, floor=2)
    finer = load_scene(path, subdivide=0.5)
    assert len(scene.positions) == len(finer.positions) + 193 * 193
    assert lengths(finer).max() <= 0.5
    with pytest.raises(InputError, match=r"^subdivide: is "):
        load_scene(path, subdivide=-1)


def test_the_cathedral(data: Path) -> None:
    if not (data / "sibenik" / "sibenik.obj").exists():
        pytest.skip("no Sibenik in the test data")
    scene = load_scene(data / "sibenik" / "sibenik.obj")
    finer = subdivided(scene, 1.0)
    assert lengths(finer).max() <= 1
    found = [np.linalg.norm(areas(s), axis=1).sum() for s in (scene, finer)]
    assert found[1] == pytest.approx(found[0], rel=1e-6)
