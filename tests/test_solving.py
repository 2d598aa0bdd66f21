"""Light from a wanted picture: a known rig is recovered from its own picture, and masks decide what counts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from prelight.encoding.principal_components import Keep
from prelight.errors import InputError
from prelight.lighting.distributions import Power
from prelight.lighting.panel import Panel
from prelight.lighting.spot import Spot
from prelight.relighting.steerable import SteerableRelighter
from prelight.solving.nonnegative import nonnegative
from prelight.solving.poses import Freedom, narrowest_power
from prelight.solving.search import solve

from .steerable_scenes import SIDE, bake_of, panel_layer, spot_layer

FINE = Keep(error=0.003)


def picture(layers, lights) -> np.ndarray:
    relighter = SteerableRelighter(layers)
    relighter.light(lights, negligible=0.0)
    return relighter.radiance


def angle_deg(a, b) -> float:
    return float(np.degrees(np.arccos(np.clip(np.dot(a, b), -1.0, 1.0))))


def test_least_squares_without_negative_numbers(rng: np.random.Generator) -> None:
    """The conditions of Karush, Kuhn and Tucker, which only the answer satisfies."""
    for _ in range(20):
        A, t = rng.standard_normal((12, 6)), rng.standard_normal(12)
        x = nonnegative(A.T @ A, A.T @ t)
        slope = A.T @ (t - A @ x)
        assert (x >= 0.0).all()
        assert (slope <= 1e-8).all()
        np.testing.assert_allclose(slope[x > 0.0], 0.0, atol=1e-8)
    np.testing.assert_allclose(nonnegative(np.eye(2), np.array([3.0, -1.0])), [3.0, 0.0])
    same = np.ones((4, 2))  # two lights that are one
    assert nonnegative(same.T @ same, same.T @ np.full(4, 5.0)).sum() == pytest.approx(5.0)


def test_a_spot_is_recovered_from_its_picture() -> None:
    layer = spot_layer(9, keep=FINE)
    known = Spot((3.0, 2.0, 1.0), direction=(0.3, -1.0, 0.2), distribution=Power(12.0), layer="key")
    found = solve([layer], picture([layer], [known]))
    assert found.error < 1e-5
    (light,) = found.lights
    assert angle_deg(light.direction, known.direction) < 0.01
    np.testing.assert_allclose(light.intensity, known.intensity, rtol=1e-4)
    assert light.distribution.power == pytest.approx(12.0, rel=1e-3)


def test_a_spot_and_a_panel_are_told_apart() -> None:
    layers = [spot_layer(5, keep=FINE, position=(1.2, 0.8, -0.6)), panel_layer(3, keep=FINE)]
    known = [
        Spot((0.3, 0.5, 4.0), direction=(-1.0, -0.6, 0.5), distribution=Power(4.0), layer="key"),
        Panel((0.3, 0.7), (0.6, 0.8), (1.0, 2.0, 3.0), layer="soft"),
    ]
    found = solve(layers, picture(layers, known))
    spot, panel = found.lights
    assert found.error < 1e-4
    assert angle_deg(spot.direction, known[0].direction) < 0.1
    np.testing.assert_allclose(spot.intensity, known[0].intensity, rtol=0.01)
    np.testing.assert_allclose(panel.position, known[1].position, atol=0.002)
    np.testing.assert_allclose(panel.width, known[1].width, atol=0.005)
    np.testing.assert_allclose(panel.radiance, known[1].radiance, rtol=0.01)


def test_lights_that_are_given_keep_what_is_not_free() -> None:
    layer = spot_layer(5)
    aims = [(0.5, -1.0, 0.3), (-0.6, -1.0, 0.1), (0.0, -1.0, -0.7)]
    known = [
        Spot(c, direction=a, distribution=Power(4.0)) for a, c in zip(aims, np.eye(3).tolist(), strict=True)
    ]
    wanted = picture([layer], known)
    white = [Spot((1, 1, 1), direction=a, distribution=Power(4.0)) for a in aims]
    found = solve([layer], wanted, lights=white, freedom=Freedom(aim=False, width=False))
    assert found.error < 1e-4
    assert found.steps == 0
    for light, original in zip(found.lights, known, strict=True):
        assert light.direction == original.direction
        np.testing.assert_allclose(light.intensity, original.intensity, atol=1e-3)
    # A light that does nothing for the picture is switched off, never negative.
    spare = [*white, Spot((1, 1, 1), direction=(0, 1, 0), distribution=Power(4.0))]
    off = solve([layer], wanted, lights=spare, freedom=Freedom(aim=False, width=False))
    assert max(off.lights[3].intensity) < 1e-2
    wide = [Spot((1, 1, 1), direction=aims[0], distribution=Power(1.0))]
    fixed = solve([layer], picture([layer], known[:1]), lights=wide, freedom=Freedom(aim=True, width=False))
    assert fixed.lights[0].distribution.power == 1.0
    assert fixed.error > 0.01


def test_only_what_the_mask_shows_counts() -> None:
    layer = spot_layer(5)
    known = Spot((1.0, 1.0, 1.0), direction=(0.3, -1.0, 0.2), distribution=Power(5.0))
    wanted, mask = picture([layer], [known]), np.ones(SIDE * SIDE)
    wanted[: SIDE * 8], mask[: SIDE * 8] = 9.0, 0.0  # painted over
    masked = solve([layer], wanted, mask=mask).lights[0]
    assert angle_deg(masked.direction, known.direction) < 0.1
    misled = solve([layer], wanted).lights[0]
    assert angle_deg(misled.direction, known.direction) > 2.0


def test_a_target_that_no_light_gives_is_approached() -> None:
    layer = spot_layer(3)
    wanted = np.zeros((SIDE, SIDE, 3), np.float32)
    wanted[10:16, 26:32] = 1.0  # one bright corner
    found = solve([layer], wanted.reshape(-1, 3))
    assert 0.3 < found.error < 1.0
    (light,) = found.lights
    assert light.direction[0] > 0.3 > 0.0 > light.direction[2]
    assert light.distribution.power == pytest.approx(narrowest_power(3), rel=0.05)  # as narrow as there is


def test_what_does_not_fit_is_refused() -> None:
    layer = spot_layer(1)
    good = np.ones((SIDE * SIDE, 3))
    for message, arguments in {
        "expected a picture of 40×40": ([layer], good[1:]),
        "no steerable layer": ([], good),
        "is black": ([layer], 0.0 * good),
        "not finite": ([layer], np.full_like(good, np.nan)),
    }.items():
        with pytest.raises(InputError, match=message):
            solve(*arguments)
    with pytest.raises(InputError, match="black everywhere"):
        solve([layer], good, mask=np.zeros(SIDE * SIDE))
    with pytest.raises(InputError, match="mask: 3 pixels"):
        solve([layer], good, mask=np.ones(3))
    with pytest.raises(InputError, match="'gone' is not in this bake"):
        solve([layer], good, lights=[Spot((1, 1, 1), direction=(0, 0, 1), layer="gone")])


@pytest.fixture
def painted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Files for the command; the bake's layers come from memory."""
    from prelight.images.formats import write_exr, write_png

    layer = spot_layer(5)
    known = Spot((1.0, 2.0, 3.0), direction=(0.3, -1.0, 0.2), distribution=Power(5.0))
    wanted = picture([layer], [known]).reshape(SIDE, SIDE, 3)
    wanted[wanted <= 0.0] = -1e-6  # as approximated lights have it
    assert wanted.min() < 0.0
    write_exr(tmp_path / "target.exr", wanted)
    write_exr(tmp_path / "small.exr", wanted[1:])
    write_png(tmp_path / "black.png", np.zeros((SIDE, SIDE, 3), np.uint8))
    monkeypatch.setattr("prelight.solving.goal.open_steerable", lambda bake: [layer])
    monkeypatch.setattr("prelight.solving.goal.Bake.open", lambda path: bake_of(layer.name))
    return tmp_path


