"""Lights that change in time: keys in a rig, what is between them, and the frames."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.errors import InputError
from prelight.lighting.distributions import Power
from prelight.lighting.keyframes import Track, between
from prelight.lighting.panel import Panel
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot

from .steerable_scenes import SIDE, bake_of, spot_layer

MOVING = """
[[spot]]
intensity = [4, 2, 0]
azimuth_deg = 0
elevation_deg = 0
power = 2
ease = "linear"
keys = [ { at = 1, azimuth_deg = 90, elevation_deg = 0, power = 8 }, { at = 3, scale = 0.5 } ]
[[panel]]
position = [0.2, 0.5]
width = 0.5
radiance = [1, 1, 1]
keys = [ { at = 2, position = [0.6, 0.5], width = 0.7 } ]
"""


@pytest.fixture
def rig(tmp_path: Path):
    def opened(text: str) -> Rig:
        (tmp_path / "rig.toml").write_text(text)
        return Rig.open(str(tmp_path / "rig.toml"))

    return opened


def test_keys_say_where_lights_are(rig) -> None:
    moving = rig(MOVING)
    assert moving.duration == 3.0
    spot, panel = moving.lights_at(0.5)
    np.testing.assert_allclose(
        spot.direction, [math.sqrt(0.5), 0, -math.sqrt(0.5)], atol=1e-9
    )  # halfway around
    assert spot.distribution.power == pytest.approx(4.0)  # by factors
    assert spot.intensity == (4, 2, 0)
    np.testing.assert_allclose(panel.position, [0.2 + 0.4 * 0.15625, 0.5])  # smooth: 3·0.25² − 2·0.25³
    dimming = moving.lights_at(2.0)[0]
    np.testing.assert_allclose(dimming.intensity, [3, 1.5, 0])
    np.testing.assert_allclose(dimming.direction, [1, 0, 0], atol=1e-9)  # what a key leaves out stays
    assert moving.lights_at(-1.0) == moving.lights == moving.lights_at(0.0)
    assert moving.lights_at(99.0) == moving.lights_at(3.0)
    assert moving.lights_at(99.0)[0].distribution == Power(8.0)
    np.testing.assert_allclose(moving.lights_at(99.0)[1].width, [0.7, 0.7])


def test_opposite_directions_have_a_way_between() -> None:
    one, other = (Spot((1, 1, 1), direction=d) for d in ((0, 1, 0), (0, -1, 0)))
    middle = np.array(between(one, other, 0.5).direction)
    assert abs(middle @ [0, 1, 0]) < 1e-9
    assert np.linalg.norm(middle) == pytest.approx(1.0)
    assert between(one, one, 0.3) == one


BAD = {
    "keys = [ { at = 0 } ]": "greater than 0.*/spot/0/keys/0/at",
    "keys = [ { at = 2 }, { at = 1 } ]": "times that rise.*/spot/0",
    "keys = [ { at = 1, target = [1, 0, 0] } ]": "a direction at every time, or a target at every time",
    "keys = [ { at = 1, polynomial = [1] } ]": "'polynomial' is not known here; known are direction",
    "keys = [ { scale = 1 } ]": "at is missing.*/spot/0/keys/0/at",
    "keys = [ { at = 1, width_deg = 40 } ]\npolynomial = [1, 1]": "at 1 s: expected one of width_deg and polynomial",
    "keys = [ { at = 1, azimuth_deg = 4 } ]": "at 1 s: expected either direction",
}


@pytest.mark.parametrize("keys", BAD)
def test_keys_are_checked(rig, keys: str) -> None:
    with pytest.raises(InputError, match=BAD[keys]) as caught:
        rig("[[spot]]\nintensity = [1, 1, 1]\ndirection = [0, -1, 0]\n" + keys)
    assert "\n" not in str(caught.value)


def test_what_has_nothing_between_is_refused() -> None:
    spot, panel = Spot((1, 1, 1), direction=(0, 1, 0)), Panel((0.5, 0.5), (0.5, 0.5), (1, 1, 1))
    with pytest.raises(InputError, match="nothing between lights of two kinds"):
        Track((0.0, 1.0), (spot, panel))
    with pytest.raises(InputError, match="as many times as lights"):
        Track((0.0,), (spot, spot))


@pytest.fixture
def bake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A command's bake from memory, and a rig beside it."""
    layer = spot_layer(3)
    monkeypatch.setattr("prelight.relighting.steerable_bake.open_steerable", lambda bake: [layer])
    monkeypatch.setattr("prelight.storage.bake.Bake.open", lambda path: bake_of(layer.name))
    light = "[[spot]]\nintensity = [1, 1, 1]\ndirection = [-1, -1, 0]\n"
    (tmp_path / "still.toml").write_text(light)
    (tmp_path / "rig.toml").write_text(light + "keys = [ { at = 0.5, direction = [1, -1, 0] } ]")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_frames_follow_the_light(prelight, bake: Path) -> None:
    answer = prelight("animate", "a.prelight", "rig.toml", "-o", "shot_{frame}.exr", "--fps", "8", "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["frames"] == 5
    from prelight.images.formats import read_radiance_map

    frames = [read_radiance_map(bake / f"shot_000{n}.exr") for n in range(5)]
    left = [float(f[:, : SIDE // 2].mean() / f[:, SIDE // 2 :].mean()) for f in frames]
    assert left == sorted(left, reverse=True)
    assert left[0] > 1.5 * left[-1]
    answer = prelight("animate", "a.prelight", "rig.toml", "-o", "shot.webp", "--fps", "8")
    assert answer.code == 0, answer.err
    with Image.open(bake / "shot.webp") as moving:
        assert moving.n_frames == 5
        assert moving.size == (SIDE, SIDE)
    assert prelight("animate", "a.prelight", "rig.toml", "-o", "shot.webp").code == 3  # it is there


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["rig.toml", "-o", "a.avi"], "ending in .mp4, .webp or .gif, or with {frame}"),
        (["rig.toml", "-o", "a.png"], "or with {frame}"),
        (["still.toml", "-o", "a.webp"], "none of its lights has keys"),
        (["rig.toml", "-o", "a.webp", "--fps", "0"], "expected 0.1 to 240"),
        (["rig.toml", "-o", "a.webp", "--seconds", "80000"], "at most 20,000 are made"),
        (["rig.toml", "-o", "a.webp", "--seconds", "-1"], "more than 0"),
        (["rig.toml", "-o", "none/a.webp"], "no such folder"),
    ],
)
def test_the_command_refuses(prelight, bake: Path, options: list[str], message: str) -> None:
    answer = prelight("animate", "a.prelight", *options)
    assert answer.code in (2, 3)
    assert message in answer.err
    assert answer.err.count("\n") == 1
