"""Materials as BSDFs: textures the right way up and in the right space, vertex colours, what is refused."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from prelight.bases.cube_map import solid_angles, texel_directions
from prelight.errors import InputError
from prelight.images.tonemap import srgb_decode
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene, index_of_refraction
from prelight.scene.geometry import Scene
from prelight.transport.eye import SeenPoints, vertex_points
from prelight.transport.viewed import ViewedTransfer

from .scenes import plane

UP = np.float32([[0, 1, 0]])
EYE = (0.0, 50.0, 0.0)


def square(material: Material, *, textures=(), tint=None) -> Scene:
    """One unit square of four vertices in the xz plane, facing up; u along x, v along z."""
    positions = np.float32([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]])
    tint = np.tile(np.float32(material.colour), (4, 1)) if tint is None else np.float32(tint)
    return Scene(
        "square", positions, np.float32([[0, 1, 0]] * 4), np.int32([[0, 2, 1], [1, 2, 3]]), tint,
        materials=(material,), uv=np.ascontiguousarray(positions[:, [0, 2]]), tint=tint, textures=tuple(textures),
    )  # fmt: skip


def at(u: np.ndarray, v: np.ndarray, *, eye=EYE) -> SeenPoints:
    """Points of the square by their texture coordinates."""
    first = u + v < 1  # triangle 0 has its corner at (0, 0), triangle 1 at (1, 1)
    weights = np.where(first[:, None], np.stack([v, u], -1), np.stack([1 - u, u + v - 1], -1))
    return SeenPoints(eye, (~first).astype(np.int32)[:, None], weights.astype(np.float32)[:, None], False)


def radiance(scene: Scene, points: SeenPoints, d=UP) -> np.ndarray:
    """T of the points for one light, (points, 3)."""
    occluders = Occluders(scene.positions, scene.triangles)
    rows, _ = ViewedTransfer(occluders, SurfaceScene(scene), points).trace(np.float32(d))
    return rows[0].T


@pytest.fixture(scope="module")
def pattern() -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, (4, 6, 3), dtype=np.uint8)


@pytest.fixture(scope="module")
def centres() -> tuple[np.ndarray, np.ndarray]:
    """Of the texels of a texture of 4 × 6, row by row."""
    u, v = np.meshgrid((np.arange(6) + 0.5) / 6, (np.arange(4) + 0.5) / 4)
    return u.ravel(), v.ravel()


def test_a_texture_has_its_first_row_at_v_0_and_is_decoded_from_srgb(pattern, centres):
    material = Material(colour=(1, 1, 1), colour_texture=0)
    seen = radiance(square(material, textures=[pattern]), at(*centres)) * math.pi
    np.testing.assert_allclose(seen, srgb_decode(pattern.reshape(-1, 3) / np.float32(255)), atol=2e-3)


@pytest.mark.parametrize("raw", [True, False])
def test_a_stored_texture_of_a_bsdf_is_raw_or_srgb_as_it_says(pattern, centres, raw):
    stored = {"type": "stored_texture", "index": 0, "raw": raw}
    material = Material(bsdf={"type": "twosided", "one": {"type": "diffuse", "reflectance": stored}})
    seen = radiance(square(material, textures=[pattern]), at(*centres)) * math.pi
    bytes_ = pattern.reshape(-1, 3) / np.float32(255)
    np.testing.assert_allclose(seen, bytes_ if raw else srgb_decode(bytes_), atol=2e-3)


def test_colour_and_vertex_colours_multiply_the_texture(pattern, centres):
    texel = srgb_decode(pattern.reshape(-1, 3) / np.float32(255))
    u, v = (c[:, None] for c in centres)
    even = square(Material(colour=(0.5, 0.25, 1.0), colour_texture=0), textures=[pattern])
    np.testing.assert_allclose(
        radiance(even, at(*centres)) * math.pi, texel * np.float32([0.5, 0.25, 1]), atol=2e-3
    )
    corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]])
    material = Material(colour=(1, 1, 1), colour_texture=0)
    uneven = square(material, textures=[pattern], tint=corners)
    between = np.where(
        u + v < 1,
        corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]),
        corners[3] + (1 - u) * (corners[2] - corners[3]) + (1 - v) * (corners[1] - corners[3]),
    )
    np.testing.assert_allclose(radiance(uneven, at(*centres)) * math.pi, texel * between, atol=2e-3)


def test_vertex_colours_without_a_texture_and_for_a_bsdf():
    corners = np.float32([[0.1, 0.2, 0.3], [0.9, 0.2, 0.3], [0.1, 0.8, 0.3], [0.9, 0.8, 0.3]])
    named = Material(
        bsdf={"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_Col"}}
    )
    for material in (Material(colour=(1, 1, 1)), named):
        scene = square(material, tint=corners)
        np.testing.assert_allclose(
            radiance(scene, vertex_points(scene, EYE)) * math.pi, corners, rtol=1e-5, atol=1e-6
        )


def test_green_is_roughness_and_blue_is_metal():
    texture = np.full((2, 2, 3), (255, 128, 64), np.uint8)
    textured = Material(colour=(0.9, 0.5, 0.2), roughness=0.7, metallic=0.8, roughness_texture=0)
    plain = dataclasses.replace(
        textured, roughness_texture=None, roughness=0.7 * 128 / 255, metallic=0.8 * 64 / 255
    )
    points = at(np.float64([0.3, 0.7]), np.float64([0.2, 0.9]), eye=(2.0, 2.0, 0.5))
    d = [[-0.6, 0.8, 0.0]]
    np.testing.assert_allclose(
        radiance(square(textured, textures=[texture]), points, d),
        radiance(square(plain), points, d),
        rtol=5e-3,
    )


@pytest.mark.parametrize(("specular", "ior"), [(1.0, 1.5), (0.5, 1.5), (1.0, 1.33), (0.0, 1.5), (1.0, 3.0)])
def test_a_dielectric_reflects_what_its_index_and_specular_say(specular, ior):
    n = index_of_refraction(Material(specular=specular, ior=ior))
    assert ((n - 1) / (n + 1)) ** 2 == pytest.approx(specular * ((ior - 1) / (ior + 1)) ** 2, abs=1e-8)


def test_what_mirrors_is_told_and_what_is_not_seen_from_behind():
    materials = (
        Material(),
        Material(roughness=0.2, metallic=1.0),
        Material(bsdf={"type": "dielectric"}),
        Material(bsdf={"type": "twosided", "one": {"type": "plastic"}}),
        Material(bsdf={"type": "roughconductor"}),
    )
    scene = dataclasses.replace(plane(3), materials=materials)
    scene = dataclasses.replace(scene, material_of=np.int32([0, 1, 2, 3, 4, 4, 4, 4]))
    surfaces = SurfaceScene(scene)
    np.testing.assert_array_equal(surfaces.delta, [False, False, True, True, False])
    np.testing.assert_array_equal(surfaces.lambertian, [True, False, False, False, False])
    points = SeenPoints(
        EYE, np.arange(8, dtype=np.int32)[:, None], np.full((8, 1, 2), 0.3, np.float32), False
    )
    assert points.share_on(scene, surfaces.delta) == 2 / 8
    above, below = (dataclasses.replace(points, eye=(0.0, side * 3.0, 0.0)) for side in (1, -1))
    assert (radiance(scene, above)[[0, 1, 4]] > 0).all()
    lit_behind = radiance(scene, below, -UP) > 0
    assert lit_behind[:2].all(), "glTF's materials have two sides"
    assert not lit_behind[4:].any(), "a bsdf is taken as it is"


@pytest.mark.parametrize(
    "bsdf",
    [
        {"type": "diffuse", "reflectance": "red"},
        {"type": "roughconductor", "alpha": {"type": "nonsense"}},
        {"type": "principled", "no_such_thing": 3.0},
        {"type": "twosided"},
    ],
)
def test_a_bsdf_that_mitsuba_does_not_take_is_refused_in_one_line(bsdf):
    with pytest.raises(InputError, match=r"material odd.*Mitsuba does not take its bsdf") as refusal:
        SurfaceScene(dataclasses.replace(plane(3), materials=(Material(name="odd", bsdf=bsdf),)))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "material",
    [
        Material(colour=(1, 1, 1), roughness=0.0, metallic=1.0),
        Material(bsdf={"type": "twosided", "one": {"type": "conductor"}}),
        Material(bsdf={"type": "roughconductor", "alpha_u": 0.001, "alpha_v": 0.001}),
    ],
    ids=["metal", "mirror", "polished"],
)
def test_a_mirror_finds_the_light_between_texels(material, rng):
    """A white mirror under radiance 1 shows 1, wherever among the lights' directions it is looked at from."""
    resolution = 24
    texels = np.arange(6 * resolution**2)
    d, omega = texel_directions(texels, resolution), np.tile(solid_angles(resolution).ravel(), 6)
    scene = square(material)
    occluders = Occluders(scene.positions, scene.triangles)
    wide, sharp = SurfaceScene(scene, resolution=resolution), SurfaceScene(scene)
    assert wide.widened == (material.name,)
    assert sharp.widened == ()
    assert not wide.delta.any()
    shown = {wide: [], sharp: []}
    for x, z in rng.uniform(-2, 2, (12, 2)):
        points = at(np.float64([0.3]), np.float64([0.3]), eye=(x, 2.0, z))
        for surfaces, values in shown.items():
            rows, _ = ViewedTransfer(occluders, surfaces, points).trace(d)
            values.append(float(rows[:, 0, 0] @ omega))
    assert np.abs(np.array(shown[wide]) - 1).max() < 0.04
    assert np.abs(np.array(shown[sharp]) - 1).max() > 0.5


def test_only_what_is_narrower_than_texels_is_widened():
    texture = np.uint8([[[0, 10, 0], [0, 200, 0]]])
    materials = (
        Material("matte"),
        Material("satin", roughness=0.3, specular=1.0),
        Material("polished", roughness=0.05, specular=1.0),
        Material("coated", roughness=1.0, specular=1.0, clearcoat=1.0),
        Material("rough", bsdf={"type": "roughconductor", "alpha": 0.3}),
        Material("textured", roughness=1.0, specular=1.0, roughness_texture=0),
    )
    scene = dataclasses.replace(square(materials[0], textures=[texture]), materials=materials)
    surfaces = SurfaceScene(scene, resolution=64)
    assert surfaces.widened == ("polished", "coated", "textured")
    plain = SurfaceScene(scene)
    same = [str(a) == str(b) for a, b in zip(surfaces.bsdfs, plain.bsdfs, strict=True)]
    assert same == [True, True, False, False, True, False]