def test_the_command(prelight, painted: Path) -> None:
    from prelight.lighting.rig import Rig

    answer = prelight(
        "solve", "a.prelight", "--target", painted / "target.exr", "-o", painted / "found.toml", "--json"
    )
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["relative_rms"] < 1e-4
    (light,) = Rig.open(str(painted / "found.toml")).lights
    assert angle_deg(light.direction, np.array([0.3, -1.0, 0.2]) / np.sqrt(1.13)) < 0.1
    np.testing.assert_allclose(light.intensity, [1, 2, 3], rtol=0.01)
    again = prelight(
        "solve", "a.prelight", "-t", painted / "target.exr", "-o", painted / "colours.toml",
        "--lights", painted / "found.toml", "--free", "colour",
    )  # fmt: skip
    assert again.code == 0, again.err
    assert "1 light (1 lit)" in again.out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-t", "target.exr", "-o", "found.txt"], "ending in .toml"),
        (["-t", "none.exr", "-o", "a.toml"], "no such file"),
        (["-t", "small.exr", "-o", "a.toml"], "40×39 pixels, the bake has 40×40"),
        (["-t", "target.exr", "-o", "a.toml", "--mask", "black.png"], "all black"),
        (["-t", "target.exr", "-o", "a.toml", "--free", "colour"], "needs --lights"),
        (["-t", "target.exr", "-o", "a.toml", "--free", "aim"], "expected colour"),
        (["-t", "target.exr", "-o", "a.toml", "--lights", "target.exr"], "expected a rig ending in .toml"),
        (["-t", "target.exr", "-o", "none/a.toml"], "no such folder"),
    ],
)
def test_the_command_refuses(prelight, painted: Path, options: list[str], message: str, monkeypatch) -> None:
    monkeypatch.chdir(painted)
    answer = prelight("solve", "a.prelight", *options)
    assert answer.code in (2, 3)
    assert message in answer.err
    assert answer.err.count("\n") == 1
