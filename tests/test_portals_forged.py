"""Layers of portals that are forged: refused by name, in one line, before a kernel runs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import DamagedBakeError
from prelight.relighting.portals import PortalsRelighter
from prelight.storage.bake import Bake

from .disk import copy, rewrite_manifest
from .portal_rooms import portals_of, two_windows
from .test_forged_bakes import changed, replace_array

AT = "layers/portals"


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("original") / "room.prelight"
    portals_of(two_windows(cells=3), path, rays=256, gather_rays=64, order=1)
    return path


@pytest.fixture
def bake(original, tmp_path) -> Path:
    return copy(original, tmp_path / "room.prelight")


def opened(path: Path) -> None:
    PortalsRelighter(Bake.open(path))


ARRAYS = {
    "centres": {"one more": lambda v: np.concatenate([v, v[:1]]), "no number": lambda v: changed(v, (0, 0), np.nan)},
    "areas": {"below 0": lambda v: -v, "one more": lambda v: np.append(v, v[:1]), "infinite": lambda v: v * np.inf},
    "tints": {"below 0": lambda v: -v, "two colours": lambda v: v[:, :2]},
    "portal_of_pane": {
        "outside": lambda v: changed(v, -1, 7),
        "negative": lambda v: changed(v, 0, -1),
        "falling": lambda v: v[::-1],
        "wide": lambda v: v.astype(np.int64),
    },
    "pane_rows": {
        "beyond": lambda v: changed(v, -1, v[-1] + 5),
        "short": lambda v: changed(v, -1, v[-1] - 1),
        "falling": lambda v: changed(v, 1, v[-1] + 1),
        "negative": lambda v: changed(v, 0, -3),
    },
    "receiver": {
        "outside": lambda v: changed(v, 3, 10**6),
        "negative": lambda v: changed(v, 3, -1),
        "one less": lambda v: v[1:],
    },
    "kind": {"neither": lambda v: changed(v, 0, 2), "one more": lambda v: np.append(v, v[:1])},
    "scale": {
        "no number": lambda v: changed(v, 0, np.nan), "below 0": lambda v: -v, "huge": lambda v: changed(v, 0, 1e30),
    },
    "row_runs": {
        "beyond": lambda v: changed(v, -1, v[-1] + 1),
        "falling": lambda v: changed(v, 2, 0),
        "not from 0": lambda v: changed(v, 0, 1),
        "narrow": lambda v: v.astype(np.int32),
    },
    "runs": {
        "beyond the cube": lambda v: changed(v, (0, 0), 6 * 32 * 32),
        "longer": lambda v: changed(v, (0, 1), v[0, 1] + 1),
        "three numbers": lambda v: np.pad(v, ((0, 0), (0, 1))),
        "one less": lambda v: v[1:],
    },
    "data": {"one less": lambda v: v[1:], "signed": lambda v: v.view(np.int8), "two axes": lambda v: v[None]},
    "openings/corners": {"no number": lambda v: changed(v, (0, 0, 0), np.nan), "one less": lambda v: v[1:]},
    "openings/pane_of": {"outside": lambda v: changed(v, 0, 9), "negative": lambda v: changed(v, 0, -1)},
    "openings/origins": {"huge": lambda v: changed(v, (0, 0), 1e30), "one more": lambda v: np.append(v, v[:1], axis=0)},
    "openings/glass_triangles": {"outside": lambda v: changed(v, 0, 10**6), "wide": lambda v: v.astype(np.int64)},
    "glass": {
        "outside": lambda v: changed(v, -1, 10**6), "negative": lambda v: changed(v, 0, -1),
        "one less": lambda v: v[1:],
    },
    "glass_portal": {"outside": lambda v: changed(v, 0, 2), "negative": lambda v: changed(v, 0, -1)},
    "bounced/modes": {
        "a mode less": lambda v: v[:, 1:], "a group less": lambda v: v[1:], "unsigned": lambda v: v.view(np.uint8),
    },
    "bounced/first/order": {"one twice": lambda v: changed(v, 0, v[1]), "one less": lambda v: v[1:]},
    "bounced/first/scales": {"no number": lambda v: changed(v, 0, np.nan), "above one": lambda v: changed(v, 0, 2.0)},
    "bounced/scales": {"no number": lambda v: changed(v, 0, np.nan), "one more": lambda v: np.append(v, v[:1])},
    "bounced/weights": {
        "no number": lambda v: changed(v, (0, 0, 0, 0), np.nan),
        "a function less": lambda v: v[:, 1:],
        "two colours": lambda v: np.repeat(v[:, :, :1], 2, axis=2),
        "a portal less": lambda v: v[1:],
    },
    "bounced/energy": {"an order less": lambda v: v[:, 1:], "huge": lambda v: changed(v, (0, 0, 0), 1e30)},
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "what"), [(name, what) for name, faults in ARRAYS.items() for what in faults], ids=lambda x: x
)
def test_forged_arrays_are_refused(bake, name, what) -> None:
    values = Bake.open(bake).array(f"{AT}/{name}")
    replace_array(bake, f"{AT}/{name}", np.ascontiguousarray(ARRAYS[name][what](values)))
    with pytest.raises(DamagedBakeError) as error:
        opened(bake)
    assert (
        name.split("/")[-1] in str(error.value)
        or "glass" in str(error.value)
        or "portals" in str(error.value)
    )
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("cube", 33), ("cube", None), ("cube", 32.0), ("cube", True), ("names", 3), ("names", "[]"),
        ("names", "not json"),
        ("names", json.dumps(["one"])), ("names", "[" * 5000), ("names", json.dumps([1, 2])), ("bounces", "some"),
        ("bounces", -1), ("order", 13), ("order", None), ("order", 2), ("order", 1.0),
    ],
)  # fmt: skip
def test_forged_records_are_refused(bake, key, value) -> None:
    rewrite_manifest(bake, lambda m: m["layers"]["portals"]["parameters"].update({key: value}))
    with pytest.raises(DamagedBakeError):
        opened(bake)


@pytest.mark.parametrize("name", ["data", "runs", "tints", "bounced/modes"])
def test_missing_arrays_are_refused(bake, name) -> None:
    def forget(manifest: dict) -> None:
        del manifest["arrays"][f"{AT}/{name}"]
        manifest["chunks"] = {
            k: v for k, v in manifest["chunks"].items() if not k.startswith(f"{AT}/{name}/c/")
        }

    rewrite_manifest(bake, forget)
    with pytest.raises(DamagedBakeError, match=name.split("/")[-1]):
        opened(bake)


def test_the_honest_bake_opens(bake) -> None:
    opened(bake)
