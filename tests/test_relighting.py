"""Relighting layers of random transfer: kernels against plain products, edits against full, no drift."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.bases.cube_map import solid_angles
from prelight.camera import Camera
from prelight.encoding.sparse_tiles import PANEL
from prelight.errors import DamagedBakeError, InputError
from prelight.lighting.disc import Disc, add_discs
from prelight.lighting.environment import Environment
from prelight.relighting.environment import EnvironmentRelighter, Update
from prelight.relighting.layer import EnvironmentLayer
from prelight.relighting.light_tree import LightTree
from prelight.relighting.pace import Pace
from prelight.relighting.relighter import Relighter
from prelight.storage.bake import Bake

from .scenes import ball_on_floor
from .zoned_bake import EYE, LAYER, RandomZone, plainly, random_leaves, random_zone, random_zones, write_bake

R, ROWS = 13, 331  # odd, so that nodes split unevenly; eleven groups, the last not full
PICTURE = (20, 12)


@dataclass(frozen=True)
class Sample:
    """A bake, what is in it, and its layer opened."""

    bake: Bake
    zones: list[RandomZone]
    layer: EnvironmentLayer
    rows: int = ROWS

    def relighter(self) -> EnvironmentRelighter:
        albedo = None if self.layer.picture_size else self.bake.receivers.albedo
        return EnvironmentRelighter(self.layer, albedo)

    def plainly(self, cube: np.ndarray) -> np.ndarray:
        return plainly(self.bake, self.zones, cube, rows=self.rows)


ZONES = {"one": (1,), "viewed": (3,), "several": (1, 3, 1, 1, 3, 1)}


@pytest.fixture(scope="module", params=[*ZONES, "pixels"])
def sample(request, tmp_path_factory) -> Sample:
    rng = np.random.default_rng(7)
    picture = PICTURE if request.param == "pixels" else None
    rows = math.prod(PICTURE) if picture else ROWS
    zones = random_zones(rng, rows, ZONES.get(request.param, (3, 3)), resolution=R)
    folder = tmp_path_factory.mktemp("bake")
    bake = write_bake(folder, zones, resolution=R, rows=rows, picture=picture)
    return Sample(bake, zones, EnvironmentLayer(bake), rows)


@pytest.fixture(scope="module")
def several(tmp_path_factory) -> Sample:
    zones = random_zones(np.random.default_rng(8), ROWS, ZONES["several"], resolution=R)
    bake = write_bake(tmp_path_factory.mktemp("bake"), zones, resolution=R, rows=ROWS)
    return Sample(bake, zones, EnvironmentLayer(bake))


def hdr(rng) -> np.ndarray:
    return (rng.random((6, R, R, 3)) ** 6 * 50).astype(np.float32)


def assert_like(found: np.ndarray, expected: np.ndarray, *, within: float = 1e-6) -> None:
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(found, expected, rtol=0, atol=within * expected.max())


# ---- Full and local ---------------------------------------------------------------------------------------


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


# ---- The light of clusters --------------------------------------------------------------------------------


def test_every_zone_has_its_own_light_from_one_pass(several, rng):
    tree, cube = LightTree(several.layer), hdr(rng)
    changed, change = tree.light_all(cube)
    assert len(changed) == len(tree)
    np.testing.assert_array_equal(change, tree.light)
    omega = solid_angles(R)[..., None].astype(np.float64)
    for (face, i, j, h, w), light in zip(tree.nodes, tree.light, strict=True):
        part = (slice(i, i + h), slice(j, j + w))
        np.testing.assert_allclose(light, (cube[face][part] * omega[part]).sum(axis=(0, 1)), rtol=1e-7)
    assert tree.total() == pytest.approx(float((cube * omega).sum()))
    assert len(np.unique(tree.nodes, axis=0)) == len(tree)
    every = np.concatenate([zone.leaves for zone in several.zones])
    np.testing.assert_array_equal(np.unique(every, axis=0), np.unique(tree.nodes, axis=0))
    again, _ = tree.light_all(cube)
    assert not len(again)


def test_light_found_again_is_the_same_to_the_last_bit(several, rng):
    tree, fresh, cube = LightTree(several.layer), LightTree(several.layer), hdr(rng)
    tree.light_all(cube)
    cube[4, 3:9, 2:11] = rng.random((6, 9, 3))
    changed, _ = tree.light_part(cube, 4, (3, 2, 9, 11))
    f, i, j, h, w = tree.nodes.T
    there = (f == 4) & (i < 9) & (i + h > 3) & (j < 11) & (j + w > 2)
    np.testing.assert_array_equal(changed, np.flatnonzero(there))
    fresh.light_all(cube)
    np.testing.assert_array_equal(tree.light, fresh.light)


@pytest.mark.parametrize("resolution", [1, 2, 5, 64])
def test_trees_of_any_resolution(tmp_path, rng, resolution):
    zones = [
        random_zone(rng, part.astype(np.int32), channels=1, resolution=resolution, splits=splits)
        for part, splits in zip(np.split(np.arange(90), 3), (0.2, 0.7, 0.5), strict=True)
    ]
    bake = write_bake(tmp_path, zones, resolution=resolution, rows=90)
    live = EnvironmentRelighter(EnvironmentLayer(bake), bake.receivers.albedo)
    cube = rng.random((6, resolution, resolution, 3), np.float32)
    live.set_cube(cube)
    assert_like(live.radiance, plainly(bake, zones, cube, rows=90))


# ---- Discs ------------------------------------------------------------------------------------------------


def discs_at(step: float, brightness: float) -> list[Disc]:
    return [
        Disc.at(10 + step, 5, radius_deg=11, radiance=(brightness, 0.5, 0), softness=0.4),
        Disc.at(93 + 2 * step, -60, radius_deg=25, radiance=(0, brightness, 2)),
        Disc.at(-100, 40 + step, radius_deg=0.5, radiance=(90, 80, 60 * brightness), softness=1.0),
        Disc.at(180, 0, radius_deg=80, radiance=(0.1, 0.1, 0.3), softness=0.7),
    ]


def test_discs_are_what_they_add_to_the_texels(sample, rng):
    """Added, brightened, moved, taken away: always as if they were painted on the cube."""
    live, cube = sample.relighter(), hdr(rng)
    live.set_cube(cube)
    states = [discs_at(0, 1), discs_at(0, 4), discs_at(7, 4), discs_at(8, 2)[1:], [], discs_at(3, 1)[::-1]]
    for discs in states:
        assert live.set_discs(discs).kind == "local"
        painted = cube.copy()
        add_discs(painted, discs)
        assert_like(live.radiance, sample.plainly(painted))
    assert live.set_discs(states[-1]).kind == "none"
    before = live.radiance
    live.refresh()
    assert_like(live.radiance, before)
    live.edit(1, slice(0, 5), slice(0, 5), [3.0, 2.0, 1.0])
    painted[1, :5, :5] += [3.0, 2.0, 1.0] - cube[1, :5, :5]
    assert_like(live.radiance, sample.plainly(painted))


def test_brightening_a_disc_reads_no_transfer(several):
    live = several.relighter()
    live.set_discs([Disc.at(10, 5, radius_deg=11, radiance=(1, 1, 1))])
    one = live.radiance
    update = live.set_discs([Disc.at(10, 5, radius_deg=11, radiance=(3, 3, 3))])
    assert (update.kind, update.bytes_read) == ("local", 0)
    np.testing.assert_allclose(live.radiance, 3 * one, rtol=1e-6)
    assert live.set_discs([Disc.at(12, 5, radius_deg=11, radiance=(3, 3, 3))]).bytes_read > 0


def test_discs_come_and_go_without_a_trace(several, rng):
    live, cube = several.relighter(), hdr(rng) * np.float32(1e-3)
    live.set_cube(cube)
    for step in range(200):
        live.set_discs(discs_at(step / 5, float(10 ** rng.uniform(-3, 3))))
    live.set_discs([])
    assert_like(live.radiance, several.plainly(cube))


@pytest.mark.parametrize("softness", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("radius_deg", [0.01, 3.0, 40.0, 90.0])
def test_discs_weigh_nodes_as_they_cover_texels(tmp_path, radius_deg, softness):
    """By integrals around the nodes, without looking at texels; over all of them, the solid angle."""
    rng, resolution = np.random.default_rng(3), 37
    zones = [
        random_zone(rng, np.arange(32, dtype=np.int32) + 32 * z, channels=1, resolution=resolution, splits=s)
        for z, s in enumerate((0.8, 0.4))
    ]
    tree = LightTree(EnvironmentLayer(write_bake(tmp_path, zones, resolution=resolution, rows=64)))
    omega = solid_angles(resolution).astype(np.float64)
    for direction in [(1, 1, 1), (0.1, -1, 0.02), (0, 0, 1), (-1, 0.999, 0.2), *rng.standard_normal((4, 3))]:
        disc = Disc(tuple(direction), radius_deg, (1, 1, 1), softness).region
        share = np.zeros((6, resolution, resolution))
        for face, rows, columns, part in disc.cover(resolution):
            share[face, rows, columns] = part
        nodes, weights = tree.weights_of(disc)
        found = np.zeros(len(tree))
        found[nodes] = weights[:, 0]
        expected = [
            (share[f, i : i + h, j : j + w] * omega[i : i + h, j : j + w]).sum()
            for f, i, j, h, w in tree.nodes
        ]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * disc.solid_angle)
        assert tree.total(nodes, weights) == pytest.approx(3 * disc.solid_angle, rel=1e-6)
        assert (np.diff(nodes) > 0).all()


# ---- Bad input and forged layers --------------------------------------------------------------------------


def test_radiance_is_a_copy_and_bad_edits_change_nothing(several, rng):
    live = several.relighter()
    live.set_cube(hdr(rng))
    before = live.radiance
    live.radiance[...] = 7
    bad = [
        (0, slice(0, 1), slice(0, 1), [np.nan, 0, 0]),
        (0, slice(0, 1), slice(0, 1), [-1.0, 0, 0]),
        (0, slice(0, 1), slice(0, 1), [np.inf, 0, 0]),
        (0, slice(0, 1), slice(0, 1), [1.0, 2.0]),
        (0, slice(0, 1), slice(0, 1), 1.0),
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
    for wrong in (np.nan, -1.0, np.inf):
        cube = hdr(rng)
        cube[5, 3, 2, 1] = wrong
        with pytest.raises(InputError):
            live.set_cube(cube)
    with pytest.raises(InputError):
        live.set_cube(np.zeros((6, R, R + 1, 3), np.float32))
    with pytest.raises(InputError):
        live.set_discs([Disc.at(k, 0, radius_deg=1, radiance=(1, 1, 1)) for k in range(33)])
    live.refresh()
    np.testing.assert_array_equal(live.radiance, before)
    minus_zero = np.full((6, R, R, 3), -0.0, np.float32)
    live.set_cube(minus_zero)
    assert not live.radiance.any()


def _changed(zones: np.ndarray, where: tuple[int, int], value: int) -> np.ndarray:
    zones = zones.copy()
    zones[where] = value
    return zones


FORGED_ZONES = {
    "a group more": lambda v: _changed(v, (0, 0), v[0, 0] + 1),
    "no group": lambda v: _changed(v, (0, 0), 0),
    "groups negative": lambda v: _changed(v, (1, 0), -1),
    "groups huge": lambda v: _changed(v, (1, 0), 2**31 - 1),
    "a group moved": lambda v: v + np.array([[1, 0, 0, 0], [-1, 0, 0, 0], *[[0] * 4] * 4], np.int32),
    "two channels": lambda v: _changed(v, (0, 1), 2),
    "no channels": lambda v: _changed(v, (0, 1), 0),
    "channels negative": lambda v: _changed(v, (0, 1), -1),
    "three channels of one": lambda v: _changed(v, (0, 1), 3),
    "one channel of three": lambda v: _changed(v, (1, 1), 1),
    "a cluster more": lambda v: _changed(v, (0, 2), v[0, 2] + 1),
    "a cluster less": lambda v: _changed(v, (0, 2), v[0, 2] - 1),
    "clusters huge": lambda v: _changed(v, (2, 2), 2**31 - 1),
    "no clusters": lambda v: _changed(v, (2, 2), 0),
    "clusters negative": lambda v: _changed(v, (2, 2), -(2**31)),
    "a parcel more": lambda v: _changed(v, (0, 3), 2),
    "no parcel": lambda v: _changed(v, (0, 3), 0),
    "parcels huge": lambda v: _changed(v, (5, 3), 2**31 - 1),
    "a zone less": lambda v: v[:-1],
    "a zone more": lambda v: np.concatenate([v, v[-1:]]),
    "zones exchanged": lambda v: v[[1, 0, 2, 3, 4, 5]],
    "zones all alike": lambda v: np.repeat(v[:1], 6, axis=0),
    "of three numbers": lambda v: v[:, :3],
    "of floats": lambda v: v.astype(np.float32),
}


def _forge(several: Sample, folder: Path, name: str, values: np.ndarray) -> Bake:
    """The same bake with other values in one array, all hashes right."""
    from .disk import copy
    from .test_forged_bakes import replace_array

    path = copy(several.bake.path, folder / "forged.prelight")
    replace_array(path, name, np.ascontiguousarray(values))
    return Bake.open(path)


@pytest.mark.parametrize("forgery", FORGED_ZONES)
def test_forged_zones(several, tmp_path, forgery):
    zones = FORGED_ZONES[forgery](several.bake.array(f"{LAYER}/zones"))
    with pytest.raises(DamagedBakeError) as refused:
        EnvironmentLayer(_forge(several, tmp_path, f"{LAYER}/zones", zones))
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize("value", ["twice", "missing", -2, ROWS, 2**31 - 1])
def test_rows_occur_once(several, tmp_path, value):
    order = several.bake.array(f"{LAYER}/order").copy()
    order[3] = {"twice": order[4], "missing": -1}.get(value, value)
    with pytest.raises(DamagedBakeError, match="order"):
        EnvironmentLayer(_forge(several, tmp_path, f"{LAYER}/order", order))


@pytest.mark.parametrize("zone", [1, 5])
def test_rectangles_of_every_zone_are_a_tree(several, tmp_path, zone):
    """Leaves exchanged, moved, left out, outside: found whichever zone they are in."""
    name = f"{LAYER}/rectangles/{zone:05d}"
    good = several.bake.array(name)
    outside = good.copy()
    outside[-1, 1] += R
    for wrong in (
        good[::-1],
        np.roll(good, 1, axis=0),
        good[[1, 0, *range(2, len(good))]],
        outside,
        0 * good,
    ):
        with pytest.raises(DamagedBakeError, match=f"zone {zone}"):
            EnvironmentLayer(_forge(several, tmp_path, name, wrong))


def test_whole_trees_are_not_refused(tmp_path, rng):
    for k, splits in enumerate((0.0, 0.3, 0.9, 1.0)):
        for resolution in (1, 2, 3, 8, 11):
            rows = np.arange(3, dtype=np.int32)
            zone = random_zone(rng, rows, channels=1, resolution=resolution, splits=splits)
            folder = tmp_path / f"{k} {resolution}.prelight"
            EnvironmentLayer(write_bake(folder, [zone], resolution=resolution, rows=3))
    assert len(random_leaves(rng, 11, splits=1.0)) == 6 * 121


# ---- Threads or one ---------------------------------------------------------------------------------------


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


# ---- The public face --------------------------------------------------------------------------------------


def test_the_public_face(tmp_path):
    """From a bake as it is made."""
    scene = ball_on_floor(side=9, rings=6)
    bake = bake_environment(scene, tmp_path / "ball.prelight", resolution=8)
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
