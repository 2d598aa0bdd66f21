"""Pictures under steered lights against closed forms; growing pictures; several lights; what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases.panels import PanelBasis
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.encoding.principal_components import Keep
from prelight.errors import InputError
from prelight.lighting.distributions import Gobo, Polynomial, Power, frame
from prelight.lighting.panel import Panel, axis_fit
from prelight.lighting.places import Place
from prelight.lighting.spot import Spot
from prelight.relighting.steerable import SteerableRelighter
from prelight.relighting.steerable_layer import SteerableLayer

from .steerable_scenes import ABOVE, SIDE, from_spot, panel_layer, panel_light, panel_points, spot_layer

AIM = (0.3, -1.0, 0.2)


def unit(v) -> np.ndarray:
    return np.array(v) / np.linalg.norm(v)


@pytest.mark.parametrize("degree", [1, 3, 5, 9])
def test_a_spot_wherever_it_points(degree: int, rng: np.random.Generator) -> None:
    way, floor = from_spot()
    relighter = SteerableRelighter([spot_layer(degree)])
    for aim in rng.standard_normal((4, 3)):
        relighter.light([Spot((3.0, 2.0, 1.0), direction=tuple(aim))], negligible=0.0)
        wanted = floor * (((1.0 + way @ unit(aim)) / 2.0) ** degree)[:, None] * [3.0, 2.0, 1.0]
        np.testing.assert_allclose(relighter.radiance, wanted, atol=2e-3 * floor.max())


def test_shape_changes_at_run_time() -> None:
    way, floor = from_spot()
    relighter = SteerableRelighter([spot_layer(5)])
    cosine = way @ unit(AIM)
    for shape, wanted in (
        (Power(2.0), ((1.0 + cosine) / 2.0) ** 2),
        (Polynomial((0.2, 0.0, 0.5)), 0.2 + 0.5 * cosine**2),
    ):
        relighter.light([Spot((1.0, 1.0, 1.0), direction=AIM, distribution=shape)], negligible=0.0)
        np.testing.assert_allclose(relighter.radiance, floor * wanted[:, None], atol=3e-3 * floor.max())


def test_a_spot_follows_its_target() -> None:
    relighter = SteerableRelighter([spot_layer(3)])
    relighter.light([Spot((1, 1, 1), target=(0.6, 0.0, 0.4))])
    there = relighter.radiance
    relighter.light([Spot((1, 1, 1), direction=(0.6, -1.5, 0.4))])
    np.testing.assert_array_equal(relighter.radiance, there)
    with pytest.raises(InputError, match="is where the light itself is"):
        relighter.light([Spot((1, 1, 1), target=ABOVE)])


def test_a_picture_in_front_of_the_lamp_is_upright() -> None:
    """Red on the left, blue below: as somebody sees it who looks along the beam; and rolled by a quarter."""
    picture = np.zeros((20, 20, 3))
    picture[:, :10, 0] = picture[10:, :, 2] = 1.0
    lamp = Gobo(picture, 80.0)
    ahead = frame(np.array([0.0, 0.0, -1.0]))  # towards −Z: left is −X, up is +Y

    def colour(left: float, up: float, roll: float = 0.0) -> np.ndarray:
        scene = unit([-left, up, -1.0])
        return lamp.along((scene @ frame(np.array([0.0, 0.0, -1.0]), roll))[None])[0]

    np.testing.assert_allclose(ahead, [[-1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-12)
    np.testing.assert_allclose(colour(0.3, 0.3), [1, 0, 0])
    np.testing.assert_allclose(colour(0.3, -0.3), [1, 0, 1])
    np.testing.assert_allclose(colour(-0.3, -0.3), [0, 0, 1])
    np.testing.assert_allclose(colour(-0.3, 0.3), [0, 0, 0])
    np.testing.assert_allclose(
        colour(0.3, 0.3, roll=90.0), [1, 0, 1]
    )  # clockwise: what was below left is now above
    np.testing.assert_allclose(colour(-0.3, 0.3, roll=90.0), [1, 0, 0])
    assert not lamp.along(np.array([[0.0, 0.0, -1.0]])).any()  # behind


def test_lights_without_symmetry_turn_about_their_beam() -> None:
    """A polynomial of x alone, rotated by harmonics, against the closed form in the turned frame."""
    way, floor = from_spot()

    class Sideways:
        def along(self, d: np.ndarray) -> np.ndarray:
            return 1.0 + d[:, :1] + 0.5 * d[:, :1] * d[:, 1:2]

        def harmonics(self, degree: int) -> np.ndarray:
            from prelight.bases import spherical_harmonics as sh

            return sh.project(self.along(sh.quadrature(12)[0]), degree, degree=12)

    relighter = SteerableRelighter([spot_layer(3)])
    for roll in (0.0, 35.0):
        relighter.light(
            [Spot((1, 1, 1), direction=AIM, distribution=Sideways(), roll_deg=roll)], negligible=0.0
        )
        wanted = floor * Sideways().along(way @ frame(unit(AIM), roll))
        np.testing.assert_allclose(relighter.radiance, wanted, atol=3e-3 * floor.max())


@pytest.mark.parametrize("shape", ["raised-cosine", "soft"])
def test_a_panel_wherever_it_is(shape) -> None:
    relighter = SteerableRelighter([panel_layer(2)])
    panel = Panel((0.45, 0.55), (0.8, 0.9), (2.0, 1.0, 0.5), shape=shape)
    relighter.light([panel], negligible=0.0)
    points = panel_points()
    light = np.ones(len(points))
    for axis in range(2):
        x = points[:, axis] - panel.position[axis]
        width = panel.width[axis]
        if shape == "soft":
            power = np.log(0.5) / (2.0 * np.log(np.cos(np.pi * width / 4.0)))
            light *= np.abs(np.cos(np.pi * x)) ** (2.0 * power)
        else:
            light *= np.where(np.abs(x) < width / 2, 0.5 + 0.5 * np.cos(2.0 * np.pi * x / width), 0.0)
    wanted = panel_light(light) * [2.0, 1.0, 0.5]
    np.testing.assert_allclose(relighter.radiance, wanted, atol=0.01 * wanted.max())
    assert relighter.notes([panel]) == []


def test_a_panel_that_turns_and_a_box_of_light(rng: np.random.Generator) -> None:
    """Position times direction, and three dimensions: coefficients against the light itself."""
    basis = ProductBasis(PanelBasis((2, 2)), SpotBasis(3))
    place = Place("panel", (0, 1, 0), ((1, 0, 0), (0, 0, -2)))  # shines up: first × second
    x, d = rng.random((80, 2)), rng.standard_normal((80, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    where = ((0.5 + 0.5 * np.cos(2.0 * np.pi * (x - [0.3, 0.6]))) ** 1).prod(axis=1)
    for beam, aim, power, colour in (
        (None, (0.0, 1.0, 0.0), 3, (1.0, 2.0, 3.0)),
        (Spot((2, 2, 2), direction=(1, 1, 0), distribution=Power(2.0)), unit((1, 1, 0)), 2, (2.0, 4.0, 6.0)),
        (Spot((1, 1, 1), target=(0.5, 1.0, 9.0)), (0.0, 0.0, 1.0), 3, (1.0, 2.0, 3.0)),
    ):
        panel = Panel((0.3, 0.6), (1.0, 1.0), (1.0, 2.0, 3.0), beam=beam)
        light = basis.evaluate(x, d) @ panel.coefficients(basis, place)
        wanted = where * ((1.0 + d @ np.array(aim)) / 2.0) ** power
        np.testing.assert_allclose(light, wanted[:, None] * colour, atol=1e-6)
        assert panel.notes(basis, place) == [] or "opposite edge" in panel.notes(basis, place)[0]
    box, inside = PanelBasis((1, 2, 1)), rng.random((60, 3))
    lamp = Panel((0.5, 0.4, 0.7), (1.0, 1.0, 1.0), (3.0, 2.0, 1.0))
    light = box.evaluate(inside) @ lamp.coefficients(
        box, Place("box", edges=((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    )
    wanted = (0.5 + 0.5 * np.cos(2.0 * np.pi * (inside - lamp.position))).prod(axis=1)
    np.testing.assert_allclose(light, wanted[:, None] * [3.0, 2.0, 1.0], atol=1e-9)


def test_the_range_that_is_free_of_copies() -> None:
    """Within the stated range nothing is at the opposite edge; just beyond it, something is, and it is said."""
    layer = panel_layer(4)
    basis, width = layer.basis, (0.5, 0.5)
    low, high = Panel((0.5, 0.5), width, (1, 1, 1)).free_range(basis)[0]
    assert Panel((0.5, 0.5), (1.0, 1.0), (1, 1, 1)).free_range(basis)[0][0] > 0.45  # as wide as the panel
    assert low == pytest.approx(0.25, abs=0.02)
    assert high == pytest.approx(1.0 - low)
    far = np.stack([np.full(50, 0.995), np.linspace(0.4, 0.6, 50)], -1)
    ringing = 1.2 * axis_fit("raised-cosine", 0.5, 4).worst
    for at, copies in ((low, False), (low - 0.12, True), (high, False), (high + 0.12, True)):
        panel = Panel((at, 0.5), width, (1, 1, 1))
        opposite = far if at < 0.5 else 1.0 - far
        light = basis.evaluate(opposite) @ panel.placed(basis)
        assert (np.abs(light).max() > 0.1) == copies
        if not copies:
            assert np.abs(light).max() <= ringing + 0.01
        assert any("opposite edge" in note for note in panel.notes(basis, layer.place)) == copies
    narrow = Panel((0.5, 0.5), (0.15, 0.5), (1, 1, 1)).notes(basis, layer.place)
    assert len(narrow) == 1
    assert "a mirror shows it" in narrow[0]


def test_lights_add_and_forget() -> None:
    """Two spots in one place and a panel, each in its colour, are the sum; what was before leaves nothing."""
    relighter = SteerableRelighter([spot_layer(3), panel_layer(1)])
    lights = [
        Spot((1, 0, 0), direction=AIM, layer="key"),
        Spot((0, 0, 2), direction=(-1, -1, 0), layer="key"),
        Panel((0.3, 0.5), (0.9, 0.9), (0, 1, 0), layer="soft"),
    ]
    total = np.zeros((SIDE * SIDE, 3), np.float32)
    for light in lights:
        relighter.light([light], negligible=0.0)
        total += relighter.radiance
        alone = relighter.radiance
    relighter.light(lights, negligible=0.0)
    np.testing.assert_allclose(relighter.radiance, total, atol=1e-5)
    relighter.light(lights[2:], negligible=0.0)
    np.testing.assert_array_equal(relighter.radiance, alone)
    relighter.light([])
    assert not relighter.radiance.any()
    assert relighter.last.bytes_read == 0


def test_pictures_grow_and_say_how_much_is_missing() -> None:
    relighter = SteerableRelighter([spot_layer(5)])
    spot = Spot((1.0, 0.8, 0.5), direction=AIM)
    relighter.light([spot], negligible=0.0)
    whole = relighter.radiance
    shown = list(relighter.refine([spot], step=3))
    assert [r.planes for r in shown[:3]] == [3, 6, 9]
    assert shown[-1].planes == shown[-1].whole == relighter.last.whole
    for picture in shown:
        assert np.abs(picture.radiance - whole).mean(dtype=np.float64) <= picture.error + 1e-7
    errors = [r.error for r in shown]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == 0.0
    np.testing.assert_allclose(shown[-1].radiance, whole, atol=1e-6)
    # Those that matter most come first: half of them do better than the other half.
    half = shown[len(shown) // 2]
    assert np.abs(half.radiance - whole).mean() < 0.2 * np.abs(whole).mean()
    enough = list(relighter.refine([spot], step=3, error=errors[4]))
    assert enough[-1].planes == shown[4].planes
    np.testing.assert_array_equal(relighter.radiance, enough[-1].radiance)


def test_a_lamp_in_a_mirror_is_there_from_the_first_picture() -> None:
    """A pixel that outshines all others is kept apart, is exact, and takes no part in what is still missing."""
    basis, (way, floor) = SpotBasis(3), from_spot()
    lit = int(np.argmax(floor.sum(axis=1)))
    floor[lit] *= 1000.0
    span = (basis.evaluate(way)[:, None] * floor[:, :, None]).transpose(2, 0, 1).astype(np.float32)
    layer = SteerableLayer.of_images(
        "key", span, basis=basis, place=Place("spot", ABOVE), size=(SIDE, SIDE), keep="all"
    )
    spot = Spot((1.0, 2.0, 3.0), direction=AIM)
    wanted = floor * (((1.0 + way @ unit(AIM)) / 2.0) ** 3)[:, None] * [1.0, 2.0, 3.0]
    relighter = SteerableRelighter([layer])
    shown = list(relighter.refine([spot], step=4))
    for picture in shown:
        np.testing.assert_allclose(picture.radiance[lit], wanted[lit], rtol=1e-4)
        missing = np.abs(picture.radiance - shown[-1].radiance).mean(dtype=np.float64)
        assert missing <= picture.error + 1e-7
    relighter.light([spot], negligible=0.0)
    np.testing.assert_allclose(relighter.radiance[lit], wanted[lit], rtol=1e-4)
    others = np.arange(len(floor)) != lit
    np.testing.assert_allclose(relighter.radiance[others], wanted[others], atol=4e-3 * wanted[others].max())


def test_negligible_planes_are_skipped() -> None:
    relighter = SteerableRelighter([spot_layer(5)])
    spot = Spot((1.0, 1.0, 1.0), direction=AIM)
    all_of_them = relighter.light([spot], negligible=0.0)
    whole = relighter.radiance
    few = relighter.light([spot], negligible=0.05)
    assert few.planes < all_of_them.planes
    assert few.bytes_read < all_of_them.bytes_read
    missing = np.abs(relighter.radiance - whole).mean(dtype=np.float64)
    assert 0.0 < missing <= few.error + 1e-7


def test_components_do_for_the_pictures(rng: np.random.Generator) -> None:
    """The paper's rule keeps a third of the images at most; 35 dB, peak at the 99th percentile."""
    layer = spot_layer(5, keep=Keep())
    assert layer.components <= 12
    way, floor = from_spot()
    relighter, loudness = SteerableRelighter([layer]), []
    for aim in rng.standard_normal((20, 3)):
        aim[1] = -abs(aim[1])
        relighter.light([Spot((1, 1, 1), direction=tuple(aim))])
        wanted = floor * (((1.0 + way @ unit(aim)) / 2.0) ** 5)[:, None]
        error = np.square(relighter.radiance - wanted).mean()
        loudness.append(10.0 * np.log10(np.percentile(wanted, 99) ** 2 / error))
    assert np.mean(loudness) > 33.0


