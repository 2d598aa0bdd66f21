"""`prelight inspect`: what it says of each kind of layer, and its two pictures of clusters."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.cli.main import run
from prelight.relighting.relighter import Relighter

from .workshop import assert_refusal

GAP = 12
STILL_LIFE = ["bake", "environment", "stock:still-life-small", "--json", "--camera", "front"]
PIXELS = ["--receivers", "pixels", "--size", "24x16", "--pixel-samples", "1", "--resolution", "4"]


@pytest.fixture(scope="module")
def bakes(tmp_path_factory) -> Path:
    """The glossy still life at the pixels of one eye."""
    folder = tmp_path_factory.mktemp("bakes")
    assert run([*STILL_LIFE, *PIXELS, "-o", str(folder / "pixels.prelight")]) == 0
    return folder


def test_words_tell_layers_apart(prelight, workshop, bakes):
    said = {
        name: prelight("inspect", folder / f"{name}.prelight")
        for name, folder in {"ball": workshop, "pixels": bakes}.items()
    }
    assert {(answer.code, answer.err) for answer in said.values()} == {(0, "")}
    for name, words in {
        "ball": [
            "diffuse vertices, seen from anywhere, 2 zones",
            "  bounces    as often as matters",
            "3 modes of 486 cells of light",
            "loses      gloss",
            "  cost       ",
        ],
        "pixels": [
            "mirrors and clear glass",
            " rays, ",
            "front, close",
            "24×16 pixels of camera 'front', 1 sample each",
        ],
    }.items():
        for word in words:
            assert word in said[name].out
    assert "mirrors" not in said["ball"].out


def test_json_of_a_layer_of_pixels(prelight, bakes):
    answer = prelight("inspect", bakes / "pixels.prelight", "--json")
    assert (answer.code, answer.err) == (0, "")
    said = json.loads(answer.out)
    assert said["pictures"] == []
    (layer,) = said["layers"]
    assert (layer["camera"], layer["basis_lights"]) == ("front", 6 * 4**2)
    for name, value in {"receivers": "pixels", "width": 24, "height": 16, "samples": 1}.items():
        assert layer["parameters"][name] == value


def picture_of(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")).astype(float)


def test_clusters_on_the_unfolded_cube(prelight, workshop, tmp_path):
    """Four faces high and three wide; each zone has its own; a light behind them changes the colours only."""
    plain, other, over = (tmp_path / f"{name}.png" for name in ("plain", "other", "over"))
    call = ["inspect", workshop / "ball.prelight", "--json", "--clusters"]
    for output, options in ((plain, []), (other, ["--zone", "1"]), (over, ["--over", "stock:sunset"])):
        answer = prelight(*call, output, *options)
        assert json.loads(answer.out)["pictures"] == [str(output)]
        assert picture_of(output).shape == (1280, 960, 3)
    assert plain.read_bytes() != other.read_bytes()
    red, _, blue = np.moveaxis(picture_of(over)[320:640], -1, 0)
    assert (red - blue).max() > 60, "the glow of a sunset"
    red, _, blue = np.moveaxis(picture_of(plain)[320:640], -1, 0)
    assert (red - blue).max() < 20
    light = Relighter(workshop / "ball.prelight")
    sizes = [light.clusters(k).shape[0] for k in range(2)]
    assert sizes[0] != sizes[1], "pictures that differ show nothing of zones whose clusters are the same"
    assert_refusal(prelight("inspect", workshop / "ball.prelight", "--clusters", plain), 3, "--force")
    assert prelight(*call, plain, "--force").code == 0


def three(picture: np.ndarray, wide: int, high: int) -> list[np.ndarray]:
    return [picture[GAP : GAP + high, GAP + k * (wide + GAP) :][:, :wide] for k in range(3)]


@pytest.mark.parametrize(("bake", "wide", "high"), [("ball", 560, 420), ("pixels", 312, 208)])
def test_one_light_beside_its_cluster(prelight, workshop, bakes, tmp_path, bake, wide, high):
    """The same picture twice but for what the cluster loses, and that is what the third shows."""
    output = tmp_path / "light.png"
    path = (workshop if bake == "ball" else bakes) / f"{bake}.prelight"
    answer = prelight("inspect", path, "--light", "170,55", "-o", output)
    assert (answer.code, answer.err) == (0, "")
    assert str(output) in answer.out
    picture = picture_of(output)
    assert picture.shape[1] == 3 * wide + 4 * GAP
    alone, clustered, difference = three(picture, wide, high)
    assert alone.std() > 20
    assert np.corrcoef(alone.ravel(), clustered.ravel())[0, 1] > 0.95
    differs = np.abs(alone - clustered).max(axis=2)
    assert difference[differs >= np.percentile(differs, 99)].mean() > difference.mean()
    assert (picture[high + 2 * GAP :] < 200).any(), "captions"


def test_a_light_from_below_is_dark(prelight, workshop, tmp_path):
    """Where the floor hides it from everything: only the seams of the ball's underside may show."""
    above, below = tmp_path / "above.png", tmp_path / "below.png"
    for output, direction in ((above, "0,90"), (below, "0,-90")):
        assert prelight("inspect", workshop / "ball.prelight", "--light", direction, "-o", output).code == 0
    assert three(picture_of(above), 560, 420)[0].mean() > 30
    assert three(picture_of(below), 560, 420)[0].mean() < 1


BAD = [
    (["--clusters", "p.jpg"], ".png"),
    (["--clusters", ""], ""),
    (["--clusters", "p.png", "--zone", "5"], "0 to 1"),
    (["--clusters", "p.png", "--zone", "-1"], "0 to 1"),
    (["--clusters", "p.png", "--zone", "1.5"], "whole number"),
    (["--clusters", "p.png", "--over", "stock:nothing"], "stock:nothing"),
    (["--clusters", "p.png", "--over", "missing.hdr"], "missing.hdr"),
    (["--zone", "1"], "--clusters"),
    (["--over", "stock:noon"], "--clusters"),
    (["--camera", "front"], "--light"),
    (["--light", "30,40"], "--output"),
    (["-o", "p.png"], "--light"),
    (["--light", "30,40", "-o", "p.gif"], ".png"),
    (["--light", "30,40", "-o", "p.png", "--camera", "nowhere"], "it has none"),
    *((["--light", angles, "-o", "p.png"], "light") for angles in
      ("30", "", "a,b", "1,2,3", "nan,0", "inf,0", "0,nan", "0,90.5", "0,-91")),
]  # fmt: skip


@pytest.mark.parametrize(
    ("options", "word"), BAD, ids=lambda value: " ".join(value) if isinstance(value, list) else ""
)
def test_refusals(prelight, workshop, tmp_path, monkeypatch, options, word):
    monkeypatch.chdir(tmp_path)
    assert_refusal(prelight("inspect", workshop / "ball.prelight", *options), 2, word)
    assert not list(tmp_path.iterdir())


def test_outputs_that_cannot_be(prelight, workshop, bakes, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for options in (["--clusters", "nowhere/p.png"], ["--light", "0,50", "-o", "nowhere/p.png"]):
        assert_refusal(prelight("inspect", workshop / "ball.prelight", *options), 3, "nowhere")
    same = ["--clusters", "p.png", "--light", "0,50", "-o", "p.png"]
    assert_refusal(prelight("inspect", workshop / "ball.prelight", *same), 2, "two pictures")
    assert_refusal(
        prelight("inspect", bakes / "pixels.prelight", "--light", "0,50", "-o", "p.png", "--camera", "close"),
        2,
    )
    assert not list(tmp_path.iterdir())
