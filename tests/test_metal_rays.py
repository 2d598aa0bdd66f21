"""Light by way of rough metal, in bakes that keep gloss: against the path tracer, and a mirror's closed form."""

from __future__ import annotations

import dataclasses
import re
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import pytest

from prelight.baking import bounced_plan
from prelight.baking.bounced_plan import BouncedPlan, plan_bounced
from prelight.baking.caustics import cells_of
from prelight.baking.environment import bake_environment
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.baking.fitness import even_sky_fitness
from prelight.baking.layer_receivers import LayerReceivers
from prelight.baking.light_cells import light_cells
from prelight.bases.cube_map import mean_directions, solid_angles, texel_directions
from prelight.errors import DamagedBakeError
from prelight.lighting.environment import Environment
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.relighter import Relighter
from prelight.scene.geometry import Scene
from prelight.scene.subdivision import subdivided
from prelight.storage.bake import Bake
from prelight.transport import gathering, metal_rays
from prelight.transport.eye import vertex_points
from prelight.transport.gathering import Gathering
from prelight.transport.metal_rays import MetalRays, Metals
from prelight.transport.path_tracing import path_traced_view
from prelight.transport.specular import rough_metals

from .disk import copy, rewrite_manifest
from .rooms import rectangle, scene_of_rectangles
from .test_forged_bakes import changed, replace_array

R = 8
AT = "layers/environment/bounced/metal"
MATT = Material("matt", (0.5, 0.5, 0.5))


def metal(alpha: float, colour: tuple[float, float, float]) -> Material:
    whole = {"type": "rgb", "value": list(colour)}
    bsdf = {"type": "roughconductor", "alpha": alpha, "distribution": "ggx", "specular_reflectance": whole}
    return Material("metal", colour, bsdf=bsdf | {"material": "none"})


@lru_cache
def floor_before_metal(alpha: float, colour: tuple[float, float, float]) -> Scene:
    """A matt floor, 0 < x < 2, and a sheet of metal that stands on its edge x = 0 and looks along x."""
    parts = [
        rectangle((0, 0, -1), (0, 0, 2), (2, 0, 0), cells=6),
        rectangle((0, 0, -3), (0, 2, 0), (0, 0, 6), cells=6),
    ]
    scene = scene_of_rectangles(*parts)
    of = np.repeat([0, 1], [len(t) for _, _, t in parts]).astype(np.int32)
    albedo = np.where(
        np.arange(len(scene.positions))[:, None] < len(parts[0][0]), np.float32(0.5), np.float32(colour)
    )
    return dataclasses.replace(
        scene, albedo=albedo.astype(np.float32), materials=(MATT, metal(alpha, colour)), material_of=of
    )


def evening() -> np.ndarray:
    """Light from +x alone."""
    d = texel_directions(np.arange(6 * R * R, dtype=np.int32), R)
    bright = np.where(d[:, 0] > 0.5, 1.0, 0.0)[:, None] * np.float32([1, 0.8, 0.6])
    return bright.reshape(6, R, R, 3).astype(np.float32)


def lit_floor(scene: Scene, path) -> tuple[np.ndarray, np.ndarray]:
    """Irradiance / π of the floor's inner vertices: of a bake, and by the path tracer."""
    bake = bake_environment(
        scene, path, resolution=R, tolerance=1e-3, gather_rays=1024, glossy_order=2, force=True
    )
    light = Relighter(bake)
    light.environment = Environment.from_cube(evening())
    inner = np.flatnonzero(
        (scene.normals[:, 1] > 0.9) & (scene.positions[:, 0] > 0.3) & (np.abs(scene.positions[:, 2]) < 0.9)
    )
    truth, _ = path_traced_view(
        SurfaceScene(scene), vertex_points(scene, (1.0, 5.0, 0.0)), cube=evening(), receivers=inner.astype(np.int32),
        bounces=None, samples=4096,
    )  # fmt: skip
    return light.irradiance[inner], truth / 0.5


def followed(scene: Scene) -> Metals:
    """Rough metal, and the sky in cells, the 6·16² of R = 16."""
    cell_of = partial(cells_of, cells=light_cells(16), resolution=16)
    return Metals(SurfaceScene(scene), rough_metals(scene), cell_of, 6 * 16**2)


