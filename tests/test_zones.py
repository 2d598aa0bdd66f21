"""Zones: every receiver in one of them, and Eq. 11 held among its receivers alone."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from prelight.baking.clustering import cluster_lights
from prelight.baking.environment import bake_environment, bake_planned
from prelight.baking.environment_plan import plan_environment
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.baking.layer_receivers import LayerReceivers
from prelight.baking.zones import DARK, DIFFUSE, VIEWED, Zone, divide, sort_of
from prelight.bases.cube_map import solid_angles, texel_directions
from prelight.bases.quadtree import LeafCover, sample_texels
from prelight.camera import Camera
from prelight.cli.main import run
from prelight.encoding.sparse_tiles import decode_panel, panels_of_parcel
from prelight.errors import InputError
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.storage.bake import Bake
from prelight.transport.exact import integrate
from prelight.transport.ordering import receiver_order

from .disk import quick_bake, tree
from .scenes import ball_on_floor, plane

LAYER = "layers/environment"
EYE = Camera((2.0, 2.0, 2.0), (0.0, 0.4, 0.0))


def glossy_ball(*, side: int = 17, rings: int = 10, roughness: float = 0.5) -> Scene:
    """A glossy ball on a Lambertian floor, with an eye."""
    scene = ball_on_floor(side=side, rings=rings)
    material_of = (scene.triangles.max(axis=1) < 2 * rings * rings).astype(np.int32)
    materials = (
        Material("floor"),
        Material("ball", colour=(0.6, 0.3, 0.1), roughness=roughness, specular=1.0),
    )
    return replace(scene, materials=materials, material_of=material_of, cameras={"a": EYE})


def read_zones(bake: Bake) -> list[tuple[Zone, np.ndarray, np.ndarray, np.ndarray]]:
    """Of each zone its rows, rectangles, bytes (C, channels, receivers) and scales, straight from the arrays."""
    order, found, first, q = bake.array(f"{LAYER}/order"), [], 0, 0
    for groups, channels, clusters, parcels in bake.array(f"{LAYER}/zones"):
        stored = order[first : first + 32 * groups]
        first += 32 * groups
        rows = stored[stored >= 0]
        assert (stored[len(rows) :] == -1).all()
        assert groups == -(-len(rows) // 32)
        parts, panels = [], []
        for _ in range(parcels):
            leaves, scales, present, tiles = (
                bake.array(f"{LAYER}/{name}/{q:05d}") for name in ("rectangles", "scales", "present", "tiles")
            )
            q += 1
            at = 0
            for bits in present:
                count = int(np.bitwise_count(bits).sum())
                panels.append(decode_panel(tiles[at : at + count], bits))
                at += count
            assert at == len(tiles) or (at == 0 and not tiles.any())
            parts.append((leaves, scales))
        size = 256 * panels_of_parcel(groups, channels)
        assert [len(leaves) for leaves, _ in parts[:-1]] == [size] * (parcels - 1)
        leaves, scales = (np.concatenate(x) for x in zip(*parts, strict=True))
        assert len(leaves) == len(scales) == clusters
        columns = np.concatenate(panels)[:clusters].reshape(clusters, channels, 32 * groups)
        assert not columns[:, :, len(rows) :].any()
        kind = {1: DIFFUSE, 3: VIEWED}[channels]
        found.append((Zone(rows, kind, int(channels)), leaves, columns[:, :, : len(rows)], scales))
    assert first == len(order)
    assert f"{LAYER}/tiles/{q:05d}" not in bake.manifest.arrays
    return found


def test_one_zone_is_the_walk_over_all_receivers(tmp_path):
    """The paper's single cut, in the order bakes always had: 326 clusters here since the first version."""
    bake = quick_bake(tmp_path / "ball.prelight", zones=1, bounces=0)
    ((zone, leaves, columns, scales),) = read_zones(bake)
    scene = ball_on_floor(side=6, rings=5)
    np.testing.assert_array_equal(zone.rows, receiver_order(scene.positions, scene.normals))
    assert len(leaves) == bake.layers["environment"].coefficients == 326
    assert bake.layers["environment"].rays == 20250
    assert (columns.max(axis=(1, 2)) == 255).sum() == (scales > 0).sum()


