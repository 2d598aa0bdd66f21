"""Caustics in environment layers: against the path tracer, by cells and by a sun's own photons, on disk and forged."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from prelight.baking import bounced as bounced_module
from prelight.baking.bounced import BouncedLight
from prelight.baking.bounced_plan import plan_bounced
from prelight.baking.caustics import Caustics, cells_of, find_caustics
from prelight.baking.environment import bake_environment
from prelight.baking.environment_settings import PHOTONS, EnvironmentSettings
from prelight.baking.layer_receivers import LayerReceivers
from prelight.baking.light_cells import cell_samples, light_cells
from prelight.bases.cube_map import solid_angles
from prelight.camera import Camera
from prelight.errors import DamagedBakeError, InputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.material import Material
from prelight.relighting import caustic_rays
from prelight.relighting.caustic_rays import TracedCaustics
from prelight.relighting.relighter import Relighter
from prelight.storage.bake import Bake
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.path_traced_light import LitScene
from prelight.transport.photon_tracing import BATCH
from prelight.transport.specular import is_specular, specular_materials, without_specular

from .disk import copy, rewrite_manifest
from .glass import GLASS, GREEN_GLASS, ball, ball_above_floor, joined
from .rooms import rectangle, room, scene_of_rectangles
from .scenes import ball_on_floor
from .test_forged_bakes import changed, replace_array
from .workshop import assert_refusal

AT = "layers/environment/bounced/caustics"
R = 32  # two texels a cell


def sun(x: float) -> Environment:
    return Environment.dark().with_discs(
        (Disc(direction=(x, 1.0, 0.1), radius_deg=1.5, radiance=(50.0, 50.0, 50.0)),)
    )


def small_scene(material: Material = GLASS):
    return ball_above_floor(material=material, cells=14, rings=12)


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("glass") / "glass.prelight"
    return bake_environment(
        small_scene(), path, resolution=R, tolerance=0.05, gather_rays=100, photons=4 * BATCH
    ).path


@pytest.fixture
def bake(original, tmp_path) -> Path:
    return copy(original, tmp_path / "glass.prelight")


def test_under_a_sky_a_floor_below_glass_is_as_the_path_tracer_has_it(original) -> None:
    scene, light = small_scene(), Relighter(original)
    sky = Environment.constant((1.0, 1.0, 1.0))
    light.environment = sky
    floor = np.flatnonzero(scene.positions[:, 1] < 0.01)
    chosen = floor[np.linalg.norm(scene.positions[floor], axis=1) < 0.5].astype(np.int32)
    reference = LitScene(scene, sky=sky.cube(R)).light(chosen, samples=2048).total.mean(axis=1)
    ours = light.irradiance[chosen].mean(axis=1)
    assert ours.mean() == pytest.approx(reference.mean(), rel=0.015)
    assert np.abs(ours - reference).mean() < 0.05 * reference.mean()
    shadowed = Relighter(original, bounced=False)
    shadowed.environment = sky
    assert shadowed.irradiance[chosen].mean() < 0.93 * reference.mean()


def test_a_suns_caustic_moves_with_it_within_its_cell(original, monkeypatch) -> None:
    """By its own photons; by those of its cell, without the renderer, it only has as much light."""
    monkeypatch.setattr(caustic_rays, "PHOTONS", BATCH)
    light = Relighter(original)
    floor = np.flatnonzero(light.bake.receivers.positions[:, 1] < 0.01)

    def caustic(x: float) -> np.ndarray:
        light.environment = sun(x)
        (strong, direct) = light.strong_lights, light._strong.tracer.radiance(light.strong_lights)
        assert len(strong)
        return light.traced_radiance(strong, irradiance=True)[floor, 0] - direct[floor, 0]

    traced = [caustic(x) for x in (0.15, 0.2)]
    monkeypatch.setattr(TracedCaustics, "__call__", lambda *_: None)
    of_cell = [caustic(x) for x in (0.15, 0.2)]
    energy = [r.sum(dtype=np.float64) for r in traced + of_cell]
    np.testing.assert_allclose(energy, np.mean(energy), rtol=0.12)
    assert np.abs(traced[0] - traced[1]).sum() > 0.3 * energy[0]
    assert np.abs(of_cell[0] - of_cell[1]).sum() < 0.05 * energy[0]


def test_lights_off_is_dark_and_an_edit_is_as_good_as_a_new_map(original) -> None:
    light = Relighter(original, trace_strong=False)
    light.environment = Environment.constant((1.0, 2.0, 3.0))
    light.edit(2, slice(0, 4), slice(0, 4), np.float32([5, 5, 5]))
    edited = light.radiance
    cube = Environment.constant((1.0, 2.0, 3.0)).cube(R).copy()
    cube[2, 0:4, 0:4] = 5
    again = Relighter(original, trace_strong=False)
    again._live.set_cube(cube)
    again._live.settle()
    np.testing.assert_allclose(edited, again.radiance, rtol=1e-4, atol=1e-5)
    light.environment = Environment.dark()
    assert not light.radiance.any()


# ---- the matrix ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found() -> tuple[LayerReceivers, Caustics]:
    eye = Camera((0.0, 2.5, 0.8), (0.0, 0.0, 0.0), vertical_fov_deg=50.0)
    layer = LayerReceivers(
        small_scene(GREEN_GLASS),
        EnvironmentSettings(R, receivers="pixels", camera=eye, width=24, height=16, pixel_samples=4),
    )
    cells = light_cells(R)
    return layer, find_caustics(layer.scene, layer.occluders, cells, R, photons=BATCH, report=lambda _: None)


def dense(caustics: Caustics, count: int) -> np.ndarray:
    out = np.zeros((caustics.colours, len(caustics.starts) - 1, count))
    rows = np.repeat(np.arange(out.shape[1]), np.diff(caustics.starts))
    out[:, rows, caustics.cells] = caustics.values
    return out


def test_forth_and_back_are_one_matrix_and_its_transpose(found, rng) -> None:
    _, caustics = found
    count, C = len(light_cells(R)), caustics.colours
    assert C == 3
    matrix = dense(caustics, count)
    mixtures = rng.standard_normal((C, count, 5)).astype(np.float32)
    direct = np.ones((C, matrix.shape[1], 5), np.float32)
    caustics.add(mixtures, direct)
    np.testing.assert_allclose(direct, 1 + matrix @ mixtures, rtol=1e-3, atol=1e-3 * matrix.max())
    Q = rng.standard_normal(direct.shape).astype(np.float32)
    weights = np.ones((C, count, 5))
    caustics.add_answers(Q, weights)
    expected = 1 + matrix.transpose(0, 2, 1) @ Q
    np.testing.assert_allclose(weights, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


def test_pixels_have_what_their_points_have_times_their_albedo(found) -> None:
    layer, caustics = found
    scene, count = layer.scene, len(light_cells(R))
    of_pixels = dense(caustics.for_rows(layer), count).sum(axis=2).T
    floor_only = np.where(specular_materials(scene)[scene.material_of_vertex], 0, 1)[:, None]
    at_vertices = dense(caustics, count).sum(axis=2).T * scene.albedo * floor_only
    points = layer.points
    expected = points.interpolated(scene, at_vertices.astype(np.float32)) * points.coverage[:, None]
    matt = (points.triangle < 0) | ~specular_materials(scene)[scene.material_of[points.triangle]]
    plain = matt.all(axis=1) & (of_pixels.sum(axis=1) > 0)
    assert plain.sum() > 20
    np.testing.assert_allclose(of_pixels[plain], expected[plain], rtol=1e-3)


def test_bytes_keep_the_mean(found) -> None:
    _, caustics = found
    parts = caustics.in_bytes()
    kept = (parts["codes"] * np.repeat(parts["scales"], parts["counts"])).sum(axis=1)
    np.testing.assert_allclose(kept, caustics.values.sum(axis=1), rtol=0.01)


@pytest.mark.parametrize("resolution", [1, 5, 8, 32, 40])
def test_directions_find_their_cells(resolution) -> None:
    cells = light_cells(resolution)
    d, _ = cell_samples(cells, resolution)
    middle = d[:, d.shape[1] // 2]
    assert (cells_of(middle, cells, resolution) == np.arange(len(cells))).all()


def bounced_of_a_lit_floor(layer: LayerReceivers, monkeypatch) -> tuple[np.ndarray, np.ndarray]:
    """What a layer has for bounced light of a floor that every cell lights by glass, and what the operator says."""
    scene, count, V = layer.scene, len(light_cells(2)), len(layer.scene.positions)
    lit = (scene.positions[:, 1] == 0) & (scene.normals[:, 1] > 0.9)
    starts = np.concatenate([[0], np.cumsum(lit * count)]).astype(np.int64)
    cells = np.tile(np.arange(count, dtype=np.int32), int(lit.sum()))

    def indirect(strength: float) -> np.ndarray:
        given = Caustics(starts, cells, np.full((1, len(cells)), strength, np.float32), 1, 0.0)
        monkeypatch.setattr(bounced_module, "find_caustics", lambda *_, **__: given)
        part = BouncedLight(layer, rays=256, most=None, memory=None, report=lambda _: None).found(
            lanes=1 << 20
        )
        return part.modes @ part.weights[0].sum(axis=1)

    gathering = Gathering.trace(layer.bouncing, layer.occluders, origins=layer.origins, rays=256)
    C = np.zeros((V, 1, 1), np.float32)
    C[lit] = 0.2 * count
    return indirect(0.2) - indirect(0.0), bounced(gathering, C).indirect[:, 0, 0]


def test_caustics_bounce_like_all_other_light(monkeypatch) -> None:
    """A floor that every cell lights by glass: the wall beside it has that floor's light from the modes."""
    walls = scene_of_rectangles(
        rectangle((0, 0, 0), (0, 0, 2), (2, 0, 0), cells=5),
        rectangle((0, 0, 0), (0, 2, 0), (0, 0, 2), cells=5),
    )
    scene = joined(walls, *ball(radius=0.05, centre=(1, 1.9, 1), rings=4), GLASS)
    found, expected = bounced_of_a_lit_floor(
        LayerReceivers(scene, EnvironmentSettings(2, gather_rays=256, photons=BATCH)), monkeypatch
    )
    np.testing.assert_allclose(found, expected, atol=0.02 * expected.max())


