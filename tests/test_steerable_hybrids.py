"""First bounces kept apart or traced live, lights found in such bakes, bakes against the path tracer, films."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prelight.baking.steerable import bake_steerable
from prelight.baking.steerable_settings import BakedLamp, SteerableSettings
from prelight.camera import Camera
from prelight.encoding.octahedral import encoded_directions, encoded_places
from prelight.errors import DamagedBakeError, InputError, MissingExtraError
from prelight.images.film import check_film, write_film
from prelight.images.formats import write_exr
from prelight.lighting.distributions import Gobo, Power
from prelight.lighting.panel import Panel
from prelight.lighting.places import Place
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot
from prelight.material import Material
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.deep_buffer import DeepBuffer
from prelight.relighting.steerable_bake import SteerableBake
from prelight.relighting.stored_steerable import open_deep, open_steerable
from prelight.relighting.viewed import narrow_parts
from prelight.scene.stock.parts import rectangle, scene_of
from prelight.storage.bake import Bake
from prelight.transport.basis_images import ImageSettings
from prelight.transport.deep_buffer import deep_samples
from prelight.transport.steered_lamps import SteeredBox, SteeredPanel, SteeredSky, SteeredSpot

from .disk import rewrite_manifest
from .steered import LAMP_AT, room

W, H = 20, 14
IMAGES = ImageSettings(W, H, samples=128, particles=8, depth=4)
SPOT = BakedLamp("key", SteeredSpot(LAMP_AT, 3, 0.1))
PANEL = BakedLamp("top", SteeredPanel((-0.5, 0.75, -0.4), (1.0, 0, 0), (0, 0, 1.0), (1, 1)))
NARROW = Spot((3.0, 2.0, 1.0), target=(0.1, 0.1, -0.1), distribution=Power.of_width(25.0), layer="key")
SLIT = Panel((0.35, 0.6), (0.3, 0.35), (2.0, 3.0, 4.0), layer="top")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Bake:
    """Every bounce in the layers."""
    settings = SteerableSettings((SPOT, PANEL), images=IMAGES, keep="all")
    return bake_steerable(room(), tmp_path_factory.mktemp("whole") / "whole.prelight", settings=settings)


@pytest.fixture(scope="module")
def deep(tmp_path_factory: pytest.TempPathFactory) -> Bake:
    """First bounces apart."""
    settings = SteerableSettings((SPOT, PANEL), images=IMAGES, keep="all", deep=256)
    return bake_steerable(room(), tmp_path_factory.mktemp("deep") / "deep.prelight", settings=settings)


def rms(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(a - b)) / np.mean(np.square(b))))


@pytest.mark.parametrize(("light", "better"), [(NARROW, 2.0), (SLIT, 1.1)])
def test_narrow_lights_are_true_in_both_hybrids(whole: Bake, deep: Bake, light: Any, better: float) -> None:
    """Against the path tracer: exact in the first, as good in the second, poor in the layer alone."""
    from prelight.checking.against_lamps import LampComparison

    plain, first = SteerableBake(whole), SteerableBake(deep)
    second = SteerableBake(whole, narrow=narrow_parts(whole, 256))
    errors = {}
    for name, live in (("plain", plain), ("first", first), ("second", second)):
        work = LampComparison(live, [light])
        figures = work.run(samples=8192)
        errors[name] = np.sqrt(max(figures["relative_rms"] ** 2 - figures["noise"] ** 2, 0))
    assert errors["first"] < 0.14, errors
    assert errors["plain"] > better * errors["second"], errors
    assert errors["plain"] > better * errors["first"], errors
    assert plain.notes([light])
    assert not second.notes([light])


@pytest.mark.parametrize("width", [0.06, 0.3])
def test_a_narrow_light_on_a_panel_as_its_integral_says(width: float) -> None:
    """ρ/π·∫ L·cos θ·cos θ'/r² dA on a floor, where a sixteenth of the panel may have no sample at all."""
    x, z = np.array([4.0, 0, 0]), np.array([0, 0, -4.0])
    sheet = rectangle(np.array([-2.0, 0, 2.0]), x, z, cells=(1, 1))
    eye = Camera((0.0, 2.0, 0.001), (0.0, 0.0, 0.0), vertical_fov_deg=0.2)
    scene = scene_of("floor", [(sheet, Material("grey", (0.6, 0.6, 0.6)))], cameras={"down": eye})
    lamp = SteeredPanel((-0.5, 1.0, -0.4), (1.0, 0, 0), (0, 0, 1.0), (1, 1))
    found = deep_samples(SurfaceScene(scene), lamp, eye, settings=ImageSettings(1, 1), samples=256)
    assert found.aimed.mean() > 0.9
    assert {tuple(part) for part in (found.places * 16).astype(int).tolist()} == {
        (a, b) for a in range(16) for b in range(16)
    }
    codes = encoded_places(found.places, found.aimed)
    deep = DeepBuffer(
        found.starts, found.colours, encoded_directions(found.directions), None, codes, parts=16
    )
    panel = Panel((0.37, 0.61), (width, width), (1.0, 2.0, 3.0))
    radiance = deep.radiance(panel, Place("panel", lamp.corner, (lamp.side_u, lamp.side_v)))[0]
    at = (np.arange(400) + 0.5) / 400
    u, v = (part.ravel() for part in np.meshgrid(at, at, indexing="ij"))
    p = np.array(lamp.corner) + np.outer(u, lamp.side_u) + np.outer(v, lamp.side_v)
    brought = panel.shape_at(np.stack([u, v], axis=1)) * p[:, 1] ** 2 / (p**2).sum(axis=1) ** 2
    assert radiance == pytest.approx(0.6 / np.pi * brought.mean() * np.array([1.0, 2.0, 3.0]), rel=0.03)


