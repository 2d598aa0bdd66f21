"""Environment layers of one eye among layers of other kinds: pixels add to pixels, the rows of vertices shine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.baking.steerable import bake_steerable
from prelight.baking.steerable_settings import BakedLamp, SteerableSettings
from prelight.cli.main import run
from prelight.errors import InputError
from prelight.lighting.distributions import Power
from prelight.lighting.environment import Environment
from prelight.lighting.keyframes import Track
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot
from prelight.relighting.lit_bake import LitBake
from prelight.relighting.relighter import Relighter
from prelight.relighting.steerable_bake import SteerableBake
from prelight.scene.loading import load_scene
from prelight.storage.bake import Bake
from prelight.storage.joining import add_layers
from prelight.studio.environments import Environments
from prelight.studio.lighting import lighting_of
from prelight.studio.lit_rows import View
from prelight.studio.protocol import SetEnvironment, SetLamp, State
from prelight.studio.protocol_values import LampLight
from prelight.studio.rig_state import changed, initial
from prelight.studio.shown import Shown
from prelight.transport.basis_images import ImageSettings
from prelight.transport.steered_lamps import SteeredSpot

from .test_studio_rgb9e5 import unpacked

W, H = 20, 14
LAMP = SteeredSpot((0.5, 1.5, 1.0), 1)
SKY = Environment.constant((1.0, 0.5, 0.25))


@pytest.fixture(scope="module")
def scene():
    return load_scene("stock:still-life-small")


@pytest.fixture(scope="module")
def folder(scene, tmp_path_factory):
    """Pixels of an eye with a spot that it sees too, and vertices of the eye, each in a bake."""
    out = tmp_path_factory.mktemp("eye")
    options = {"resolution": 8, "bounces": 0, "camera": "front"}
    bake_environment(
        scene, out / "pixels.prelight", receivers="pixels", width=W, height=H, pixel_samples=1, **options
    )
    bake_environment(scene, out / "vertices.prelight", **options)
    images = ImageSettings(W, H, samples=4, particles=4, depth=2)
    lamps = SteerableSettings((BakedLamp("key", LAMP),), camera="front", images=images, keep="all")
    bake_steerable(scene, out / "lamp.prelight", settings=lamps)
    bake_environment(
        scene, out / "both.prelight", receivers="pixels", width=W, height=H, pixel_samples=1, **options
    )
    add_layers(out / "both.prelight", out / "lamp.prelight")
    bake_environment(scene, out / "lit.prelight", **options)
    add_layers(out / "lit.prelight", out / "lamp.prelight")
    return out


def test_pixels_add_up(folder):
    """A sky and a spot in one picture, each as it is alone; and no light counts twice."""
    spot = Spot(LAMP.position, target=(0.0, 0.0, 0.0), distribution=Power(1))
    rig = Rig(SKY, (Track((0.0,), (spot,)),))
    light, sky, lamp = (
        LitBake(folder / "both.prelight"),
        Relighter(folder / "pixels.prelight"),
        SteerableBake(folder / "lamp.prelight"),
    )
    light.light(rig)
    sky.environment = SKY
    lamp.light([spot])
    whole, of_lamp = light.picture(), lamp.picture().linear
    np.testing.assert_allclose(whole.linear, sky.picture().linear + of_lamp, rtol=1e-5, atol=1e-6)
    assert of_lamp.mean() > 0.01
    np.testing.assert_array_equal(whole.coverage, sky.coverage)
    light.light(Rig(SKY))
    np.testing.assert_allclose(light.picture().linear, sky.picture().linear, rtol=1e-5, atol=1e-6)


def test_vertices_of_an_eye_shine_as_it_sees_them(folder):
    light, alone = LitBake(folder / "vertices.prelight"), Relighter(folder / "vertices.prelight")
    light.light(Rig(SKY))
    alone.environment = SKY
    eye = alone.camera()
    assert light.camera() == eye
    np.testing.assert_allclose(light.radiance(eye.eye), alone.radiance, rtol=1e-5, atol=1e-7)
    glossy = light.glossy(eye.eye)
    assert glossy is not None
    assert 0 < (glossy.sum(axis=1) > 0).mean() < 1
    ours, theirs = (one.picture(width=80, height=60).linear for one in (light, alone))
    assert np.abs(ours - theirs).mean() < 0.01 * theirs.mean()


def test_films_and_days_of_pixels(folder, tmp_path):
    """What ``relight`` of one moment takes, ``animate`` and ``--day`` take too."""
    bake, rig = str(folder / "pixels.prelight"), tmp_path / "rig.toml"
    rig.write_text('[environment]\nmap = "stock:noon"\n')
    assert run(["relight", bake, str(rig), "-o", str(tmp_path / "still.npy")]) == 0
    assert np.load(tmp_path / "still.npy").shape == (W * H, 3)
    day = ["--day", "2026-06-21", "--place", "43.7,15.9", "--steps", "2"]
    assert run(["relight", bake, str(rig), *day, "-o", str(tmp_path / "day_{frame}.exr")]) == 0
    moving = ["--seconds", "1", "--fps", "2"]
    assert run(["animate", bake, str(rig), *moving, "-o", str(tmp_path / "frame_{frame}.exr")]) == 0
    assert sorted(path.stem for path in tmp_path.glob("*.exr")) == [
        *(f"day_{n:04}" for n in range(2)), *(f"frame_{n:04}" for n in range(3))
    ]  # fmt: skip


def test_eyes_that_differ_do_not_add(folder, scene, tmp_path):
    bake_environment(scene, tmp_path / "wide.prelight", resolution=8, bounces=0, receivers="pixels", camera="front",
                     width=W + 1, height=H, pixel_samples=1)  # fmt: skip
    add_layers(tmp_path / "wide.prelight", folder / "lamp.prelight")
    with pytest.raises(InputError, match="of different eyes or sizes"):
        LitBake(Bake.open(tmp_path / "wide.prelight"))


# ---- In the studio -----------------------------------------------------------------------------------------------

EVEN = changed(initial("stock:overcast"), SetEnvironment(rotation_deg=40.0, scale=0.5), author=None)
KEY = LampLight(
    "k", "Key", "spot", True, LAMP.position, (0.0, 0.0, 0.0), 900.0, 1.0, (1.0, 1.0, 1.0), 0.0, 40.0, (0.5, 0.5),
    layer="key",
)  # fmt: skip


def shown(bake: Bake, state: State) -> tuple[np.ndarray, np.ndarray, View]:
    """What the studio sends of a state: vertices, pixels, and what depends on the eye."""
    light = lighting_of(bake, Environments())
    assert light.relight(state, exact=True, check=lambda: None)[0]
    rows = unpacked(np.frombuffer(light.frame(state), np.uint32, offset=32))
    assert len(rows) == light.rows == Shown(bake).rows
    eye = Shown(bake).cameras[0].eye
    return *np.split(rows, [len(bake.receivers)]), light.view(state, eye)


def test_the_studio_adds_pixels_of_a_sky_and_a_lamp(folder):
    """Dark vertices; the pixels are those of the sky alone and of the lamp alone."""
    bake, alone = Bake.open(folder / "both.prelight"), Relighter(folder / "pixels.prelight")
    view = Shown(bake).steered
    assert view is not None
    assert (view.camera.name, view.width, view.height) == ("front", W, H)
    alone.environment = Environments().open("stock:overcast").rotated(40.0).scaled(0.5)
    dark, sky, _ = shown(bake, EVEN)
    _, both, _ = shown(bake, changed(EVEN, SetLamp(KEY), author=None))
    _, lamp, _ = shown(bake, changed(replace(EVEN, scale=0.0), SetLamp(KEY), author=None))
    assert not dark.any()
    step = 2.0**-8 * both.max()
    assert np.abs(sky - alone.radiance).max() < step
    assert lamp.mean() > 0.01 * both.mean()
    assert np.abs(both - sky - lamp).max() < 3 * step


def test_the_studio_shows_vertices_of_an_eye_among_others(folder):
    """Lambertian rows as irradiance, the others as light toward the eye: together what the layer alone says."""
    bake, alone = Bake.open(folder / "lit.prelight"), Relighter(folder / "vertices.prelight")
    alone.environment = Environments().open("stock:overcast").rotated(40.0).scaled(0.5)
    rows, pixels, view = shown(bake, EVEN)
    assert Shown(bake).glossy
    assert not pixels.any()
    assert view.shine is not None
    found = rows * bake.receivers.albedo + view.shine[:, :3]
    np.testing.assert_allclose(found, alone.radiance, atol=2.0**-8 * found.max())
    assert not rows[np.setdiff1d(np.arange(len(rows)), alone.lambertian)].any()
