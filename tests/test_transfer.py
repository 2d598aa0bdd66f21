"""Any light, live: closed forms of direct light, all bounces against solving, and what depends on the rig alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.camera import Camera
from prelight.checking.placed_emitters import emitter_of
from prelight.errors import InputError
from prelight.images.formats import read_radiance_map
from prelight.lighting.distributions import Gobo, Power
from prelight.lighting.environment import Environment
from prelight.lighting.keyframes import Track
from prelight.lighting.placed_lights import Lamp, PlacedPanel
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot
from prelight.rays.mitsuba import Occluders
from prelight.relighting import direct_to_indirect, transfer
from prelight.relighting.lit_bake import LitBake
from prelight.relighting.transfer import TransferRelighter
from prelight.scene.geometry import Scene
from prelight.storage.bake import Bake
from prelight.transport import light_rays
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.path_traced_light import LitScene
from prelight.transport.vantage import vantage_points

from .scenes import grid, plane, scene_of

RAYS = 576
DOWN = (0.0, -1.0, 0.0)


def chamber(albedo: float = 0.6, *, side: int = 9) -> Scene:
    """A closed box seen from within, one wall red, and a block that stands in it."""
    sides = []
    for k in range(3):
        p, t = grid(side, size=2.0, height=-1.0)
        sides += [(np.roll(p, k, axis=1), t), (np.roll(-p * (1, 1, -1), k, axis=1).astype(np.float32), t)]
    inner, block = side // 2 + 2, []
    for k in range(3):
        p, t = grid(inner, size=0.7, height=0.35)
        p = p + np.float32([0.0, 0.0, 0.0])
        block += [(np.roll(p, k, axis=1), t), (np.roll(-p * (1, 1, -1), k, axis=1).astype(np.float32), t)]
    block = [((p + np.float32([0.3, -0.5, -0.2])).astype(np.float32), t) for p, t in block]
    scene = scene_of(*sides, *block, albedo=albedo, name="chamber")
    colours = scene.albedo.copy()
    colours[scene.positions[:, 0] < -0.999] = (albedo, 0.2 * albedo, 0.1 * albedo)
    return replace(scene, albedo=colours)


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Bake:
    settings = TransferSettings(gather_rays=RAYS, entries=300, modes=100)
    return bake_transfer(chamber(), tmp_path_factory.mktemp("room") / "room.prelight", settings=settings)


@pytest.fixture(scope="module")
def open_plane(tmp_path_factory) -> Bake:
    settings = TransferSettings(gather_rays=64)
    return bake_transfer(plane(), tmp_path_factory.mktemp("plane") / "plane.prelight", settings=settings)


@pytest.fixture
def live(room: Bake) -> TransferRelighter:
    return TransferRelighter(room)


def spot(colour=(1.0, 1.0, 1.0), *, toward=DOWN, shape=None) -> Spot:
    return Spot(colour, direction=toward, distribution=shape)


LAMP = Lamp((-0.4, 0.5, 0.3), spot((3.0, 2.0, 1.0)))
BEAM = Lamp((0.5, 0.7, 0.5), spot((9.0, 9.0, 4.0), toward=(-1, -1.2, -0.3), shape=Power.of_width(50)))
PANEL = PlacedPanel((0.1, 0.9, 0.2), (0.5, 0.3), spot((2.0, 2.0, 2.5), toward=(0.1, -1.0, 0.05)))


# ---- direct light -----------------------------------------------------------------------------------------------


def test_a_lamp_over_a_plane(open_plane: Bake) -> None:
    """E / π = I cos θ / π d², whatever the radius; the beam's shape multiplies it."""
    live, at = TransferRelighter(open_plane, shadow_rays=4), np.array([0.2, 0.8, -0.1])
    p = open_plane.receivers.positions.astype(np.float64)
    way = p - at
    d2 = (way**2).sum(axis=1)
    even = 0.8 / np.sqrt(d2) / (np.pi * d2)
    for radius in (0.0, 0.02, 0.3):
        live.shine([Lamp(tuple(at), spot((1.0, 2.0, 4.0)), radius)])
        np.testing.assert_allclose(live.irradiance, even[:, None] * [1, 2, 4], rtol=2e-3)
        assert (live.indirect == 0).all()  # nothing to bounce from
    power, beam = 6.0, np.array([0.3, -1.0, 0.1]) / np.linalg.norm([0.3, -1.0, 0.1])
    live.shine([Lamp(tuple(at), spot(toward=(0.3, -1.0, 0.1), shape=Power(power)))])
    shape = (0.5 + 0.5 * way @ beam / np.sqrt(d2)) ** power
    np.testing.assert_allclose(live.irradiance[:, 0], even * shape, rtol=2e-3)