def test_what_a_layer_holds_gains_nothing_from_the_second_hybrid(whole: Bake) -> None:
    held = Spot((1.0, 1.0, 1.0), target=(0.1, 0.2, 0.0), layer="key")
    plain, second = SteerableBake(whole), SteerableBake(whole, narrow=narrow_parts(whole, 4))
    plain.light([held])
    second.light([held])
    assert rms(second.radiance, plain.radiance) < 1e-4


def test_narrow_parts_are_of_bakes_that_hold_all(deep: Bake, whole: Bake, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="keeps first bounces apart"):
        narrow_parts(deep, 4)
    with pytest.raises(InputError, match="1 to 256"):
        narrow_parts(whole, 257)


def test_first_bounces_of_the_other_kind_are_refused(deep: Bake) -> None:
    found = open_deep(deep)
    layers = {layer.name: layer for layer in open_steerable(deep)}
    assert found["top"].places is not None
    with pytest.raises(InputError, match="that of a panel"):
        found["top"].radiance(NARROW, layers["top"].place)
    with pytest.raises(InputError, match="that of a spot"):
        found["key"].radiance(SLIT, layers["key"].place)


@pytest.mark.parametrize("change", ["pop", "shape"])
def test_forged_first_bounces_are_refused(deep: Bake, tmp_path: Path, change: str) -> None:
    import shutil

    folder = tmp_path / "forged.prelight"
    shutil.copytree(deep.path, folder)

    def forge(manifest: dict) -> None:
        if change == "pop":
            manifest["arrays"].pop("layers/top/deep_directions")
        else:
            manifest["arrays"]["layers/top/deep_places"]["shape"][0] += 1

    rewrite_manifest(folder, forge)
    with pytest.raises(DamagedBakeError):
        open_deep(Bake.open(folder))


def test_lights_are_found_where_first_bounces_are_apart(deep: Bake, prelight: Any, tmp_path: Path) -> None:
    known = (replace(NARROW, distribution=Power.of_width(60.0)), replace(SLIT, width=(0.5, 0.6)))
    live = SteerableBake(deep)
    live.light(known)
    write_exr(tmp_path / "wanted.exr", live.radiance.reshape(H, W, 3))
    answer = prelight(
        "solve", deep.path, "-t", tmp_path / "wanted.exr", "-o", tmp_path / "found.toml", "--json"
    )
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["relative_rms"] < 0.02
    spot, panel = Rig.open(str(tmp_path / "found.toml")).lights
    place = next(layer.place for layer in open_steerable(deep) if layer.name == "key")
    assert np.degrees(np.arccos(spot.aim(place) @ known[0].aim(place))) < 1.5
    assert spot.distribution.width_deg == pytest.approx(60.0, rel=0.05)
    assert panel.position == pytest.approx(known[1].position, abs=0.02)
    assert spot.intensity == pytest.approx(known[0].intensity, rel=0.05)