@pytest.mark.parametrize("fault", [False, True])
def test_a_floor_before_metal_has_the_light_that_the_path_tracer_finds(tmp_path, monkeypatch, fault):
    """The fault: metal is taken as diffuse."""
    if fault:
        monkeypatch.setattr(LayerReceivers, "metals", None)
    found, truth = lit_floor(floor_before_metal(0.2, (0.9, 0.7, 0.4)), tmp_path / "a.prelight")
    off = np.abs(found - truth).mean(axis=0) / truth.mean(axis=0)
    assert (off > 0.04).any() if fault else (off < 0.025).all(), off


def test_a_smooth_sheet_shows_the_sky_that_it_mirrors():
    """Rays that it sends to the sky go where a mirror would send them, and lose the metal's colour alone."""
    colour = (0.9, 0.6, 0.3)
    scene = floor_before_metal(0.02, colour)
    occluders = Occluders(scene.positions, scene.triangles)
    place, up = np.float32([[0.5, 0.0, 0.0]]), np.float32([[0, 1, 0]])
    metals = dataclasses.replace(followed(scene), chosen=np.array([False, True]))
    rays = MetalRays(occluders, scene, metals, origins=place, normals=up, rays=4096)
    sky = rays.trace(0, 1).to_sky
    assert sky.counts.tolist() == [len(sky.cells)]
    toward = mean_directions(light_cells(16), 16)[sky.cells]
    assert (toward[:, 0] > -0.01).all(), "back from the sheet, toward +x"
    plain = Gathering.trace(scene, occluders, origins=place, normals=up, rays=4096)
    seen = next(iter(plain.tiles())).values.sum()  # the share of rays that meet anything: the sheet
    weights = sky.by_row()[0] / 4096
    np.testing.assert_allclose(weights, seen * np.float32(colour), rtol=0.02)


