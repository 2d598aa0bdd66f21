"""Caustics of light through windows: one map of photons for all of it, against panels and the path tracer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.portals_plan import plan_portals
from prelight.baking.portals_room import without_triangles
from prelight.baking.portals_settings import PortalsSettings
from prelight.errors import DamagedBakeError, InputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.material import Material
from prelight.rays.mitsuba import Occluders, triangle_scene
from prelight.relighting.portal_sun_caustics import PortalSunCaustics
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.storage.bake import Bake
from prelight.transport.path_traced_light import LitScene
from prelight.transport.photon_mapping import PhotonMap
from prelight.transport.photon_sources import TriangleSource
from prelight.transport.photon_tracing import BATCH, CAUSTIC
from prelight.transport.portal_caustics import PortalCaustics

from .disk import copy
from .glass import GLASS, GREEN_GLASS, ball, joined
from .portal_rooms import pane, portals_of, wall_with_hole, with_glass
from .rooms import SIZE, rectangle, room, scene_of_rectangles
from .test_forged_bakes import replace_array

X, Y, Z = SIZE
WINDOW = np.float32([[[0, 0.5, 1], [0, 2.5, 1], [0, 2.5, 4]], [[0, 0.5, 1], [0, 2.5, 4], [0, 0.5, 4]]])


def open_room():
    """A room without the wall at x = 0, but for a sill and a lintel; a glass ball in it."""
    sides = (
        ((0, 0, 0), (0, 0, Z), (X, 0, 0)), ((0, Y, 0), (X, 0, 0), (0, 0, Z)), ((X, 0, 0), (0, 0, Z), (0, Y, 0)),
        ((0, 0, 0), (X, 0, 0), (0, Y, 0)), ((0, 0, Z), (0, Y, 0), (X, 0, 0)),
        ((0, 0, 0), (0, 0.5, 0), (0, 0, Z)), ((0, 2.5, 0), (0, 0.5, 0), (0, 0, Z)),
        ((0, 0.5, 0), (0, 2, 0), (0, 0, 1)), ((0, 0.5, 4), (0, 2, 0), (0, 0, 1)),
    )  # fmt: skip
    walls = scene_of_rectangles(*(rectangle(*side, cells=4) for side in sides))
    return joined(walls, *ball(radius=0.5, centre=(1.5, 1.0, 2.5), rings=16), GLASS)


@pytest.fixture(scope="module")
def scene():
    return open_room()


def of_room(scene, photons: int = 2 * BATCH, **options) -> PortalCaustics:
    occluders = Occluders(scene.positions, scene.triangles)
    return PortalCaustics(scene, occluders, WINDOW, np.zeros(2, np.int32), photons=photons, **options)


def in_even_light(caustics: PortalCaustics, vertices: int, resolution: int = 8) -> np.ndarray:
    """(vertices, colours) of all cells together."""
    rows = caustics.rows(np.arange(vertices), resolution, number=0)
    sums = np.add.reduceat(np.append(rows.weight, 0), rows.starts[:-1]) * (np.diff(rows.starts) > 0)
    return sums.reshape(vertices, caustics.panes, caustics.colours)[:, 0]


def test_even_light_behind_a_portal_is_a_panel_behind_which_nothing_stands(scene) -> None:
    occluders, caustics = Occluders(scene.positions, scene.triangles), of_room(scene)
    inward = WINDOW if np.cross(*(WINDOW[0, 1:] - WINDOW[0, 0]))[0] > 0 else WINDOW[:, ::-1]
    source = TriangleSource(np.ascontiguousarray(inward), np.ones((2, 3), np.float32), np.zeros(2, np.int32))
    panel = PhotonMap(scene, occluders, source, ways=CAUSTIC)
    panel.more(2 * BATCH)
    expected = panel.light(nearest=1024).light[:, 0]
    assert caustics.colours == 1
    found = in_even_light(caustics, len(scene.positions))
    assert found.sum() == pytest.approx(expected[:, 0].sum(), rel=0.02)
    assert (
        np.abs(found[:, 0] - expected[:, 0]).mean() < 0.1 * expected.mean()
    )  # other photons, each its noise


def test_small_samples_are_rounded_by_chance_and_keep_the_mean(scene, monkeypatch) -> None:
    caustics = of_room(scene, BATCH)
    every = np.arange(len(scene.positions))
    rounded = caustics.rows(every, 16, number=0)
    monkeypatch.setattr(PortalCaustics, "_rounded", lambda self, values, *_, **__: values)
    whole = caustics.rows(every, 16, number=0)
    assert len(rounded.cell) < 0.9 * len(whole.cell)
    assert rounded.weight.sum() == pytest.approx(whole.weight.sum(), rel=0.01)


def test_panes_behind_others_send_no_light_of_their_own(scene) -> None:
    """A second sheet within, which is part of the same portal: what comes in counts for the outer one."""
    inner = WINDOW + np.float32([0.05, 0, 0])
    both, pane_of = np.concatenate([WINDOW, inner]), np.int32([0, 0, 1, 1])
    occluders = Occluders(scene.positions, scene.triangles)
    corners = both.reshape(-1, 3)
    _, glass = triangle_scene(corners, np.arange(12, dtype=np.int32).reshape(-1, 3))
    once = of_room(scene)
    twice = PortalCaustics(scene, occluders, both, pane_of, photons=4 * BATCH, glass=glass)
    of_panes = (
        np.bincount(twice._photons.light, twice._photons.power[:, 0], minlength=2) / twice._photons.emitted
    )
    alone = once._photons.power[:, 0].sum() / once._photons.emitted
    assert of_panes[0] == pytest.approx(alone, rel=0.03)
    assert of_panes[1] < 0.1 * alone  # past the sides of the outer one


def test_what_bounced_before_goes_by_harmonics(scene) -> None:
    caustics = of_room(scene)
    first, white = np.int32([0]), np.ones((1, 3), np.float32)
    low = caustics.bounced_harmonics(first, white, slice(0, 4), order=1)
    assert (
        low == caustics.bounced_harmonics(first, white, slice(0, 4), order=2)
    ).all()  # an order more changes nothing
    assert low[:, 0].sum() > 0
    red = caustics.bounced_harmonics(first, np.float32([[1, 0.5, 0]]), slice(1, 3), order=1)
    np.testing.assert_allclose(red, low[:, 1:3] * np.float32([1, 0.5, 0]), rtol=1e-5, atol=1e-9)
    assert low[:, 0, 0].sum() < 2 * in_even_light(caustics, len(scene.positions)).sum()


def test_hair_in_a_room_with_glass_is_refused_before_anything_is_paid() -> None:
    room_ = crystal_room()
    fur = replace(room_, materials=(Material("fur", bsdf={"type": "hair"}), *room_.materials[1:]))
    with pytest.raises(InputError, match="fur: its bsdf hair scatters as fibres do"):
        plan_portals(fur, PortalsSettings())


def test_a_room_without_glass_has_none() -> None:
    dark = of_room(room(3), BATCH)
    assert dark.is_dark
    assert not in_even_light(dark, len(room(3).positions)).any()
    assert not dark.bounced_harmonics(np.int32([0]), np.ones((1, 3)), slice(0, 9), order=2).any()


# ---- a bake ------------------------------------------------------------------------------------------------


def crystal_room() -> Scene:
    """A large window, and a ball of green glass above a floor that is finer than the walls."""
    sides = (
        ((0, Y, 0), (X, 0, 0), (0, 0, Z)), ((0, 0, 0), (X, 0, 0), (0, Y, 0)), ((0, 0, Z), (0, Y, 0), (X, 0, 0)),
    )  # fmt: skip
    window, far = ((0, 0, 0), (0, Y, 0), (0, 0, Z)), ((X, 0, 0), (0, 0, Z), (0, Y, 0))
    holes = ((0.3, 0.15), (0.95, 0.85)), ((0.5, 0.35), (0.8, 0.8))
    walls = (
        rectangle((0, 0, 0), (0, 0, Z), (X, 0, 0), cells=30),
        *(rectangle(*side, cells=6) for side in sides),
    )
    for wall, hole in zip((window, far), holes, strict=True):
        walls += wall_with_hole(*wall, hole=hole, cells=4)
    panes = {"left glass": [pane(*window, hole=holes[0])], "right glass": [pane(*far, hole=holes[1])]}
    scene = with_glass(walls, panes)
    return with_more(scene, *ball(radius=0.4, centre=(1.0, 0.55, 2.5), rings=16), GREEN_GLASS, albedo=1.0)


def with_more(scene: Scene, positions, normals, triangles, material, *, albedo: float) -> Scene:
    first, kind = len(scene.positions), len(scene.materials)
    return replace(
        scene,
        positions=np.concatenate([scene.positions, np.float32(positions)]),
        normals=np.concatenate([scene.normals, np.float32(normals)]),
        triangles=np.concatenate([scene.triangles, np.int32(triangles) + first]),
        albedo=np.concatenate([scene.albedo, np.full((len(positions), 3), albedo, np.float32)]),
        materials=(*scene.materials, material),
        material_of=np.concatenate([scene.material_of, np.full(len(triangles), kind, np.int32)]),
    )


@pytest.fixture(scope="module")
def crystal(tmp_path_factory) -> tuple[Scene, PortalsRelighter, Path]:
    scene, path = crystal_room(), tmp_path_factory.mktemp("crystal") / "a.prelight"
    return scene, portals_of(scene, path, photons=4 * BATCH), path


def lit(relighter: PortalsRelighter, environment: Environment, *glass: Glass) -> np.ndarray:
    relighter.light(Rig(environment, portals=glass))
    return relighter.irradiance


def of_caustics(relighter: PortalsRelighter, shell: np.ndarray) -> np.ndarray:
    """(vertices, 3) what the caustic panes hold for a shell of cells (6 n²,)."""
    layer, out = relighter.layer, np.zeros((relighter.vertices, 3), np.float32)
    for number in np.flatnonzero(layer.pane_caustic):
        first, last = layer.pane_rows[number : number + 2]
        found = layer.rows.times(np.float32(shell.reshape(-1, 1)), int(first), int(last))
        out[layer.receiver[first:last]] += found * layer.pane_tints[number]
    return out


def floor_of(scene: Scene) -> np.ndarray:
    inside = (np.abs(scene.positions - np.float32([X / 2, 0, Z / 2]))[:, [0, 2]] < [0.49 * X, 0.49 * Z]).all(
        axis=1
    )
    return np.flatnonzero((scene.positions[:, 1] == 0) & (scene.normals[:, 1] > 0.9) & inside)


def test_under_an_even_sky_a_caustic_is_as_the_path_tracer_has_it(crystal) -> None:
    scene, relighter, _ = crystal
    assert relighter.layer.names == ("left glass", "right glass"), "the ball is no portal"
    C = of_caustics(relighter, np.ones(6 * relighter.layer.cube**2))
    open_ = without_triangles(scene, np.flatnonzero(np.isin(scene.material_of, [1, 2])))
    floor = floor_of(scene)
    chosen = floor[np.argsort(C[floor, 1])[-40:]].astype(np.int32)
    sky = Environment.constant((1.0, 1.0, 1.0))
    reference = LitScene(open_, sky=sky.cube(8)).light(chosen, samples=2048).total
    ours = lit(relighter, sky)[chosen]
    assert C[chosen, 1].mean() > 0.12 * reference[:, 1].mean(), "so that it would be missed"
    np.testing.assert_allclose(ours.mean(axis=0), reference.mean(axis=0), rtol=0.04)
    assert np.abs(ours - reference)[:, 1].mean() < 0.08 * reference[:, 1].mean()
    assert C[chosen, 0].mean() < 0.4 * C[chosen, 1].mean(), "it is green"


def test_caustics_of_portals_add_and_are_tinted_and_shut_with_them(crystal) -> None:
    _, relighter, _ = crystal
    sky = Environment.stock("overcast")
    left, right = Glass("left glass", "shut"), Glass("right glass", "shut")
    both, of_right, of_left = (lit(relighter, sky, *shut) for shut in ((), (left,), (right,)))
    assert np.abs(of_right + of_left - both).max() < 1e-5 * both.max()
    tinted = lit(relighter, sky, Glass("left glass", tint=(0.5, 0.25, 0.0)))
    np.testing.assert_allclose(
        tinted, of_right + of_left * np.float32([0.5, 0.25, 0]), atol=1e-5 * both.max()
    )
    assert not lit(relighter, sky, left, right).any()


def test_a_suns_caustic_by_its_own_photons_has_the_light_of_its_cells(crystal, monkeypatch) -> None:
    scene, relighter, path = crystal
    disc = Disc(direction=(-0.8, 0.6, 0.05), radius_deg=1.0, radiance=(1.0, 1.0, 1.0))
    sun, floor = Environment.dark().with_discs((disc,)), floor_of(scene)
    of_cells = of_caustics(relighter, sun.cube(relighter.layer.cube).mean(axis=3))[floor, 1]
    exact, exact_direct = lit(relighter, sun), relighter.direct
    monkeypatch.setattr(
        PortalSunCaustics, "brought", lambda *_: (np.zeros(0, np.int32),) * 2 + (np.zeros(0),)
    )
    bare = PortalsRelighter(Bake.open(path))
    without, own = lit(bare, sun), (exact_direct - bare.direct)[floor, 1]
    assert own.sum() == pytest.approx(of_cells.sum(), rel=0.1)
    brought = (exact - without)[floor, 1].sum()
    assert brought > 1.02 * own.sum(), "and it bounces"
    monkeypatch.setattr(PortalSunCaustics, "is_there", False)
    blurred = (lit(PortalsRelighter(Bake.open(path)), sun) - without)[floor, 1].sum()
    assert blurred == pytest.approx(brought, rel=0.1), "without the renderer as much light, less sharp"


@pytest.mark.parametrize(
    "fault",
    [
        lambda v: v[:-1],
        lambda v: 1 - v,
        lambda v: v + np.uint8(1),
        lambda v: np.uint8(np.arange(len(v)) > 2),
    ],
)
def test_forged_caustic_panes_are_refused(crystal, tmp_path, fault) -> None:
    path = copy(crystal[2], tmp_path / "a.prelight")
    values = fault(np.array(Bake.open(path).array("layers/portals/pane_caustic")))

    def forge_and_open() -> None:
        replace_array(path, "layers/portals/pane_caustic", values)
        PortalsRelighter(Bake.open(path))

    with pytest.raises(DamagedBakeError, match="pane_caustic"):
        forge_and_open()
