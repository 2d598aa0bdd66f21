"""A cloud of lights from scene to disk to relighting, in two rooms with a door between them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.cloud import bake_cloud
from prelight.baking.cloud_settings import CloudSettings
from prelight.encoding.light_fit import bounded
from prelight.errors import InputError
from prelight.lighting.environment import Environment
from prelight.lighting.keyframes import Track
from prelight.lighting.placed_lights import Lamp, PlacedPanel
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot
from prelight.rays.mitsuba import Occluders
from prelight.relighting.cloud import CloudRelighter
from prelight.relighting.cloud_fading import Fading
from prelight.relighting.lit_bake import LitBake
from prelight.scene.geometry import Scene
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.lamps import SphereLamps, lamp_light

from .disk import copy
from .rooms import box, room
from .test_gltf_lights import file_of

SETTINGS = CloudSettings(
    lights=90, modes=128, zone=256, gather_rays=256, box=((0.1, 0.1, 0.1), (3.9, 2.9, 4.9)), coefficients=32
)
HERE, THERE = (0.9, 1.3, 1.1), (2.9, 1.7, 3.9)


def two_rooms() -> Scene:
    """A wall across the room, from side to side but for a door."""
    wall = box((0.003, 0.003, 2.75), (2.9, 2.997, 3.05), cells=5)
    return room(9, albedo=0.6, more=wall)


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    return bake_cloud(
        two_rooms(), tmp_path_factory.mktemp("cloud") / "rooms.prelight", settings=SETTINGS
    ).path


@pytest.fixture(scope="module")
def lit(path) -> CloudRelighter:
    return CloudRelighter(path)


@pytest.fixture(scope="module")
def truth(path):
    """Indirect light of points, by the same operator and without any compression."""
    scene, layer = two_rooms(), CloudRelighter(path).layer
    occluders = Occluders(scene.positions, scene.triangles)
    gathering = Gathering.trace(scene, occluders, origins=layer.origins, rays=256)

    def of(*places) -> np.ndarray:
        lamps = SphereLamps(
            np.float32(places), np.zeros(len(places), np.float32), np.full((len(places), 3), 4 * np.pi, np.float32)
        )  # fmt: skip
        direct = lamp_light(occluders, layer.origins, scene.normals, lamps=lamps)[:, :, :1]
        return bounded(direct, layer.areas), bounced(gathering, bounded(direct, layer.areas)).indirect[
            :, :, 0
        ]

    return of


def point(at=HERE, intensity=(1.0, 1.0, 1.0), radius=0.0) -> Lamp:
    return Lamp(tuple(map(float, at)), Spot(intensity, direction=(0.0, -1.0, 0.0)), radius)


def off(ours: np.ndarray, true: np.ndarray) -> float:
    return float(np.linalg.norm(ours - true) / np.linalg.norm(true))


def test_lamps_add_up_and_light_is_linear_in_them(lit):
    lit.shine([point(HERE)])
    first = lit.irradiance
    lit.shine([point(THERE)])
    second = lit.irradiance
    lit.shine([point(HERE, (2.0, 0.5, 0.0)), point(THERE)])
    expected = first * np.float32([2.0, 0.5, 0.0]) + second
    np.testing.assert_allclose(lit.irradiance, expected, atol=2e-6 * expected.max())


def test_without_lamps_it_is_dark_exactly_and_what_was_before_does_not_matter(lit):
    lit.shine([point(THERE)])
    once = lit.irradiance
    lit.shine([point(HERE), point(THERE, (3, 2, 1))])
    assert lit.shine([])
    assert not lit.irradiance.any()
    lit.shine([point(HERE, (0.0, 0.0, 0.0))])
    assert not lit.irradiance.any()
    lit.shine([point(THERE)])
    np.testing.assert_array_equal(lit.irradiance, once)
    assert not lit.shine([point(THERE)])


def test_a_lamp_on_a_light_of_the_grid_brings_its_column(lit, truth):
    at = lit.layer.grid[len(lit.layer.grid) // 3]
    lit.shine([point(at)])
    _, true = truth(at)
    assert off(lit.indirect[:, 0], true[:, 0]) < 0.03  # components and clusters alone


def test_between_lights_fitted_weights_err_at_most_half_as_much_as_the_kernel(path, lit, truth):
    chance, kernel = np.random.default_rng(8), CloudRelighter(path, interpolation="kernel")
    places = (0.4, 0.4, 0.4) + chance.random((24, 3)) * (3.2, 2.2, 2.0)
    _, true = truth(*places)
    errors = []
    for light in (lit, kernel):
        for k, at in enumerate(places):
            light.shine([point(at)])
            errors.append(off(light.indirect[:, 0], true[:, k]))
    fitted, papers = np.median(errors[:24]), np.median(errors[24:])
    assert fitted < 0.06
    assert fitted < 0.55 * papers


def test_clusters_and_zones_show_no_seams(lit, truth):
    """What is wrong changes across borders of clusters and zones no more than within them."""
    cluster_of, layer = np.empty(len(lit.layer.order), int), lit.layer
    for k, (first, rows) in enumerate(layer.places[:, :2]):
        cluster_of[layer.order[first : first + rows]] = k
    a, b = lit.bake.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    across, jumps = cluster_of[a] != cluster_of[b], []
    assert 0.1 < across.mean() < 0.9
    places = layer.grid[::9]
    _, true = truth(*places)
    for k, at in enumerate(places):
        lit.shine([point(at)])
        wrong = (lit.indirect[:, 0] - true[:, k]) / true[:, k].mean()
        jumps.append(np.square(wrong[a] - wrong[b]))
    mean = np.mean(jumps, axis=0)
    assert mean[across].mean() < 1.5**2 * mean[~across].mean()
    assert (
        mean[across].mean() < 0.05**2
    )  # of the lamp's mean light; that itself changes by a half from vertex to vertex


def test_little_leaks_through_the_wall(lit, truth):
    """On the far side no more than the reference, and a hundredth of what it has there on the mean."""
    places = [(0.6, 1.2, 2.7), (0.6, 1.2, 2.45), (1.5, 2.0, 2.65)]
    direct, true = truth(*places)
    behind = (two_rooms().positions[:, 2] > 3.1) & (two_rooms().positions[:, 0] < 2.5)
    for k, at in enumerate(places):
        lit.shine([point(at)])
        ours, there = lit.irradiance[behind, 0].mean(), (direct[:, k, 0] + true[:, k])[behind].mean()
        assert ours < 1.01 * there
        near = (direct[:, k, 0] + true[:, k])[~behind].mean()
        assert there < 0.2 * near  # it is a wall


def test_a_lamp_that_goes_through_the_door_does_not_pop(lit, truth):
    """Each centimetre changes the light by at most twice what it does in truth, and a hundredth of the mean."""
    places = np.array([(3.4, 1.2, z) for z in np.arange(2.65, 3.15, 0.01)])
    _, true = truth(*places)
    ours = []
    for at in places:
        lit.shine([point(at)])
        ours.append(lit.indirect[:, 0])
    steps = np.abs(np.diff(np.array(ours), axis=0)).mean(axis=1)
    real = np.abs(np.diff(true.T, axis=0)).mean(axis=1)
    assert (steps <= 2 * real + 0.01 * true.mean()).all()


def test_a_live_session_fades_to_what_is_there_at_once_without_one(path, lit):
    now = [0.0]
    live = CloudRelighter(path, fading=Fading(0.1, clock=lambda: now[0]))
    lit.shine([point(HERE)])
    before = lit.indirect
    assert live.shine([point(HERE)])  # a lamp that is new is there at once
    np.testing.assert_array_equal(live.indirect, before)
    lit.shine([point(THERE)])
    after = lit.indirect
    shares = []
    for _ in range(40):
        assert live.shine([point(THERE)])
        shares.append(off(live.indirect, after) / off(before, after))
        now[0] += 0.05
        if not live.is_settling:
            break
    assert shares[0] == pytest.approx(1, abs=1e-3)
    assert shares[2] == pytest.approx(np.exp(-1), abs=0.02)
    assert not live.is_settling
    np.testing.assert_array_equal(live.indirect, after)
    assert not live.shine([point(THERE)])
    live.shine([])
    assert not live.irradiance.any()  # what is gone is gone


def test_a_lamp_beside_a_wall_is_a_spot_that_no_light_of_the_grid_has(path, lit, truth):
    """Five centimetres from surfaces, where no light of the grid is near: half the error of the paper's kernel."""
    kernel, errors = CloudRelighter(path, interpolation="kernel"), []
    places = [
        (0.05, 1.3, 1.0),
        (1.9, 0.05, 1.4),
        (2.2, 2.95, 0.8),
        (3.95, 0.9, 2.1),
        (1.1, 1.0, 2.7),
        (2.0, 2.0, 0.05),
    ]
    _, true = truth(*places)
    for light in (lit, kernel):
        for k, at in enumerate(places):
            light.shine([point(at)])
            errors.append(off(light.indirect[:, 0], true[:, k]))
    assert np.median(errors[:6]) < 0.5 * np.median(errors[6:])
    assert max(errors[:6]) < max(errors[6:])