@pytest.mark.parametrize("zones", [1, 5])
def test_a_bake_is_what_the_walk_found_zone_by_zone(tmp_path, zones):
    scene, wanted = (
        ball_on_floor(side=17, rings=10),
        EnvironmentSettings(resolution=8, zones=zones, bounces=0),
    )
    bake = bake_environment(scene, tmp_path / "ball.prelight", resolution=8, zones=zones, bounces=0)
    layer, found = LayerReceivers(scene, wanted), read_zones(bake)
    assert len(found) == len(layer.zones) == zones == bake.layers["environment"].parameters["zones"]
    rows = np.concatenate([zone.rows for zone, *_ in found])
    np.testing.assert_array_equal(np.sort(rows), np.arange(len(scene.positions)))
    for zone, (written, leaves, columns, scales) in zip(layer.zones, found, strict=True):
        np.testing.assert_array_equal(zone.rows, written.rows)
        assert LeafCover(leaves, 8).is_whole_tree
        walk = cluster_lights(
            layer.transfer(zone),
            wanted.test_for(layer.count),
            covered=np.zeros((0, 5), np.int32),
            block=17,
            lanes=1 << 16,
        )
        groups = [group for group, _ in walk]
        np.testing.assert_array_equal(leaves, np.concatenate([g.leaves for g in groups]))
        np.testing.assert_array_equal(columns, np.concatenate([g.columns for g in groups]))
        np.testing.assert_array_equal(scales, np.concatenate([g.scale for g in groups]))
    assert bake.layers["environment"].coefficients == sum(len(leaves) for _, leaves, *_ in found)
    assert bake.layers["environment"].camera is None


def assert_equation_11(layer: LayerReceivers, zone: Zone, leaves: np.ndarray, tolerance: float) -> int:
    """Every sample of every cluster of more than one light is within τ of their mean, RMS over the zone."""
    R, count = layer.settings.resolution, 0
    transfer = layer.transfer(zone)
    for texels in sample_texels(leaves[leaves[:, 3] * leaves[:, 4] > 1], 3, R):
        d = texel_directions(texels[texels >= 0], R)
        T = transfer.values(transfer.trace(d, lanes=1 << 18)[0], d)
        rms = np.sqrt(((T - T.mean(axis=0)) ** 2).mean(axis=2))
        assert rms.max() < tolerance * 1.0001
        count += 1
    return count


def test_each_zone_satisfies_equation_11_among_its_own(tmp_path):
    scene = ball_on_floor(side=17, rings=10)
    bake = bake_environment(
        scene, tmp_path / "ball.prelight", resolution=8, zones=3, tolerance=0.05, bounces=0
    )
    layer = LayerReceivers(scene, EnvironmentSettings(resolution=8, zones=3, tolerance=0.05, bounces=0))
    zones = read_zones(bake)
    counts = [assert_equation_11(layer, zone, leaves, 0.05) for zone, leaves, *_ in zones]
    assert min(counts) > 10
    assert len({len(leaves) for _, leaves, *_ in zones}) > 1, "all zones have the same cut"
    coarsest = min((leaves for _, leaves, *_ in zones), key=len)
    finest = max(zones, key=lambda zone: len(zone[1]))[0]
    with pytest.raises(AssertionError):  # the test of the test: another zone's cut is not good enough
        assert_equation_11(layer, finest, coarsest, 0.05)


def test_glossy_vertices_have_a_zone_of_their_own_under_an_eye(tmp_path):
    """The limit the paper names: among many diffuse receivers a few glossy ones would hardly count."""
    scene = glossy_ball()
    options = {"resolution": 8, "tolerance": 0.05, "bounces": 0}
    bake = bake_environment(scene, tmp_path / "ball.prelight", camera="a", **options)
    layer = LayerReceivers(scene, EnvironmentSettings(camera="a", **options))
    zones = read_zones(bake)
    assert [zone.channels for zone, *_ in zones] == [1, 3]
    is_ball = scene.material_of_vertex == 1
    assert not is_ball[zones[0][0].rows].any()
    assert is_ball[zones[1][0].rows].all()
    for (_, leaves, *_), zone in zip(zones, layer.zones, strict=True):
        assert assert_equation_11(layer, zone, leaves, 0.05) > 10
    record = bake.layers["environment"]
    assert record.camera is not None
    assert record.camera.name == "a"
    assert Camera.from_dict(record.camera.view) == EYE
    assert record.parameters["receivers"] == "vertices"


