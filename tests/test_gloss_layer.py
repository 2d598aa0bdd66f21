"""Gloss in an environment layer: beside the fixed-eye layer and the path tracer, on disk, and on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.camera import Camera
from prelight.errors import DamagedBakeError, InputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.rig import Rig
from prelight.material import Material
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.live_environment import LiveEnvironment
from prelight.relighting.relighter import Relighter
from prelight.scene.geometry import Scene
from prelight.storage.bake import Bake
from prelight.transport.eye import vertex_points
from prelight.transport.path_tracing import path_traced_view

from .disk import copy, rewrite_manifest
from .scenes import grid, scene_of, sphere
from .test_forged_bakes import changed, replace_array
from .workshop import assert_refusal

AT = "layers/environment/glossy"
EYE = Camera(eye=(1.6, 1.4, 1.2), target=(0, 0.5, 0), vertical_fov_deg=40)
FLOOR = Material("floor", (0.6, 0.6, 0.6))
GOLD = Material(
    "gold", (0.9, 0.7, 0.4),
    bsdf={"type": "roughconductor", "alpha": 0.3, "specular_reflectance": {"type": "rgb", "value": [0.9, 0.7, 0.4]}},
)  # fmt: skip


def golden_ball() -> Scene:
    ball, floor = sphere(16), grid(9, size=3.0)
    scene = scene_of(ball, floor, name="gold")
    of = np.where(np.arange(len(scene.triangles)) < len(ball[1]), 1, 0).astype(np.int32)
    scene = replace(scene, materials=(FLOOR, GOLD), material_of=of)
    return replace(scene, albedo=np.float32([FLOOR.colour, GOLD.colour])[scene.material_of_vertex])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The same scene for any eye, and for one; direct light alone, that both may be compared."""
    folder, scene = tmp_path_factory.mktemp("gold"), golden_ball()
    few = {"resolution": 16, "tolerance": 0.02}
    bake_environment(scene, folder / "free.prelight", glossy_order=8, bounces=2, gather_rays=64, **few)
    bake_environment(scene, folder / "eye.prelight", camera=EYE, bounces=2, gather_rays=64, **few)
    return folder


def facing(scene: Scene) -> np.ndarray:
    """Vertices of the ball that the eye sees not too flatly."""
    toward = np.float32(EYE.eye) - scene.positions
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    return ((scene.normals * toward).sum(axis=1) > 0.2) & (scene.material_of_vertex == 1)


def test_the_free_eye_sees_what_the_fixed_one_sees(folder):
    free, fixed = (Relighter(folder / f"{name}.prelight", trace_strong=False) for name in ("free", "eye"))
    light = Environment.open("stock:studio")
    free.environment = fixed.environment = light
    gloss = free.glossy(EYE.eye)
    assert gloss is not None
    ours, theirs = free.radiance + gloss, fixed.radiance
    seen = facing(golden_ball())
    assert np.abs(ours - theirs)[seen].mean() < 0.05 * theirs[seen].mean()
    assert abs((ours - theirs)[seen].mean()) < 0.03 * theirs[seen].mean()
    assert np.abs(free.radiance - theirs)[seen].mean() > 0.2 * theirs[seen].mean(), (
        "gloss does make a difference"
    )
    matt = golden_ball().material_of_vertex == 0
    assert not gloss[matt].any(), "diffuse vertices have none"


def test_the_free_eye_sees_what_the_path_tracer_sees(folder):
    free = Relighter(folder / "free.prelight")
    free.environment = Environment.open("stock:studio")
    scene = golden_ball()
    rows = np.flatnonzero(facing(scene))[::5].astype(np.int32)
    for eye in (EYE.eye, (-1.5, 0.9, 1.4)):
        points = vertex_points(scene, eye)
        toward = np.float32(eye) - scene.positions[rows]
        kept = rows[(scene.normals[rows] * toward).sum(axis=1) > 0.3 * np.linalg.norm(toward, axis=1)]
        mean, _ = path_traced_view(
            SurfaceScene(scene),
            points,
            cube=free.environment.cube(16),
            receivers=kept,
            bounces=2,
            samples=1024,
        )
        ours = (free.radiance + free.glossy(eye))[kept]
        assert np.abs(ours - mean).mean() < 0.06 * mean.mean()
        assert abs((ours - mean).mean()) < 0.03 * mean.mean()