def test_rays_are_the_same_in_tiles_of_any_size(monkeypatch):
    scene = floor_before_metal(0.2, (0.9, 0.7, 0.4))
    occluders, metals = Occluders(scene.positions, scene.triangles), followed(scene)

    def traced() -> tuple[np.ndarray, ...]:
        found = Gathering.trace(scene, occluders, rays=64, metals=metals)
        values = np.concatenate([tile.values for tile in found.tiles()], axis=1)
        parts = [[getattr(t, n) for t in found.to_sky] for n in ("counts", "cells", "weights")]
        return values, found.mirrored_sky, *(np.concatenate(part, axis=-1) for part in parts)

    whole = traced()
    monkeypatch.setattr(gathering, "_RAYS_AT_ONCE", 64 * 17)
    monkeypatch.setattr(metal_rays, "_AT_ONCE", 100)
    for a, b in zip(whole, traced(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_of_the_sky_by_way_of_metal_no_more_is_held_than_cells_and_the_plan_counts_it(monkeypatch):
    scene = floor_before_metal(0.2, (0.9, 0.7, 0.4))
    occluders = Occluders(scene.positions, scene.triangles)
    found = Gathering.trace(scene, occluders, rays=256, metals=followed(scene))
    held = sum(part.bytes for part in found.to_sky)
    for part in found.to_sky:
        keys = np.repeat(np.arange(len(part.counts)), part.counts) * 6 * 16**2 + part.cells
        assert (np.diff(keys) > 0).all(), "each cell of a row once"
        assert part.gone > 2 * len(keys), "and that is less than one for every ray"

    def planned(order: int) -> BouncedPlan:
        settings = EnvironmentSettings(16, glossy_order=order, gather_rays=256)
        return plan_bounced(LayerReceivers(scene, settings), 1 << 40)

    sent_on = found.rays - 256 * len(scene.positions)
    assert planned(2).rays - planned(0).rays == pytest.approx(sent_on, rel=0.01)
    memory = planned(2).memory
    monkeypatch.setattr(bounced_plan, "_SKY_COPIES", 0)
    assert memory - planned(2).memory == pytest.approx(2.5 * held, rel=0.01)


@pytest.mark.parametrize("fault", ["", "no sky by way of metal", "compared with matt metal"])
def test_a_fine_mesh_beside_metal_holds_the_light_of_an_even_sky(fault):
    scene = subdivided(floor_before_metal(0.2, (0.9, 0.7, 0.4)), 0.25)
    occluders, metals = Occluders(scene.positions, scene.triangles), followed(scene)
    found = Gathering.trace(scene, occluders, rays=1024, metals=metals)
    if fault == "no sky by way of metal":
        found.mirrored_sky[:] = 0
    there = None if fault == "compared with matt metal" else metals
    fitness = even_sky_fitness(scene, occluders, found, metals=there)
    place = scene.positions[scene.triangles[fitness.triangle]].mean(axis=1)
    beside = fitness.deviation[(place[:, 1] == 0) & (place[:, 0] < 0.5)].mean()
    held = (fitness.share > 0.99, beside < 0.008)
    assert held == ((True, True) if not fault else (fault.startswith("compared"), False)), (
        fitness.share, beside,
    )  # fmt: skip


def test_metals_are_followed_where_gloss_is_kept_and_nowhere_else():
    scene = floor_before_metal(0.2, (0.9, 0.7, 0.4))
    assert LayerReceivers(scene, EnvironmentSettings(R, glossy_order=4)).metals.tolist() == [False, True]
    assert LayerReceivers(scene, EnvironmentSettings(R)).metals is None
    assert LayerReceivers(scene, EnvironmentSettings(R, glossy_order=4, bounces=0)).metals is None
    kinds = [
        (Material("steel", metallic=1.0, roughness=0.5), True),
        (Material("mirror", metallic=1.0, roughness=0.1), False),  # photons carry it
        (Material("plastic", specular=1.0, roughness=0.5), False),
        (Material("two", bsdf={"type": "twosided", "inner": {"type": "roughconductor", "alpha": 0.3}}), True),
    ]
    for material, expected in kinds:
        assert rough_metals(dataclasses.replace(scene, materials=(MATT, material)))[1] == expected, material


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Bake:
    path = tmp_path_factory.mktemp("metal") / "b.prelight"
    return bake_environment(
        floor_before_metal(0.2, (0.9, 0.7, 0.4)), path, resolution=2, gather_rays=16, glossy_order=1
    )


def test_what_metal_sends_is_kept_and_another_program_finds_it(small):
    """The reader that docs/bake-format.md gives in full."""
    assert small.layers["environment"].statistics["metal_rays"] > 0
    text = (Path(__file__).resolve().parents[1] / "docs" / "bake-format.md").read_text(encoding="utf-8")
    theirs: dict = {}
    exec(compile("\n".join(re.findall(r"```python\n(.*?)```", text, re.S)), "bake-format.md", "exec"), theirs)
    light = Relighter(small, trace_strong=False)
    light.environment = Environment.stock("sunset")
    cube, omega = light._live.cube.astype(np.float64), solid_angles(2).astype(np.float64)
    expected = theirs["radiance"](small.path, cube, omega)
    np.testing.assert_allclose(light.radiance, expected, rtol=1e-3, atol=1e-4 * expected.max())
    found = theirs["caustics"](small.path, f"{AT}/", np.ones((24, 3)))
    matt = small.receivers.normals[:, 1] > 0.9
    assert found[matt].mean() > 0.01, "and there is something to find"


def test_a_bake_without_what_its_metal_sends_is_refused(small, tmp_path):
    path = copy(small.path, tmp_path / "lost.prelight")

    def without(document: dict) -> None:
        for part in ("arrays", "chunks"):
            document[part] = {name: said for name, said in document[part].items() if not name.startswith(AT)}

    rewrite_manifest(path, without)
    with pytest.raises(DamagedBakeError, match="metal: its arrays are missing"):
        Bake.open(path)


@pytest.mark.parametrize(("name", "wrong"), [("cells", 60_000), ("scales", np.nan)])
def test_forged_light_of_metal_is_refused(small, tmp_path, name, wrong):
    path = copy(small.path, tmp_path / "forged.prelight")
    replace_array(path, f"{AT}/{name}", changed(np.array(small.array(f"{AT}/{name}")), 0, wrong))
    with pytest.raises(DamagedBakeError, match="metal"):
        Relighter(Bake.open(path))