def walked(layer: LayerReceivers, zone: Zone, cube: np.ndarray) -> tuple[np.ndarray, int]:
    """Radiance of a zone's rows under a map, and how many bytes its clusters are."""
    light = cube * solid_angles(cube.shape[1])[..., None]
    B, size = np.zeros((len(zone.rows), 3)), 0
    test = layer.settings.test_for(layer.count)
    covered = np.zeros((0, 5), np.int32)
    for group, _ in cluster_lights(layer.transfer(zone), test, covered=covered, block=512, lanes=1 << 22):
        if not len(group.leaves):
            continue
        l = np.array([light[f, i : i + h, j : j + w].sum(axis=(0, 1)) for f, i, j, h, w in group.leaves])
        T = np.broadcast_to(group.columns * group.scale[:, :, None], (len(l), 3, len(zone.rows)))
        B += np.einsum("kc,kcr->rc", l, T)
        size += group.columns.size
    return B * (layer.scene.albedo[zone.rows] if zone.channels == 1 else 1), size


def test_a_glossy_object_among_diffuse_ones_is_right_at_its_highlight():
    """One cut for all, as in the paper, and zones of each sort of as many bytes, by exact integration."""
    scene = glossy_ball(side=65, rings=16, roughness=0.25)
    coarse, layer = (
        LayerReceivers(scene, EnvironmentSettings(resolution=32, tolerance=tolerance, camera="a", bounces=0))
        for tolerance in (0.03, 0.0135)
    )
    everything = Zone(receiver_order(scene.positions, scene.normals), VIEWED, 3)
    d = texel_directions(np.arange(6 * 32**2), 32)
    cube = np.full((6 * 32**2, 3), 0.3, np.float32)
    for centre, degrees in (((-0.3, 0.8, -0.2), 6), ((0.8, 0.4, -0.5), 4), ((0.1, 0.9, 0.5), 8)):
        lit = d @ (np.array(centre) / np.linalg.norm(centre)) > np.cos(np.radians(degrees))
        assert lit.sum() > 3
        cube[lit] += 180 / degrees
    cube = cube.reshape(6, 32, 32, 3)

    exact = np.empty((layer.count, 3))
    exact[everything.rows] = integrate(layer.transfer(everything), cube)
    one, zoned = np.empty_like(exact), np.empty_like(exact)
    one[everything.rows], bytes_of_one = walked(coarse, everything, cube)
    sizes = []
    for zone in layer.zones:
        zoned[zone.rows], size = walked(layer, zone, cube)
        sizes.append(size)
    ball = np.flatnonzero(scene.material_of_vertex)
    brightness = exact[ball].sum(axis=1)
    highlight = ball[brightness >= np.quantile(brightness, 0.95)]

    def error(found: np.ndarray) -> float:
        return float(np.sqrt(((found - exact)[highlight] ** 2).sum() / (exact[highlight] ** 2).sum()))

    assert sum(sizes) < 1.05 * bytes_of_one
    assert error(one) > 0.05
    assert error(zoned) < 0.2 * error(one)


def test_without_an_eye_all_is_diffuse_and_without_gloss_an_eye_is_nothing(tmp_path):
    free = bake_environment(glossy_ball(), tmp_path / "free.prelight", resolution=4, bounces=0)
    assert free.layers["environment"].camera is None
    assert [zone.channels for zone, *_ in read_zones(free)] == [1]
    matte = bake_environment(
        ball_on_floor(side=9, rings=6), tmp_path / "a.prelight", resolution=4, camera=EYE, bounces=0
    )
    assert matte.layers["environment"].camera is None
    assert [zone.channels for zone, *_ in read_zones(matte)] == [1]


