"""Bounced parts that are forged, or asked for wrongly: refused by name, in one line, before a kernel runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from prelight.baking.bounced_plan import plan_bounced
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.baking.layer_receivers import LayerReceivers
from prelight.errors import DamagedBakeError, InputError
from prelight.relighting.relighter import Relighter
from prelight.storage.bake import Bake

from .disk import copy, quick_bake, rewrite_manifest
from .scenes import ball_on_floor
from .test_forged_bakes import changed, replace_array

AT = "layers/environment/bounced"


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    return quick_bake(tmp_path_factory.mktemp("original") / "ball.prelight").path


@pytest.fixture
def bake(original, tmp_path) -> Path:
    return copy(original, tmp_path / "ball.prelight")


ARRAYS = {
    "cells": {
        "two cells change places": lambda v: v[np.r_[1, 0, 2 : len(v)]],
        "a cell missing": lambda v: v[1:],
        "a cell outside": lambda v: changed(v, (0, 1), 10**6),
        "a negative face": lambda v: changed(v, (0, 0), -1),
        "six numbers": lambda v: np.pad(v, ((0, 0), (0, 1))),
        "floats": lambda v: v.astype(np.float32),
        "too many": lambda v: np.repeat(v, 4, axis=0),
    },
    "modes": {
        "a group more": lambda v: np.concatenate([v, v[:1]]),
        "a mode less": lambda v: v[:, 1:],
        "half of a group": lambda v: v[:, :, :16],
        "unsigned": lambda v: v.view(np.uint8),
        "two axes": lambda v: v.reshape(len(v), -1),
    },
    "scales": {
        "no number": lambda v: changed(v, 0, np.nan),
        "infinite": lambda v: changed(v, 0, np.inf),
        "one more": lambda v: np.append(v, v[:1]),
    },
    "weights": {
        "no number": lambda v: changed(v, (0, 0, 0), np.nan),
        "huge": lambda v: changed(v, (0, 0, 0), 1e30),
        "two colours": lambda v: v[:2],
        "a cell less": lambda v: v[:, :, 1:],
    },
    "sources": {
        "a vertex less": lambda v: v[:, 1:],
        "one colour": lambda v: v[:1],
        "unsigned": lambda v: v.view(np.uint8),
    },
    "first/order": {
        "one twice": lambda v: changed(v, 0, v[1]),
        "outside": lambda v: changed(v, 0, 10**6),
        "negative": lambda v: changed(v, 0, -1),
        "one less": lambda v: v[1:],
        "wide": lambda v: v.astype(np.int64),
    },
    "first/left": {
        "above one": lambda v: changed(v, 1, 1.5),
        "no number": lambda v: changed(v, 1, np.nan),
        "a node less": lambda v: v[1:],
    },
    "first/colours": {
        "brighter than white": lambda v: changed(v, (0, 0), 4.0),
        "negative": lambda v: changed(v, (0, 0), -1e-3),
        "two": lambda v: v[:, :2],
    },
    "first/sums": {
        "more than is sent": lambda v: changed(v, 0, 1.01),
        "negative": lambda v: changed(v, 0, -0.1),
        "one more": lambda v: np.append(v, v[:1]),
    },
    "first/scales": {"infinite": lambda v: changed(v, 0, np.inf), "negative": lambda v: changed(v, 0, -1.0)},
    "first/counts": {
        "one more": lambda v: changed(v, 0, v[0] + 1),
        "huge": lambda v: changed(v, 0, 65535),
        "a row less": lambda v: v[1:],
    },
    "first/steps": {
        "out of the tree": lambda v: changed(v, 1, 65535),
        "on the spot": lambda v: changed(v, 1, 0),
        "one less": lambda v: v[1:],
        "two axes": lambda v: v.reshape(-1, 2),
    },
    "first/codes": {"one more": lambda v: np.append(v, v[:1]), "unsigned": lambda v: v.view(np.uint8)},
    "source_scales": {"no number": lambda v: changed(v, (0, 0), np.nan), "a colour less": lambda v: v[:2]},
}
CASES = [(name, what) for name, cases in ARRAYS.items() for what in cases]


@pytest.mark.parametrize(("name", "what"), CASES, ids=[" ".join(case) for case in CASES])
def test_forged_arrays(bake, name, what):
    values = Bake.open(bake).array(f"{AT}/{name}")
    replace_array(bake, f"{AT}/{name}", np.ascontiguousarray(ARRAYS[name][what](values)))
    with pytest.raises(DamagedBakeError) as error:
        Relighter(bake)
    assert str(error.value).isprintable()


def drop(name: str):
    def change(document: dict) -> None:
        for key in [k for k in document["chunks"] if k.startswith(f"{AT}/{name}/c/")]:
            del document["chunks"][key]
        del document["arrays"][f"{AT}/{name}"]

    return change


def said(part: str, name: str, value: object):
    return lambda d: d["layers"]["environment"][part].update({name: value})


MANIFESTS = {
    **{
        f"no {name}": drop(name)
        for name in (
            "cells",
            "modes",
            "scales",
            "weights",
            "sources",
            "source_scales",
            "first/order",
            "first/codes",
        )
    },
    "first entries not counted": said("statistics", "bounced_first_entries", 10**6),
    "a negative error": said("statistics", "bounced_first_error", -0.1),
    "no threshold": lambda d: d["layers"]["environment"]["statistics"].pop("bounced_first_threshold"),
    "bounces in words": said("parameters", "bounces", "many"),
    "negative bounces": said("parameters", "bounces", -1),
    "half a bounce": said("parameters", "bounces", 0.5),
    "no rays": said("parameters", "gather_rays", None),
    "modes not counted": lambda d: d["layers"]["environment"]["statistics"].pop("bounced_modes"),
    "no rest": lambda d: d["layers"]["environment"]["statistics"].pop("bounced_remaining"),
}


@pytest.mark.parametrize("version", [2, 3])
def test_bakes_without_the_first_bounce_still_open(bake, version):
    """As they were written before it was kept."""

    def change(document: dict) -> None:
        for name in ("order", "left", "colours", "sums", "scales", "counts", "steps", "codes"):
            drop(f"first/{name}")(document)
        document["version"] = version

    assert Relighter(bake)._live.bounced.part.first is not None
    rewrite_manifest(bake, change)
    assert Relighter(bake)._live.bounced.part.first is None


@pytest.mark.parametrize("what", MANIFESTS)
def test_forged_manifests(bake, what):
    rewrite_manifest(bake, MANIFESTS[what])
    with pytest.raises(DamagedBakeError, match=r"bounce|sources"):
        Bake.open(bake)


def test_a_damaged_chunk_is_named(bake):
    path = bake / AT / "modes" / "c" / "0" / "0" / "0"
    path.write_bytes(bytes(8) + path.read_bytes()[8:])
    with pytest.raises(DamagedBakeError, match="bounced/modes"):
        Relighter(bake)


def test_origins_that_are_no_place(bake):
    values = Bake.open(bake).array("layers/environment/origins")
    replace_array(bake, "layers/environment/origins", changed(values, (0, 0), np.nan))
    with pytest.raises(DamagedBakeError, match="origins"):
        Relighter(bake)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bounces": -1}, "bounces.*0 to 1000"),
        ({"bounces": 1001}, "bounces.*0 to 1000"),
        ({"bounces": 1.5}, "bounces.*whole number"),
        ({"gather_rays": 0}, "gather-rays"),
        ({"gather_rays": 1000}, "gather-rays.*square"),
        ({"gather_rays": 1 << 15}, "gather-rays"),
    ],
    ids=str,
)
def test_settings_out_of_range(options, words):
    with pytest.raises(InputError, match=words):
        EnvironmentSettings(**options)


def test_the_plan_is_near_and_says_what_is_too_little():
    layer = LayerReceivers(ball_on_floor(), EnvironmentSettings(resolution=16, gather_rays=64))
    plan = plan_bounced(layer, 4_000_000_000)
    V = len(layer.scene.positions)
    assert V * 64 < plan.rays < V * 64 + V * 6 * 32**2
    assert plan.seconds > 0
    assert plan.memory < 4_000_000_000
    with pytest.raises(InputError, match=r"at least .* --bounces 0"):
        plan_bounced(layer, 200_000_000)
    assert plan_bounced(LayerReceivers(layer.scene, EnvironmentSettings(bounces=0)), 1).rays == 0