def test_a_ball_half_below_the_horizon(open_plane: Bake) -> None:
    """Its middle in the plane: half of the cone's light, by the form factor (Naraghi and Chung 1982)."""
    live = TransferRelighter(open_plane, shadow_rays=16)
    live.shine([Lamp((3.0, 0.0, 0.0), spot(), 0.5)])
    H = np.linalg.norm(open_plane.receivers.positions - (3.0, 0.0, 0.0), axis=1) / 0.5
    exact = (np.arctan(1 / np.sqrt(H * H - 1)) - np.sqrt(H * H - 1) / (H * H)) / np.pi / (np.pi * 0.25)
    # The plane itself hides what is below it; rays begin a little above it.
    np.testing.assert_allclose(live.irradiance[:, 0], exact, rtol=0.02)


def test_a_panel_over_a_plane(open_plane: Bake) -> None:
    """Under its middle and under its corner, by the form factor of a rectangle; nothing behind it."""
    live = TransferRelighter(open_plane)
    p = open_plane.receivers.positions
    k = int(np.argmin(np.abs(p[:, [0, 2]] - 0.1).sum(axis=1)))
    x, z = float(p[k, 0]), float(p[k, 2])

    def corner(X: float, Y: float) -> float:
        s, t = np.sqrt(1 + X * X), np.sqrt(1 + Y * Y)
        return (X / s * np.arctan(Y / s) + Y / t * np.arctan(X / t)) / (2 * np.pi)

    live.shine([PlacedPanel((x, 1.0, z), (1.0, 1.0), spot((1.0, 2.0, 3.0)))])
    np.testing.assert_allclose(live.irradiance[k], 4 * corner(0.5, 0.5) * np.float32([1, 2, 3]), rtol=1e-3)
    live.shine([PlacedPanel((x, 1.0, z), (2.0, 2.0), spot(toward=(0, 1, 0)))])
    assert (live.irradiance == 0).all()
    live.shine([PlacedPanel((x, 0.5, z), (2.0, 1.0), spot(toward=(1, 0, 0)))])  # it stands on the plane
    assert live.irradiance[p[:, 0] > x + 0.05].min() > 0
    assert (live.irradiance[p[:, 0] < x - 0.05] == 0).all()


def test_half_of_a_light_behind_an_edge_is_half_of_it(tmp_path: Path) -> None:
    wall = np.float32([[0, 0.2, -1], [0, 0.2, 1], [1, 0.2, 1], [1, 0.2, -1]])  # over all x > 0
    scene = scene_of(grid(3, size=1.0), (wall, np.int32([[0, 1, 2], [0, 2, 3]])))
    bake = bake_transfer(scene, tmp_path / "edge.prelight", settings=TransferSettings(gather_rays=64))
    live, middle = TransferRelighter(bake, shadow_rays=1024), 4
    for light, whole in (
        (Lamp((0, 1, 0), spot(), 0.3), 1 / np.pi),
        (PlacedPanel((0, 1, 0), (0.02, 0.02), spot((2500.0,) * 3)), 1 / np.pi),
    ):
        live.shine([light])
        assert live.direct[middle, 0] == pytest.approx(0.5 * whole, rel=0.02)
        assert (live.direct[5] == 0).all()  # x = 0.5, under the wall


