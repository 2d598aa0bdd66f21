"""Bakes made to harm, every hash in them right: refused before a kernel follows their numbers (P11)."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from prelight.bases.quadtree import LeafCover, roots, split
from prelight.errors import DamagedBakeError
from prelight.storage.bake import Bake
from prelight.storage.chunks import encode
from prelight.storage.manifest import Manifest

from .disk import copy, light_of, quick_bake, refusal, rewrite_manifest

LAYER = "layers/environment"


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    return quick_bake(tmp_path_factory.mktemp("original") / "ball.prelight").path


@pytest.fixture
def bake(original, tmp_path) -> Path:
    """A copy to be forged."""
    return copy(original, tmp_path / "ball.prelight")


def replace_array(folder: Path, name: str, values: np.ndarray, chunk_shape: list[int] | None = None) -> None:
    """Put other values in an array, as whoever made the bake could: chunks and manifest agree."""
    manifest = Manifest.open(folder)
    shape = chunk_shape or list(values.shape)
    shutil.rmtree(folder / name / "c", ignore_errors=True)

    def change(document: dict) -> None:
        document["arrays"][name] = {
            "shape": list(values.shape),
            "dtype": values.dtype.name,
            "chunk_shape": shape,
        }
        document["chunks"] = {k: r for k, r in document["chunks"].items() if not k.startswith(f"{name}/c/")}
        spec = manifest.arrays[name].model_copy(update=document["arrays"][name])
        for index in spec.chunk_indices():
            part = values[tuple(slice(i * c, (i + 1) * c) for i, c in zip(index, shape, strict=True))]
            data, record = encode(part, spec)
            path = folder / name / "c" / Path(*map(str, index))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            document["chunks"][f"{name}/c/" + "/".join(map(str, index))] = record.model_dump()

    rewrite_manifest(folder, change)


def changed(values: np.ndarray, where: object, value: object) -> np.ndarray:
    values = values.copy()
    values[where] = value
    return values


def moved_edge(rectangles: np.ndarray) -> np.ndarray:
    """A leaf one texel wider and its neighbour one narrower: the total is right, the tree is not."""
    r = rectangles.copy()
    for i in range(len(r) - 1):
        if r[i, 0] == r[i + 1, 0] and r[i, 1] == r[i + 1, 1] and r[i, 3] == r[i + 1, 3] and r[i + 1, 4] > 1:
            r[i, 4] += 1
            r[i + 1, 2:5:2] += (1, -1)
            return r
    raise AssertionError("no two leaves side by side")


def more_present(present: np.ndarray) -> np.ndarray:
    """One tile more than there are, in the group that has the fewest."""
    fewest = np.unravel_index(np.bitwise_count(present).argmin(), present.shape)
    assert present[fewest] < 0xFFFF
    return changed(present, fewest, 0xFFFF)


FORGERIES: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "order beyond": (f"{LAYER}/order", lambda v: changed(v, 3, v.max() + 1)),
    "order with a hole": (f"{LAYER}/order", lambda v: changed(v, 3, -1)),
    "order into the filling": (f"{LAYER}/order", lambda v: changed(v, v.argmin(), 3)),
    "order of nobody": (f"{LAYER}/order", lambda v: np.full_like(v, -1)),
    "order far beyond": (f"{LAYER}/order", lambda v: changed(v, 3, 2**31 - 1)),
    "order negative": (f"{LAYER}/order", lambda v: changed(v, 3, -2)),
    "order twice": (f"{LAYER}/order", lambda v: changed(v, 3, v[4])),
    "order short": (f"{LAYER}/order", lambda v: v[:-1]),
    "order long": (f"{LAYER}/order", lambda v: np.append(v, v[:1])),
    "order a group short": (f"{LAYER}/order", lambda v: v[:-32]),
    "order a group long": (f"{LAYER}/order", lambda v: np.append(v, np.full(32, -1, np.int32))),
    "zones none": (f"{LAYER}/zones", np.zeros_like),
    "zones negative": (f"{LAYER}/zones", lambda v: -v),
    "zones one less": (f"{LAYER}/zones", lambda v: v[:1]),
    "zones one more": (f"{LAYER}/zones", lambda v: np.concatenate([v, v[:1]])),
    "zones exchanged": (f"{LAYER}/zones", lambda v: v[::-1]),
    "zones of three numbers": (f"{LAYER}/zones", lambda v: v[:, :3]),
    "zones flat": (f"{LAYER}/zones", lambda v: v.ravel()),
    "zones as numbers": (f"{LAYER}/zones", lambda v: v.astype(np.float32)),
    "zone of a group more": (f"{LAYER}/zones", lambda v: changed(v, (0, 0), v[0, 0] + 1)),
    "zones with groups moved": (f"{LAYER}/zones", lambda v: v + np.array([[-1, 0, 0, 0], [1, 0, 0, 0]], np.int32)),
    "zone of two channels": (f"{LAYER}/zones", lambda v: changed(v, (0, 1), 2)),
    "zone of three channels": (f"{LAYER}/zones", lambda v: changed(v, (0, 1), 3)),
    "zone of no channel": (f"{LAYER}/zones", lambda v: changed(v, (0, 1), 0)),
    "zone of a cluster more": (f"{LAYER}/zones", lambda v: changed(v, (0, 2), v[0, 2] + 1)),
    "zones with clusters moved": (f"{LAYER}/zones", lambda v: v + np.array([[0, 0, 1, 0], [0, 0, -1, 0]], np.int32)),
    "zone of all clusters": (f"{LAYER}/zones", lambda v: changed(v, (0, 2), 2**31 - 1)),
    "zone of no parcel": (f"{LAYER}/zones", lambda v: changed(v, (0, 3), 0)),
    "zone of a parcel more": (f"{LAYER}/zones", lambda v: changed(v, (0, 3), 2)),
    "zones with parcels moved": (f"{LAYER}/zones", lambda v: v + np.array([[0, 0, 0, 1], [0, 0, 0, -1]], np.int32)),
    "zone of two billion parcels": (f"{LAYER}/zones", lambda v: changed(v, (0, 3), 2**31 - 1)),
    "order as a column": (f"{LAYER}/order", lambda v: v[:, None]),
    "order wider": (f"{LAYER}/order", lambda v: v.astype(np.int64)),
    "order as numbers": (f"{LAYER}/order", lambda v: v.astype(np.float32)),
    "present more tiles": (f"{LAYER}/present/00000", more_present),
    "present everything": (f"{LAYER}/present/00000", lambda v: np.full_like(v, 0xFFFF)),
    "present fewer": (f"{LAYER}/present/00000", lambda v: changed(v, (0, 0), 0)),
    "present without a group": (f"{LAYER}/present/00000", lambda v: v[:, :-1]),
    "present with a group more": (f"{LAYER}/present/00000", lambda v: np.pad(v, ((0, 0), (0, 1)))),
    "present without a panel": (f"{LAYER}/present/00000", lambda v: v[:1]),
    "present with a panel more": (f"{LAYER}/present/00000", lambda v: np.pad(v, ((0, 1), (0, 0)))),
    "present flat": (f"{LAYER}/present/00000", lambda v: v.ravel()),
    "present as bytes": (f"{LAYER}/present/00000", lambda v: v.astype(np.uint8)),
    "present as numbers": (f"{LAYER}/present/00000", lambda v: v.astype(np.float32)),
    "tiles too few": (f"{LAYER}/tiles/00000", lambda v: v[:-1]),
    "tiles too many": (f"{LAYER}/tiles/00000", lambda v: np.concatenate([v, v])),
    "tiles narrow": (f"{LAYER}/tiles/00000", lambda v: v[:, :, :16]),
    "tiles turned": (f"{LAYER}/tiles/00000", lambda v: v.reshape(-1, 32, 16)),
    "tiles flat": (f"{LAYER}/tiles/00000", lambda v: v.ravel()),
    "tiles of floats": (f"{LAYER}/tiles/00000", lambda v: v.astype(np.float32)),
    "scale NaN": (f"{LAYER}/scales/00000", lambda v: changed(v, 5, np.nan)),
    "scale infinite": (f"{LAYER}/scales/00000", lambda v: changed(v, 5, np.inf)),
    "scale negative": (f"{LAYER}/scales/00000", lambda v: changed(v, 5, -1e-3)),
    "scale huge": (f"{LAYER}/scales/00000", lambda v: changed(v, 5, 3e38)),
    "scales short": (f"{LAYER}/scales/00000", lambda v: v[:-1]),
    "scales as a column": (f"{LAYER}/scales/00000", lambda v: v[:, None]),
    "scales as integers": (f"{LAYER}/scales/00000", lambda v: np.zeros(v.shape, np.int32)),
    "rectangle outside": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, 1), 9)),
    "rectangle far outside": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, 2), 2**31 - 1)),
    "rectangle negative": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, 1), -1)),
    "rectangle empty": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, 3), 0)),
    "rectangle of negative size": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, slice(3, 5)), -1)),
    "rectangle of wrapping size": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, slice(3, 5)), 2**31 - 1)),
    "rectangle on a seventh face": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, 0), 6)),
    "rectangle on no face": (f"{LAYER}/rectangles/00000", lambda v: changed(v, (0, 0), -1)),
    "rectangles overlapping": (f"{LAYER}/rectangles/00000", lambda v: changed(v, 1, v[0])),
    "rectangles with a moved edge": (f"{LAYER}/rectangles/00000", moved_edge),
    "rectangles backwards": (f"{LAYER}/rectangles/00000", lambda v: v[::-1]),
    "rectangles exchanged": (f"{LAYER}/rectangles/00000", lambda v: v[[1, 0, *range(2, len(v))]]),
    "rectangles all alike": (f"{LAYER}/rectangles/00000", lambda v: np.repeat(v[:1], len(v), axis=0)),
    "rectangles short": (f"{LAYER}/rectangles/00000", lambda v: v[:-1]),
    "rectangles of four numbers": (f"{LAYER}/rectangles/00000", lambda v: v[:, :4]),
    "rectangles as floats": (f"{LAYER}/rectangles/00000", lambda v: v.astype(np.float32)),
    "triangle beyond": ("scene/triangles", lambda v: changed(v, (0, 0), 2**31 - 1)),
    "triangle negative": ("scene/triangles", lambda v: changed(v, (0, 0), -1)),
    "triangles of two": ("scene/triangles", lambda v: v[:, :2]),
    "triangles flat": ("scene/triangles", lambda v: v.ravel()),
    "triangles as floats": ("scene/triangles", lambda v: v.astype(np.float32)),
    "positions NaN": ("scene/positions", lambda v: changed(v, (0, 0), np.nan)),
    "positions infinite": ("scene/positions", lambda v: changed(v, (0, 0), np.inf)),
    "positions short": ("scene/positions", lambda v: v[:-1]),
    "positions of two": ("scene/positions", lambda v: v[:, :2]),
    "positions as bytes": ("scene/positions", lambda v: np.zeros(v.shape, np.uint8)),
    "normals NaN": ("scene/normals", lambda v: changed(v, (0, 0), np.nan)),
    "albedo NaN": ("scene/albedo", lambda v: changed(v, (0, 0), np.nan)),
    "albedo of one": ("scene/albedo", lambda v: v[:, :1]),
    "albedo short": ("scene/albedo", lambda v: v[:-1]),
}  # fmt: skip


@pytest.mark.parametrize("forgery", FORGERIES)
def test_forged_arrays(bake, forgery):
    """Kernels follow these numbers to memory: they must not get that far."""
    name, forge = FORGERIES[forgery]
    replace_array(bake, name, np.ascontiguousarray(forge(Bake.open(bake).array(name))))
    assert isinstance(refusal(lambda: light_of(bake)), DamagedBakeError)


def test_forging_itself_is_not_what_is_refused(bake):
    """The same rewriting with the same values is a good bake, whatever the chunks are."""
    expected = light_of(bake)
    for name in Bake.open(bake).manifest.arrays:
        values = Bake.open(bake).array(name).copy()
        replace_array(bake, name, values, [max(1, n // 2) for n in values.shape])
    np.testing.assert_array_equal(light_of(bake), expected)


def test_trees_that_look_whole():
    """`LeafCover.is_whole_tree` against every rearrangement of a small tree."""
    for resolution in (1, 2, 3, 5, 8):
        leaves = roots(resolution)
        assert LeafCover(leaves, resolution).is_whole_tree
        if resolution == 1:
            continue
        children, _ = split(leaves[2:3])
        leaves = np.concatenate([leaves[:2], children, leaves[3:]])
        assert LeafCover(leaves, resolution).is_whole_tree
        assert not LeafCover(leaves, resolution + 1).is_whole_tree
        assert not LeafCover(leaves[:-1], resolution).is_whole_tree
        assert not LeafCover(np.concatenate([leaves, leaves[-1:]]), resolution).is_whole_tree
        for i in range(len(leaves) - 1):
            order = np.arange(len(leaves))
            order[[i, i + 1]] = i + 1, i
            assert not LeafCover(leaves[order], resolution).is_whole_tree