def test_a_traced_sun_shines_as_one_in_the_cells(folder):
    """Its highlight is in the same place and of the same energy, whichever way it comes in."""
    sun = Disc(direction=(0.5, 0.8, 0.35), radius_deg=1.5, radiance=(900.0, 800.0, 600.0))
    traced, cells = (
        Relighter(folder / "free.prelight"),
        Relighter(folder / "free.prelight", trace_strong=False),
    )
    for light in (traced, cells):
        light.environment = Environment.constant((0.2, 0.2, 0.2)).with_discs((sun,))
    assert len(traced.strong_lights) > 0
    assert len(cells.strong_lights) == 0
    a, b = (light.glossy(EYE.eye) for light in (traced, cells))
    scene = golden_ball()
    assert a[facing(scene)].sum() == pytest.approx(b[facing(scene)].sum(), rel=0.08)
    assert a.max() == pytest.approx(b.max(), rel=0.15)
    dull = Relighter(folder / "free.prelight")
    dull.environment = Environment.constant((0.2, 0.2, 0.2))
    assert a.max() > 5 * dull.glossy(EYE.eye).max()


def test_light_changes_and_goes_out(folder):
    light = Relighter(folder / "free.prelight")
    light.environment = Environment.constant((1.0, 0.5, 0.25))
    first = light.glossy(EYE.eye)
    light.environment = Environment.constant((2.0, 1.0, 0.5))
    np.testing.assert_allclose(light.glossy(EYE.eye), 2 * first, rtol=1e-3, atol=1e-4)
    light.environment = Environment.constant((0.0, 0.0, 0.0))
    assert not light.glossy(EYE.eye).any()
    light.edit(2, slice(0, 8), slice(0, 8), np.full(3, 5.0, np.float32))
    assert light.glossy(EYE.eye).max() > 0, "edits of texels are seen"


def test_the_picture_has_it_and_the_other_eye_another(folder):
    light = Relighter(folder / "free.prelight")
    light.environment = Environment.open("stock:studio")
    here = light.picture(EYE, width=48, height=36, background=None)
    diffuse = light.view(EYE, width=48, height=36).draw(light.radiance)
    assert np.abs(here.linear - diffuse.linear).max() > 0.1 * diffuse.linear.max()
    assert here.linear.min() >= 0


def test_as_a_live_layer(folder):
    bake = Bake.open(folder / "free.prelight")
    layer, alone = LiveEnvironment(Relighter(bake)), Relighter(bake)
    rig = Rig(Environment.open("stock:studio"))
    assert layer.light(rig)
    alone.environment = rig.environment
    np.testing.assert_allclose(layer.glossy(EYE.eye), alone.glossy(EYE.eye), atol=1e-6)


def test_an_eye_and_gloss_for_all_eyes_do_not_go_together(tmp_path):
    with pytest.raises(InputError, match="glossy-order"):
        bake_environment(golden_ball(), tmp_path / "a.prelight", camera=EYE, glossy_order=4)
    with pytest.raises(InputError, match="glossy-order"):
        bake_environment(golden_ball(), tmp_path / "a.prelight", glossy_order=17)


# ---- forged ------------------------------------------------------------------------------------------

Forge = Callable[[np.ndarray], np.ndarray]
FORGED: dict[str, dict[str, Forge]] = {
    "rows": {
        "one twice": lambda v: changed(v, 1, v[0]),
        "outside": lambda v: changed(v, -1, 10**6),
        "negative": lambda v: changed(v, 0, -1),
        "one less": lambda v: v[1:],
    },
    "counts": {"too many": lambda v: changed(v, 0, 60_000), "wide": lambda v: v.astype(np.int32)},
    "texels": {"outside": lambda v: changed(v, 5, 1536), "one less": lambda v: v[1:]},
    "codes": {
        "a vertex that is not": lambda v: changed(v, 3, (4 << 25) + 10**6),
        "five quarters": lambda v: changed(v, 3, (3 << 28) + (2 << 25)),
        "negative": lambda v: changed(v, 3, -1),
    },
    "lobe_of": {"outside": lambda v: changed(v, 0, 7), "negative": lambda v: changed(v, 0, -1)},
    "lobes": {
        "no number": lambda v: changed(v, (0, 0, 0, 0), np.nan),
        "of another order": lambda v: v[..., :28],
        "an angle less": lambda v: v[:, 1:],
    },
    "highlights": {
        "a node less": lambda v: v[:, 1:],
        "no number": lambda v: changed(v, (0, 0, 0, 0), np.nan),
    },
    "matt": {"infinite": lambda v: changed(v, (0, 0), np.inf), "one colour": lambda v: v[:, :1]},
    "strength": {"huge": lambda v: changed(v, (0, 0), 1e20)},
    "reflectance": {"no number": lambda v: changed(v, (0, 0), np.nan)},
}


