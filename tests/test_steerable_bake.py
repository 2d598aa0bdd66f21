"""Steerable bakes: from tracing to a relit picture, resumed to the same bytes, never trusted when opened."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prelight.baking import steerable
from prelight.baking.steerable import bake_steerable
from prelight.baking.steerable_foreign import bake_from_images, lights_list, picture_name
from prelight.baking.steerable_settings import BakedLamp, SteerableSettings
from prelight.bases.steering import SpotBasis
from prelight.cli.meant_lights import said_of_lights
from prelight.encoding import principal_components
from prelight.encoding.principal_components import Keep
from prelight.errors import DamagedBakeError, InputError, InterruptedBakeError
from prelight.images.formats import read_radiance_map, write_exr
from prelight.lighting.distributions import Power, frame
from prelight.lighting.panel import Panel
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot
from prelight.relighting.deep_buffer import first_bounces
from prelight.relighting.steerable import SteerableRelighter
from prelight.relighting.stored_steerable import open_deep, open_steerable, steerable_camera
from prelight.storage.bake import Bake
from prelight.transport.basis_images import ImageSettings, basis_images
from prelight.transport.steered_lamps import SteeredPanel, SteeredSpot

from .disk import rewrite_manifest, tree
from .steered import EYE, LAMP_AT, room

W, H = 20, 14
IMAGES = ImageSettings(W, H, samples=32, particles=16, depth=4)
SPOT = BakedLamp("key", SteeredSpot(LAMP_AT, 3))
PANEL = BakedLamp("top", SteeredPanel((-0.5, 1.5, -0.4), (1.0, 0, 0), (0, 0, 1.0), (1, 1)))
SETTINGS = SteerableSettings((SPOT, PANEL), images=IMAGES, keep="all")


@pytest.fixture(scope="module", autouse=True)
def small_strips() -> Iterator[None]:
    """So that a small bake has parts, and pixels that are kept apart."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(steerable, "strip_pixels", lambda *_: 64)
        patched.setattr(principal_components, "far_brighter", lambda _: np.array([3, 100], np.int32))
        yield


@pytest.fixture(scope="module")
def scene() -> Any:
    return room(mirror=True)


@pytest.fixture(scope="module")
def bake(scene: Any, tmp_path_factory: pytest.TempPathFactory) -> Bake:
    return bake_steerable(scene, tmp_path_factory.mktemp("bake") / "room.prelight", settings=SETTINGS)


def test_a_relit_spot_is_the_sum_of_its_basis_images(scene: Any, bake: Bake) -> None:
    span = basis_images(scene, SPOT.lamp, EYE, settings=IMAGES).images
    light = Spot((3.0, 2.0, 1.0), target=(0.1, 0.2, 0.0), distribution=Power(3))
    live = SteerableRelighter([layer for layer in open_steerable(bake) if layer.name == "key"])
    live.light([light], negligible=0.0)
    layer = next(iter(live.layers.values()))
    weights = light.coefficients(SpotBasis(3), layer.place)
    expected = np.einsum("sc,shwc->hwc", weights, span).reshape(-1, 3)
    assert np.sqrt(np.mean((live.radiance - expected) ** 2)) < 0.01 * np.sqrt(np.mean(expected**2))
    assert steerable_camera(bake) == ("front", EYE)


