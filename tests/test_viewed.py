"""Image relighting (Eq. 3): closed forms, the eye's points, the clustering arithmetic, and the path tracer."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from prelight.bases.cube_map import mean_directions, solid_angles, texel_directions
from prelight.bases.quadtree import sample_texels
from prelight.camera import Camera
from prelight.drawing.view import View
from prelight.errors import InputError
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.eye import SeenPoints, seen_points, vertex_points
from prelight.transport.viewed import ViewedTransfer

from .scenes import ball_on_floor, grid, plane, scene_of

WHITE = Material(colour=(1, 1, 1))
ROUGH_GOLD = Material(bsdf={"type": "roughconductor", "alpha": 0.15})  # reflects all that it does not shadow
LACQUER = Material(colour=(0.7, 0.2, 0.1), roughness=0.5, specular=1.0)
METAL = Material(colour=(0.9, 0.6, 0.4), roughness=0.4, metallic=1.0)
EYE = (0.4, 1.7, 2.0)


def made_of(scene: Scene, *materials: Material, of=0) -> Scene:
    of = np.broadcast_to(np.int32(of), len(scene.triangles)).copy()
    colours = np.float32([material.colour for material in materials])
    scene = dataclasses.replace(scene, materials=materials, material_of=of)
    return dataclasses.replace(scene, albedo=colours[scene.material_of_vertex])


def viewed(scene: Scene, points: SeenPoints, receivers=None) -> ViewedTransfer:
    occluders = Occluders(scene.positions, scene.triangles)
    return ViewedTransfer(occluders, SurfaceScene(scene), points, receivers=receivers)


def unit(rng, count):
    d = rng.normal(size=(count, 3)).astype(np.float32)
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def seen_by(scene: Scene, *, width=24, height=16, samples=4, **camera) -> SeenPoints:
    camera = Camera.framing(scene.positions, **camera)
    occluders = Occluders(scene.positions, scene.triangles)
    return seen_points(occluders, camera, width=width, height=height, samples=samples)


def all_texels(R: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions of all lights and their solid angles."""
    return texel_directions(np.arange(6 * R * R), R), np.tile(solid_angles(R).ravel(), 6)


@pytest.fixture(scope="module")
def white_ball() -> Scene:
    return made_of(ball_on_floor(side=15, rings=10), WHITE)


# ---- closed forms ------------------------------------------------------------------------------------


def test_white_diffuse_is_the_diffuse_transfer(white_ball, rng):
    d = unit(rng, 40)
    rows, rays = viewed(white_ball, vertex_points(white_ball, EYE)).trace(d)
    occluders = Occluders(white_ball.positions, white_ball.triangles)
    diffuse = DiffuseTransfer(occluders, white_ball.positions, white_ball.normals)
    bits, all_rays = diffuse.trace(d, lanes=1 << 20)
    T = diffuse.values(bits, d)
    faces = ((np.float32(EYE) - white_ball.positions) * white_ball.normals).sum(axis=1) > 0
    assert 0.2 < faces.mean() < 0.95
    np.testing.assert_allclose(rows[:, :, faces], np.repeat(T[:, :, faces], 3, axis=1), atol=1e-6)
    assert not rows[:, :, ~faces].any(), "a vertex that faces away from the eye is dark"
    assert (rays <= all_rays).all()
    assert rays.sum() < all_rays.sum()


@pytest.mark.parametrize(
    ("material", "least", "most"),
    [
        (Material(colour=(0.6, 0.6, 0.6)), 0.5995, 0.6005),
        (ROUGH_GOLD, 0.9, 1.001),
        (Material(bsdf={"type": "roughplastic", "alpha": 0.2, "diffuse_reflectance": 1.0}), 0.9, 1.001),
        (Material(colour=(1, 1, 1), roughness=0.5, metallic=1.0), 0.8, 1.001),
        (Material(colour=(0, 0, 0), roughness=0.4, specular=1.0), 0.03, 0.3),
    ],
    ids=["diffuse", "conductor", "plastic", "metal", "black lacquer"],
)
def test_the_white_furnace_gives_nothing_for_nothing(material, least, most):
    """An unshadowed plane under radiance 1: its albedo toward the eye, from steep to 60° off."""
    d, omega = all_texels(48)
    scene = made_of(scene_of(grid(3)), material)
    for eye in ((0.0, 4.0, 0.3), (0.0, 2.0, 4.0)):
        rows, _ = viewed(scene, vertex_points(scene, eye), np.int32([4])).trace(d)
        albedo = rows[:, :, 0].T.astype(np.float64) @ omega
        assert (albedo > least).all(), albedo
        assert (albedo < most).all(), albedo


