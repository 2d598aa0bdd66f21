"""Visibility bits, transfer vectors and the clustering arithmetic against plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.encoding import sparse_tiles
from prelight.rays.mitsuba import Occluders
from prelight.transport import direct
from prelight.transport.ordering import receiver_order
from prelight.transport.transfer import DarkTransfer
from prelight.transport.visibility import Visibility

from .scenes import ball_on_floor, grid, scene_of


def unit(rng, *shape):
    d = rng.normal(size=(*shape, 3)).astype(np.float32)
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def plain_transfer(bits, d, normals):
    """T_l(x_i) = V max(d·n, 0) / π, receivers last."""
    visible = np.unpackbits(bits, axis=-1, count=len(normals), bitorder="little")
    return visible * np.maximum(d @ normals.T, 0) / np.pi


@pytest.mark.parametrize("receivers", [1, 7, 256, 300, 1000])
def test_distances_and_means_are_equations_9_to_11(receivers, rng):
    nodes, s2 = 5, 9
    normals = unit(rng, receivers)
    d = unit(rng, nodes, s2)
    d[0] = d[0, 0] + 0.01 * d[0]  # a narrow node, whose samples most receivers face together
    d[0] /= np.linalg.norm(d[0], axis=-1, keepdims=True)
    bits = rng.integers(0, 256, (nodes * s2, -(-receivers // 8)), dtype=np.uint8)
    rows = rng.permutation(nodes * s2).reshape(nodes, s2).astype(np.int32)
    rows[1, 4:] = -1
    by_axis = np.ascontiguousarray(normals.T)

    distance = np.empty((nodes, s2))
    direct.squared_distances(bits, rows, d, by_axis, distance)
    columns, scale = np.empty((nodes, receivers), np.uint8), np.empty(nodes, np.float32)
    used = (rows >= 0)[..., None]
    centre = (np.where(used, d, 0).sum(axis=1) / used.sum(axis=1) * 0.99).astype(
        np.float32
    )  # not the mean itself
    direct.quantized_means(bits, rows, d, centre, by_axis, columns, scale)

    for n in range(nodes):
        used = rows[n] >= 0
        T = np.stack(
            [plain_transfer(bits[r], v, normals) for r, v in zip(rows[n][used], d[n][used], strict=True)]
        )
        T_C = T.mean(axis=0)
        np.testing.assert_allclose(distance[n][used], ((T - T_C) ** 2).sum(axis=1), rtol=1e-4, atol=1e-9)
        assert (distance[n][~used] == 0).all()
        faces_all = (normals @ d[n][used].T > 0).all(axis=1)
        sample_mean = d[n][used].mean(axis=0)
        ratio = (normals @ centre[n]) / np.where(faces_all, normals @ sample_mean, 1)
        expected = np.where(faces_all, T_C * ratio, T_C)
        assert scale[n] == pytest.approx(expected.max() / 255, rel=1e-4, abs=1e-12)
        np.testing.assert_allclose(columns[n] * scale[n], expected, atol=scale[n] * 0.51)


def test_a_receiver_sees_what_is_not_behind_something():
    """A roof over a floor: straight up is dark exactly under it, a low sun comes in from the side."""
    roof = grid(5, size=1.0, height=0.5)
    scene = scene_of(grid(21, size=3.0), roof)
    floor = slice(0, 21 * 21)
    occluders = Occluders(scene.positions, scene.triangles)
    v = Visibility(occluders, origins=scene.positions[floor], normals=scene.normals[floor])
    low = np.float32([np.cos(0.05), np.sin(0.05), 0])
    d = np.stack([[0, 1, 0], [0, -1, 0], low]).astype(np.float32)
    bits, rays = v.trace(d)
    seen = np.unpackbits(bits, axis=1, count=21 * 21, bitorder="little").astype(bool)
    p = scene.positions[floor]
    under = (np.abs(p[:, 0]) < 0.5) & (np.abs(p[:, 2]) < 0.5)
    np.testing.assert_array_equal(seen[0], ~under)
    assert not seen[1].any()
    assert seen[2].all()
    np.testing.assert_array_equal(rays, [441, 0, 441])


def test_tiles_of_a_launch_do_not_change_what_is_seen(rng):
    scene = ball_on_floor(side=9, rings=6)
    v = Visibility(
        Occluders(scene.positions, scene.triangles), origins=scene.positions, normals=scene.normals
    )
    d = unit(rng, 40)
    whole, rays = v.trace(d)
    parts, rays_of_parts = v.trace(d, lanes=3 * v.receivers + 1)
    np.testing.assert_array_equal(whole, parts)
    np.testing.assert_array_equal(rays, rays_of_parts)


def test_a_diffuse_transfer_is_its_bits_and_cosines(rng):
    """One channel; the distances are those from `values`, whatever form rows have."""
    scene = ball_on_floor(side=9, rings=6)
    transfer = direct.DiffuseTransfer(
        Occluders(scene.positions, scene.triangles), scene.positions, scene.normals
    )
    d = unit(rng, 2, 9)
    rows, rays = transfer.trace(d.reshape(-1, 3), lanes=1 << 16)
    assert (transfer.channels, rows.nbytes) == (1, 18 * transfer.row_bytes)
    np.testing.assert_array_equal(rays, (d.reshape(-1, 3) @ scene.normals.T > 0).sum(axis=1))
    T = transfer.values(rows, d.reshape(-1, 3)).reshape(2, 9, -1)
    np.testing.assert_allclose(
        T.reshape(18, -1), plain_transfer(rows, d.reshape(-1, 3), scene.normals), atol=1e-6
    )
    sample = np.arange(18, dtype=np.int32).reshape(2, 9)
    expected = ((T - T.mean(axis=1, keepdims=True)) ** 2).sum(axis=2)
    np.testing.assert_allclose(transfer.squared_distances(rows, sample, d), expected, rtol=1e-4)
    columns, scale = transfer.quantized_means(rows, sample, d, d.mean(axis=1))
    assert (columns.shape, scale.shape) == ((2, 1, len(scene.positions)), (2, 1))
    np.testing.assert_allclose(columns[:, 0] * scale, T.mean(axis=1), atol=float(scale.max()) * 0.51)


def test_in_the_dark_there_is_nothing_to_trace(rng):
    dark, d = DarkTransfer(5, 3), unit(rng, 2, 4)
    rows, rays = dark.trace(d[0], lanes=1)
    sample = np.arange(8, dtype=np.int32).reshape(2, 4)
    assert not rays.any()
    assert rows.nbytes == 4 * dark.row_bytes
    assert not dark.squared_distances(rows, sample, d).any()
    columns, scale = dark.quantized_means(rows, sample, d, d[:, 0])
    assert (columns.shape, scale.shape) == ((2, 3, 5), (2, 3))
    assert not columns.any()
    assert not scale.any()
    assert dark.values(rows, d[0]).shape == (4, 3, 5)


def test_a_second_launch_of_another_size_compiles_nothing(rng):
    import drjit as dr

    scene = ball_on_floor(side=9, rings=6)
    v = Visibility(
        Occluders(scene.positions, scene.triangles), origins=scene.positions, normals=scene.normals
    )
    v.trace(unit(rng, 8))
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        v.trace(unit(rng, 31))
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert kernels
    assert all(kernel["cache_hit"] for kernel in kernels)


def test_order_is_a_permutation_with_unlit_receivers_first():
    scene = ball_on_floor()
    normals = scene.normals.copy()
    normals[::7] = 0
    order = receiver_order(scene.positions, normals)
    np.testing.assert_array_equal(np.sort(order), np.arange(len(normals)))
    dark = ~normals[order].any(axis=1)
    assert dark[: dark.sum()].all()


@pytest.mark.parametrize(("clusters", "receivers"), [(256, 64), (256, 33), (17, 100), (1, 1)])
def test_tiles_give_back_every_byte(clusters, receivers, rng):
    columns = rng.integers(0, 256, (clusters, receivers), dtype=np.uint8)
    columns[:, receivers // 2 :] *= rng.integers(0, 2, (clusters, 1), dtype=np.uint8)
    columns[: clusters // 2] *= columns[: clusters // 2] > 250
    columns[16:32, :32] = 0
    columns[32:48, :32] = 0
    columns[40:41, 5:6] = 1  # the least that is not zero keeps its tile
    tiles, present = sparse_tiles.encode_panel(columns)
    np.testing.assert_array_equal(sparse_tiles.decode_panel(tiles, present)[:clusters, :receivers], columns)
    assert tiles.any(axis=(1, 2)).all(), "a tile of zeros was stored"
