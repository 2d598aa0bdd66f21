"""Relighting layers of random transfer: kernels against plain products, edits against full, no drift."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.camera import Camera
from prelight.encoding.sparse_tiles import PANEL
from prelight.errors import InputError
from prelight.lighting.disc import Disc, add_discs
from prelight.lighting.environment import Environment
from prelight.relighting.environment import Update
from prelight.relighting.layer import EnvironmentLayer
from prelight.relighting.pace import Pace
from prelight.relighting.relighter import Relighter

from .scenes import ball_on_floor
from .zoned_bake import (
    CHANNELS,
    EYE,
    LAYER,
    PICTURE,
    R,
    Sample,
    assert_like,
    discs_at,
    hdr,
    make_sample,
    random_zone,
    random_zones,
    write_bake,
)


@pytest.fixture(scope="module", params=CHANNELS)
def sample(request, tmp_path_factory) -> Sample:
    return make_sample(tmp_path_factory.mktemp("bake"), request.param)


@pytest.fixture(scope="module")
def several(tmp_path_factory) -> Sample:
    return make_sample(tmp_path_factory.mktemp("bake"), "several")


def test_full_is_the_product_of_the_bytes(sample, rng):
    live, cube = sample.relighter(), hdr(rng)
    assert live.set_cube(cube).kind == "full"
    assert len(sample.zones[0].leaves) > PANEL, "too few clusters to cross a panel"
    assert_like(live.radiance, sample.plainly(cube), within=2e-6)


def test_edits_agree_with_a_fresh_relight(sample, rng):
    live, cube = sample.relighter(), hdr(rng)
    live.set_cube(cube)
    kinds = set()
    for _ in range(50):
        face, i, j = int(rng.integers(6)), *rng.integers(0, R - 2, 2)
        kinds.add(live.edit(face, slice(i, i + 2), slice(j, j + 2), rng.random((2, 2, 3)) * 30).kind)
        cube[face, i : i + 2, j : j + 2] = live.cube[face, i : i + 2, j : j + 2]
    assert kinds == {"local"}
    assert_like(live.radiance, sample.plainly(cube))
    assert live.edit(0, slice(0, 1), slice(0, 1), live.cube[0, :1, :1]).kind == "none"


def test_many_parcels(tmp_path, rng):
    """A zone so large that each panel is a parcel, beside a small one."""
    rows = 9000
    zones = [
        random_zone(rng, part.astype(np.int32), channels=1, resolution=R, splits=0.85)
        for part in np.split(rng.permutation(rows), [rows - 40])
    ]
    bake = write_bake(tmp_path, zones, resolution=R, rows=rows)
    assert bake.array(f"{LAYER}/zones")[0, 3] > 1
    made = Sample(bake, zones, EnvironmentLayer(bake), rows)
    live, cube = made.relighter(), hdr(rng)
    live.set_cube(cube)
    cube[3, 2:4, 5:9] = 7.0
    assert live.edit(3, slice(2, 4), slice(5, 9), [7.0, 7.0, 7.0]).kind == "local"
    assert_like(live.radiance, made.plainly(cube))


def test_one_thread_or_all_give_the_same_bits(sample, rng, monkeypatch):
    changes = [(int(rng.integers(6)), *(int(x) for x in rng.integers(0, R - 4, 2))) for _ in range(10)]
    start, radiances = hdr(rng), []
    for threads in (1, numba.config.NUMBA_NUM_THREADS):
        monkeypatch.setattr(numba, "get_num_threads", lambda n=threads: n)
        monkeypatch.setattr(Pace, "_run", lambda pace, some, threads, arguments: pace._kernel(*arguments))
        live = sample.relighter()
        assert len(live._shares) == threads + 1
        live.set_cube(start)
        for face, i, j in changes:
            assert live.edit(face, slice(i, i + 4), slice(j, j + 4), [i, j, face]).kind == "local"
        live.set_discs([Disc.at(30, 20, radius_deg=9, radiance=(3, 2, 1), softness=0.5)])
        live.set_discs([Disc.at(33, 20, radius_deg=9, radiance=(3, 2, 1), softness=0.5)])
        radiances.append(live.radiance)
    if len(radiances) > 1:
        np.testing.assert_array_equal(*radiances)


def test_threads_share_the_bytes(several):
    for threads in (1, 2, 3, 5, 64):
        shares = several.layer.even_shares(threads)
        assert len(shares) == threads + 1
        assert (shares[0], shares[-1]) == (0, several.layer.groups)
        assert (np.diff(shares) >= 0).all()
    size = np.zeros(several.layer.groups)
    g = 0
    for zone in several.zones:
        tiles = np.add.reduceat(zone.columns.any(axis=1), np.arange(0, len(zone.rows), 32), axis=1).astype(
            bool
        )
        here = tiles.shape[1]
        size[g : g + here] = np.add.reduceat(tiles, np.arange(0, len(tiles), 16)).astype(bool).sum(axis=0)
        g += here
    first, _ = np.split(size, [several.layer.even_shares(2)[1]])
    assert abs(first.sum() / size.sum() - 0.5) < 2 / len(size)


def test_a_local_edit_reads_only_what_it_changes(several, rng):
    live = several.relighter()
    live.set_cube(hdr(rng))
    update = live.edit(2, slice(3, 4), slice(3, 4), [9.0, 9.0, 9.0])
    assert (update.kind, update.clusters) == ("local", len(several.zones))
    channels = sum(zone.columns.shape[1] * -(-len(zone.rows) // 32) * 32 for zone in several.zones)
    assert 0 < update.bytes_read <= channels


def test_lights_off_is_exactly_zero(sample, rng):
    live = sample.relighter()
    live.set_cube(hdr(rng))
    live.set_discs([Disc.at(50, 10, radius_deg=20, radiance=(9, 9, 9))])
    for face in range(6):
        live.edit(face, slice(0, R), slice(0, R), [0.0, 0.0, 0.0])
    assert live.radiance.any()
    live.set_discs([])
    assert not live.radiance.any()


def test_light_superposes(sample, rng):
    a, b = hdr(rng), hdr(rng)
    one, two, both = (sample.relighter() for _ in range(3))
    one.set_cube(a)
    two.set_cube(b)
    both.set_cube(a + b)
    assert_like(one.radiance + two.radiance, both.radiance, within=2e-6)


def test_long_editing_and_dimming_does_not_drift(several, rng):
    """Intensities over seven decades, then all lights at a thousandth (reliability R1, shortened)."""
    live = several.relighter()
    cube = np.zeros((6, R, R, 3), np.float32)
    live.set_cube(cube)
    texels = rng.integers(0, [6, R, R], (64, 3))
    for step in range(20_000):
        face, i, j = (int(x) for x in texels[step % 64])
        value = np.float32(10 ** rng.uniform(-3.5, 3.5))
        live.edit(face, slice(i, i + 1), slice(j, j + 1), [value] * 3)
        cube[face, i, j] = value
    expected = several.plainly(cube)
    assert np.linalg.norm(live.radiance - expected) / np.linalg.norm(expected) < 1e-6
    for face, i, j in np.unique(texels, axis=0).tolist():
        live.edit(face, slice(i, i + 1), slice(j, j + 1), cube[face, i, j] * np.float32(1e-3))
        expected = several.plainly(live.cube)
        assert np.linalg.norm(live.radiance - expected) / np.linalg.norm(expected) < 1e-6
    assert (live.radiance >= 0).all()


def test_pace_settles_on_what_is_faster(monkeypatch):
    """Whichever way round, with few trials of the slower one."""
    for slow in (1, 4):
        now, used = [0.0], []

        def kernel(now=now, used=used, slow=slow):
            used.append(numba.get_num_threads())
            now[0] += 8.0 if used[-1] == slow else 1.0

        threads = [4]
        monkeypatch.setattr(numba, "get_num_threads", lambda threads=threads: threads[0])
        monkeypatch.setattr(numba, "set_num_threads", lambda n, threads=threads: threads.__setitem__(0, n))
        monkeypatch.setattr("time.perf_counter", lambda now=now: now[0])
        pace = Pace(kernel)
        for _ in range(1000):
            pace(10_000_000)
        assert used.count(slow) < 15
        assert threads == [4]
        used.clear()
        pace(1000)
        assert used == [1], "small ones are not worth a second thread"


def test_the_public_face(tmp_path):
    """From a bake as it is made."""
    scene = ball_on_floor(side=9, rings=6)
    bake = bake_environment(scene, tmp_path / "ball.prelight", resolution=8, bounces=0)
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
    with pytest.raises(InputError, match="layers are environment"):
        Relighter(bake, layer="portals")


def test_a_disc_does_not_sample_the_map_again(several, monkeypatch):
    light = Relighter(several.bake, trace_strong=False)
    sky = Environment.constant((1.0, 0.5, 0.25))
    light.environment = sky
    light.edit(2, slice(0, 3), slice(0, 3), [9.0, 0.0, 0.0])
    painted, plain = light._live.cube.copy(), sky.cube(R)
    with monkeypatch.context() as patch:
        patch.setattr(Environment, "cube", lambda *_: pytest.fail("the map was sampled again"))
        for step in range(5):
            light.environment = sky.with_discs(discs_at(step, step))
            assert light.last.kind == "local"
    add_discs(painted, discs_at(4, 4))
    assert_like(light.radiance, several.plainly(painted))
    light.environment = light.environment  # nothing but the edit differs: it goes
    add_discs(plain, discs_at(4, 4))
    assert_like(light.radiance, several.plainly(plain))
    light.environment = sky.rotated(90).with_discs(discs_at(1, 2))
    assert light.last.kind in ("full", "local")
    many = [Disc.at(k, 0, radius_deg=2, radiance=(1, 1, 1)) for k in range(40)]
    for discs in (many, many[:3], many):
        light.environment = sky.with_discs(discs)
        assert_like(light.radiance, several.plainly(sky.with_discs(discs).cube(R)))


def test_pixels_are_the_picture(tmp_path, rng):
    width, height = PICTURE
    zones = random_zones(rng, width * height, (3, 3), resolution=R)
    bake = write_bake(tmp_path, zones, resolution=R, rows=width * height, picture=PICTURE)
    light = Relighter(bake, trace_strong=False)
    assert light.picture_size == PICTURE
    light.environment = Environment.constant((1.0, 0.5, 0.25))
    picture = light.picture(background=None)
    np.testing.assert_array_equal(picture.linear, light.radiance.reshape(height, width, 3))
    behind = light.picture().linear - picture.linear
    assert 0 < picture.coverage.mean() < 1
    np.testing.assert_allclose(behind[..., 0], 1 - picture.coverage, atol=1e-6)
    assert light.camera() == EYE
    light.picture(EYE, width=width, height=height)
    for wrong in (
        {"width": width + 1, "height": height},
        {"camera": Camera((0, 5, 5), (0, 0, 0))},
        {"width": 64},
    ):
        with pytest.raises(InputError):
            light.picture(**wrong)


def test_a_fixed_eye_is_the_camera(several):
    light = Relighter(several.bake, trace_strong=False)
    assert light.camera() == EYE
    other = Camera((0, 5, 5), (0, 0, 0))
    assert light.camera(other) == other
    assert light.picture(other, width=32, height=18).linear.shape == (18, 32, 3)


def test_updates_add_up():
    a, b = Update("local", 1.0, 2, 3), Update("full", 4.0, 5, 6)
    assert a.after(b) == b.after(a) == Update("full", 5.0, 7, 9)
    assert a.after(Update("none", 0.0, 0, 0)).kind == "local"
