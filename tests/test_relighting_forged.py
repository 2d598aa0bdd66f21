"""Layers whose zones are forged, and light that is none: refused by name, and nothing changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from prelight.errors import DamagedBakeError, InputError
from prelight.lighting.disc import Disc
from prelight.relighting.layer import EnvironmentLayer
from prelight.storage.bake import Bake

from .disk import copy
from .test_forged_bakes import replace_array
from .zoned_bake import (
    LAYER,
    ROWS,
    R,
    Sample,
    hdr,
    make_sample,
    random_leaves,
    random_zone,
    write_bake,
)


@pytest.fixture(scope="module")
def several(tmp_path_factory) -> Sample:
    return make_sample(tmp_path_factory.mktemp("bake"), "several")


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
    elsewhere = good.copy()
    elsewhere[elsewhere[:, 0] == 1, 0] = 2
    for wrong in (
        good[::-1],
        np.roll(good, 1, axis=0),
        good[[1, 0, *range(2, len(good))]],
        outside,
        elsewhere,
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