@pytest.mark.parametrize("fault", [False, True])
def test_modes_span_what_caustics_alone_bring(monkeypatch, fault) -> None:
    """A closed room where nothing falls directly. The fault: mixtures that span the modes have direct light alone."""
    scene = joined(room(3), *ball(radius=0.05, centre=(2, 2.5, 2), rings=4), GLASS)
    if fault:
        monkeypatch.setattr(Caustics, "add", lambda *_: None)
    found, expected = bounced_of_a_lit_floor(
        LayerReceivers(scene, EnvironmentSettings(2, gather_rays=256, photons=BATCH)), monkeypatch
    )
    off = float(np.abs(found - expected).max() / expected.max())
    assert off > 0.5 if fault else off < 0.02


# ---- settings, disk, forgeries ------------------------------------------------------------------------------


def test_photons_are_traced_only_where_a_material_needs_them() -> None:
    glass, matt = small_scene(), ball_on_floor(side=4, rings=4)
    of = {photons: EnvironmentSettings(R, photons=photons) for photons in (None, 0, 1000)}
    assert [LayerReceivers(glass, s).photons for s in of.values()] == [PHOTONS, 0, 1000]
    assert [LayerReceivers(matt, s).photons for s in of.values()] == [0, 0, 0]
    assert LayerReceivers(glass, EnvironmentSettings(R, bounces=0)).photons == 0
    plan = plan_bounced(LayerReceivers(glass, of[None]), 4 << 30)
    assert plan.photons == PHOTONS
    assert 0 < plan.photon_seconds < plan.seconds
    black = without_specular(glass)
    on_glass = np.unique(glass.triangles[glass.material_of == 1])
    assert not black.albedo[on_glass].any()
    assert black.albedo.sum() == pytest.approx(glass.albedo.sum() - glass.albedo[on_glass].sum())
    assert without_specular(matt) is matt
    for wrong in (-1, 1 << 40, 2.5):
        with pytest.raises(InputError, match="photons"):
            EnvironmentSettings(R, photons=wrong)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Material(transmission=1.0), True), (Material(metallic=1.0, roughness=0.1), True),
        (Material(metallic=1.0, roughness=0.6), False), (Material(specular=1.0, roughness=0.0), False),
        (Material(bsdf={"type": "twosided", "inner": {"type": "conductor"}}), True),
        (Material(bsdf={"type": "roughconductor", "alpha": 0.4}), False),
        (Material(bsdf={"type": "plastic"}), False), (Material(bsdf={"type": "thindielectric"}), True),
        (Material(bsdf={"type": "principled", "spec_trans": 0.9}), True),
    ],
)  # fmt: skip
def test_which_materials_photons_carry(material, expected) -> None:
    assert is_specular(material) == expected