def test_a_projector_throws_its_picture_upright(open_plane: Bake) -> None:
    """Red on the left of who looks along the beam: thrown down with −Z up, left is −X."""
    picture = np.zeros((2, 2, 3), np.float32)
    picture[:, 0] = (1, 0, 0)
    picture[:, 1] = (0, 0, 1)
    live = TransferRelighter(open_plane)
    live.shine([Lamp((0, 1, 0), spot(shape=Gobo(picture, 100.0)))])
    x = open_plane.receivers.positions[:, 0]
    assert live.direct[x < -0.65, 2].max() == 0
    assert live.direct[x < -0.3, 0].max() > 0
    assert live.direct[x > 0.65, 0].max() == 0
    assert live.direct[x > 0.3, 2].max() > 0


def test_an_even_sky_over_a_plane_is_its_radiance(open_plane: Bake) -> None:
    live = TransferRelighter(open_plane)
    live.shine([], Environment.constant((1.0, 2.0, 3.0)))
    np.testing.assert_allclose(live.irradiance, np.full((len(live.irradiance), 3), (1, 2, 3)), rtol=5e-3)


# ---- all bounces ------------------------------------------------------------------------------------------------


def solved(bake: Bake, direct: np.ndarray) -> np.ndarray:
    """Indirect light by the whole operator, of other rays."""
    scene = chamber()
    occluders = Occluders(scene.positions, scene.triangles)
    gathering = Gathering.trace(scene, occluders, rays=4096, seed=3)
    return bounced(gathering, direct[:, None, :]).indirect[:, 0]


def rms(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.square(a - b, dtype=np.float64).mean() / np.square(b, dtype=np.float64).mean()))


def bounces_are_right(room: Bake) -> bool:
    live = TransferRelighter(room)
    for lights in ([LAMP], [BEAM], [PANEL]):
        live.shine(lights)
        if rms(live.indirect, solved(room, live.direct)) > 0.04:
            return False
    return True


def furnace_is_right(room: Bake) -> bool:
    """Evenly lit: rows of the thinned operator keep their sums, so that no light is lost or made on the whole."""
    even = np.ones((len(room.receivers), 3), np.float32)
    indirect, expected = TransferRelighter(room)._indirect.bounced(even), solved(room, even)
    return rms(indirect, expected) < 0.02 and abs(indirect.mean() / expected.mean() - 1) < 5e-3


def mixing_is_right(room: Bake) -> bool:
    """Lights add, whatever else is lit, and colours multiply."""
    one, other, both = (TransferRelighter(room) for _ in range(3))
    one.shine([LAMP])
    other.shine([replace(BEAM, beam=replace(BEAM.beam, intensity=(18.0, 18.0, 8.0)))])
    both.shine([LAMP, BEAM])
    return bool(np.allclose(both.irradiance, one.irradiance + other.irradiance / 2, rtol=1e-5, atol=1e-7))


CHECKS = (bounces_are_right, furnace_is_right, mixing_is_right)


@pytest.mark.parametrize("check", CHECKS)
def test_it_is_right(room: Bake, check: Callable[[Bake], bool]) -> None:
    assert check(room)


def no_modes(monkeypatch) -> None:
    monkeypatch.setattr(direct_to_indirect.DirectToIndirect, "by_modes", lambda self, light: 0 * light)


def no_albedo(monkeypatch) -> None:
    bounce = direct_to_indirect.FirstBounce.bounce
    monkeypatch.setattr(
        direct_to_indirect.FirstBounce,
        "bounce",
        lambda self, E: bounce(replace(self, colours=0 * self.colours + 1), E),
    )


