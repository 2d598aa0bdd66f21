"""Layers of several bakes in one: byte for byte what they were, or nothing has happened."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import DamagedBakeError, InputError, OutputError, PrelightError
from prelight.lighting.environment import Environment
from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake
from prelight.relighting.relighter import Relighter
from prelight.storage import journal
from prelight.storage.bake import Bake
from prelight.storage.joining import add_layers, remove_layer

from .disk import copy, quick_bake, rewrite_manifest, tree

SKY = Environment.constant((1.0, 0.5, 0.25))


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, Path]:
    """Two bakes of one scene, one of them finer."""
    folder = tmp_path_factory.mktemp("made")
    coarse = quick_bake(folder / "coarse.prelight").path
    return coarse, quick_bake(folder / "fine.prelight", tolerance=0.01, zones=1, bounces=0).path


@pytest.fixture
def bakes(made, tmp_path) -> tuple[Path, Path]:
    return copy(made[0], tmp_path / "coarse.prelight"), copy(made[1], tmp_path / "fine.prelight")


def radiance(path: Path, layer: str) -> np.ndarray:
    light = Relighter(path, layer=layer)
    light.environment = SKY
    return light.radiance


def test_layers_stay_what_they_were(bakes):
    coarse, fine = bakes
    before, other = radiance(coarse, "environment"), radiance(fine, "environment")
    untouched = tree(fine)
    joined = add_layers(coarse, fine, name="fine_one")
    assert list(joined.layers) == ["environment", "fine_one"]
    assert list(joined.verify())
    np.testing.assert_array_equal(radiance(coarse, "environment"), before)
    np.testing.assert_array_equal(radiance(coarse, "fine_one"), other)
    assert not np.array_equal(before, other)
    assert tree(fine) == untouched
    shutil.rmtree(fine)  # nothing depends on it
    np.testing.assert_array_equal(radiance(coarse, "fine_one"), other)


def test_what_is_taken_out_again_leaves_no_trace(bakes):
    coarse, fine = bakes
    remove_layer(add_layers(coarse, fine, name="more"), "more")
    once = tree(coarse)
    remove_layer(add_layers(coarse, fine, name="more"), "more")
    assert tree(coarse) == once
    assert not any("more" in name for name in once)
    assert sorted(path.name for path in coarse.parent.iterdir()) == ["coarse.prelight", "fine.prelight"]


def test_a_layer_is_replaced_by_force_alone(bakes):
    coarse, fine = bakes
    other = radiance(fine, "environment")
    with pytest.raises(InputError, match="already; --force replaces it"):
        add_layers(coarse, fine)
    add_layers(coarse, fine, force=True)
    np.testing.assert_array_equal(radiance(coarse, "environment"), other)
    assert list(Bake.open(coarse).layers) == ["environment"]


def refused(bakes, kind: type[PrelightError], match: str, act) -> None:
    before = [tree(path) for path in bakes]
    with pytest.raises(kind, match=match):
        act()
    assert [tree(path) for path in bakes] == before
    assert sorted(path.name for path in bakes[0].parent.iterdir()) == sorted(path.name for path in bakes)


def test_another_scene_is_refused(bakes):
    rewrite_manifest(bakes[1], lambda manifest: manifest["scene"].update(digest="0" * 64))
    refused(bakes, InputError, "its scene .* is not that of", lambda: add_layers(*bakes, name="more"))


@pytest.mark.parametrize("name", ["", "a/b", "..", "é", "x" * 41, "a b"])
def test_names_are_plain_words(bakes, name):
    refused(bakes, InputError, "expected letters, digits and _", lambda: add_layers(*bakes, name=name))


def test_the_last_layer_and_a_strange_one_are_not_removed(bakes):
    refused(bakes, InputError, "is its only layer", lambda: remove_layer(bakes[0], "environment"))
    refused(
        bakes, InputError, "has no layer 'lamps'; it has environment", lambda: remove_layer(bakes[0], "lamps")
    )


@pytest.mark.parametrize("which", [0, 1])
def test_damage_is_found_before_anything_is_replaced(bakes, which):
    path = next(p for p in sorted((bakes[which] / "layers").rglob("c/*")) if p.is_file())
    data = bytearray(path.read_bytes())
    data[0] ^= 1
    path.write_bytes(data)
    refused(bakes, DamagedBakeError, "sha256 differs", lambda: add_layers(*bakes, name="more"))


@pytest.mark.parametrize("allowed", [0, 5, 20])
def test_a_disk_that_refuses_costs_nothing(bakes, monkeypatch, allowed):
    done = 0

    def link(*_):
        nonlocal done
        done += 1
        raise OSError(28, "No space left on device")

    def publish(*arguments, **options):
        if done > allowed:
            raise OutputError(arguments[0], "cannot write: no space left")
        return wrote(*arguments, **options)

    wrote = journal.publish
    monkeypatch.setattr(os, "link", link)
    monkeypatch.setattr(journal, "publish", publish)
    refused(bakes, OutputError, "no space left", lambda: add_layers(*bakes, name="more"))


def test_a_disk_without_links_gets_copies(bakes, monkeypatch):
    coarse, fine = bakes
    other = radiance(fine, "environment")

    def link(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(os, "link", link)
    add_layers(coarse, fine, name="more")
    np.testing.assert_array_equal(radiance(coarse, "more"), other)


def test_another_that_writes_is_waited_for(bakes):
    writer = journal.BakeWriter(bakes[0], settings={}, resume=False, force=True)
    try:
        with pytest.raises(OutputError, match="another process is writing"):
            add_layers(*bakes, name="more")
    finally:
        writer.close()
        shutil.rmtree(writer.partial)


def test_light_is_counted_once(bakes):
    """Two layers of one kind are two ways to say the same light: the first takes it."""
    coarse, fine = bakes
    expected = radiance(coarse, "environment")
    add_layers(coarse, fine, name="more")
    light = LitBake(coarse)
    light.light(Rig(SKY))
    np.testing.assert_allclose(light.radiance(), expected, rtol=1e-5)
    light.light(Rig(Environment.dark()))
    assert not light.radiance().any()


def test_the_command_line(prelight, bakes):
    coarse, fine = bakes
    told = prelight("layers", "add", str(coarse), str(fine), "--name", "more", "--json")
    assert told.code == 0, told.err
    assert "more" in told.out
    assert prelight("verify", str(coarse)).code == 0
    assert prelight("layers", "add", str(coarse), str(fine)).code == 2
    told = prelight("layers", "remove", str(coarse), "more")
    assert "more" not in told.out
    assert told.code == 0
