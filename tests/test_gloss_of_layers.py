"""Gloss in layers of every kind: under lamps, through panes, in pictures; beside the path tracer and each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.baking.cloud import bake_cloud
from prelight.baking.cloud_settings import CloudSettings
from prelight.baking.environment import bake_environment
from prelight.baking.portals_room import without_triangles
from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.camera import Camera
from prelight.checking.placed_emitters import emitter_of
from prelight.errors import InputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.placed_lights import Lamp, PlacedPanel
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot
from prelight.material import Material
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting import placed_gloss, portal_gloss
from prelight.relighting.cloud import CloudRelighter
from prelight.relighting.lit_bake import LitBake
from prelight.relighting.relighter import Relighter
from prelight.relighting.transfer import TransferRelighter
from prelight.scene.geometry import Scene
from prelight.scene.normals import vertex_normals
from prelight.transport.eye import vertex_points
from prelight.transport.path_tracing import path_traced_view

from .portal_rooms import SIZE, portals_of, two_windows
from .scenes import grid, scene_of, sphere

GOLD = Material(
    "gold", (0.9, 0.7, 0.4),
    bsdf={"type": "roughconductor", "alpha": 0.3, "specular_reflectance": {"type": "rgb", "value": [0.9, 0.7, 0.4]}},
)  # fmt: skip
EYE = Camera(eye=(1.6, 1.4, 1.2), target=(0, 0.5, 0), vertical_fov_deg=40)
DARK = np.full((6, 4, 4, 3), 1e-9, np.float32)
SUN = Disc(direction=(0.5, 0.8, 0.35), radius_deg=1.5, radiance=(900.0, 800.0, 600.0))


def ball_on_floor() -> Scene:
    ball, floor = sphere(16), grid(9, size=3.0)
    scene = scene_of(ball, floor, name="gold")
    of = np.where(np.arange(len(scene.triangles)) < len(ball[1]), 1, 0).astype(np.int32)
    scene = replace(scene, materials=(Material("floor", (0.6, 0.6, 0.6)), GOLD), material_of=of)
    return replace(scene, albedo=np.float32([(0.6, 0.6, 0.6), GOLD.colour])[scene.material_of_vertex])


def with_ball(scene: Scene, *, middle: tuple[float, float, float], radius: float) -> Scene:
    """A room with a golden ball in it."""
    positions, triangles = sphere(16, radius=radius, centre=middle)
    normals = vertex_normals(positions, triangles).astype(np.float32)
    material = len(scene.materials)
    return replace(
        scene,
        positions=np.concatenate([scene.positions, positions]),
        normals=np.concatenate([scene.normals, normals]),
        triangles=np.concatenate([scene.triangles, triangles + len(scene.positions)]).astype(np.int32),
        albedo=np.concatenate([scene.albedo, np.tile(np.float32(GOLD.colour), (len(positions), 1))]),
        materials=(*scene.materials, GOLD),
        material_of=np.append(scene.material_of, np.full(len(triangles), material, np.int32)),
    )


def facing(scene: Scene, eye, *, material: int, least: float = 0.3) -> np.ndarray:
    """Vertices of a material that the eye sees not too flatly."""
    toward = np.float32(eye) - scene.positions
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    seen = ((scene.normals * toward).sum(axis=1) > least) & (scene.material_of_vertex == material)
    return np.flatnonzero(seen).astype(np.int32)


def lamp(radius: float) -> Lamp:
    return Lamp((1.2, 1.6, 1.0), Spot((4.0, 3.0, 2.0), direction=(0, -1, 0)), radius)


LIGHTS = {
    "a small lamp": lamp(0.01),
    "a large lamp": lamp(0.3),
    "a panel": PlacedPanel((1.5, 2.0, 1.0), (1.0, 1.0), Spot((3.0, 3.0, 3.0), direction=(-1, -1, -0.5))),
}


@pytest.fixture(scope="module")
def lamplit(tmp_path_factory) -> TransferRelighter:
    settings = TransferSettings(gather_rays=256, entries=64, modes=16, glossy_order=8)
    path = tmp_path_factory.mktemp("transfer") / "a.prelight"
    return TransferRelighter(bake_transfer(ball_on_floor(), path, settings=settings))


def lamp_error(layer: TransferRelighter | CloudRelighter, light) -> float:
    """Mean |difference| from the path tracer on the ball."""
    scene = ball_on_floor()
    rows = facing(scene, EYE.eye, material=1)[::4]
    layer.shine([light])
    shine = layer.glossy(EYE.eye)
    assert shine is not None
    ours, surfaces = (layer.irradiance * scene.albedo + shine)[rows], SurfaceScene(scene)
    mean, _ = path_traced_view(
        surfaces, vertex_points(scene, EYE.eye), cube=DARK, receivers=rows, bounces=None, samples=1024,
        lights=[emitter_of(surfaces.mi, light)],
    )  # fmt: skip
    return float(np.abs(ours - mean).mean() / mean.mean())


@pytest.mark.parametrize("kind", LIGHTS)
def test_lamps_and_panels_are_mirrored_as_the_path_tracer_mirrors_them(lamplit, kind):
    assert lamp_error(lamplit, LIGHTS[kind]) < 0.05  # of which noise 0.03


@pytest.mark.parametrize("fault", ["half the light", "no shadows", "the sun of another room"])
def test_seeded_faults_of_lamps_are_found(lamplit, monkeypatch, fault):
    honest = placed_gloss.shining

    def wrong(placed, light, rows):
        d, energy = honest(placed, light, rows)
        if fault == "half the light":
            energy = energy * np.float32(0.8)
        if fault == "no shadows":
            energy = np.broadcast_to(energy.max(axis=0, keepdims=True), energy.shape).copy()
        if fault == "the sun of another room":
            d = np.roll(d, 1, axis=2)
        return d, energy

    monkeypatch.setattr(placed_gloss, "shining", wrong)
    lamplit.shine([])
    assert lamp_error(lamplit, LIGHTS["a large lamp"]) > 0.06


def test_without_light_there_is_no_gloss(lamplit):
    lamplit.shine([])
    assert not lamplit.glossy(EYE.eye).any()
    lamplit.shine([lamp(0.01)])
    assert lamplit.glossy(EYE.eye).any()


def test_the_cloud_mirrors_the_lamps_as_the_transfer_layer_does(lamplit, tmp_path):
    few = CloudSettings(
        lights=27, modes=8, gather_rays=256, glossy_order=8, box=((-1, 0.8, -1), (1.4, 2, 1.4))
    )
    layer = CloudRelighter(bake_cloud(ball_on_floor(), tmp_path / "a.prelight", settings=few))
    rows = facing(ball_on_floor(), EYE.eye, material=1)
    both = []
    for one in (layer, lamplit):
        one.shine([lamp(0.01)])
        both.append((one.irradiance * one.bake.receivers.albedo + one.glossy(EYE.eye))[rows])
    assert np.abs(both[0] - both[1]).mean() < 0.03 * both[1].mean()


@pytest.mark.parametrize("settings", [TransferSettings, CloudSettings])
@pytest.mark.parametrize("order", [-1, 17, 8.0, None])
def test_an_order_that_cannot_be_is_refused(settings, order):
    with pytest.raises(InputError, match="glossy-order"):
        settings(glossy_order=order)


# ---- through panes -----------------------------------------------------------------------------------

LEFT_EYE = (0.6, 1.7, 1.2)


@pytest.fixture(scope="module")
def windows(tmp_path_factory):
    X, Y, Z = SIZE
    scene = with_ball(two_windows(), middle=(X / 2, Y / 2, Z / 2), radius=0.5)
    return scene, portals_of(
        scene, tmp_path_factory.mktemp("panes") / "a.prelight", glossy_order=8, gather_rays=1024
    )


def seen_at(room, environment: Environment, *glass: Glass) -> np.ndarray:
    room.light(Rig(environment, portals=glass))
    shine, panes = room.glossy(LEFT_EYE), room.pane_shine(LEFT_EYE)
    return shine - panes


def _no_lights(places: int):
    return (np.zeros((places, 0, 3), np.float32),) * 2


def openings(scene: Scene) -> np.ndarray:
    """Corner and edges of each window."""
    out = []
    for side in (1, 2):
        corners = (
            scene.positions[scene.triangles[scene.material_of == side]].reshape(-1, 3).astype(np.float64)
        )
        low, high = corners.min(axis=0), corners.max(axis=0)
        out.append([low, [0, high[1] - low[1], 0], [0, 0, high[2] - low[2]]])
    return np.array(out)


def test_a_ball_in_a_room_is_seen_as_the_path_tracer_sees_it(windows):
    scene, room = windows
    sky = Environment.stock("overcast")
    shine = seen_at(room, sky)
    rows = facing(scene, LEFT_EYE, material=len(scene.materials) - 1)[::6]
    ours = (room.irradiance * scene.albedo + shine)[rows]
    bare = without_triangles(scene, np.flatnonzero(np.isin(scene.material_of, (1, 2))))
    mean, _ = path_traced_view(
        SurfaceScene(bare), vertex_points(bare, LEFT_EYE), cube=sky.cube(32), receivers=rows, bounces=None,
        samples=1024, openings=openings(scene),
    )  # fmt: skip
    assert np.abs(ours - mean).mean() < 0.06 * mean.mean()  # of which noise 0.03
    assert abs((ours - mean).mean()) < 0.02 * mean.mean()


def test_each_window_brings_its_own_share(windows):
    _, room = windows
    sky = Environment.stock("overcast")
    left, right = (Glass(f"{side} glass", "shut") for side in ("left", "right"))
    both, no_left, no_right = seen_at(room, sky), seen_at(room, sky, left), seen_at(room, sky, right)
    assert np.abs(both - no_left - no_right).mean() < 0.03 * np.abs(both).mean()
    assert min(np.abs(no_left).mean(), np.abs(no_right).mean()) > 0.05 * np.abs(both).mean()
    assert not seen_at(room, sky, left, right).any()


def test_a_disc_through_a_pane_is_mirrored(windows, monkeypatch):
    """By itself it has the energy of one that is wide enough for the cells."""
    scene, room = windows
    rows = facing(scene, LEFT_EYE, material=len(scene.materials) - 1, least=0.1)

    def shown(radius: float, radiance: float) -> float:
        disc = Disc(direction=(-0.8, 0.25, 0.1), radius_deg=radius, radiance=(radiance,) * 3)
        shine = seen_at(room, Environment.dark().with_discs((disc,)))
        return float((room.irradiance * scene.albedo + shine)[rows].sum())

    sharp = shown(1.0, 3000.0)
    assert sharp == pytest.approx(shown(8.0, 47.0), rel=0.15)
    monkeypatch.setattr(portal_gloss, "_as_falls", lambda discs, normals: _no_lights(len(normals)))
    assert shown(1.0, 3000.0) < 0.7 * sharp, "it comes by no other way"


# ---- pictures ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sunlit(tmp_path_factory):
    path = tmp_path_factory.mktemp("sunlit") / "a.prelight"
    return bake_environment(
        ball_on_floor(), path, resolution=16, tolerance=0.02, bounces=2, gather_rays=64, glossy_order=8
    )


@pytest.mark.parametrize("fine", [False, True])
def test_all_layers_together_draw_what_one_draws(sunlit, fine):
    light, whole = Environment.constant((0.2, 0.2, 0.2)).with_discs((SUN,)), LitBake(sunlit)
    alone = Relighter(sunlit)
    alone.environment = light
    whole.light(Rig(light))
    size = {"width": 48, "height": 40, "background": None, "fine": fine}
    np.testing.assert_allclose(
        whole.picture(EYE, **size).linear, alone.picture(EYE, **size).linear, rtol=1e-4, atol=1e-5
    )


def test_suns_at_pixels_are_those_at_vertices_where_these_are(sunlit):
    light = Relighter(sunlit)
    light.environment = Environment.constant((0.2, 0.2, 0.2)).with_discs((SUN,))
    suns, receivers = light.fine_suns, sunlit.receivers
    assert suns is not None
    here = suns.lamp_light_at(receivers.positions, receivers.normals)
    there = suns.lamp_light
    same = np.isclose(here, there, rtol=1e-4, atol=1e-6).all(axis=1)
    assert same.mean() > 0.97  # but where rays begin elsewhere
    fine, coarse = (
        light.picture(EYE, width=96, height=72, background=None, fine=f).linear for f in (True, False)
    )
    assert np.abs(fine - coarse).max() > 0.1 * coarse.max(), "the shadow's edge is sharper than the mesh"
    assert fine.mean() == pytest.approx(coarse.mean(), rel=0.03)
