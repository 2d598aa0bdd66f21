"""Glass at run time: what a rig may say of it, and frost that is even over the sphere."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.errors import InputError
from prelight.lighting.frost import frosted, through_glass
from prelight.lighting.glass import Glass, glass_of
from prelight.lighting.rig import Rig
from prelight.lighting.rough_pane import rough_pane

N = 32
DIRECTIONS = cube_map.texel_directions(np.arange(6 * N * N, dtype=np.int32), N)
AREAS = np.tile(cube_map.solid_angles(N).ravel(), 6)


def spot(direction, *, width_deg: float = 4.0) -> np.ndarray:
    d = np.array(direction) / np.linalg.norm(direction)
    light = (DIRECTIONS @ d > math.cos(math.radians(width_deg))).astype(np.float32)
    return np.repeat(light[:, None], 3, axis=1).reshape(6, N, N, 3)


@pytest.mark.parametrize("frost", [1.0, 6.0, 20.0, 60.0])
def test_an_even_shell_stays_even(frost) -> None:
    even = np.full((6, N, N, 3), 0.7, np.float32)
    assert np.abs(frosted(even, frost) - 0.7).max() < 1e-5


@pytest.mark.parametrize("direction", [(1, 0, 0), (1, 1, 0), (1, 1, 1), (0.3, -0.9, 0.2)])
@pytest.mark.parametrize("frost", [12.0, 20.0, 40.0])
def test_frost_turns_light_by_the_angle_it_says(direction, frost) -> None:
    """Wherever on the cube: the energy is kept, and half of the peak is as far as the Gaussian says."""
    light = spot(direction)
    blurred = frosted(light, frost)[..., 0].ravel()
    whole = (light[..., 0].ravel() * AREAS).sum()
    assert abs((blurred * AREAS).sum() / whole - 1) < 0.03
    angle = np.degrees(
        np.arccos(np.clip(DIRECTIONS @ (np.array(direction) / np.linalg.norm(direction)), -1, 1))
    )
    half = frost * math.sqrt(2 * math.log(2))
    peak = blurred[angle < max(0.3 * frost, 3.0)].mean()
    ring = np.abs(angle - half) < 1.5
    assert abs(blurred[ring].mean() / peak - 0.5) < 0.08


@pytest.mark.parametrize("frost", [5.0, 15.0])
def test_frost_is_the_mean_over_every_cell(rng, frost) -> None:
    """Against all pairs of cells: none is passed over that is near enough to count."""
    light = rng.random((6, 16, 16, 3)).astype(np.float32) ** 8
    cells = np.arange(6 * 256, dtype=np.int32)
    towards = cube_map.texel_directions(cells, 16).astype(np.float64)
    angle = np.degrees(np.arccos(np.clip(towards @ towards.T, -1, 1)))
    weight = np.exp(-0.5 * (angle / frost) ** 2) * (angle < 4 * frost)
    weight *= np.tile(cube_map.solid_angles(16).ravel(), 6)
    weight[:, towards[:, 1] < 0] = 0
    known = weight @ light.reshape(-1, 3) / np.maximum(weight.sum(axis=1, keepdims=True), 1e-30)
    found = frosted(light, frost, np.float32([0, 1, 0]), cells_per_sigma=100.0).reshape(-1, 3)
    ahead = towards[:, 1] >= 0
    assert np.abs(found - known)[ahead].max() < 1e-3 * known.max()


@pytest.mark.parametrize("frost", [8.0, 14.0])
def test_a_sun_stays_where_it_is_while_a_hand_drags(frost) -> None:
    """Cells are larger then, but light in them is where it was."""
    light = np.zeros((6, 32, 32, 3), np.float32)
    light[2, 9, 5] = 500.0
    glass, outward = Glass("a", "frosted", None, frost), np.zeros(3, np.float32)
    exact, rough = (through_glass(light + 0.1, glass, outward, roughly=quick) for quick in (False, True))
    assert np.sqrt(((rough - exact) ** 2).mean() / (exact**2).mean()) < 0.02


def test_without_frost_nothing_changes() -> None:
    light = spot((1, 2, 3))
    assert frosted(light, 0.0) is light


def test_light_from_behind_the_pane_does_not_count() -> None:
    light = spot((0.1, -0.995, 0))
    blurred = frosted(light, 40.0, np.float32([0, 1, 0]))
    assert (blurred == 0).all()
    even = np.full((6, N, N, 3), 0.7, np.float32)
    toward = DIRECTIONS[:, 1] > 0
    assert np.abs(frosted(even, 40.0, np.float32([0, 1, 0])).reshape(-1, 3)[toward] - 0.7).max() < 1e-5


def test_smooth_glass_lets_through_what_fresnel_says() -> None:
    """The least rough pane beside a slab of two smooth faces, with all that goes to and fro between them."""
    angle = np.radians([0, 20, 40, 50])
    within = np.arcsin(np.sin(angle) / 1.5)
    one = (np.cos(angle) - 1.5 * np.cos(within)) / (np.cos(angle) + 1.5 * np.cos(within))
    two = (1.5 * np.cos(angle) - np.cos(within)) / (1.5 * np.cos(angle) + np.cos(within))
    reflected = (one**2 + two**2) / 2
    assert rough_pane(0.02).share(np.cos(angle)) == pytest.approx((1 - reflected) / (1 + reflected), abs=0.01)


def test_rough_glass_is_what_a_path_tracer_refracts_through() -> None:
    """Mitsuba's roughdielectric, GGX 0.5, before a smooth face (benchmarks/portals, part rough-glass)."""
    pane, angle = rough_pane(0.5), np.radians([0, 15, 30, 40, 50, 60, 70, 80])
    known = [0.902, 0.890, 0.829, 0.719, 0.518, 0.299, 0.162, 0.107]
    assert pane.share(np.cos(angle)) == pytest.approx(known, abs=0.008)
    assert pane.turned_deg == pytest.approx(14.5, abs=0.3)