def test_a_lamp_that_lights_nothing_is_told_and_leaves_nothing(tmp_path: Path, prelight: Any) -> None:
    away = BakedLamp("up", SteeredPanel((-0.5, 1.7, -0.4), (0, 0, 1.0), (1.0, 0, 0), (1, 1)))  # it shines up
    target = tmp_path / "dark.prelight"
    for keep in ("all", SteerableSettings((away,)).keep):
        settings = SteerableSettings((away,), images=replace(IMAGES, samples=8), keep=keep)
        with pytest.raises(InputError, match="lamp up: lights nothing"):
            bake_steerable(room(), target, settings=settings)
        assert list(tmp_path.iterdir()) == []
    answer = prelight(
        "bake", "steerable", "stock:steerable-small", "-o", target, "--spot", "0,-0.5,0", "--size", "8x8",
        "--samples", "8", "--degree", "1",
    )  # fmt: skip
    assert (answer.code, answer.err.count("lights nothing")) == (2, 1)
    assert list(tmp_path.iterdir()) == []


def test_light_that_never_bounces_is_a_bake_where_first_bounces_are_apart(tmp_path: Path) -> None:
    settings = SteerableSettings((SPOT,), images=replace(IMAGES, samples=8, depth=2), deep=16)
    live = SteerableBake(bake_steerable(room(), tmp_path / "a.prelight", settings=settings))
    live.light([NARROW])
    assert live.radiance.max() > 0.1
    assert not live.live.radiance.any()


