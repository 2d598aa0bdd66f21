"""Relighting a real small bake: kernels against plain products, edits against full, no drift."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.bases.cube_map import solid_angles
from prelight.encoding.sparse_tiles import PANEL, decode_panel
from prelight.errors import InputError
from prelight.lighting.environment import Environment
from prelight.relighting.environment import EnvironmentLayer, EnvironmentRelighter
from prelight.relighting.relighter import Relighter
from prelight.relighting.tile_kernels import relight_local, relight_local_alone
from prelight.storage.bake import Bake

from .scenes import ball_on_floor

R = 16


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Bake:
    return bake_environment(ball_on_floor(), tmp_path_factory.mktemp("bake") / "ball.prelight", resolution=R)


@pytest.fixture(scope="module")
def layer(bake) -> EnvironmentLayer:
    return EnvironmentLayer(bake)


def relighter(bake, layer) -> EnvironmentRelighter:
    return EnvironmentRelighter(layer, bake.receivers.albedo)


def hdr(rng) -> np.ndarray:
    return (rng.random((6, R, R, 3)) ** 6 * 50).astype(np.float32)


def plainly(bake, layer, cube) -> np.ndarray:
    """Eq. 8 in float64, from the decoded bytes."""
    omega = solid_angles(R).astype(np.float64)[..., None]
    light = np.array(
        [
            (cube[f, i : i + h, j : j + w] * omega[i : i + h, j : j + w]).sum(axis=(0, 1))
            for f, i, j, h, w in layer.rectangles
        ]
    )
    T = np.concatenate([decode_panel(t, p) for t, p in zip(layer.tiles, layer.present, strict=True)])
    assert len(layer.present) * PANEL == len(T)
    B = (T[: len(light)] * layer.scales[:, None].astype(np.float64)).T @ light
    radiance = np.empty((len(layer.order), 3))
    radiance[layer.order] = B[: len(layer.order)]
    return radiance * bake.receivers.albedo


def test_full_is_the_product_of_the_bytes(bake, layer, rng):
    live, cube = relighter(bake, layer), hdr(rng)
    assert live.set_cube(cube).kind == "full"
    expected = plainly(bake, layer, cube)
    assert len(layer.scales) > PANEL, "the scene is too simple to cross a panel"
    np.testing.assert_allclose(live.radiance, expected, atol=2e-6 * expected.max())


def test_edits_agree_with_a_fresh_relight(bake, layer, rng):
    live, cube = relighter(bake, layer), hdr(rng)
    live.set_cube(cube)
    kinds = set()
    for _ in range(50):
        face, i, j = int(rng.integers(6)), *rng.integers(0, R - 2, 2)
        kinds.add(live.edit(face, slice(i, i + 2), slice(j, j + 2), rng.random((2, 2, 3)) * 30).kind)
        cube[face, i : i + 2, j : j + 2] = live.cube[face, i : i + 2, j : j + 2]
    assert kinds == {"local"}
    expected = plainly(bake, layer, cube)
    np.testing.assert_allclose(live.radiance, expected, atol=2e-6 * expected.max())
    assert live.edit(0, slice(0, 1), slice(0, 1), live.cube[0, :1, :1]).kind == "none"


def test_one_thread_or_all_give_the_same_bits(bake, layer, rng):
    changes = [(int(rng.integers(6)), *(int(x) for x in rng.integers(0, R - 4, 2))) for _ in range(20)]
    start, radiances = hdr(rng), []
    for slow, fast in ((relight_local, relight_local_alone), (relight_local_alone, relight_local)):
        live = relighter(bake, layer)
        live.set_cube(start)
        live._pace._seconds = {slow: 1e9, fast: 1e-9}
        for face, i, j in changes:
            assert live.edit(face, slice(i, i + 4), slice(j, j + 4), [i, j, face]).kind == "local"
        radiances.append(live.radiance)
    np.testing.assert_array_equal(*radiances)


def test_a_local_edit_reads_only_what_it_changes(bake, layer, rng):
    live = relighter(bake, layer)
    live.set_cube(hdr(rng))
    update = live.edit(2, slice(3, 4), slice(3, 4), [9.0, 9.0, 9.0])
    assert (update.kind, update.clusters) == ("local", 1)
    assert 0 < update.bytes_read <= -(-len(bake.receivers) // 32) * 32


def test_long_editing_and_dimming_does_not_drift(bake, layer, rng):
    """Intensities over seven decades, then all lights at a thousandth (reliability R1, shortened)."""
    live = relighter(bake, layer)
    cube = np.zeros((6, R, R, 3), np.float32)
    live.set_cube(cube)
    texels = rng.integers(0, [6, R, R], (64, 3))
    for step in range(20_000):
        face, i, j = (int(x) for x in texels[step % 64])
        value = np.float32(10 ** rng.uniform(-3.5, 3.5))
        live.edit(face, slice(i, i + 1), slice(j, j + 1), [value] * 3)
        cube[face, i, j] = value
    expected = plainly(bake, layer, cube)
    error = np.linalg.norm(live.radiance - expected) / np.linalg.norm(expected)
    assert error < 1e-6
    for face, i, j in texels.tolist():
        live.edit(face, slice(i, i + 1), slice(j, j + 1), cube[face, i, j] * np.float32(1e-3))
        cube[face, i, j] *= np.float32(1e-3)
        if not cube[face, i, j].any():
            break
    expected = plainly(bake, layer, live.cube)
    assert np.linalg.norm(live.radiance - expected) / np.linalg.norm(expected) < 1e-6
    assert (live.radiance >= 0).all()


def test_lights_off_is_exactly_zero(bake, layer, rng):
    live = relighter(bake, layer)
    live.set_cube(hdr(rng))
    for face in range(6):
        live.edit(face, slice(0, R), slice(0, R), [0.0, 0.0, 0.0])
    assert not live.radiance.any()


def test_light_superposes(bake, layer, rng):
    a, b = hdr(rng), hdr(rng)
    one, two, both = (relighter(bake, layer) for _ in range(3))
    one.set_cube(a)
    two.set_cube(b)
    both.set_cube(a + b)
    np.testing.assert_allclose(one.radiance + two.radiance, both.radiance, atol=2e-6 * both.radiance.max())


def test_radiance_is_a_copy_and_bad_edits_change_nothing(bake, layer, rng):
    live = relighter(bake, layer)
    live.set_cube(hdr(rng))
    before = live.radiance
    live.radiance[...] = 7
    bad = [
        (0, slice(0, 1), slice(0, 1), [np.nan, 0, 0]),
        (0, slice(0, 1), slice(0, 1), [-1.0, 0, 0]),
        (0, slice(0, 1), slice(0, 1), [np.inf, 0, 0]),
        (0, slice(0, 1), slice(0, 1), [1.0, 2.0]),
        (6, slice(0, 1), slice(0, 1), [1.0, 1, 1]),
        (0, slice(0, R + 1), slice(0, 1), [1.0, 1, 1]),
        (0, slice(-1, 1), slice(0, 1), [1.0, 1, 1]),
        (0, slice(3, 3), slice(0, 1), [1.0, 1, 1]),
        (0, slice(0, 4, 2), slice(0, 1), [1.0, 1, 1]),
        (0, slice(0, 2), slice(0, 2), np.ones((2, 3, 3))),
    ]
    for arguments in bad:
        with pytest.raises(InputError):
            live.edit(*arguments)
    with pytest.raises(InputError):
        live.set_cube(np.zeros((6, R, R + 1, 3), np.float32))
    live.refresh()
    np.testing.assert_array_equal(live.radiance, before)


def test_the_public_face(bake):
    light = Relighter(bake.path)
    light.environment = Environment.constant((1.0, 0.5, 0.25))
    assert light.radiance.shape == (len(bake.receivers), 3)
    np.testing.assert_allclose(light.radiance[:, 1], light.radiance[:, 0] / 2, rtol=1e-5)
    turned = light.radiance
    light.environment = light.environment.rotated(30)
    np.testing.assert_allclose(light.radiance, turned, rtol=1e-4, atol=1e-5)
    picture = light.picture(width=64, height=36)
    assert picture.linear.shape == (36, 64, 3)
    with pytest.raises(InputError, match="camera"):
        light.camera("nowhere")
    with pytest.raises(InputError):
        light.environment = "sky.hdr"