def test_the_same_bake_is_the_same_bytes_and_so_is_one_that_was_stopped(
    scene: Any, bake: Bake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "room.prelight"
    traced, stop = steerable.BasisTracer.pixels, [3]

    def until(tracer: Any, first: int, count: int, **how: Any) -> Any:
        stop[0] -= 1
        if stop[0] < 0:
            raise KeyboardInterrupt
        return traced(tracer, first, count, **how)

    plan = steerable.plan_steerable(scene, SETTINGS)
    monkeypatch.setattr(steerable.BasisTracer, "pixels", until)
    with pytest.raises(InterruptedBakeError):
        steerable.bake_planned(scene, target, plan=plan)
    stop[0] = 1000
    other = steerable.SteerablePlan(**{**vars(plan), "settings": SteerableSettings((SPOT,), images=IMAGES)})
    with pytest.raises(InputError, match="begun with"):
        steerable.bake_planned(scene, target, plan=other, resume=True)
    steerable.bake_planned(scene, target, plan=plan, resume=True)
    assert 0 < 1000 - stop[0] < 2 * 5  # of the first lamp's five strips three were there
    assert tree(target) == tree(bake.path)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda m: m["layers"]["key"]["parameters"].update(width=2), "expected"),
        (lambda m: m["layers"]["key"]["parameters"].update(basis=3), "basis"),
        (lambda m: m["layers"]["key"].update(camera=None), "eye"),
        (lambda m: m["layers"]["key"].update(coefficients=3), "planes"),
        (
            lambda m: m["layers"]["key"]["parameters"].update(
                basis='{"kind": "spot", "degree": 4, "parity": "all"}'
            ),
            "fit",
        ),
        (lambda m: m["layers"]["key"]["parameters"].update(basis='{"kind": "sun"}'), "fit"),
        (lambda m: m["layers"]["key"]["parameters"].update(basis="[" * 5000), "fit"),
        (lambda m: m["layers"]["key"]["parameters"].update(place='{"kind": "spot"}'), "fit"),
    ],
)
def test_a_forged_layer_is_refused(bake: Bake, tmp_path: Path, change: Any, word: str) -> None:
    import shutil

    folder = tmp_path / "forged.prelight"
    shutil.copytree(bake.path, folder)
    rewrite_manifest(folder, change)
    with pytest.raises(DamagedBakeError, match=word):
        open_steerable(Bake.open(folder))


def test_the_first_bounce_apart_and_the_later_ones_make_the_whole(scene: Any, tmp_path: Path) -> None:
    lamp = BakedLamp("key", SteeredSpot(LAMP_AT, 2, 0.1))
    plenty = replace(IMAGES, samples=1024)
    light = Spot((1.0, 1.0, 1.0), target=(0.1, 0.2, 0.0), distribution=Power(2))
    pictures = []
    for deep in (0, 64):
        settings = SteerableSettings((lamp,), images=plenty, keep="all", deep=deep)
        bake = bake_steerable(scene, tmp_path / f"{deep}.prelight", settings=settings)
        live = SteerableRelighter(open_steerable(bake))
        live.light([light], negligible=0.0)
        pictures.append(live.radiance + first_bounces(live, open_deep(bake), [light]))
        assert (live.radiance.mean() < 0.5 * pictures[0].mean()) == bool(deep)
    assert abs(pictures[1].mean() / pictures[0].mean() - 1) < 0.03
    rewrite_manifest(bake.path, lambda m: m["arrays"].pop("layers/key/deep_colours"))
    with pytest.raises(DamagedBakeError):
        Bake.open(bake.path)


def test_images_of_another_renderer(scene: Any, tmp_path: Path) -> None:
    lamp = BakedLamp("key", SteeredSpot(LAMP_AT, 2))
    settings = SteerableSettings((lamp,), images=IMAGES, keep="all")
    listed = json.loads(lights_list(scene, settings))
    lights = listed["lamps"][0]["lights"]
    assert len(lights) == 9
    span = basis_images(scene, lamp.lamp, EYE, settings=IMAGES).images
    pictures = lamp.basis.basis_images(span)
    for light, picture in zip(lights, pictures, strict=True):
        write_exr(tmp_path / light["picture"], np.maximum(picture, 0))
    bake = bake_from_images(scene, tmp_path / "room.prelight", tmp_path, settings=settings)
    live = SteerableRelighter(open_steerable(bake))
    aim = np.array(lights[4]["direction"])
    live.light([Spot((1.0, 1.0, 1.0), direction=tuple(aim), distribution=Power(2))], negligible=0.0)
    assert np.allclose(live.radiance, pictures[4].reshape(-1, 3), atol=0.01 * pictures[4].max())

    write_exr(tmp_path / picture_name("key", 3), np.zeros((H, W + 1, 3), np.float32))
    with pytest.raises(InputError, match=f"{W + 1}×{H}, expected {W}×{H}"):
        bake_from_images(scene, tmp_path / "b.prelight", tmp_path, settings=settings)
    (tmp_path / picture_name("key", 3)).unlink()
    with pytest.raises(InputError, match="missing"):
        bake_from_images(scene, tmp_path / "b.prelight", tmp_path, settings=settings)