def test_shapes_of_all_kinds_are_compared(whole: Bake, prelight: Any, tmp_path: Path) -> None:
    """A picture in front of the lamp, by its values, and lights of two layers at once."""
    from prelight.checking.against_lamps import LampComparison

    slope = np.linspace(0.2, 1.0, 64)[None, :, None] * np.ones((48, 1, 3)) * [1.0, 0.6, 0.3]
    gobo = Spot(
        (3.0, 3.0, 3.0), target=(0, 0.2, 0), distribution=Gobo(slope, 120.0), roll_deg=30, layer="key"
    )
    live = SteerableBake(whole, narrow=narrow_parts(whole, 256))
    soft = Panel((0.5, 0.45), (0.9, 0.9), (1.0, 1.0, 1.0), shape="soft", layer="top")
    figures = LampComparison(live, [gobo, soft]).run(samples=1024)
    assert figures["relative_rms"] < 0.06, figures
    turned = LampComparison(live, [replace(gobo, roll_deg=-60), soft]).run(samples=64)
    live.light([gobo, soft])
    wrong = LampComparison(live, [gobo, soft])
    wrong._radiance = np.roll(wrong._radiance, 3, axis=0)
    assert wrong.run(samples=64)["relative_rms"] > 2 * turned["relative_rms"]

    rig = tmp_path / "rig.toml"
    rig.write_text("[[spot]]\nlayer = 'key'\nintensity = [3, 2, 1]\ntarget = [0, 0, 0]\n")
    answer = prelight("compare", whole.path, rig, "--samples", "256", "-o", tmp_path / "c.png", "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["relative_rms"] < 0.1
    assert (tmp_path / "c.png").stat().st_size > 1000
    assert "relative RMS" in prelight("compare", whole.path, rig, "--samples", "16").out
    assert prelight("compare", whole.path, rig, "--exact").code == 2
    assert prelight("relight", whole.path, rig, "--narrow", "4").code == 0
    assert prelight("relight", whole.path, rig, "--narrow", "999").code == 2


def test_boxes_and_skies_by_command(prelight: Any, tmp_path: Path) -> None:
    target, rig = tmp_path / "a.prelight", tmp_path / "rig.toml"
    bake = (
        "bake", "steerable", "stock:steerable-small", "-o", target, "--size", "8x8", "--samples", "16",
        "--box", "glow=-0.2,0.3,-0.2/0.4,0,0/0,0.2,0/0,0,0.4", "--box-periods", "1", "--depth", "4",
        "--panel=-0.45,0.95,-0.45/1,0,0/0,0,1", "--panel-terms", "0:2,-2+3i:0", "--light-paths", "4",
    )  # fmt: skip
    answer = prelight(*bake)
    assert answer.code == 0, answer.err
    assert "a box of light from" in prelight("inspect", target).out
    rig.write_text(
        "[[panel]]\nlayer = 'glow'\nposition = [0.5, 0.5, 0.5]\nwidth = 1.0\nradiance = [3, 1, 1]\n"
        "[[panel]]\nlayer = 'panel'\nposition = [0.1, 0.5]\nwidth = 0.9\nradiance = [1, 1, 3]\n"
    )
    answer = prelight("relight", target, rig, "-o", tmp_path / "a.npy")
    assert answer.code == 0, answer.err
    assert np.load(tmp_path / "a.npy").max() > 0.05
    assert "no reference" in prelight("compare", target, rig).err
    panel = "--panel=-0.45,0.95,-0.45/1,0,0/0,0,1"
    for wrong, words in (
        ((panel, "--panel-terms", "x"), "RATE:POWER"),
        ((panel, "--panel-terms", "0:40"), "0 to 12"),
        (("--box", "0,0,0/1,0,0/0,1,0"), "expected X,Y,Z/X,Y,Z/X,Y,Z/X,Y,Z"),
        (("--box", "0,0,0/1,0,0/0,1,0/0,0,1", "--deep", "4"), "box of light"),
    ):
        told = prelight("bake", "steerable", "stock:steerable-small", *wrong, "-o", tmp_path / "b.prelight")
        assert told.code == 2, wrong
        assert words in told.err, told.err
        assert told.err.count("\n") == 1


def test_skies_are_relit_and_compared(tmp_path: Path, prelight: Any) -> None:
    sky = BakedLamp("dome", SteeredSky(4))
    settings = SteerableSettings((sky,), images=IMAGES, keep="all")
    target = bake_steerable(room(mirror=True), tmp_path / "sky.prelight", settings=settings).path
    assert "a sky, degree 4" in prelight("inspect", target).out
    rig = tmp_path / "rig.toml"
    rig.write_text("[[spot]]\nintensity = [1, 2, 3]\ndirection = [0.3, 1, 0.4]\npower = 3\n")
    answer = prelight("compare", target, rig, "--samples", "1024", "--json")
    assert answer.code == 0, answer.err
    figures = json.loads(answer.out)
    assert figures["relative_rms"] < 0.08, figures
    assert abs(figures["signed_mean"]) < 0.03, figures
    rig.write_text("[[spot]]\nintensity = [1, 1, 1]\ntarget = [0, 1, 0]\n")
    assert "expected a direction" in prelight("relight", target, rig).err


def test_settings_describe_what_is_baked() -> None:
    box = BakedLamp("a", SteeredBox((0, 0, 0), (1, 0, 0), (0, 2, 0), (0, 0, 3), (1, 0, 2)))
    assert box.basis.functions == 15
    assert box.place()["edges"][2] == [0, 0, 3]
    sky = BakedLamp("b", SteeredSky(3), "odd")
    assert sky.basis.functions == 10
    with pytest.raises(InputError, match="box of light"):
        SteerableSettings((box,), deep=4)
    SteerableSettings((sky,)).check_in(room())


def test_films(tmp_path: Path) -> None:
    from PIL import Image

    frames = [np.full((7, 9, 3), 40 * n, np.uint8) for n in range(5)]
    for name in ("a.webp", "a.gif"):
        assert write_film(tmp_path / name, iter(frames), fps=10) == 5
        with Image.open(tmp_path / name) as film:
            assert (film.n_frames, film.size) == (5, (9, 7))
    with pytest.raises(InputError, match=r"expected a name ending in \.mp4, \.webp or \.gif"):
        check_film(tmp_path / "a.avi")
    with pytest.raises(InputError, match="none given"):
        write_film(tmp_path / "b.gif", [], fps=10)
    with pytest.raises(InputError, match="as the first"):
        write_film(tmp_path / "b.gif", [frames[0], frames[0][1:]], fps=10)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.gif", "a.webp"]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_films_of_ffmpeg(tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    frames = [np.full((7, 9, 3), (200, 60 * n, 20), np.uint8) for n in range(4)]
    assert write_film(tmp_path / "a.mp4", frames, fps=25) == 4
    reader = ffmpeg.read_frames(str(tmp_path / "a.mp4"))
    assert next(reader)["size"] == (10, 8)
    shown = [np.frombuffer(frame, np.uint8).reshape(8, 10, 3) for frame in reader]
    assert len(shown) == 4
    for mine, theirs in zip(frames, shown, strict=True):
        assert np.abs(theirs[:7, :9].astype(int) - mine).max() < 12  # of 255: no colour has shifted


def test_mp4_without_ffmpeg_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match="pip install imageio-ffmpeg"):
        check_film(tmp_path / "a.mp4")