def test_spots_and_panels_are_carried_too_but_not_by_the_kernel(path, lit, truth):
    down = PlacedPanel((0.9, 2.8, 1.1), (0.3, 0.3), Spot((4.0, 4.0, 4.0), direction=(0.0, -1.0, 0.0)))
    lit.shine([down])
    scene, layer = two_rooms(), lit.layer
    gathering = Gathering.trace(
        scene, Occluders(scene.positions, scene.triangles), origins=layer.origins, rays=256
    )
    true = bounced(gathering, lit.direct[:, None, :1]).indirect[:, 0, 0]
    assert off(lit.indirect[:, 0], true) < 0.1
    with pytest.raises(InputError, match="kernel"):
        CloudRelighter(path, interpolation="kernel").shine([down])


def test_lamps_in_solids_and_outside_are_told(lit):
    lit.shine([point((1.0, 1.0, 2.9))])
    assert "inside a solid" in lit.notes[0]
    lit.shine([point((1.0, 1.0, -9.0))])
    assert any("outside of the cloud" in note for note in lit.notes)
    lit.shine([point()])
    assert lit.notes == []


def test_a_bake_with_a_cloud_takes_the_rig_s_lamps(path):
    lit = LitBake(path)
    lit.light(Rig(Environment.dark(), lamps=(Track((0.0,), (point(),)),)))
    assert lit.irradiance.min() > -5e-3 * lit.irradiance.max()
    assert lit.irradiance.max() > 0
    with pytest.raises(InputError, match="environment"):
        lit.light(Rig(Environment.open("stock:sunset")))