def test_commands(prelight: Any, tmp_path: Path) -> None:
    target, rig = tmp_path / "chess.prelight", tmp_path / "rig.toml"
    bake = (
        "bake", "steerable", "stock:steerable-small", "-o", target, "--size", "32x32", "--samples", "8",
        "--light-paths", "4", "--degree", "2", "--depth", "4",
    )  # fmt: skip
    dry = prelight(*bake, "--dry-run", "--json")
    assert dry.code == 0
    assert json.loads(dry.out)["basis_images"] == 9
    assert not target.exists()
    assert prelight(*bake).code == 0
    rig.write_text("[[spot]]\nintensity = [6, 5, 4]\ntarget = [0, 0, 0]\n")
    relit = prelight("relight", target, rig, "-o", tmp_path / "a.png", "--json")
    assert relit.code == 0, relit.err
    assert json.loads(relit.out)["receivers"] == 32 * 32
    assert (tmp_path / "a.png").stat().st_size > 500
    assert prelight("verify", target).code == 0
    said = prelight("inspect", target)
    assert said.code == 0
    assert "components" in said.out
    assert "a spot at 0.5, 0.78, 0.46" in said.out
    assert "left out" not in said.out  # not even light through glass, seen in the mirror
    rig.write_text("[[disc]]\ndirection=[0,1,0]\nradius_deg=3\nradiance=[1,1,1]\n")
    assert prelight("relight", target, rig).code == 2


def test_refusals_are_one_line_before_any_work(prelight: Any, tmp_path: Path) -> None:
    start = ("bake", "steerable", "stock:steerable-small", "-o", tmp_path / "a.prelight")
    for options, words in (
        (("--spot", "900,0,0"), "outside the scene"),
        (("--spot", "1,2"), "X,Y,Z"),
        (("--degree", "40"), "0 to 24"),
        (("--size", "2048x2048", "--degree", "24", "--memory", "2GB"), "memory"),
        (
            ("--size", "2048x2048", "--degree", "1", "--deep", "64", "--light-paths", "0", "--memory", "8GB"),
            "--deep",
        ),
        (("--panel", "0,1,0/1,0,0/1,0,0"), "parallel"),
        (("--spot", "a=0,1,0", "--spot", "a=0,1,1"), "twice"),
        (("--components", "3", "--share", "0.5"), "choose one"),
        (
            (
                "--components",
                "99",
            ),
            "1 to 36",
        ),
        (("--all-components", "--share", "0.5"), "choose one"),
        (("--from-images", tmp_path / "none"), "no such folder"),
        (("--from-images", tmp_path, "--dry-run"), "choose one"),
        (("--lights-list", tmp_path / "lights.json", "--dry-run"), "choose one"),
        (("--parity", "odd", "--degree", "2"), "parity"),
    ):
        answer = prelight(*start, *options)
        assert answer.code == 2, (options, answer.err)
        assert words in answer.err, answer.err
        assert answer.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_components_keep_the_picture(scene: Any, tmp_path: Path) -> None:
    """The paper's twelve of thirty-six."""
    lamp = BakedLamp("key", SteeredSpot(LAMP_AT, 5))
    settings = SteerableSettings((lamp,), images=IMAGES, keep=Keep(count=12))
    bake = bake_steerable(scene, tmp_path / "twelve.prelight", settings=settings)
    live = SteerableRelighter(open_steerable(bake))
    span = basis_images(scene, lamp.lamp, EYE, settings=IMAGES).images.reshape(36, -1, 3)
    rng = np.random.default_rng(5)
    for _ in range(4):
        light = Spot((1.0, 1.0, 1.0), target=tuple(rng.uniform(-0.5, 0.5, 3)), distribution=Power(5))
        live.light([light], negligible=0.0)
        expected = np.einsum("sc,spc->pc", light.coefficients(lamp.basis, live.layers["key"].place), span)
        mse, peak = np.mean((live.radiance - expected) ** 2), np.percentile(expected, 99)
        assert 10 * np.log10(peak**2 / mse) >= 35


