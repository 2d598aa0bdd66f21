"""The one-bounce operator against closed forms, reciprocity, and itself traced another way."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest

from prelight.errors import InputError
from prelight.images.textures import sample
from prelight.images.tonemap import srgb_decode
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.transport import gathering
from prelight.transport.gathering import Gathering
from prelight.transport.hemisphere import Hits
from prelight.transport.hit_colour import HitColour

from .rooms import coloured, rectangle, room, scene_of_rectangles


def traced(scene: Scene, **options) -> Gathering:
    return Gathering.trace(scene, Occluders(scene.positions, scene.triangles), **options)


def ones(scene: Scene, channels: int = 1) -> np.ndarray:
    return np.ones((len(scene.positions), 1, channels), np.float32)


def lit_from_within(scene: Scene) -> np.ndarray:
    """Smooth light of three lamps near the walls."""
    lamps = np.float32([[0.4, 0.5, 0.6], [3.5, 2.6, 1.0], [2.0, 0.3, 4.6]])
    away = np.linalg.norm(scene.positions[:, None] - lamps, axis=2)
    return (1 / (0.1 + away**2))[..., None].astype(np.float32)


def facing_squares(*, above: float = 1.0) -> Scene:
    """A floor of 2 m × 2 m and a square of the same size above that faces it."""
    floor = rectangle((-1, 0, -1), (0, 0, 2), (2, 0, 0), cells=8)
    roof = rectangle((-1, above, -1), (2, 0, 0), (0, 0, 2), cells=8)
    return scene_of_rectangles(floor, roof, albedo=1.0)


# ---- what it must be --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sink", [0.0, 0.11, 0.6])
def test_no_ray_leaves_a_closed_room_and_rows_sum_to_the_albedo(sink):
    scene = room(8, sink=sink, albedo=0.5)
    found = traced(scene, rays=256)
    inside = scene.positions[:, 1] >= 0
    assert found.sky[inside].max() <= 1 / 256  # one ray between two triangles is forgiven
    assert found.sky[inside].mean() < 1e-5
    off = np.abs(found.bounce(ones(scene))[inside, 0, 0] / 0.5 - 1)
    assert off.max() < (5e-3 if sink else 1e-3)
    assert off.mean() < 1e-4


def test_a_parallel_square_fills_the_share_of_the_hemisphere_that_lambert_says():
    scene = facing_squares()
    middle = 40  # of the floor's 81 vertices
    assert np.allclose(scene.positions[middle], 0)
    lit = np.zeros((len(scene.positions), 1, 1), np.float32)
    lit[81:] = 1
    a = 1.0  # half of a side, over the distance
    expected = 4 / np.pi * a / np.hypot(1, a) * np.arctan(a / np.hypot(1, a))  # four corners of a × a
    found = traced(scene, rays=4096).bounce(lit)
    assert found[middle, 0, 0] == pytest.approx(expected, rel=0.004)


def test_light_at_a_hit_is_interpolated_between_the_vertices_of_its_triangle():
    """Two triangles above, E their vertices' x or z: the mean of x or z over what is seen, by quadrature."""
    roof = rectangle((0.0, 1.0, -0.5), (2, 0, 0), (0, 0, 3), cells=1)
    floor = rectangle((-0.5, 0, -0.5), (0, 0, 1), (1, 0, 0), cells=2)
    scene = scene_of_rectangles(roof, floor, albedo=1.0)
    middle = 4 + 4
    assert np.allclose(scene.positions[middle], 0)
    x, z = np.meshgrid((np.arange(800) + 0.5) / 400, (np.arange(800) + 0.5) / 800 * 3 - 0.5)
    share = 6 / x.size / (np.pi * (x**2 + 1 + z**2) ** 2)  # cos cos / (π r²) at height 1
    light = np.zeros((13, 2, 1), np.float32)
    light[:4, :, 0] = scene.positions[:4, [0, 2]]
    found = traced(scene, rays=4096).bounce(light)[middle, :, 0]
    assert found == pytest.approx([(x * share).sum(), (z * share).sum()], abs=0.005)


def test_noise_is_that_of_well_spread_rays():
    """Of 1,024 in strata 0.7 to 1.2 % in a room with lamps; random ones have five times as much."""
    scene = room(11, albedo=0.7)
    light = lit_from_within(scene)
    first, second = (traced(scene, seed=seed).bounce(light) for seed in (1, 2))
    noise = np.sqrt(((first - second) ** 2).mean() / 2) / first.mean()
    assert 0.0005 < noise < 0.012