def test_what_no_layer_has_is_refused() -> None:
    relighter = SteerableRelighter([spot_layer(1), panel_layer(1)])
    cases = {
        "no layer is named; it has key, soft": Spot((1, 1, 1), direction=AIM),
        "'gone' is not in this bake": Spot((1, 1, 1), direction=AIM, layer="gone"),
        "is that of a panel": Spot((1, 1, 1), direction=AIM, layer="soft"),
        "is that of a spot": Panel((0.5, 0.5), (0.5, 0.5), (1, 1, 1), layer="key"),
        "3 numbers, this layer's light has 2 axes": Panel((0.5,) * 3, (0.5,) * 3, (1, 1, 1), layer="soft"),
        "leave direction out": Panel(
            (0.5, 0.5), (0.5, 0.5), (1, 1, 1), beam=Spot((1, 1, 1), direction=AIM), layer="soft"
        ),
    }
    for message, light in cases.items():
        with pytest.raises(InputError, match=message):
            relighter.light([light])
    with pytest.raises(InputError, match="the same name"):
        SteerableRelighter([spot_layer(1), spot_layer(1)])
    with pytest.raises(InputError, match="no steerable layer"):
        SteerableRelighter([])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Spot((1, 1, 1)), "either a direction or a target"),
        (lambda: Spot((1, 1, 1), direction=(0, 0, 0)), "points nowhere"),
        (lambda: Spot((1, -1, 1), direction=AIM), "at least 0"),
        (lambda: Panel((0.5,), (0.5,), (1, 1, 1)), "expected two numbers"),
        (lambda: Panel((0.5, 0.5), (0.5, 0.0), (1, 1, 1)), "from 0.01 to 1"),
        (
            lambda: Panel((0.5, 0.5), (0.5, 0.5), (1, 1, 1), shape="round"),
            "expected one of raised-cosine, soft",
        ),
        (lambda: Place("panel", edges=((1, 0, 0), (1, 1, 0))), "right angles"),
        (lambda: Place("panel", edges=((1, 0, 0), (0, 0, 0))), "has no length"),
        (lambda: Place("spot", edges=((1, 0, 0),)), "a spot has 0"),
        (lambda: Polynomial(()), "expected 1 to 41"),
        (lambda: Power(-1.0), "at least 0|from 0"),
        (lambda: Gobo(np.zeros((2, 2)), 40.0), r"expected \(height, width, 3\)"),
    ],
)
def test_lights_are_checked(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_widths_are_those_of_lamp_makers() -> None:
    """Half the intensity at the edge of the full angle."""
    for width in (20.0, 60.0, 120.0):
        lamp = Power.of_width(width)
        angle = np.radians(width / 2.0)
        assert lamp.along(np.array([[np.sin(angle), 0.0, np.cos(angle)]]))[0, 0] == pytest.approx(0.5)
        assert lamp.width_deg == pytest.approx(width)