def test_three_lines_in_a_notebook(tmp_path: Path) -> None:
    import prelight as pl

    settings = pl.SteerableSettings.of({"key": LAMP_AT}, degree=2, width=W, height=H, samples=8)
    live = pl.SteerableBake(pl.bake_steerable(room(), tmp_path / "room.prelight", settings=settings))
    live.light([pl.Spot((3, 2, 1), target=(0.1, 0.2, 0))])

    assert live.size == (W, H)
    live.picture().save(tmp_path / "room.png")
    assert live.radiance[:, 0].mean() > live.radiance[:, 2].mean() > 0
    one = live.radiance
    live.light([pl.Spot((6, 4, 2), target=(0.1, 0.2, 0))])
    assert np.allclose(live.radiance, 2 * one, atol=1e-6)
    with pytest.raises(pl.InputError, match="that of a spot"):
        live.light([pl.Panel((0.5, 0.5), (0.5, 0.5), (1, 1, 1))])


@pytest.fixture(scope="module")
def deep(scene: Any, tmp_path_factory: pytest.TempPathFactory) -> Bake:
    """Its first bounce is kept apart."""
    settings = SteerableSettings((SPOT,), images=IMAGES, keep="all", deep=4)
    return bake_steerable(scene, tmp_path_factory.mktemp("deep") / "deep.prelight", settings=settings)