@pytest.mark.parametrize(
    ("name", "how"), [(name, how) for name, ways in FORGED.items() for how in ways], ids=str
)
def test_forged_arrays_are_refused(folder, tmp_path, name, how):
    bake = copy(folder / "free.prelight", tmp_path / "forged.prelight")
    values = Bake.open(bake).array(f"{AT}/{name}")
    replace_array(bake, f"{AT}/{name}", np.ascontiguousarray(FORGED[name][how](values)))
    with pytest.raises(DamagedBakeError, match="glossy"):
        Relighter(bake)


@pytest.mark.parametrize("order", [0, 7, 17, -1, 8.0, "8", None])
def test_an_order_that_cannot_be_is_refused(folder, tmp_path, order):
    bake = copy(folder / "free.prelight", tmp_path / "forged.prelight")

    def other(manifest: dict) -> None:
        manifest["layers"]["environment"]["parameters"]["glossy_order"] = order

    rewrite_manifest(bake, other)
    with pytest.raises(DamagedBakeError):
        Relighter(bake)


# ---- the command line ----------------------------------------------------------------------------------


def test_plan_and_inspect_tell_bytes_and_time(prelight, folder, tmp_path):
    answer = prelight(
        "bake", "environment", "stock:still-life-small", "--glossy-order", "6", "--resolution", "8", "--bounces", "0",
        "--dry-run", "--json",
    )  # fmt: skip
    assert answer.code == 0, answer.err
    plan = json.loads(answer.out)
    assert plan["glossy_rows"] > 0
    assert min(plan["glossy_bytes"], plan["glossy_milliseconds"], plan["glossy_rays"]) > 0
    words = prelight("inspect", folder / "free.prelight").out
    assert "harmonics of order 8" in words
    assert "ms a change of light" in words
    assert "loses      light through glass" in words
    said = json.loads(prelight("inspect", folder / "free.prelight", "--json").out)["layers"][0]
    assert said["glossy_bytes"] > 1000
    assert said["statistics"]["glossy_rows"] == 512


def test_relight_tells_what_gloss_took(prelight, folder, tmp_path):
    camera = tmp_path / "eye.json"
    camera.write_text(json.dumps(EYE.to_dict()))
    out = tmp_path / "a.npy"
    answer = prelight(
        "relight", folder / "free.prelight", "stock:studio", "--camera", camera, "-o", out, "--json"
    )
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["glossy_milliseconds"] > 0
    light = Relighter(folder / "free.prelight")
    light.environment = Environment.open("stock:studio")
    np.testing.assert_allclose(np.load(out), light.radiance + light.glossy(EYE.eye), rtol=1e-4, atol=1e-5)


def test_compare_looks_from_the_camera(prelight, folder, tmp_path):
    camera = tmp_path / "eye.json"
    camera.write_text(json.dumps(EYE.to_dict()))
    answer = prelight(
        "compare", folder / "free.prelight", "stock:studio", "--camera", camera, "--receivers", "60", "--samples",
        "256", "--json",
    )  # fmt: skip
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["mean_difference"] < 0.1


def test_gloss_with_an_eye_is_refused_in_one_line(prelight, tmp_path):
    answer = prelight(
        "bake", "environment", "stock:still-life-small", "--camera", "front", "--glossy-order", "4", "-o",
        tmp_path / "a.prelight",
    )  # fmt: skip
    assert_refusal(answer, 2, "glossy-order", "--camera")
