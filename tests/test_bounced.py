"""Bounced light in environment layers: a spherical bowl, whose inter-reflection is known in closed form.

From anywhere inside a sphere every part of it is seen alike. So in a bowl that is the share f of a sphere, of albedo
ρ, whatever light D falls in, all points receive the same I = ρ f mean(D) / (1 − ρ f) by bouncing.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numba
import numpy as np
import pytest

from prelight.baking.bounced import BouncedLight
from prelight.baking.environment import bake_environment
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.baking.first_bounce import thinned
from prelight.baking.layer_receivers import LayerReceivers
from prelight.baking.light_cells import cell_samples, light_cells, solid_angles_of
from prelight.bases.cube_map import face_coordinates
from prelight.camera import Camera
from prelight.checking.against import Comparison
from prelight.encoding.row_wavelet_kernels import colour_halves, multiply_rows
from prelight.encoding.vertex_tree import halves, left_shares, vertex_order
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.material import Material
from prelight.relighting.relighter import Relighter
from prelight.relighting.strong_lights import StrongLights
from prelight.scene.geometry import Scene
from prelight.transport.bounces import bounced
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.gathering import Gathering
from prelight.transport.spreading import Spreading

from .disk import quick_bake
from .scenes import plane

COLOURS = np.array([0.8, 0.5, 0.2])
RAYS = 256
ABOVE = Camera((0.0, 2.5, 0.01), (0.0, 0.0, 0.0), vertical_fov_deg=40.0)


@cache
def bowl(*, grey: bool = False) -> Scene:
    """The lower half of a unit sphere, open above, seen and lit from inside."""
    rings, around = 10, 30
    polar, turn = np.meshgrid(
        np.linspace(np.pi / 2, np.pi, rings + 1), 2 * np.pi * np.arange(around) / around, indexing="ij"
    )
    p = np.stack([np.sin(polar) * np.cos(turn), np.cos(polar), np.sin(polar) * np.sin(turn)], axis=-1)
    p = np.concatenate([p[:-1].reshape(-1, 3), [[0.0, -1.0, 0.0]]])
    ring = np.arange(rings * around).reshape(rings, around)
    beside, last = np.roll(ring, -1, axis=1), np.full(around, len(p) - 1)
    upper = np.stack([ring[:-1], beside[:-1], ring[1:]], axis=-1).reshape(-1, 3)
    lower = np.stack([beside[:-1], beside[1:], ring[1:]], axis=-1).reshape(-1, 3)
    tip = np.stack([ring[-1], beside[-1], last], axis=-1)
    triangles = np.concatenate([upper, lower, tip]).astype(np.int32)
    albedo = np.broadcast_to([0.7] * 3 if grey else COLOURS, p.shape)
    return Scene(
        "bowl", p.astype(np.float32), (-p).astype(np.float32), triangles, albedo.astype(np.float32),
        cameras={"above": ABOVE},
    )  # fmt: skip


def indirect(albedo: np.ndarray | float, mean: np.ndarray | float, bounces: int | None = None):
    """I of a half sphere, of any number of bounces or of all."""
    x = np.asarray(albedo) * 0.5
    return x * mean / (1 - x) if bounces is None else mean * sum(x**k for k in range(1, bounces + 1))


def found(scene: Scene, *, most: int | None = None, memory: int | None = None, **options):
    """The bounced part of a layer, in memory."""
    settings = EnvironmentSettings(resolution=16, bounces=most, gather_rays=RAYS, **options)
    layer = LayerReceivers(scene, settings)
    light = BouncedLight(layer, rays=RAYS, most=most, memory=memory, report=lambda _: None)
    return layer, light.found(lanes=1 << 20)


@pytest.fixture(scope="module")
def of_bowl():
    return found(bowl())


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    path = tmp_path_factory.mktemp("bowl") / "bowl.prelight"
    return bake_environment(bowl(), path, resolution=16, tolerance=0.02, gather_rays=RAYS)


def bounces_of(part, light: np.ndarray) -> np.ndarray:
    """(rows, 3) of light (cells,) alike in all colours."""
    weights = np.broadcast_to(part.weights, (3, *part.weights.shape[1:]))
    return np.einsum("vk,ckj,j->vc", part.modes, weights, light)


# ---- closed form and the operator itself -------------------------------------------------------------


def test_a_bowl_under_an_even_sky(of_bowl):
    """Direct irradiance / π is the open share of the hemisphere, 1/2, everywhere."""
    layer, part = of_bowl
    E = bounces_of(part, solid_angles_of(part.cells, 16))
    inner = layer.scene.positions[:, 1] < -0.05
    np.testing.assert_allclose(E[inner].mean(axis=0), indirect(COLOURS, 0.5), rtol=0.01)
    assert E[inner].std(axis=0).max() < 0.03 * E.max()


@pytest.mark.parametrize("most", [1, 2])
def test_a_number_of_bounces(most):
    layer, part = found(bowl(grey=True), most=most)
    E = bounces_of(part, solid_angles_of(part.cells, 16))
    inner = layer.scene.positions[:, 1] < -0.05
    assert E[inner].mean() == pytest.approx(indirect(0.7, 0.5, most), rel=0.01)
    assert part.weights.shape[0] == 1  # one colour is enough for grey


def test_every_cell_and_the_sources_against_the_operator(of_bowl):
    """Any light at all: I of the solved operator, of single cells and of one light between them."""
    layer, part = of_bowl
    scene = layer.scene
    gathering = Gathering.trace(scene, layer.occluders, rays=RAYS)
    transfer = DiffuseTransfer(layer.occluders, layer.origins, scene.normals)
    d, shares = cell_samples(part.cells, 16)
    chosen = np.arange(3, len(d), 97)
    rows, _ = transfer.trace(d[chosen].reshape(-1, 3), lanes=1 << 20)
    T = transfer.values(rows, d[chosen].reshape(-1, 3))[:, 0].reshape(len(chosen), shares.shape[1], -1)
    D = np.einsum("ksv,ks->vk", T, shares[chosen]).astype(np.float32)
    truth = bounced(gathering, np.repeat(D[:, :, None], 3, axis=2)).indirect
    weights = part.weights[:, :, chosen]
    by_cells = np.einsum("vk,ckj->vjc", part.modes, weights)
    by_sources = np.einsum("vk,cuk,uj->vjc", part.modes, part.sources, D)
    size = np.sqrt((truth**2).mean())
    assert np.sqrt(((by_cells - truth) ** 2).mean()) < 0.03 * size
    np.testing.assert_allclose(by_sources, by_cells, atol=1e-3 * truth.max())


def test_what_is_convex_has_none(tmp_path):
    _, part = found(plane(albedo=0.9))
    assert not part.modes.any()
    bake = bake_environment(plane(albedo=0.9), tmp_path / "p.prelight", resolution=4, gather_rays=16)
    light, direct = Relighter(bake), Relighter(bake, bounced=False)
    for one in (light, direct):
        one.environment = Environment.constant((1.0, 0.5, 0.2))
    np.testing.assert_array_equal(light.radiance, direct.radiance)


def test_spreading_is_the_transpose_of_gathering(rng):
    scene = bowl()
    gathering = Gathering.trace(scene, LayerReceivers(scene, EnvironmentSettings()).occluders, rays=64)
    x, y = rng.random((2, len(scene.positions), 5, 3)).astype(np.float32)
    there = (x * gathering.bounce(y)).sum(axis=(0, 1), dtype=np.float64)
    spreading = Spreading(gathering, scene)
    back = spreading.areas * spreading.bounce(x / spreading.areas)
    back = (back * y).sum(axis=(0, 1), dtype=np.float64)
    np.testing.assert_allclose(there, back, rtol=1e-5)


def test_the_same_bytes_for_any_threads_and_memory(of_bowl):
    """A tile that does not fit is traced again; a row is summed by one thread."""
    _, part = of_bowl
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        _, again = found(bowl(), memory=0)
    finally:
        numba.set_num_threads(threads)
    for name in ("modes", "weights", "sources"):
        assert getattr(part, name).tobytes() == getattr(again, name).tobytes(), name
    for name in ("order", "left", "colours", "sums", "scales", "counts", "steps", "codes"):
        assert getattr(part.first, name).tobytes() == getattr(again.first, name).tobytes(), name


# ---- relit -------------------------------------------------------------------------------------------


def test_relit_it_is_the_closed_form(bake):
    light, direct = Relighter(bake), Relighter(bake, bounced=False)
    assert (light.has_bounces, direct.has_bounces) == (True, False)
    sky = (1.0, 2.0, 3.0)
    for one in (light, direct):
        one.environment = Environment.constant(sky)
    inner = bake.receivers.positions[:, 1] < -0.05
    bounced = (light.irradiance - direct.irradiance)[inner].mean(axis=0)
    np.testing.assert_allclose(bounced, indirect(COLOURS, 0.5) * sky, rtol=0.015)
    np.testing.assert_allclose(light.radiance, light.irradiance * bake.receivers.albedo, rtol=1e-5)


def test_light_adds_up_and_dark_is_dark(bake, rng):
    cubes = rng.random((2, 6, 16, 16, 3)).astype(np.float32)
    light = Relighter(bake, trace_strong=False)
    seen = []
    for cube in (*cubes, cubes[0] + cubes[1], 0 * cubes[0]):
        light.environment = Environment.from_cube(cube)
        seen.append(light.radiance)
    np.testing.assert_allclose(seen[0] + seen[1], seen[2], rtol=1e-4, atol=1e-5)
    assert not seen[3].any()


def test_an_edit_is_what_a_new_map_is(bake, rng):
    cube = rng.random((6, 16, 16, 3)).astype(np.float32)
    light, fresh = Relighter(bake, trace_strong=False), Relighter(bake, trace_strong=False)
    light.environment = Environment.from_cube(cube)
    before = light.radiance
    cube[2, 3:6, 4:9] = 7.0
    assert light.edit(2, slice(3, 6), slice(4, 9), np.float32([7, 7, 7])).bytes_read > 0
    fresh.environment = Environment.from_cube(cube)
    np.testing.assert_allclose(light.radiance, fresh.radiance, rtol=2e-6, atol=2e-6)
    assert (light.radiance > before).all()  # the whole bowl is brighter for it


def test_a_disc_bounces_in_its_colour(bake):
    """In front of the map, and in no other cell than its own."""
    disc = Disc((0.0, 1.0, 0.0), 20.0, (4.0, 0.0, 0.0))
    light, direct = Relighter(bake, trace_strong=False), Relighter(bake, trace_strong=False, bounced=False)
    for one in (light, direct):
        one.environment = Environment.constant((0.0, 0.0, 0.0)).with_discs((disc,))
    bounced = light.irradiance - direct.irradiance
    area = _areas(bake)
    mean = (direct.irradiance * area[:, None]).sum(axis=0) / area.sum()
    assert mean[0] > 0
    inner = bake.receivers.positions[:, 1] < -0.05
    assert bounced[inner, 0].mean() == pytest.approx(indirect(COLOURS[0], mean[0]), rel=0.04)
    assert not bounced[:, 1:].any()


def test_a_traced_sun_bounces_by_its_own_shadow(bake):
    """Not by the mean of its cell: what bounces follows from the direct light that its rays find."""
    cube = np.full((6, 16, 16, 3), 0.01, np.float32)
    face, u, v = face_coordinates(np.array([[0.6, 0.7, 0.2]]))
    cube[face[0], int((v[0] + 1) * 8), int((u[0] + 1) * 8)] = 800.0
    environment = Environment.from_cube(cube)
    light, direct = Relighter(bake), Relighter(bake, bounced=False)
    light.environment = direct.environment = environment
    assert len(light.strong_lights) >= 1
    bounced, area = light.irradiance - direct.irradiance, _areas(bake)
    mean = (direct.irradiance * area[:, None]).sum(axis=0) / area.sum()
    inner = bake.receivers.positions[:, 1] < -0.05
    np.testing.assert_allclose(bounced[inner].mean(axis=0), indirect(COLOURS, mean), rtol=0.01)
    clustered = Relighter(bake, trace_strong=False)
    clustered.environment = environment
    np.testing.assert_allclose(clustered.irradiance.mean(), light.irradiance.mean(), rtol=0.06)


def test_a_traced_sun_bounces_as_the_operator_bounces_it(bake):
    """Its first bounces one by one, from a patch of any shape, and what follows by the modes."""
    light, direct = Relighter(bake), Relighter(bake, bounced=False)
    scene = bowl()
    gathering = Gathering.trace(scene, LayerReceivers(scene, EnvironmentSettings()).occluders, rays=RAYS)
    part = light._live.bounced.part
    errors = []
    for towards in ([0.95, 0.3, 0.1], [-0.2, 0.25, 0.95]):
        d = (np.array([towards]) / np.linalg.norm(towards)).astype(np.float32)
        sun = StrongLights(np.array([[2, 8, 8, 1, 1]], np.int32), d, np.array([[5.0, 4.0, 3.0]]))
        D = direct.traced_radiance(sun, irradiance=True)
        first = part.first.bounce(D)
        truth = gathering.bounce(np.ascontiguousarray(D[:, None]))[:, 0]
        assert np.sqrt(((first - truth) ** 2).mean() / (truth**2).mean()) < 0.04
        assert first.mean() == pytest.approx(truth.mean(), rel=0.01)
        whole = bounced(gathering, np.ascontiguousarray(D[:, None])).indirect[:, 0]
        found = light.traced_radiance(sun, irradiance=True) - D
        errors.append(np.sqrt(((found - whole) ** 2).mean() / (whole**2).mean()))
    assert max(errors) < 0.03


def test_a_bounce_by_its_few_entries(rng):
    """Nothing dropped, it is the operator; and light that is the same everywhere is bounced exactly, whatever is."""
    scene = bowl()
    gathering = Gathering.trace(scene, LayerReceivers(scene, EnvironmentSettings()).occluders, rays=64)
    order = vertex_order(scene.positions, scene.normals)
    assert sorted(order) == list(range(len(order)))
    light = rng.random((len(order), 3)).astype(np.float32)
    left = left_shares(order, np.ones(len(order), np.float32))
    np.testing.assert_allclose(halves(light, order, left)[0], light.mean(axis=0), rtol=1e-5)
    place = np.argsort(order).astype(np.int32)
    tile, least = next(gathering.tiles()), np.float32(0)
    matrix = tile.starts, tile.columns, tile.values[0]
    for threshold, tolerance in ((1e-7, 0.006), (1e-2, None)):
        counts, sums, scales, steps, codes = thinned(matrix, (place, left), threshold)
        starts = np.concatenate([[0], np.cumsum(counts)])
        out = np.empty((len(counts), 3), np.float32)
        multiply_rows((starts, steps, codes, sums, scales), nodes_of(light * 0 + 1, order, left), least, out)
        np.testing.assert_allclose(out, np.repeat(sums[:, None], 3, axis=1), rtol=1e-5)
        if tolerance:
            multiply_rows((starts, steps, codes, sums, scales), nodes_of(light, order, left), least, out)
            full = gathering.bounce(np.ascontiguousarray((light / scene.albedo)[:, None]))[:, 0]
            np.testing.assert_allclose(out, full, rtol=0, atol=tolerance * full.max())
            rows, there = (starts, steps, codes, sums, scales), out.copy()
            multiply_rows(rows, nodes_of(-light, order, left), np.float32(-np.inf), out)
            np.testing.assert_allclose(out, -there, atol=1e-4 * full.max())  # light that is taken away


def nodes_of(light: np.ndarray, order: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Both ways of halving are one."""
    nodes, means = np.empty((len(left), 4), np.float32), np.empty((2 * len(left), 4), np.float32)
    colour_halves(light, np.ones_like(light), order, left, means, nodes)
    np.testing.assert_allclose(nodes[:, :3], halves(light, order, left), atol=1e-6)
    return nodes