def test_pixels_are_rows_from_the_top_and_empty_ones_are_dark(tmp_path):
    scene = glossy_ball()
    looking_up = Camera((2.0, 1.0, 2.0), (0.0, 0.8, 0.0))  # the sky above the floor's far edge
    bake = bake_environment(
        scene, tmp_path / "picture.prelight", resolution=6, receivers="pixels", camera=looking_up,
        width=24, height=16, pixel_samples=1, zones=3, bounces=0,
    )  # fmt: skip
    zones = read_zones(bake)
    rows = np.concatenate([zone.rows for zone, *_ in zones])
    np.testing.assert_array_equal(np.sort(rows), np.arange(24 * 16))
    dark = np.zeros(24 * 16, bool)
    for zone, leaves, columns, scales in zones:
        assert zone.channels == 3
        if not columns.any():
            dark[zone.rows] = True
            assert len(leaves) == 6
            assert not scales.any()
    dark = dark.reshape(16, 24)
    assert dark[0].all()
    assert not dark[-1].any()
    layer = LayerReceivers(
        scene,
        EnvironmentSettings(resolution=6, receivers="pixels", camera=looking_up, width=24, height=16,
                            pixel_samples=1, zones=3, bounces=0),
    )  # fmt: skip
    assert {zone.kind for zone in layer.zones} == {DARK, VIEWED}
    said = bake.layers["environment"].parameters
    assert (said["receivers"], said["width"], said["height"], said["samples"]) == ("pixels", 24, 16, 1)
    assert bake.layers["environment"].camera.name == "eye"


def test_zones_and_pixels_are_the_same_bytes_twice(tmp_path):
    scene = glossy_ball(side=9, rings=6)
    options = {"camera": "a", "zones": 3, "resolution": 4}
    for more in ({}, {"receivers": "pixels", "width": 16, "height": 9}):
        trees = []
        for name, memory in (("one", None), ("two", 700_000_000)):
            target = tmp_path / name / f"{len(more)}.prelight"
            target.parent.mkdir(exist_ok=True)
            trees.append(tree(bake_environment(scene, target, memory=memory, **options, **more).path))
        assert trees[0] == trees[1]


@settings(max_examples=60, deadline=None)
@given(
    receivers=st.integers(1, 700),
    zones=st.integers(1, 80),
    sorts=st.integers(1, 4),
    spread=st.sampled_from([0.0, 1e-30, 1.0, 1e30]),
    seed=st.integers(0, 1000),
)
def test_parts_are_whole_groups_of_one_sort(receivers, zones, sorts, spread, seed):
    rng = np.random.default_rng(seed)
    positions = (rng.normal(size=(receivers, 3)) * spread).astype(np.float32)
    normals = rng.normal(size=(receivers, 3)).astype(np.float32)
    sort = rng.integers(0, sorts, receivers).astype(np.int32)
    parts = divide(positions, normals, sort, zones=zones)
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(receivers))
    for value in np.unique(sort):
        sizes = [len(part) for part in parts if sort[part[0]] == value]
        assert sum(sizes) == (sort == value).sum()
        assert sum(size % 32 != 0 for size in sizes) <= 1
        assert max(sizes) <= 2 * min(sizes) + 64
    assert len(parts) <= min(zones, -(-receivers // 32)) + 2 * sorts
    again = divide(positions, normals, sort, zones=zones)
    assert all(np.array_equal(a, b) for a, b in zip(parts, again, strict=True))


def test_parts_are_compact():
    """A square floor in 16 parts: each about a sixteenth of its area, none a strip."""
    scene = plane(64)
    parts = divide(scene.positions, scene.normals, np.zeros(4096, np.int32), zones=16)
    sides = np.array([np.ptp(scene.positions[part][:, [0, 2]], axis=0) for part in parts])
    assert len(parts) == 16
    np.testing.assert_allclose(sides, 0.5, atol=0.05)


@pytest.mark.parametrize(
    ("material", "sort"),
    [
        (Material(), 0),
        (Material(bsdf={"type": "twosided", "inner": {"type": "diffuse"}}), 0),
        (Material(specular=1.0, roughness=0.0), 1),
        (Material(specular=1.0, roughness=1.0), 4),
        (Material(specular=0.5, roughness=0.3), 2),
        (Material(metallic=1.0, roughness=0.3), 6),
        (Material(bsdf={"type": "roughplastic", "alpha": 0.09}), 2),
        (Material(bsdf={"type": "twosided", "inner": {"type": "roughconductor", "alpha": 0.01}}), 5),
        (Material(bsdf={"type": "plastic"}), 1),
    ],
    ids=str,
)
def test_sorts_of_material(material, sort):
    assert sort_of(material) == sort


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--zones", "0"], "zones: 0, expected a whole number from 1 to 4096"),
        (["--zones", "5000"], "zones: 5000"),
        (["--zones", "1.5"], "--zones"),
        (["--receivers", "faces"], "vertices or pixels"),
        (["--receivers", "pixels"], "camera: none given"),
        (["--receivers", "pixels", "--camera", "b"], "is not in sculpture"),
        (["--receivers", "pixels", "--camera", "front", "--size", "9000x3"], "width: 9000"),
        (["--receivers", "pixels", "--camera", "front", "--pixel-samples", "5"], "square number"),
    ],
    ids=str,
)
def test_nonsense_on_the_command_line_is_one_line(options, words, capsys):
    assert run(["bake", "environment", "stock:sculpture", "--dry-run", *options]) == 2
    out, err = capsys.readouterr()
    assert not out
    assert err.count("\n") == 1
    assert words in err