def test_a_highlight_is_where_the_eye_is_mirrored():
    d, _ = all_texels(64)
    for material in (
        Material(bsdf={"type": "roughconductor", "alpha": 0.02}),
        Material(roughness=0.15, metallic=1),
    ):
        scene = made_of(scene_of(grid(3)), material)
        rows, _ = viewed(scene, vertex_points(scene, (1.0, 2.0, 0.5)), np.int32([4])).trace(d)
        mirrored = np.float32([-1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, 0.5])
        assert d[rows[:, 0, 0].argmax()] @ mirrored > math.cos(0.03)


@pytest.mark.parametrize(
    "material", [ROUGH_GOLD, LACQUER, Material(colour=(0.9, 0.6, 0.3), roughness=0.4, metallic=1)]
)
def test_light_and_eye_may_change_places(material, rng):
    scene = made_of(scene_of(grid(3)), material)
    centre = scene.positions[4]
    a, b = np.float32([0.3, 0.8, -0.2]), np.float32([-0.5, 0.4, 0.6])
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    there, back = (
        viewed(scene, vertex_points(scene, tuple(centre + 3 * eye)), np.int32([4])).trace(d[None])[0][0, :, 0]
        / d[1]
        for eye, d in ((a, b), (b, a))
    )
    assert (there > 0).all()
    np.testing.assert_allclose(there, back, rtol=1e-4)


def test_light_passes_a_sheet_that_transmits_and_nothing_else():
    thin = Material(
        bsdf={"type": "principledthin", "diff_trans": 1.0, "base_color": {"type": "rgb", "value": 0.5}}
    )
    sheet, roof = grid(3), grid(3, size=6.0, height=-1.0)
    below = np.float32([[0, -1, 0]])
    for parts, lit in (((sheet,), True), ((sheet, roof), False)):
        scene = made_of(scene_of(*parts), thin)
        rows, _ = viewed(scene, vertex_points(scene, (0.0, 4.0, 1.0)), np.int32([4])).trace(below)
        assert (rows > 0).all() == lit
    opaque = made_of(scene_of(sheet), LACQUER)
    rows, rays = viewed(opaque, vertex_points(opaque, (0.0, 4.0, 1.0))).trace(below)
    assert not rows.any()
    assert rays[0] == 0, "rays were traced where the BSDF says nothing"


def test_a_smoothed_normal_lets_no_light_through_its_triangle():
    """Near the edge a ray that begins above the surface would miss what it should pass."""
    scene = made_of(plane(3), WHITE)
    leaning = np.float32([1, 1, 0]) / np.sqrt(np.float32(2))
    scene = dataclasses.replace(scene, normals=np.tile(leaning, (9, 1)))
    d = np.float32([[1, -0.001, 0], [1, 0.001, 0]])  # unit to six digits
    points = seen_by(scene, elevation_deg=60)
    rows, rays = viewed(scene, points).trace(d)
    assert not rows[0].any()
    assert (rows[1, 0] > 0).sum() == (points.coverage > 0).sum()
    assert rays[0] == 0


# ---- the eye -----------------------------------------------------------------------------------------