def test_a_lamp_that_sees_no_light_of_the_cloud_is_lit_by_modes_and_told(path, truth, monkeypatch):
    blind = CloudRelighter(path)
    monkeypatch.setattr(type(blind._weights), "_sees", lambda _, place, lights: np.zeros(len(lights), bool))
    blind.shine([point()])
    assert off(blind.indirect[:, 0], truth(HERE)[1][:, 0]) < 0.3
    assert "sees no light of the cloud" in blind.notes[0]


def test_lights_of_a_gltf_file_are_lamps_of_a_cloud(lit, prelight, tmp_path):
    """KHR_lights_punctual, through ``prelight rig lamps``: a bulb is the same lamp, a spot lights its cone alone."""
    bulb = {"type": "point", "color": [1, 0.5, 0.25], "intensity": 683.0}
    spot = {"type": "spot", "intensity": 683.0, "spot": {"innerConeAngle": 0.3, "outerConeAngle": 0.6}}
    turned = {"translation": list(HERE), "rotation": [-(0.5**0.5), 0, 0, 0.5**0.5]}  # down
    found = []
    for light in (bulb, spot):
        rig = tmp_path / "rig.toml"
        assert prelight("rig", "lamps", file_of(tmp_path, light, **turned), "-o", rig, "--force").code == 0
        assert lit.light(Rig.open(str(rig)))
        found.append((lit.direct, lit.indirect))
    lit.shine([point(HERE, (1.0, 0.5, 0.25))])
    np.testing.assert_allclose(found[0][1], lit.indirect, rtol=1e-3, atol=1e-5 * lit.indirect.max())
    away = two_rooms().positions - np.float32(HERE)
    is_lit = -away[:, 1] > np.cos(0.6) * np.linalg.norm(away, axis=1)
    assert not found[1][0][~is_lit].any()
    assert found[1][1].mean() > 0.02 * lit.indirect.mean()


def test_it_is_relit_without_the_renderer(path, lit, monkeypatch):
    import prelight.rays.mitsuba as door
    from prelight.errors import MissingExtraError

    def missing(*_):
        raise MissingExtraError("no renderer")

    lit.shine([point(radius=0.05)])
    monkeypatch.setattr(door, "mitsuba", missing)
    plain = CloudRelighter(path)
    plain.shine([point(radius=0.05)])
    assert off(plain.irradiance, lit.irradiance) < 0.03