def test_a_camera_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"'b' is not in ball.*: a"):
        bake_environment(glossy_ball(), tmp_path / "b.prelight", camera="b", resolution=4, bounces=0)
    assert not list(Path(tmp_path).iterdir())


@pytest.mark.parametrize("options", [{"zones": 6}, {"camera": "a"}], ids=str)
def test_the_plan_of_zones_is_near_the_bake(tmp_path, options):
    scene, wanted = glossy_ball(side=25, rings=14), EnvironmentSettings(resolution=16, **options, bounces=0)
    plan = plan_environment(scene, wanted)
    bake = bake_planned(scene, tmp_path / "ball.prelight", plan=plan)
    layer = bake.layers["environment"]
    assert plan.zones == layer.parameters["zones"]
    assert plan.clusters == pytest.approx(layer.coefficients, rel=0.25)
    assert plan.rays == pytest.approx(layer.rays, rel=0.25)
    assert plan.bytes == pytest.approx(bake.manifest.bytes_of(""), rel=0.25)


@pytest.mark.parametrize(
    "options", [{}, {"receivers": "pixels", "width": 12, "height": 8}], ids=["vertices", "pixels"]
)
def test_the_reader_of_the_specification_reads_colours(tmp_path, rng, options):
    """docs/bake-format.md against the arrays as they are decoded here: three channels beside one, several zones."""
    scene = glossy_ball(side=9, rings=6)
    bake = bake_environment(
        scene, tmp_path / "a.prelight", resolution=5, zones=3, camera="a", **options, bounces=0
    )
    text = (Path(__file__).resolve().parents[1] / "docs" / "bake-format.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    theirs: dict = {}
    exec(compile(code, "bake-format.md", "exec"), theirs)
    cube = rng.random((6, 5, 5, 3))
    radiance = theirs["radiance"](bake.path, cube, solid_angles(5))

    light = cube * solid_angles(5)[..., None]
    expected = np.full(radiance.shape, np.nan)
    for zone, leaves, columns, scales in read_zones(bake):
        l = np.array([light[f, i : i + h, j : j + w].sum(axis=(0, 1)) for f, i, j, h, w in leaves])
        T = np.broadcast_to(columns * scales[:, :, None], (len(leaves), 3, len(zone.rows)))
        albedo = scene.albedo[zone.rows] if zone.channels == 1 else 1
        expected[zone.rows] = np.einsum("kc,kcr->rc", l, T) * albedo
    np.testing.assert_allclose(radiance, expected, atol=1e-6 * expected.max())
    assert (radiance > 0).any(axis=0).all()