def test_rough_glass_dims_a_shell_at_a_slant() -> None:
    even, up = np.ones((6, N, N, 3), np.float32), np.float32([0, 1, 0])
    glass = Glass("*", "frosted", rough=0.5)
    flat = through_glass(even, glass, up).reshape(-1, 3)[:, 0]
    known = rough_pane(0.5).share(DIRECTIONS @ up)
    assert flat == pytest.approx(known, abs=1e-5)
    uneven = through_glass(even, glass, np.zeros(3, np.float32))
    above = np.maximum(DIRECTIONS @ up, 0) * AREAS
    assert uneven == pytest.approx(float((flat * above).sum() / above.sum()), abs=5e-3)
    assert through_glass(even, Glass("*", "frosted"), up).max() == pytest.approx(1.0, abs=1e-5)


def test_the_last_glass_that_fits_is_a_portals() -> None:
    given = [Glass("*", blind=0.5), Glass("red*", "frosted"), Glass("red 2", "shut")]
    found = glass_of(["red 1", "red 2", "blue [1]"], given)
    assert [glass.kind for glass in found] == ["frosted", "shut", "clear"]
    assert found[0].blind == 0.0
    assert found[2].factor((0.5, 1.0, 0.0)) == (0.25, 0.5, 0.0)
    assert glass_of(["a [1]"], [Glass("a [*")])[0].name == "a [*"
    with pytest.raises(InputError, match="is none of this bake's: red 1, red 2"):
        glass_of(["red 1", "red 2"], [Glass("green")])


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"kind": "broken"}, "expected clear, frosted, shut"),
        ({"tint": (1.0, 2.0, 0.0)}, "expected three numbers of 0 to 1"),
        ({"frost_deg": -1.0}, "expected 0 to 60"),
        ({"frost_deg": math.nan}, "expected 0 to 60"),
        ({"blind": 1.5}, "expected 0 to 1"),
        ({"kind": "frosted", "rough": 1.5}, "expected 0.02 to 1"),
        ({"rough": 0.5}, "of frosted glass"),
    ],
)
def test_values_out_of_range_are_refused(values, reason) -> None:
    with pytest.raises(InputError, match=reason):
        Glass(**values)


def rig(path: Path, text: str) -> Rig:
    path.write_text('[environment]\nmap = "stock:noon"\n' + text)
    return Rig.open(str(path))


def test_a_rig_says_what_glass_is(tmp_path) -> None:
    text = """
        [[portal]]
        name = "east window"
        frost_deg = 20
        blind = 0.25

        [[portal]]
        glass = "shut"

        [[portal]]
        name = "red *"
        tint = [1, 0.1, 0.1]

        [[portal]]
        rough = 0.3
    """
    first, second, third, fourth = rig(tmp_path / "a.toml", text).portals
    assert fourth == Glass("*", "frosted", rough=0.3)
    assert first == Glass("east window", "frosted", None, 20.0, 0.25)
    assert (second.name, second.kind) == ("*", "shut")
    assert third.tint == (1.0, 0.1, 0.1)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('[[portal]]\nglass = "broken"', "/portal/0/glass"),
        ("[[portal]]\ntint = [1.0, 2.0, 0.0]", "/portal/0/tint/1"),
        ("[[portal]]\ntint = [1.0, 0.5]", "too few numbers"),
        ("[[portal]]\nfrost_deg = 90", "/portal/0/frost_deg"),
        ('[[portal]]\nglass = "clear"\nfrost_deg = 9', "frost_deg is of frosted glass"),
        ("[[portal]]\nblind = -1", "/portal/0/blind"),
        ("[[portal]]\nrough = 0.3\nfrost_deg = 9", "frost_deg or rough, not both"),
        ('[[portal]]\nglass = "shut"\nrough = 0.3', "rough is of frosted glass"),
        ("[[portal]]\ncolour = [1, 1, 1]", "'colour' is not known here; known are name, glass"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, text, reason) -> None:
    with pytest.raises(InputError) as error:
        rig(tmp_path / "a.toml", text)
    assert reason in str(error.value)


def test_a_bake_without_portals_refuses_glass(tmp_path) -> None:
    with pytest.raises(InputError, match="no portals layer"):
        _ = rig(tmp_path / "a.toml", "[[portal]]\nblind = 0.5").surroundings