def test_the_same_settings_give_the_same_bytes_and_a_stopped_bake_goes_on(path, tmp_path):
    from prelight.baking import cloud as module

    again = tmp_path / "again.prelight"
    real, calls = module.make_zone, []

    def stops(*args, **named):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*args, **named)

    from prelight.errors import InterruptedBakeError

    module.make_zone = stops
    try:
        with pytest.raises(InterruptedBakeError, match="parts"):
            bake_cloud(two_rooms(), again, settings=SETTINGS)
    finally:
        module.make_zone = real
    bake_cloud(two_rooms(), again, settings=SETTINGS, resume=True)
    ours, theirs = (json.loads((p / "manifest.json").read_text())["chunks"] for p in (again, path))
    assert ours == theirs


def test_lights_in_solids_are_left_out_and_counted(path):
    from prelight.storage.bake import Bake

    layer = Bake.open(path).layers["cloud"]
    told = layer.statistics
    assert told["in_solids"] > 0
    grid = CloudRelighter(path).layer.grid
    assert len(grid) == layer.basis_lights
    assert not ((grid[:, 2] > 2.76) & (grid[:, 2] < 3.04) & (grid[:, 0] < 2.89)).any()
    assert 0 < told["groups"] <= len(grid)
    assert told["coefficients_a_vertex"] <= 32


def test_the_paper_s_cloud_alone_is_smaller_and_lights_too(tmp_path, lit, truth):
    settings = CloudSettings(
        lights=90, modes=0, interpolation="kernel", zone=256, gather_rays=256, box=SETTINGS.box, codes="float16"
    )  # fmt: skip
    bake = bake_cloud(two_rooms(), tmp_path / "paper.prelight", settings=settings)
    light = CloudRelighter(bake)
    light.shine([point()])
    _, true = truth(HERE)
    assert off(light.indirect[:, 0], true[:, 0]) < 0.25
    with pytest.raises(InputError, match="kernel"):
        CloudRelighter(bake, interpolation="fitted")


@pytest.mark.parametrize(
    ("part", "change"),
    [
        ("order", lambda v: np.r_[v[1], v[1:]]),
        ("order", lambda v: v + 1),
        ("zone_rows", lambda v: v + 1),
        ("zone_rows", lambda v: -v),
        ("clusters", lambda v: v + np.int32([0, 0, 1])),
        ("clusters", lambda v: v * np.int32([1, -1, 1])),
        ("clusters", lambda v: v + np.int32([9, 0, 0])),
        ("clusters", lambda v: v[::-1]),
        ("clusters", lambda v: v[:, :2]),
        ("group_of", lambda v: v + np.uint16(7)),
        ("group_of", lambda v: v[:, 1:]),
        ("bases", lambda v: v[1:]),
        ("bases", lambda v: np.full_like(v, 0x7C00)),
        ("base_scales", lambda v: v * np.float32(np.nan)),
        ("base_scales", lambda v: v[:-1]),
        ("codes", lambda v: v[:-1]),
        ("codes", lambda v: v.view(np.uint8)),
        ("code_scales", lambda v: v * np.float32(np.inf)),
        ("sources", lambda v: v[1:]),
        ("sources", lambda v: v.view(np.uint8)),
        ("source_scales", lambda v: v * np.float32(np.nan)),
        ("source_scales", lambda v: v[:, 1:]),
        ("source_order", lambda v: np.r_[v[1], v[1:]]),
        ("zone_modes", lambda v: v + 1),
        ("zone_modes", lambda v: -v),
        ("zone_modes", lambda v: v[1:]),
        ("fluxes", lambda v: v[:, :-1]),
        ("areas", lambda v: v * np.float32(np.nan)),
        ("lights", lambda v: v * np.float32([1, 1, 1, 0])),
        ("lights", lambda v: v * np.float32(np.nan)),
        ("kept_of", lambda v: v + 10_000),
        ("grid", lambda v: v[:5]),
        ("origins", lambda v: v[:-1]),
    ],
)
def test_forged_layers_are_refused_before_a_kernel_runs(path, tmp_path, part, change):
    from prelight.errors import DamagedBakeError
    from prelight.storage.bake import Bake

    from .test_forged_bakes import replace_array

    bake = copy(path, tmp_path / "forged.prelight")
    values = np.ascontiguousarray(change(Bake.open(path).array(f"layers/cloud/{part}")))
    replace_array(bake, f"layers/cloud/{part}", values)
    with pytest.raises(DamagedBakeError):
        CloudRelighter(bake)