def test_reciprocity():
    """A_i F_ij = A_j F_ji: of pairs of vertices that see each other 99.9 % agree within four σ of their hits."""
    scene = room(12, albedo=1.0)
    found = traced(scene, rays=1024)
    V = len(scene.positions)
    F = found.bounce(np.eye(V, dtype=np.float32)[:, :, None])[:, :, 0].astype(np.float64)
    corners = scene.positions[scene.triangles].astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    A = np.bincount(scene.triangles.ravel(), np.repeat(areas / 3, 3), minlength=V)
    forth = A[:, None] * F
    # Inner vertices of two different walls; those on edges see from elsewhere than where they are.
    wall = np.arange(V) // 13**2
    edges = np.isin(np.arange(V) % 13**2 // 13, (0, 12)) | np.isin(np.arange(V) % 13, (0, 12))
    tested = (wall[:, None] < wall) & ~edges[:, None] & ~edges
    mean = (forth + forth.T) / 2
    # A hit adds a weight w ≤ 1 whose mean square is half its mean; hits of a vertex are at worst Poisson's.
    sigma = np.sqrt((A[:, None] + A) * mean / 2 / 1024)
    z = np.abs(forth - forth.T)[tested] / np.maximum(sigma[tested], 1e-12)
    assert tested.sum() > 200_000
    assert (z <= 4).mean() >= 0.999
    assert forth[tested].sum() == pytest.approx(forth.T[tested].sum(), rel=0.002)


def test_backs_bring_nothing_and_are_counted():
    floor = rectangle((-1, 0, -1), (0, 0, 2), (2, 0, 0), cells=4)
    turned = rectangle((-50, 1, -50), (0, 0, 100), (100, 0, 0), cells=4)  # faces up, as the floor does
    scene = scene_of_rectangles(floor, turned)
    found = traced(scene, rays=64)
    assert found.backs[:25].mean() > 0.99
    assert (found.bounce(ones(scene))[:25] == 0).all()
    assert (found.sky[25:] == 1).all()


def test_a_vertex_without_a_normal_sends_nothing():
    scene = room(4)
    normals = scene.normals.copy()
    normals[7] = 0
    found = traced(replace(scene, normals=normals), rays=64)
    assert found.bounce(ones(scene))[7] == 0
    assert found.sky[7] == found.backs[7] == 0
    assert found.rays == 64 * (len(normals) - 1)


def test_points_that_are_no_vertices_gather_too():
    scene = room(8, albedo=0.5)
    place, up = np.float32([[2.0, 0.0, 2.5], [0.3, 0.0, 4.1]]), np.float32([[0, 1, 0]] * 2)
    found = traced(scene, origins=place, normals=up, rays=1024)
    light = lit_from_within(scene)
    floor = np.flatnonzero(scene.normals[:, 1] > 0.5)
    near = floor[np.linalg.norm(scene.positions[floor] - place[0], axis=1).argmin()]
    assert (found.rows, found.columns) == (2, len(scene.positions))
    at_vertex = traced(scene).bounce(light)[near]
    assert found.bounce(light)[0] == pytest.approx(at_vertex, rel=0.05)


# ---- colours ----------------------------------------------------------------------------------------------------


def papered_room(texture: np.ndarray, tint=(1.0, 0.5, 0.25)) -> Scene:
    scene = room(4)
    uv = np.ascontiguousarray(scene.positions[:, :2] * np.float32(0.7) - np.float32(0.9))
    colours = np.tile(np.float32(tint), (len(uv), 1))
    paper = Material("paper", colour_texture=0)
    return replace(scene, materials=(paper,), textures=(texture,), uv=uv, tint=colours)


def test_textures_are_looked_up_in_linear_light(rng):
    texture = rng.integers(0, 256, (7, 5, 3), dtype=np.uint8)
    scene = papered_room(texture)
    triangle = rng.integers(0, len(scene.triangles), (3, 200)).astype(np.int32)
    u, v = rng.dirichlet((1, 1, 1), (3, 200))[..., 1:].transpose(2, 0, 1).astype(np.float32)
    found = HitColour(scene).at(Hits(triangle, np.ascontiguousarray(u), np.ascontiguousarray(v)))
    weights = np.stack([1 - u - v, u, v], axis=-1)[..., None]
    uv = (weights * scene.uv[scene.triangles[triangle]]).sum(axis=2)
    expected = sample(srgb_decode(texture), uv.reshape(-1, 2)).reshape(3, 200, 3) * scene.tint[0]
    assert np.abs(found - expected).max() < 2e-5


def test_a_textured_room_reflects_its_texture_and_each_channel_its_own():
    even = np.full((4, 4, 3), (188, 128, 64), np.uint8)
    scene = papered_room(even)
    found = traced(scene, rays=64)
    light = ones(scene, 3) * np.float32([1, 2, 4])
    expected = srgb_decode(even)[0, 0] * scene.tint[0] * np.float32([1, 2, 4])
    assert found.coloured_entries == 3
    assert found.bounce(light)[100, 0] == pytest.approx(expected, rel=2e-3)


def test_a_grey_texture_needs_one_channel():
    scene = papered_room(np.full((4, 4, 3), 188, np.uint8), tint=(0.5, 0.5, 0.5))
    found = traced(scene, rays=64)
    assert found.is_grey
    assert found.bounce(ones(scene))[100, 0, 0] == pytest.approx(
        0.5 * srgb_decode(np.uint8([188]))[0], rel=2e-3
    )


def test_colours_of_vertices():
    scene = coloured(room(4), (0.9, 0.3, 0.0))
    found = traced(scene, rays=64)
    assert found.bounce(ones(scene, 3))[50, 0] == pytest.approx([0.9, 0.3, 0.0], rel=2e-3)
    with pytest.raises(InputError, match="give three"):
        found.bounce(ones(scene))


# ---- the same, however it is made -------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", [1, 5, 16, 17, 40])
def test_columns_do_not_know_each_other(columns, rng):
    scene = room(4)
    found = traced(scene, rays=64)
    light = rng.normal(size=(len(scene.positions), columns, 1)).astype(np.float32)
    together = found.bounce(light)
    dense = found.bounce(np.eye(len(light), dtype=np.float32)[:, :, None])[:, :, 0]
    assert np.abs(together[:, :, 0] - dense @ light[:, :, 0]).max() < 1e-5
    assert np.array_equal(found.bounce(light[:, -1:])[:, 0], together[:, -1])


@pytest.mark.parametrize(("rows", "memory"), [(37, None), (100, 0), (100, 200_000), (1 << 20, 0)])
def test_the_same_bytes_in_any_tiles_and_any_memory(rows, memory, monkeypatch):
    scene = room(5)
    whole = traced(scene, rays=64, seed=3)
    light = lit_from_within(scene)
    monkeypatch.setattr(gathering, "_RAYS_AT_ONCE", 64 * rows)
    cut = traced(scene, rays=64, seed=3, memory=memory)
    assert cut.entries == whole.entries
    assert np.array_equal(cut.sky, whole.sky)
    for _ in range(2):
        assert np.array_equal(cut.bounce(light), whole.bounce(light))
    assert not np.array_equal(traced(scene, rays=64, seed=4).bounce(light), whole.bounce(light))


def test_the_same_bytes_for_one_thread():
    import drjit as dr

    scene = room(6)
    light = lit_from_within(scene)
    two = traced(scene, rays=256).bounce(light)
    threads, workers = numba.get_num_threads(), dr.thread_count()
    try:
        numba.set_num_threads(1)
        dr.set_thread_count(1)
        one = traced(scene, rays=256).bounce(light)
    finally:
        numba.set_num_threads(threads)
        dr.set_thread_count(workers)
    assert np.array_equal(one, two)


def test_no_two_receivers_share_their_random_numbers():
    """Two receivers in one place, in different tiles or not, have errors of their own."""
    scene = room(8, albedo=1.0)
    place, up = np.tile(np.float32([[2.1, 0.0, 2.6]]), (512, 1)), np.tile(np.float32([[0, 1, 0]]), (512, 1))
    light = np.random.default_rng(1).normal(size=(len(scene.positions), 1, 1)).astype(np.float32)
    values = traced(scene, origins=place, normals=up, rays=64).bounce(light)[:, 0, 0]
    assert len(np.unique(values)) == 512
    again = np.corrcoef(values[:-64], values[64:])[0, 1]
    assert abs(again) < 0.2


def test_a_second_tile_compiles_nothing(monkeypatch):
    import drjit as dr

    scene = room(5)
    monkeypatch.setattr(gathering, "_RAYS_AT_ONCE", 64 * 50)
    traced(scene, rays=64)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        traced(scene, rays=256, seed=5)  # tiles of another size, and a last one of yet another
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert len(launched) > 10
    assert not any(k["cache_hit"] is False or k["cache_hit"] == 0 for k in launched)


# ---- refusals ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rays", [0, -4, 1000, 1 << 20])
def test_a_number_of_rays_that_cannot_be(rays):
    with pytest.raises(InputError, match="square number"):
        traced(room(2), rays=rays)


def test_light_of_another_shape():
    found = traced(room(2), rays=4)
    for shape in ((3, 1, 1), (found.columns, 1, 2), (found.columns, 3)):
        with pytest.raises(InputError, match="expected"):
            found.bounce(np.zeros(shape, np.float32))
