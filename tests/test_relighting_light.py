"""The light of clusters and of discs: one pass for all zones, and integrals in place of texels."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases.cube_map import rectangle_solid_angles, solid_angles
from prelight.lighting.disc import Disc, add_discs
from prelight.relighting.column_kernels import plan_columns
from prelight.relighting.environment import EnvironmentRelighter
from prelight.relighting.layer import EnvironmentLayer
from prelight.relighting.light_tree import LightTree

from .zoned_bake import (
    CHANNELS,
    R,
    Sample,
    assert_like,
    discs_at,
    hdr,
    make_sample,
    plainly,
    random_zone,
    write_bake,
)

COLUMNS = "prelight.relighting.columns"


@pytest.fixture(scope="module", params=CHANNELS)
def sample(request, tmp_path_factory) -> Sample:
    return make_sample(tmp_path_factory.mktemp("bake"), request.param)


@pytest.fixture(scope="module")
def several(tmp_path_factory) -> Sample:
    return make_sample(tmp_path_factory.mktemp("bake"), "several")


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


def test_what_a_rectangle_touches_is_found(tmp_path, rng):
    """Among thousands of nodes, most of them in boxes that are passed by."""
    resolution = 32
    zones = [random_zone(rng, np.arange(32, dtype=np.int32), channels=1, resolution=resolution, splits=0.97)]
    tree = LightTree(EnvironmentLayer(write_bake(tmp_path, zones, resolution=resolution, rows=32)))
    assert len(tree) > 3000
    cube = np.zeros((6, resolution, resolution, 3), np.float32)
    f, i, j, h, w = tree.nodes.T
    for face, top, left in rng.integers(0, [6, resolution, resolution], (40, 3)).tolist():
        bottom, right = rng.integers([top + 1, left + 1], resolution + 1).tolist()
        cube[face, top:bottom, left:right] += 1
        changed, _ = tree.light_part(cube, face, (top, left, bottom, right))
        there = (f == face) & (i < bottom) & (i + h > top) & (j < right) & (j + w > left)
        np.testing.assert_array_equal(changed, np.flatnonzero(there))


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


def test_discs_moved_step_by_step_do_not_drift(several, rng):
    """Small steps read what changed alone; in the end all is as if painted, and without discs as before."""
    live, cube = several.relighter(), hdr(rng) * np.float32(1e-3)
    live.set_cube(cube)
    for step in range(200):
        live.set_discs(discs_at(step / 5, float(10 ** rng.uniform(-3, 3))))
    last = discs_at(40, 2)
    live.set_discs(last)
    painted = cube.copy()
    add_discs(painted, last)
    assert_like(live.radiance, several.plainly(painted))
    live.set_discs([])
    assert_like(live.radiance, several.plainly(cube))
    wide = [Disc.at(k / 50, 0, radius_deg=80, radiance=(1, 1, 1)) for k in range(2)]
    first, second = (live.set_discs([disc]) for disc in wide)
    assert second.bytes_read < first.bytes_read
    painted = cube.copy()
    add_discs(painted, wide[1:])
    assert_like(live.radiance, several.plainly(painted))


def walk(live: EnvironmentRelighter, rng: np.random.Generator) -> list[Disc]:
    """Move two discs about, in small steps and large ones; where they are in the end."""
    for step in range(60):
        leap = 40 * (step // 10 % 2)  # there, back, and there again
        discs = [
            Disc.at(leap + step, 10, radius_deg=6 + step % 15, radiance=tuple(rng.random(3))),
            Disc.at(leap - step, -40, radius_deg=25, radiance=tuple(rng.random(3)), softness=0.5),
        ]
        live.set_discs(discs)
    return discs


@pytest.mark.parametrize("share", [0.0, 0.2, 1.0])
def test_columns_make_room_for_others(sample, rng, monkeypatch, share):
    """With few places or many, copied out now or long ago: as from the tiles."""
    quads = [-(-len(zone.leaves) // 4) for zone in sample.zones]
    monkeypatch.setattr(f"{COLUMNS}._BYTES", 0)
    monkeypatch.setattr(f"{COLUMNS}._FEWEST", max(1, int(share * max(quads))))
    went = []
    monkeypatch.setattr(f"{COLUMNS}.plan_columns", lambda *a: went.append(plan_columns(*a)) or went[-1])
    live, cube = sample.relighter(), hdr(rng)
    live.set_cube(cube)
    discs = walk(live, rng)
    add_discs(cube, discs)
    assert_like(live.radiance, sample.plainly(cube))
    fits = [fitted for fitted, *_ in went]
    assert (any(fits), all(fits)) == (share > 0, share == 1)
    copied = np.concatenate([quads[: begins[-1]] for fitted, _, (begins, quads, _) in went if fitted] or [[]])
    assert (len(copied) > len(np.unique(copied))) == (share == 0.2)  # again and again, or each of them once


def test_what_broke_off_leaves_no_trace(sample, rng, monkeypatch):
    """Ctrl-C in a notebook: in the middle of a move, whatever was copied or added by then."""
    live, cube = sample.relighter(), hdr(rng)
    live.set_cube(cube)
    live.set_discs(discs_at(0, 1))
    for owner in (live._discs._columns, live._discs, live._tree):
        name = "_pace" if hasattr(owner, "_pace") else "gather"
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
            if owner is live._discs:
                patch.setattr(live._discs._columns, "move", lambda *_: False)
            with pytest.raises(KeyboardInterrupt):
                live.set_discs(discs_at(5, 1))
    live.set_discs(discs_at(6, 2))
    add_discs(cube, discs_at(6, 2))
    assert_like(live.radiance, sample.plainly(cube))


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
    edges = np.linspace(-1.0, 1.0, resolution + 1)
    omega = rectangle_solid_angles(edges, edges)
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
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * disc.solid_angle)
        assert tree.total(nodes, weights) == pytest.approx(disc.solid_angle, rel=1e-7)
        assert (np.diff(nodes) > 0).all()