def one_twentieth_lost(monkeypatch) -> None:
    project = direct_to_indirect.DirectToIndirect.projected
    monkeypatch.setattr(
        direct_to_indirect.DirectToIndirect, "projected", lambda self, E: 0.9 * project(self, E)
    )
    bounce = direct_to_indirect.FirstBounce.bounce
    monkeypatch.setattr(direct_to_indirect.FirstBounce, "bounce", lambda self, E: 0.95 * bounce(self, E))


def colour_squared(monkeypatch) -> None:
    def squared(self, *parts):
        out = np.zeros((len(self.bake.receivers), 3), np.float32)
        for light, key in self._lit:
            for part in parts:
                out += getattr(self._known[key], part) * np.float32(light.colour) ** 2
        return out

    monkeypatch.setattr(transfer.TransferRelighter, "_sum", squared)


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        (no_modes, bounces_are_right),
        (no_modes, furnace_is_right),
        (no_albedo, bounces_are_right),
        (one_twentieth_lost, furnace_is_right),
        (colour_squared, mixing_is_right),
    ],
)
def test_faults_are_found(room: Bake, monkeypatch, fault: Callable, check: Callable) -> None:
    fault(monkeypatch)
    assert not check(room)


def test_bounced_light_against_the_path_tracer(room: Bake) -> None:
    live, scene = TransferRelighter(room, shadow_rays=256), chamber()
    origins = vantage_points(scene, Occluders(scene.positions, scene.triangles))
    rows = np.arange(0, len(scene.positions), 4, dtype=np.int32)
    for light in (LAMP, PANEL):
        live.shine([light])
        lit = LitScene(scene, emitters=[emitter_of(light_rays_mi(), light)])
        seen = lit.light(rows, origins=origins, samples=1024)
        noise = seen.indirect_variance.mean()
        wrong = np.square(live.indirect[rows] - seen.indirect).mean() - noise
        assert np.sqrt(max(wrong, 0.0) / np.square(seen.indirect).mean()) < 0.06
        mean = seen.indirect.mean()
        assert abs(live.indirect[rows].mean() / mean - 1) < 0.035


def light_rays_mi():
    from prelight.scene.variant import mitsuba

    return mitsuba()


# ---- what follows depends on the lights alone -------------------------------------------------------------------


def test_off_is_exactly_dark(live: TransferRelighter) -> None:
    assert live.shine([LAMP, PANEL], Environment.constant((1.0, 1.0, 1.0)))
    assert live.irradiance.min() >= 0
    assert live.irradiance.max() > 0
    assert live.shine([replace(LAMP, beam=spot((0.0, 0.0, 0.0)))], Environment.dark())
    assert (live.irradiance == 0).all()
    assert not live.shine([], None)
    assert live.last.kind == "none"


def test_what_moves_is_made_anew_and_nothing_else(live: TransferRelighter, room: Bake, monkeypatch) -> None:
    live.shine([LAMP, PANEL])
    asked = []
    monkeypatch.setattr(
        light_rays.LightRays, "_launch", counted(light_rays.LightRays._launch, asked), raising=True
    )
    moved = replace(PANEL, position=(-0.3, 0.8, 0.1))
    assert live.shine([LAMP, moved])
    assert len(asked) == 1
    assert (live.last.kind, live.last.clusters) == ("local", 1)
    live.shine([replace(LAMP, beam=spot((0.5, 0.1, 9.0))), moved])
    assert len(asked) == 1  # a colour takes no ray
    live.shine([LAMP, moved])
    fresh = TransferRelighter(room)
    fresh.shine([LAMP, moved])
    np.testing.assert_array_equal(live.irradiance, fresh.irradiance)


def counted(function: Callable, calls: list) -> Callable:
    def wrapped(*arguments):
        calls.append(len(arguments))
        return function(*arguments)

    return wrapped