def test_moving_pictures_have_the_first_bounce_too(prelight: Any, deep: Bake, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(
        "[[spot]]\nintensity = [3, 2, 1]\ntarget = [0, 0, 0]\nwidth_deg = 20\n"
        "keys = [{ at = 0.5, target = [0.3, 0.1, 0] }]\n"
    )
    assert prelight("relight", deep.path, rig, "-o", tmp_path / "still.exr").code == 0
    moved = prelight("animate", deep.path, rig, "-o", tmp_path / "shot_{frame}.exr", "--fps", "2")
    assert moved.code == 0, moved.err
    still, first, last = (
        read_radiance_map(tmp_path / f"{name}.exr") for name in ("still", "shot_0000", "shot_0001")
    )
    assert np.array_equal(still, first)
    light = Rig.open(str(rig)).lights_at(0.5)
    live = SteerableRelighter(open_steerable(deep))
    live.light(light)
    direct = first_bounces(live, open_deep(deep), light)
    assert direct.mean() > 0.2 * last.mean()
    expected = np.maximum(live.radiance + direct, 0).reshape(last.shape)
    assert np.allclose(last, expected, atol=2e-3 * expected.max())


def test_rigs_and_options_that_do_not_belong_are_one_line(prelight: Any, bake: Bake, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    spot = "[[spot]]\nlayer = 'key'\ntarget = [0, 0, 0]\n"
    for text, options, words in (
        (spot + "intensity = [nan, 1, 1]", (), "finite"),
        (spot + "intensity = [-1, 1, 1]", (), "-1"),
        (spot + "intensity = [1e39, 1, 1]", (), "at most 1e+20"),
        (spot + "intensity = [1, 1, 1]", ("--scale", "nan"), "finite"),
        (spot + "intensity = [1, 1, 1]", ("--tint", "1,-1,1"), "at least 0"),
        (spot + "intensity = [1, 1, 1]", ("--rotate", "30"), "leave them out"),
        (spot.replace("key", "top") + "intensity = [1, 1, 1]", (), "layer top is that of a panel"),
        (spot.replace("key", "sun") + "intensity = [1, 1, 1]", (), "it has key, top"),
        (spot + "intensity = [1, 1, 1]\n[environment]\nmap = 'stock:sunset'", (), "nothing else"),
        ("[[spot]]\nintensity = [1, 1, 1]\ntarget = [0, 0, 0]", (), "no layer is named"),
    ):
        rig.write_text(text)
        answer = prelight("relight", bake.path, rig, *options)
        assert answer.code == 2, text
        assert words in answer.err, answer.err
        assert answer.err.count("\n") == 1
    rig.write_text(spot + "intensity = [1, 1, 1]\n[environment]\nmap = 'stock:sunset'")
    assert "nothing else" in prelight("animate", bake.path, rig, "-o", tmp_path / "a.webp").err
    rig.write_text(spot.replace("target = [0, 0, 0]", "target = [1e300, 0, 0]") + "intensity = [1, 1, 1]")
    assert prelight("relight", bake.path, rig).code == 0
    rig.write_text(spot + "intensity = [1, 1, 1]\npolynomial = [0, 1]")
    assert "takes light away" in prelight("relight", bake.path, rig).out


def test_the_format_is_specified(bake: Bake, deep: Bake) -> None:
    """The reader of docs/bake-format.md, in place of somebody else's program."""
    text = (Path(__file__).resolve().parents[1] / "docs" / "bake-format.md").read_text(encoding="utf-8")
    theirs: dict = {}
    exec(compile("\n".join(re.findall(r"```python\n(.*?)```", text, re.S)), "bake-format.md", "exec"), theirs)
    spot = Spot((3.0, 2.0, 1.0), target=(0.1, 0.2, 0.0), distribution=Power(30), layer="key")
    panel = Panel((0.4, 0.5), (0.8, 0.9), (1.0, 2.0, 3.0), layer="top")
    for light in (spot, panel):
        live = SteerableRelighter(open_steerable(bake))
        live.light([light], negligible=0.0)
        layer = live.layer_of(light)
        picture = theirs["steered"](bake.path, layer.name, light.coefficients(layer.basis, layer.place))
        assert np.allclose(live.radiance, picture, atol=1e-5 * picture.max())
        assert len(layer.planes.bright)
    live = SteerableRelighter(open_steerable(deep))
    turn = frame(spot.aim(live.layers["key"].place), 0.0)
    first = theirs["first_bounce"](
        deep.path, "key", lambda d: Power(30).along(d @ turn) * np.array(spot.intensity)
    )
    assert first.max() > 0
    assert np.allclose(first, first_bounces(live, open_deep(deep), [spot]), atol=1e-5 * first.max())
    listed = set(re.findall(r"^    (\w+)/ .*zarr\.json", text.split("layers/NAME/")[1], re.M))
    there = {name.split("/")[2] for one in (bake, deep) for name in one.manifest.arrays if name[0] == "l"}
    assert there | {"deep_places"} == listed  # of panels: test_steerable_hybrids


def test_how_well_lights_will_be_held_is_told_before_the_bake(tmp_path: Path) -> None:
    lamps = [BakedLamp("key", SteeredSpot((0.5, 0.8, 0.5), 5))]
    rig = tmp_path / "rig.toml"
    light = "[[spot]]\nintensity = [3, 3, 3]\ntarget = [0, 0, 0]\n"
    rig.write_text(f"{light}width_deg = 30\n{light}width_deg = 90\n")
    narrow, wide = said_of_lights(rig, lamps)
    assert "approximated by degree 5: 41 % RMS" in narrow
    assert "held to 3 %" in wide
    rig.write_text(f'{light}layer = "fill"\n')
    with pytest.raises(InputError, match="light 1 is for layer 'fill'; this bake will have key"):
        said_of_lights(rig, lamps)
    rig.write_text("[environment]\nmap = 'stock:overcast'\n")
    with pytest.raises(InputError, match=r"no \[\[spot\]\] and no \[\[panel\]\]"):
        said_of_lights(rig, lamps)
