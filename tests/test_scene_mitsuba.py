"""Mitsuba's scenes behind trust: against known shapes, and against Mitsuba's own rays."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from prelight.material import Material
from prelight.rays.mitsuba import triangle_mesh
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene
from prelight.scene.variant import mitsuba

RED = {"type": "rgb", "value": [0.6, 0.1, 0.05]}


def place(x: float, y: float = 0.0, z: float = 0.0) -> Any:
    return mitsuba().ScalarAffineTransform4d().translate([x, y, z])


def read(**shapes: dict) -> Scene:
    return load_scene({"type": "scene", **shapes}, trust=True)


def area(scene: Scene) -> float:
    a, b, c = (scene.positions[scene.triangles[:, k]].astype(float) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def outwards(scene: Scene, centre: tuple[float, float, float]) -> tuple[float, float]:
    """The least cosine of winding and of normals with the way from the centre."""
    a, b, c = (scene.positions[scene.triangles[:, k]].astype(float) for k in range(3))
    across, away = np.cross(b - a, c - a), (a + b + c) / 3 - centre
    wound = (across * away).sum(1) / np.linalg.norm(across, axis=1) / np.linalg.norm(away, axis=1)
    spoke = scene.positions - np.array(centre)
    turned = (scene.normals * spoke).sum(1) / np.linalg.norm(spoke, axis=1)
    return float(wound.min()), float(turned.min())


# ---- shapes ------------------------------------------------------------------------------------------


def test_known_shapes_have_their_areas():
    sphere = read(s={"type": "sphere", "center": [1, 2, 3], "radius": 2.0})
    assert area(sphere) == pytest.approx(16 * math.pi, rel=2e-3)
    np.testing.assert_allclose(np.linalg.norm(sphere.positions - [1, 2, 3], axis=1), 2, rtol=1e-5)
    disk = read(d={"type": "disk", "to_world": place(1).scale(3)})
    assert area(disk) == pytest.approx(9 * math.pi, rel=2e-3)
    cylinder = read(c={"type": "cylinder", "p0": [0, 0, 0], "p1": [0, 2, 0], "radius": 0.5})
    assert area(cylinder) == pytest.approx(2 * math.pi, rel=2e-3)
    rectangle = read(r={"type": "rectangle", "to_world": place(0).scale([2, 3, 1])})
    assert area(rectangle) == pytest.approx(24)
    assert (len(rectangle.triangles), len(rectangle.positions)) == (2, 4)
    cube = read(c={"type": "cube"})
    assert area(cube) == pytest.approx(24)
    assert len(cube.triangles) == 12
    assert outwards(cube, (0, 0, 0))[0] > 0.5


def test_a_sphere_faces_outwards():
    wound, turned = outwards(
        read(s={"type": "sphere", "to_world": place(3).rotate([1, 0, 0], 30)}), (3, 0, 0)
    )
    assert wound > 0.99
    assert turned > 0.999


def odd_scene(folder: Path) -> dict[str, Any]:
    """Mirrored, flipped, instanced and flat shapes, all apart from each other."""
    mi = mitsuba()
    mi.load_dict({"type": "cube"}).write_ply(str(folder / "cube.ply"))
    ply = {"type": "ply", "filename": str(folder / "cube.ply"), "face_normals": True}
    return {
        "type": "scene",
        "flipped": {"type": "sphere", "flip_normals": True, "to_world": place(5, 5, 5).scale([-1, 1, 1])},
        "mirrored": {"type": "rectangle", "to_world": place(0, 0, -5).rotate([0, 1, 0], 40).scale([2, 3, -1])},
        "back": {"type": "rectangle", "flip_normals": True, "to_world": place(0, -9, -5).scale([-2, 3, 1])},
        "tube": {"type": "cylinder", "flip_normals": True, "to_world": place(-6).scale([1, 1, 3])},
        "plate": {"type": "disk", "to_world": place(-6, 8).rotate([1, 1, 0], 30).scale(2)},
        "group": {"type": "shapegroup", "a": {"type": "cube"}, "b": {"type": "sphere", "center": [0, 3, 0]}},
        "first": {"type": "instance", "to_world": place(12).rotate([0, 0, 1], 20), "g": {"type": "ref", "id": "group"}},
        "second": {"type": "instance", "to_world": place(-14).scale([0.5, 1, 2]), "g": {"type": "ref", "id": "group"}},
        "cube": {"type": "cube", "flip_normals": True, "to_world": place(0, 10, 10)},
        "flat": {**ply, "to_world": place(10, 10).scale([-1, 1, 1])},
        "inside": {**ply, "flip_normals": True, "to_world": place(10, 20)},
        "made": mi.load_dict({"type": "sphere", "center": [-10, -10, 0]}),
    }  # fmt: skip


def disagreement(mi: Any, theirs: Any, scene: Scene, rng: np.random.Generator) -> tuple[float, float, float]:
    """Of rays towards the scene: hits, how many see another distance, how many another side."""
    mesh = triangle_mesh(scene.positions, scene.triangles, normals=scene.normals)
    ours = mi.load_dict({"type": "scene", "mesh": mesh})
    count = 100_000
    origin = rng.uniform(scene.positions.min(0) - 1, scene.positions.max(0) + 1, (count, 3))
    chosen = scene.triangles[rng.integers(len(scene.triangles), size=count)]
    toward = scene.positions[chosen].mean(1) + rng.normal(size=(count, 3)) * 0.2 - origin
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    ray = mi.Ray3f(mi.Point3f(*origin.T), mi.Vector3f(*toward.T))
    a, b = theirs.ray_intersect(ray), ours.ray_intersect(ray)
    both = np.array(a.is_valid() & b.is_valid())
    near = np.abs(np.array(a.t)[both] - np.array(b.t)[both]) < 0.02
    side = (np.array(a.sh_frame.n).T[both] * np.array(b.sh_frame.n).T[both]).sum(1) > 0.9
    return both.mean(), 1 - near.mean(), 1 - side[near].mean()


def test_rays_meet_the_same_shapes_from_the_same_side_as_in_mitsuba(tmp_path, rng):
    mi = mitsuba()
    table = odd_scene(tmp_path)
    theirs = mi.load_dict(table, optimize=False)
    for source in (table, theirs):
        scene = load_scene(source, trust=True)
        hits, elsewhere, turned = disagreement(mi, theirs, scene, rng)
        assert hits > 0.5
        assert elsewhere < 0.01  # silhouettes of facets
        assert turned == 0


def test_mirrored_and_flipped_shapes_face_where_mitsuba_says(rng):
    kinds = ("sphere", "cylinder", "disk", "rectangle", "cube")
    table: dict[str, Any] = {"type": "scene"}
    for row, kind in enumerate(kinds):
        for column, (mirror, flip) in enumerate([(1, False), (1, True), (-1, False), (-1, True)]):
            world = place(5 * row, 5 * column).scale([mirror, 1, 1])
            table[f"{kind}{column}"] = {"type": kind, "flip_normals": flip, "to_world": world}
    mi = mitsuba()
    hits, elsewhere, turned = disagreement(mi, mi.load_dict(table), load_scene(table, trust=True), rng)
    assert hits > 0.4
    assert elsewhere < 0.01
    assert turned == 0


def test_a_group_is_there_only_where_an_instance_places_it():
    group = {"type": "shapegroup", "a": {"type": "cube"}}
    scene = read(g=group, i={"type": "instance", "to_world": place(7), "s": {"type": "ref", "id": "g"}})
    assert len(scene.triangles) == 12
    assert scene.positions[:, 0].min() == pytest.approx(6)


def test_flat_faces_keep_their_edges_and_share_what_is_coplanar(tmp_path):
    mitsuba().load_dict({"type": "cube"}).write_ply(str(tmp_path / "cube.ply"))
    scene = read(p={"type": "ply", "filename": str(tmp_path / "cube.ply"), "face_normals": True})
    assert len(scene.positions) == 24
    assert np.sort(np.abs(scene.normals), axis=1)[:, 2] == pytest.approx(1)


def test_the_cornell_box_has_its_walls_its_lamp_and_its_eye():
    scene = load_scene(mitsuba().cornell_box(), trust=True)
    assert len(scene.triangles) == 2 * 6 + 2 * 12
    assert [m.name for m in scene.materials] == ["white", "white", "green", "red"]
    assert scene.materials[0].emission == pytest.approx((18.387, 13.9873, 6.75357))
    assert scene.materials[1].emission == (0, 0, 0)
    assert scene.materials[3].colour == pytest.approx((0.570068, 0.0430135, 0.0443706))
    assert all(m.bsdf is None for m in scene.materials)
    camera = scene.cameras["sensor"]
    assert camera.eye == pytest.approx((0, 0, 3.9))
    assert camera.target[2] < camera.eye[2]
    assert camera.vertical_fov_deg == pytest.approx(39.3077)
    # The lamp shines down, the floor looks up.
    lamp = scene.material_of_vertex == 0
    assert scene.normals[lamp] == pytest.approx(np.tile([0, -1, 0], (4, 1)), abs=1e-6)


# ---- surfaces ----------------------------------------------------------------------------------------


def test_plain_surfaces_need_no_bsdf_and_others_are_plain_data():
    scene = read(
        a={"type": "cube", "b": {"type": "twosided", "b": {"type": "diffuse", "reflectance": RED}}},
        b={"type": "cube", "to_world": place(5), "b": {"type": "roughconductor", "material": "Au", "alpha": 0.2}},
        c={"type": "cube", "to_world": place(9), "b": {"type": "plastic", "diffuse_reflectance": RED}},
        d={"type": "cube", "to_world": place(13), "b": {"type": "diffuse", "reflectance": RED}},
    )  # fmt: skip
    plain, gold, plastic = scene.materials  # the fourth is the first
    assert plain.bsdf is None
    assert plain.is_lambertian
    assert plain.colour == (0.6, 0.1, 0.05)
    assert gold.bsdf["eta"]["value"] == pytest.approx([0.143, 0.3753, 1.442], abs=1e-3)
    assert "material" not in gold.bsdf
    assert gold.colour[0] > gold.colour[2] > 0.2  # yellow
    assert plastic.colour == (0.6, 0.1, 0.05)
    assert not plastic.is_lambertian
    assert scene.material_of.tolist() == [0] * 12 + [1] * 12 + [2] * 12 + [0] * 12
    for material in scene.materials:
        stored = json.loads(json.dumps(material.to_dict()))
        assert Material.from_dict(stored, textures=0).bsdf == material.bsdf
        mitsuba().load_dict(material.bsdf or {"type": "diffuse"})


def test_nested_surfaces_and_spectra_stay_what_they_are():
    inner = {"type": "diffuse", "reflectance": {"type": "spectrum", "value": [(400, 0.1), (700, 0.9)]}}
    blend = {
        "type": "blendbsdf",
        "weight": 0.25,
        "one": inner,
        "two": {"type": "diffuse", "reflectance": RED},
    }
    (material,) = read(c={"type": "cube", "b": {"type": "mask", "opacity": 0.5, "x": blend}}).materials
    seen = material.bsdf["x"]["one"]["reflectance"]
    assert seen["type"] == "rgb"
    assert seen["value"] == pytest.approx([0.742853, 0.48114, 0.208325], abs=1e-4)  # Mitsuba's own
    expected = 0.75 * np.array(seen["value"]) + 0.25 * np.array(RED["value"])
    assert material.colour == pytest.approx(tuple(expected))
    assert Material.from_dict(material.to_dict(), textures=0) == material


def test_loaded_objects_say_the_same_of_their_surfaces():
    table = {
        "type": "scene",
        "a": {"type": "cube", "b": {"type": "twosided", "b": {"type": "principled", "roughness": 0.3}}},
        "b": {"type": "cube", "to_world": place(5), "b": {"type": "diffuse", "reflectance": RED}},
    }
    glossy, plain = load_scene(
        mitsuba().load_dict(table, optimize=False)
    ).materials  # theirs: no trust needed
    assert plain.colour == pytest.approx((0.6, 0.1, 0.05))
    assert plain.bsdf is None
    assert glossy.bsdf["brdf_0"]["roughness"] == pytest.approx(0.3)
    assert "brdf_1" not in glossy.bsdf
    mitsuba().load_dict(dict(glossy.bsdf))


def test_textures_lie_as_in_mitsuba(tmp_path):
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[:4], pixels[4:] = (220, 60, 40), (40, 90, 200)
    Image.fromarray(pixels).save(tmp_path / "picture.png")
    picture = {"type": "bitmap", "filename": str(tmp_path / "picture.png")}
    turned = picture | {"to_uv": mitsuba().ScalarTransform3f().translate([0, 0.5])}
    scene = read(
        a={"type": "rectangle", "b": {"type": "diffuse", "reflectance": picture}},
        b={"type": "rectangle", "to_world": place(5), "b": {"type": "diffuse", "reflectance": turned}},
        c={
            "type": "rectangle",
            "to_world": place(9),
            "b": {"type": "plastic", "diffuse_reflectance": picture},
        },
    )
    assert len(scene.textures) == 1
    assert np.array_equal(scene.textures[0], pixels)
    assert scene.uv[:4] == pytest.approx(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]))
    assert scene.uv[4:8] == pytest.approx(np.array([(0, 0.5), (1, 0.5), (1, 1.5), (0, 1.5)]))
    first, _, glossy = scene.materials[0], *scene.materials[-2:]
    assert (first.bsdf, first.colour_texture) == (None, 0)
    assert glossy.colour_texture == 0
    assert glossy.bsdf["diffuse_reflectance"] == {"type": "stored_texture", "index": 0, "raw": False}


def test_floating_point_textures_become_bytes_and_say_so():
    linear = np.full((2, 2, 3), 0.25, np.float32)
    picture = {"type": "bitmap", "data": mitsuba().TensorXf(linear)}
    scene = read(
        a={
            "type": "rectangle",
            "b": {"type": "twosided", "x": {"type": "plastic", "diffuse_reflectance": picture}},
        }
    )
    assert scene.textures[0].flat[0] == 137  # sRGB of 0.25
    assert any("8 bits" in note for note in scene.notes)


def test_what_is_not_read_is_noted():
    scene = read(
        sky={"type": "constant"},
        lamp={"type": "point", "position": [0, 1, 0]},
        a={"type": "cube"},
        air={"type": "cube", "b": {"type": "null"}},
    )
    assert len(scene.triangles) == 12
    said = " | ".join(scene.notes)
    for word in ("constant", "point", "null"):
        assert word in said


@pytest.mark.parametrize(
    ("more", "aspect", "vertical"),
    [
        ({"fov": 60.0, "fov_axis": "x"}, 2.0, 2 * math.atan(math.tan(math.radians(30)) / 2)),
        ({"fov": 60.0, "fov_axis": "y"}, 2.0, math.radians(60)),
        ({"fov": 60.0, "fov_axis": "larger"}, 0.5, math.radians(60)),
        ({"fov": 60.0, "fov_axis": "smaller"}, 0.5, 2 * math.atan(math.tan(math.radians(30)) * 2)),
    ],
)
def test_a_camera_sees_what_the_sensor_sees(more, aspect, vertical):
    mi = mitsuba()
    look = mi.ScalarAffineTransform4d().look_at([1, 2, 5], [0, 0.5, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": int(200 * aspect), "height": 200}
    sensor = {"type": "perspective", "to_world": look, "film": film, **more}
    camera = read(c={"type": "cube"}, eye=sensor).cameras["eye"]
    assert math.radians(camera.vertical_fov_deg) == pytest.approx(vertical)
    made = mi.load_dict(sensor)
    ray, _ = made.sample_ray(0, 0, [0.5, 0.0], [0, 0])  # the middle of the upper edge
    axes = camera.axes()
    ours = math.tan(vertical / 2) * axes[1] - axes[2]
    np.testing.assert_allclose(np.array(ray.d).ravel(), ours / np.linalg.norm(ours), atol=1e-5)