def _areas(bake) -> np.ndarray:
    corners = bake.receivers.positions[bake.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    of_vertex = np.zeros(len(bake.receivers))
    np.add.at(of_vertex, bake.triangles, area[:, None])
    return of_vertex


def test_against_the_path_tracer(bake):
    """Of any number of bounces, on Mitsuba's own BSDFs; noisy, so what noise explains passes."""
    light = Relighter(bake)
    light.environment = Environment.constant((1.0, 0.8, 0.5))
    figures = Comparison(light, count=120).run(samples=2048)
    assert abs(figures["signed_mean"]) < 0.01
    assert figures["mean_difference"] < 0.015
    direct = Relighter(bake, bounced=False)
    direct.environment = light.environment
    assert (light.radiance.mean() / direct.radiance.mean()) > 1.2


@pytest.mark.parametrize(
    ("material", "at_pixels"),
    [(Material(), True), (Material("lacquer", roughness=0.6, specular=0.5), False)],
    ids=["matt pixels", "lacquered vertices"],
)
def test_under_a_fixed_eye(tmp_path, material, at_pixels):
    """What an eye sees is lit by what bounces too, through the BSDF that reflects it: all of the bowl or its bottom."""
    scene = bowl()
    if not at_pixels:
        bottom = scene.positions[scene.triangles, 1].max(axis=1) < -0.8
        scene = replace(scene, materials=(Material(), material), material_of=bottom.astype(np.int32))
    more = {"receivers": "pixels", "width": 16, "height": 16, "pixel_samples": 1} if at_pixels else {}
    bake = bake_environment(
        scene, tmp_path / "b.prelight", resolution=16, tolerance=0.05, gather_rays=RAYS, camera="above", **more
    )  # fmt: skip
    light, direct = Relighter(bake), Relighter(bake, bounced=False)
    light.environment = direct.environment = Environment.constant((1.0, 1.0, 1.0))
    bounced = light.radiance - direct.radiance
    seen = direct.radiance[:, 0] > 0.3 * direct.radiance.max()
    assert seen.sum() > 50
    if at_pixels:
        expected = COLOURS * indirect(COLOURS, 0.5)
        np.testing.assert_allclose(bounced[seen].mean(axis=0), expected, rtol=0.02)
    figures = Comparison(light, count=60).run(samples=1024)
    assert abs(figures["signed_mean"]) < 0.02
    assert figures["mean_difference"] < 0.04


# ---- in a layer --------------------------------------------------------------------------------------


def test_without_bounces_it_is_the_direct_layer(tmp_path):
    """Every chunk of it, byte for byte."""
    free = quick_bake(tmp_path / "free.prelight", bounces=0)
    full = quick_bake(tmp_path / "full.prelight")
    for key, record in free.manifest.chunks.items():
        assert full.manifest.chunks[key] == record
    more = set(full.manifest.chunks) - set(free.manifest.chunks)
    assert all("/bounced/" in key or "/origins/" in key for key in more)
    assert free.layers["environment"].parameters["bounces"] == 0


def test_a_cell_is_lit_by_what_is_in_it_and_order_is_of_receivers(tmp_path):
    """The stand-in's T, through zones, storage order, tree and bytes."""
    bake = quick_bake(tmp_path / "ball.prelight")
    light, direct = Relighter(bake, trace_strong=False), Relighter(bake, trace_strong=False, bounced=False)
    cube = np.zeros((6, 9, 9, 3), np.float32)
    cube[3, 4, 2] = (5.0, 6.0, 7.0)
    light.environment = direct.environment = Environment.from_cube(cube)
    place = bake.receivers.positions.astype(np.float64)
    x = 0.005 + 0.002 * np.stack([np.sin(place[:, 0]), np.cos(place[:, 2]), np.tanh(place[:, 1])], axis=1)
    cells = light_cells(9)
    cell = int(np.flatnonzero((cells[:, :3] == (3, 4, 2)).all(axis=1))[0])
    weights = np.array([1 + 0.2 * np.sin(cell * k) for k in (0.1, 0.2, 0.3)])
    energy = np.array([5.0, 6.0, 7.0]) * solid_angles_of(cells, 9)[cell]
    expected = (x @ weights)[:, None] * energy * np.array([1.0, 0.7, 0.4])
    np.testing.assert_allclose(light.irradiance - direct.irradiance, expected, rtol=0.01)


def test_a_bake_of_version_2_has_direct_light(tmp_path):
    """Its manifest knew no bounces."""
    bake = quick_bake(tmp_path / "free.prelight", bounces=0)
    manifest = bake.manifest
    layer = manifest.layers["environment"]
    known = {k: v for k, v in layer.parameters.items() if k != "bounces"}
    old = manifest.model_copy(
        update={"version": 2, "layers": {"environment": layer.model_copy(update={"parameters": known})}}
    )
    (bake.path / "manifest.json").write_bytes(old.to_bytes())
    light = Relighter(bake.path)
    assert not light.has_bounces
    light.environment = Environment.constant((1.0, 1.0, 1.0))
    assert light.radiance.any()