def test_a_light_inside_a_solid_is_told_and_kept_there(live: TransferRelighter) -> None:
    live.shine(
        [LAMP, Lamp((0.3, -0.5, -0.2), spot(), name="lost"), replace(PANEL, position=(0.3, -0.5, -0.2))]
    )
    assert len(live.notes) == 2
    assert "lamp 'lost' at (0.3, -0.5, -0.2) is inside a solid" in live.notes[0]
    alone = TransferRelighter(live.bake)
    alone.shine([LAMP])
    assert rms(live.irradiance, alone.irradiance) < 1e-6
    live.shine([LAMP, PANEL, BEAM])
    assert live.notes == []


def test_bad_settings_are_refused(room: Bake) -> None:
    for settings in (
        {"gather_rays": 1000}, {"entries": 3}, {"modes": 0}, {"operator_bounces": 4}, {"memory": 1000}, {"modes": True},
    ):  # fmt: skip
        with pytest.raises(InputError):
            TransferSettings(**settings)
    with pytest.raises(InputError, match="shadow-rays"):
        TransferRelighter(room, shadow_rays=0)
    with pytest.raises(InputError, match=r"has not the transfer layer 'other'.*prelight bake transfer"):
        TransferRelighter(room, "other")


# ---- pictures ---------------------------------------------------------------------------------------------------


def from_above(height: float = 4.0) -> Camera:
    return Camera(eye=(0.0, height, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0), vertical_fov_deg=20.0)


def test_a_picture_has_light_and_shadows_finer_than_the_mesh(tmp_path: Path) -> None:
    """Over a plane of five vertices a side: the closed form in every pixel, and a strip of shadow."""
    wall = np.float32(
        [[0.1, 0.2, -1], [0.1, 0.2, 1], [0.2, 0.2, 1], [0.2, 0.2, -1]]
    )  # its shadow: x 0.30 to 0.47
    scene = scene_of(grid(5, size=3.0), (wall, np.int32([[0, 1, 2], [0, 2, 3]])), albedo=0.5)
    bake = bake_transfer(scene, tmp_path / "edge.prelight", settings=TransferSettings(gather_rays=64))
    light = LitBake(bake)
    light.light(
        Rig(Environment.dark(), lamps=(Track((0.0,), (Lamp((-0.2, 0.5, 0.1), spot((2.0,) * 3), 0.0),)),))
    )
    coarse, fine = (
        light.picture(from_above(), width=64, height=64, fine=f).linear[..., 0] for f in (False, True)
    )
    half = np.tan(np.radians(10)) * 4
    line = (np.arange(64) + 0.5) / 64 * 2 * half - half
    x, z = np.meshgrid(line, line)
    d2 = (x + 0.2) ** 2 + 0.5**2 + (z - 0.1) ** 2
    exact = 0.5 * 2.0 * 0.5 / d2**1.5 / np.pi
    lit, shadow = (x < 0.0) | (x > 0.51), (x > 0.34) & (x < 0.43) & (np.abs(z) < 0.4)
    np.testing.assert_allclose(fine[lit], exact[lit], rtol=0.03)
    assert np.abs(coarse[lit] / exact[lit] - 1).max() > 0.1
    assert (fine[shadow] < 0.03 * exact[shadow]).all()
    assert (coarse[shadow] > 0.1 * exact[shadow]).any()


def test_a_film_of_a_lamp_that_moves(room: Bake, tmp_path: Path, prelight) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(
        "[[lamp]]\nposition = [-0.5, 0.5, 0.3]\npower_w = 9\nradius = 0.03\n"
        "keys = [{ at = 0.5, position = [0.5, 0.5, 0.3] }, { at = 1, scale = 0 }]\n"
    )
    options = ["--fps", "2", "--size", "48x27", "--exposure", "0", "--json"]
    answer = prelight("animate", room.path, rig, "-o", tmp_path / "f_{frame}.exr", *options)
    assert answer.code == 0, answer.err
    frames = [read_radiance_map(tmp_path / f"f_000{n}.exr") for n in range(3)]
    assert np.abs(frames[0] - frames[1]).max() > 0.1 * frames[0].max()
    assert (frames[2] == 0).all()