def test_pixels_see_what_pictures_of_meshes_show():
    """Coverage as drawn, and every point behind its own pixel."""
    scene = ball_on_floor(side=9, rings=10)
    camera = Camera.framing(scene.positions, azimuth_deg=25, elevation_deg=20)
    size = {"width": 33, "height": 20}
    points = seen_points(Occluders(scene.positions, scene.triangles), camera, samples=9, **size)
    drawn = View(scene.positions, scene.triangles, camera=camera, samples_per_side=3, **size)
    assert 0.1 < points.coverage.mean() < 0.9
    np.testing.assert_allclose(points.coverage.reshape(20, 33), drawn.coverage, atol=1 / 9 + 1e-6)
    assert abs(points.coverage.mean() - drawn.coverage.mean()) < 1e-3
    whole = points.coverage == 1
    x, y, back = (
        camera.axes().astype(np.float64) @ (points.interpolated(scene, scene.positions) - camera.eye).T
    )
    focal = 20 / (2 * math.tan(math.radians(camera.vertical_fov_deg) / 2))
    pixel = np.arange(20 * 33)
    assert np.abs(33 / 2 - focal * x / back - (pixel % 33 + 0.5))[whole].max() < 1
    assert np.abs(20 / 2 + focal * y / back - (pixel // 33 + 0.5))[whole].max() < 1
    assert (points.material(scene) == np.where(points.coverage > 0, 0, -1)).all()


def test_a_vertex_is_looked_at_in_the_first_triangle_that_has_an_area():
    scene = plane(4)
    triangles = np.concatenate([[[5, 5, 5]], scene.triangles]).astype(np.int32)
    positions = np.concatenate([scene.positions, [[9, 9, 9]]]).astype(np.float32)
    normals = np.concatenate([scene.normals, [[0, 0, 0]]]).astype(np.float32)
    scene = Scene("p", positions, normals, triangles, np.ones_like(positions))
    points = vertex_points(scene, EYE)
    assert points.triangle[-1, 0] == -1
    assert points.coverage[-1] == 0
    np.testing.assert_array_equal(points.interpolated(scene, positions)[:-1], positions[:-1])
    for vertex, triangle in enumerate(points.triangle[:-1, 0]):
        with_area = np.flatnonzero((triangles[1:] == vertex).any(axis=1)) + 1
        assert triangle == with_area[0]
    rows, _ = viewed(scene, points).trace(np.float32([[0, 1, 0]]))
    assert (rows[0, 0] > 0).tolist() == [True] * 16 + [False]


@pytest.mark.parametrize("samples", [0, 3, -4, 81])
def test_samples_of_a_pixel_fill_a_square(samples):
    with pytest.raises(InputError, match="square number from 1 to 64"):
        seen_by(plane(3), samples=samples)


# ---- launches ----------------------------------------------------------------------------------------


def test_a_pixel_is_the_mean_of_its_samples(white_ball, rng):
    scene = made_of(white_ball, LACQUER, ROUGH_GOLD, of=np.arange(len(white_ball.triangles)) % 2)
    points, d = seen_by(scene), unit(rng, 5)
    each = SeenPoints(points.eye, points.triangle.reshape(-1, 1), points.weights.reshape(-1, 1, 2), False)
    rows, rays = viewed(scene, points).trace(d)
    of_each, rays_of_each = viewed(scene, each).trace(d)
    np.testing.assert_allclose(rows, of_each.reshape(5, 3, -1, 4).mean(axis=3), rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(rays, rays_of_each)
    some = np.int32([200, 3, 120])
    np.testing.assert_array_equal(viewed(scene, points, some).trace(d)[0], rows[:, :, some])
    assert not rows[:, :, points.coverage == 0].any()


def test_tiles_change_nothing_and_compile_nothing(white_ball, rng):
    import drjit as dr

    transfer = viewed(made_of(white_ball, LACQUER), seen_by(white_ball))
    d = unit(rng, 31)
    whole, rays = transfer.trace(d)
    transfer.trace(d[:2], lanes=1)
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        parts, rays_of_parts = transfer.trace(d, lanes=7 * transfer.receivers * transfer.samples)
        one_by_one, _ = transfer.trace(d[4:8], lanes=1)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert len(kernels) == 5 + 4, "one launch to a tile"
    assert all(kernel["cache_hit"] for kernel in kernels)
    np.testing.assert_array_equal(whole, parts)
    np.testing.assert_array_equal(rays, rays_of_parts)
    np.testing.assert_array_equal(whole[4:8], one_by_one)


@pytest.mark.parametrize("receivers", [1, 256, 300])
def test_distances_and_means_are_equations_9_to_11(receivers, rng, white_ball):
    rows = (rng.random((20, 3, receivers)) ** 3 * [[[1], [5], [0.2]]]).astype(np.float32)
    rows[:, :, 0] = 0
    sample = rng.permutation(20)[:18].reshape(2, 9).astype(np.int32)
    sample[1, 4:] = -1
    transfer = viewed(white_ball, vertex_points(white_ball, EYE), np.arange(receivers, dtype=np.int32))
    d = np.zeros((*sample.shape, 3), np.float32)
    distance = transfer.squared_distances(rows, sample, d)
    columns, scale = transfer.quantized_means(rows, sample, d, np.zeros((2, 3), np.float32))
    for n in range(2):
        used = sample[n] >= 0
        T = rows[sample[n][used]].astype(np.float64)
        T_C = T.mean(axis=0)
        expected = ((T - T_C) ** 2).sum(axis=2).max(axis=1)
        np.testing.assert_allclose(distance[n][used], expected, rtol=1e-4, atol=1e-12)
        assert not distance[n][~used].any()
        np.testing.assert_allclose(scale[n], T_C.max(axis=1) / 255, rtol=1e-5)
        np.testing.assert_allclose(columns[n] * scale[n][:, None], T_C, atol=0.502 * scale[n].max())
        assert not columns[n, :, 0].any()


@pytest.mark.parametrize("pixels", [False, True])
def test_the_unshadowed_part_of_a_matt_surface_is_its_integral(pixels):
    """Nine samples of a whole face are a poor quadrature of the cosine; what is kept is the closed form."""
    scene = made_of(plane(5), Material(colour=(0.6, 0.3, 0.9)))
    points = seen_by(scene) if pixels else vertex_points(scene, EYE)
    transfer = viewed(scene, points)
    node = np.array([[2, 0, 0, 16, 16]], np.int32)  # all of +Y
    texels = sample_texels(node, 3, 16)
    d = texel_directions(texels[0], 16)
    rows, _ = transfer.trace(d)
    D_C = mean_directions(node, 16).astype(np.float32)
    columns, scale = transfer.quantized_means(rows, np.arange(9, dtype=np.int32)[None], d[None], D_C)
    covered = points.coverage
    kept = columns[0] * scale[0][:, None]
    expected = np.float32([0.6, 0.3, 0.9])[:, None] / np.pi * D_C[0, 1] * covered
    np.testing.assert_allclose(kept, expected, atol=0.51 * scale.max())
    assert abs(rows.mean(axis=0).max() / expected.max() - 1) > 0.02, "the plain mean would do"


@pytest.mark.parametrize(("material", "side"), [(Material(colour=(0.6, 0.3, 0.9)), 2), (METAL, 8)])
def test_samples_that_leave_nothing_to_estimate_are_not_corrected(material, side):
    """All lights of a node are samples, as in small nodes; or what they bring is no cosine: the mean itself."""
    scene = made_of(plane(5), material)
    transfer = viewed(scene, vertex_points(scene, EYE))
    node = np.array([[2, 0, 0, side, side]], np.int32)  # of +Y, wide and to one side
    texels = sample_texels(node, 3, 8)
    d = texel_directions(np.maximum(texels[0], 0), 8)
    rows, _ = transfer.trace(d)
    D_C = mean_directions(node, 8).astype(np.float32)
    sample = np.where(texels >= 0, np.arange(9), -1).astype(np.int32)
    columns, scale = transfer.quantized_means(rows, sample, d[None], D_C)
    mean = rows[sample[0] >= 0].mean(axis=0)
    assert mean.max() > 0.02
    np.testing.assert_allclose(columns[0] * scale[0][:, None], mean, atol=0.51 * scale.max())