def test_what_is_on_disk_is_whole_and_said(original) -> None:
    bake = Bake.open(original)
    assert {f"{AT}/{name}" for name in ("counts", "cells", "codes", "scales")} <= set(bake.manifest.arrays)
    said = bake.layers["environment"]
    assert said.parameters["photons"] == 4 * BATCH
    assert 0 < said.statistics["caustic_noise"] < 0.2
    bake.verify()


def test_another_program_finds_the_same_light(original) -> None:
    """The reader that docs/bake-format.md gives in full."""
    text = (Path(__file__).resolve().parents[1] / "docs" / "bake-format.md").read_text(encoding="utf-8")
    theirs: dict = {}
    exec(compile("\n".join(re.findall(r"```python\n(.*?)```", text, re.S)), "bake-format.md", "exec"), theirs)
    light = Relighter(original, trace_strong=False)
    light.environment = Environment.stock("sunset")
    expected = theirs["radiance"](
        original, light._live.cube.astype(np.float64), solid_angles(R).astype(np.float64)
    )
    np.testing.assert_allclose(light.radiance, expected, rtol=1e-3, atol=1e-4 * expected.max())


ARRAYS = {
    "counts": {"one more": lambda v: np.append(v, v[:1]), "another": lambda v: changed(v, 0, 9)},
    "cells": {"beyond": lambda v: changed(v, 0, 60_000), "one less": lambda v: v[1:]},
    "codes": {"two colours": lambda v: np.concatenate([v, v]), "one less": lambda v: v[:, 1:]},
    "scales": {"no number": lambda v: changed(v, 0, np.nan), "negative": lambda v: changed(v, 0, -1)},
}


@pytest.mark.parametrize(("name", "fault"), [(n, f) for n, faults in ARRAYS.items() for f in faults])
def test_forged_caustics_are_refused(bake, name, fault) -> None:
    values = ARRAYS[name][fault](np.array(Bake.open(bake).array(f"{AT}/{name}")))

    def forge_and_open() -> None:  # some faults are seen when the manifest is
        replace_array(bake, f"{AT}/{name}", values)
        Relighter(bake)

    with pytest.raises(DamagedBakeError) as caught:
        forge_and_open()
    assert "caustics" in str(caught.value)


def test_missing_arrays_and_wrong_numbers_are_refused(bake) -> None:
    rewrite_manifest(bake, lambda m: m["layers"]["environment"]["parameters"].update(photons=-1))
    with pytest.raises(DamagedBakeError, match="photons are -1"):
        Relighter(bake)


def test_the_command_line_refuses_a_wrong_number(prelight, tmp_path) -> None:
    answer = prelight(
        "bake", "environment", "stock:sculpture-small", "--photons", "-3", "-o", tmp_path / "x.prelight"
    )
    assert_refusal(answer, 2, "photons")
