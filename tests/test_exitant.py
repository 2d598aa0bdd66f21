"""Gloss for any eye: lobes in harmonics against closed forms, energy, what is seen, and the whole layer."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest

from prelight.baking.exitant import ExitantPart
from prelight.bases import exitant, spherical_harmonics
from prelight.bases.cube_map import solid_angles, texel_directions
from prelight.errors import InputError
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.exitant import CELLS, Exitant, frames, on_cells
from prelight.scene.geometry import Scene
from prelight.transport.exitant import glossy_rows, lobes_of
from prelight.transport.seen_cells import NONE

from .glossy_surfaces import GOLD, LACQUER, PHONG, made_of, opened, part_of, phong_values
from .rooms import room
from .scenes import ball_on_floor, plane

# ---- lobes -------------------------------------------------------------------------------------------


def test_phongs_lobe_straight_on_is_a_polynomial_that_its_order_holds():
    table = exitant.lobe_table(phong_values(), 10)
    z = np.linspace(0.02, 1, 40)
    fitted = table[0, 0, : exitant.starts(10)[1]] @ exitant.polar(10, z)[: exitant.starts(10)[1]]
    first = (0.5 / exitant.INCIDENT) * np.pi / 2  # the table's first angle is half a degree
    wanted = 12 / (2 * np.pi) * (z * math.cos(first)) ** 10
    assert np.abs(fitted - wanted).max() < 2e-3 * wanted.max()


def test_polar_functions_are_those_of_the_harmonics():
    d = np.array([[0.48, 0.36, 0.8]])
    Y = spherical_harmonics.evaluate(5, d)[0]
    azimuth, at, values = math.atan2(0.36, 0.48), exitant.starts(5), exitant.polar(5, np.array([0.8]))[:, 0]
    for m in range(6):
        for l in range(m, 6):
            assert values[at[m] + l - m] * math.cos(m * azimuth) == pytest.approx(
                Y[l * (l + 1) + m], abs=1e-12
            )
            if m:
                there = values[at[m] + l - m] * math.sin(m * azimuth)
                assert there == pytest.approx(Y[l * (l + 1) - m], abs=1e-12)


def test_the_fit_keeps_the_energy_of_light_from_every_angle():
    values = phong_values()
    table, z = exitant.lobe_table(values, 6), exitant.nodes()[1]
    weight = 0.5 * np.polynomial.legendre.leggauss(len(z))[1] * z
    even = table[:, 0, : exitant.starts(6)[1]] @ exitant.polar(6, z)[: exitant.starts(6)[1]]
    np.testing.assert_allclose(2 * np.pi * even @ weight, exitant.directional_albedo(values)[:, 0], rtol=1e-4)
    assert exitant.directional_albedo(values)[0, 0] == pytest.approx(1.0, abs=1e-3), (
        "closed form, straight on"
    )


def test_a_higher_order_fits_better():
    errors = [exitant.fit_error(phong_values(), order) for order in (2, 4, 6, 8, 10)]
    assert all(later < 0.75 * earlier for earlier, later in pairwise(errors)), errors
    assert errors[3] < 0.05, errors


@pytest.mark.parametrize("functions", [3, 6, 45, 66])
def test_the_order_follows_from_the_number_of_functions(functions):
    assert exitant.count(exitant.order_of(functions)) == functions


# ---- materials ---------------------------------------------------------------------------------------


def test_phong_is_split_into_its_two_parts():
    scene = made_of(plane(4), PHONG)
    rows = glossy_rows(scene)
    lobes = lobes_of(scene, SurfaceScene(scene), rows, 8)
    np.testing.assert_allclose(lobes.matt, 0.2, atol=2e-3)
    np.testing.assert_allclose(lobes.strength, 1.0, atol=1e-3)
    known = exitant.lobe_table(0.5 * phong_values(), 8)
    assert np.abs(lobes.tables[0] - known).max() < 5e-3 * np.abs(known).max()
    albedo = 0.2 + 0.5 * exitant.mean_albedo(phong_values())[0]
    np.testing.assert_allclose(lobes.reflectance, albedo, rtol=5e-3)
    assert lobes.notes == ()


def test_colours_of_vertices_are_their_own():
    """A metal whose colour goes from vertex to vertex: one table, scaled; nothing to tell."""
    scene = plane(4)
    tint = np.linspace(0.2, 0.9, len(scene.positions) * 3, dtype=np.float32).reshape(-1, 3)
    metal = Material(name="metal", roughness=0.5, metallic=1.0, colour=(1, 1, 1))
    scene = dataclasses.replace(scene, materials=(metal,), albedo=tint, tint=tint)
    lobes = lobes_of(scene, SurfaceScene(scene), glossy_rows(scene), 8)
    brightest = tint.sum(axis=1).argmax()
    scale = lobes.strength[:, 1] / lobes.strength[brightest, 1]
    assert np.abs(scale - tint[:, 1] / tint[brightest, 1]).max() < 0.08, "but for Fresnel's white at the edge"
    assert lobes.reflectance[0, 0] < 0.4 < lobes.reflectance[brightest, 0]


def test_lambertian_vertices_are_no_glossy_rows():
    scene = ball_on_floor(side=5, rings=5)
    assert len(glossy_rows(scene)) == 0
    assert ExitantPart.of(scene, Occluders(scene.positions, scene.triangles), order=4) is None


def test_phong_samples_as_it_says(rng):
    """Σ weights over samples is the albedo, and weight · pdf is f · cos."""
    import drjit as dr

    scene = made_of(plane(2), PHONG)
    surfaces = SurfaceScene(scene)
    mi, bsdf = surfaces.mi, surfaces.bsdfs[0]
    n = 200_000
    si = dr.zeros(mi.SurfaceInteraction3f, n)
    si.wi = mi.Vector3f(math.sin(0.9), 0, math.cos(0.9))
    one, two = mi.Float(rng.random(n)), mi.Point2f(mi.Float(rng.random(n)), mi.Float(rng.random(n)))
    sample, weight = bsdf.sample(mi.BSDFContext(), si, one, two, True)
    value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, sample.wo, True)
    assert np.allclose((weight * sample.pdf).numpy(), value.numpy(), atol=1e-4)
    assert np.allclose(pdf.numpy(), sample.pdf.numpy(), rtol=1e-4, atol=1e-6)
    bin_ = int(0.9 / (np.pi / 2) * exitant.INCIDENT)
    albedo = 0.2 + 0.5 * exitant.directional_albedo(phong_values())[bin_, 0]
    assert weight.numpy()[0].mean() == pytest.approx(albedo, rel=0.01)
    si.wi, other = sample.wo, mi.Vector3f(math.sin(0.9), 0, math.cos(0.9))
    back = bsdf.eval(mi.BSDFContext(), si, other, True) / other.z
    there = sample.wo.z.numpy() > 1e-3
    assert np.allclose(back.numpy()[0][there], (value.numpy()[0] / sample.wo.z.numpy())[there], rtol=1e-3)


# ---- light in, radiance out --------------------------------------------------------------------------


def even_sky() -> np.ndarray:
    return np.tile(solid_angles(CELLS)[None, :, :, None], (6, 1, 1, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def shiny_plane() -> tuple[Scene, Exitant]:
    scene = made_of(plane(4), PHONG)
    return scene, opened(scene, part_of(scene))


def test_an_even_sky_gives_the_directional_albedo(shiny_plane):
    """Closed form by reciprocity: what leaves toward an eye is the share that would leave of light from there."""
    scene, gloss = shiny_plane
    coefficients = gloss.coefficients(sky=even_sky())
    for degrees in (5, 30, 50, 65):
        angle = math.radians(degrees)
        eye = tuple(1e4 * np.array([math.sin(angle), math.cos(angle), 0]))
        wanted = 0.5 * exitant.directional_albedo(phong_values())[degrees, 0]
        assert gloss.shine(eye, coefficients) == pytest.approx(wanted, rel=0.025)
        whole = gloss.toward(eye, coefficients, np.ones_like(scene.albedo)) + scene.albedo
        assert whole == pytest.approx(0.2 + wanted, rel=0.025), "the matt part is in it once"


def test_one_light_is_mirrored_where_it_should_be(shiny_plane):
    _, gloss = shiny_plane
    d = np.array([0.5, 0.7, -0.3]) / np.linalg.norm([0.5, 0.7, -0.3])
    lights = np.tile(np.float32(d), (len(gloss.rows), 1, 1)), np.ones((len(gloss.rows), 1, 3), np.float32)
    coefficients = gloss.coefficients(lights=lights)
    mirrored = d * (-1, 1, -1)
    around = [mirrored, d, (0, 1, 0), (-0.7, 0.6, 0.2)]
    for way in around:
        toward = np.asarray(way) / np.linalg.norm(way)
        wanted = 0.5 * 12 / (2 * np.pi) * max(float(toward @ mirrored), 0) ** 10 * d[1]
        found = gloss.shine(tuple(toward * 1e4), coefficients)
        assert np.abs(found - wanted).max() < 0.04, "of a highlight of 0.75"
    far = [gloss.shine(tuple(1e4 * mirrored), coefficients).mean()]
    assert far[0] > 0.85 * 0.5 * 12 / (2 * np.pi) * d[1]


def test_by_the_brdf_itself_a_light_is_as_sharp_as_the_material(shiny_plane):
    """Closed form everywhere, where harmonics of order 8 are a few percent off."""
    _, gloss = shiny_plane
    d = np.array([0.6, 0.6, -0.2]) / np.linalg.norm([0.6, 0.6, -0.2])
    lights = np.tile(np.float32(d), (len(gloss.rows), 1, 1)), np.ones((len(gloss.rows), 1, 3), np.float32)
    mirrored = d * (-1, 1, -1)
    for way in (mirrored, d, (0, 1, 0), (-0.7, 0.3, 0.2), (-0.4, 0.5, 0.5)):
        toward = np.asarray(way) / np.linalg.norm(way)
        wanted = 0.5 * 12 / (2 * np.pi) * max(float(toward @ mirrored), 0) ** 10 * d[1]
        found = gloss.shine(tuple(toward * 1e5), lights=lights)
        assert np.abs(found - wanted).max() < 0.01 * 0.7


def test_a_pixel_on_a_vertex_is_the_vertex_and_between_them_it_is_itself(rng):
    """At corners as at vertices; in the middle of a coarse triangle by its own normal, as no vertex shows it."""
    scene = made_of(ball_on_floor(side=5, rings=9), GOLD)
    gloss = opened(scene, part_of(scene))
    sun = np.float32([0.6, 0.7, 0.4]) / np.linalg.norm([0.6, 0.7, 0.4]).astype(np.float32)
    lights = np.tile(sun, (len(gloss.rows), 1, 1)), np.ones((len(gloss.rows), 1, 3), np.float32)
    coefficients = gloss.coefficients(sky=rng.random((6, CELLS, CELLS, 3)).astype(np.float32) * even_sky())
    corners = np.searchsorted(gloss.rows, scene.triangles[:120]).astype(np.int64)
    one = np.tile(np.float32([0, 1, 0]), (len(corners), 1))
    for eye in ((3.0, 2.0, 1.0), (0.5, 4.0, -3.0)):
        toward = np.float32(eye) - scene.positions[gloss.rows[corners[:, 1]]]
        steep = (scene.normals[gloss.rows[corners[:, 1]]] * toward).sum(axis=1) > 0.2 * np.linalg.norm(
            toward, axis=1
        )
        found = gloss.shine_between(eye, corners, one, coefficients=coefficients, lights=lights)
        known = gloss.shine(eye, coefficients, lights=lights)[corners[:, 1]]
        np.testing.assert_allclose(found[steep], known[steep], rtol=2e-3, atol=2e-4)
    a, b, _ = corners[40]
    normal = gloss._frames[[a, b], 2].sum(axis=0)
    normal /= np.linalg.norm(normal)
    middle = scene.positions[gloss.rows[[a, b]]].mean(axis=0)
    eye = tuple((middle + 50 * (2 * (normal @ sun) * normal - sun)).tolist())  # it mirrors the sun
    half = np.float32([[0.5, 0.5, 0.0]])
    sharp = gloss.shine_between(eye, corners[40:41], half, coefficients=0 * coefficients, lights=lights)
    flat = gloss.shine(eye, lights=lights)[[a, b]].mean(axis=0)
    assert (sharp[0] > 1.02 * flat).all(), "brighter than what its vertices send there"


def test_harmonics_and_the_brdf_itself_agree_on_a_sky(shiny_plane):
    _, gloss = shiny_plane
    d = texel_directions(np.arange(6 * CELLS * CELLS), CELLS)
    light = np.float32(1 + d @ np.float32([0.5, 0.3, -0.6]))[:, None] * np.float32([1, 0.5, 2])
    sky = light.reshape(6, CELLS, CELLS, 3) * even_sky()
    for eye in ((3.0, 4.0, 1.0), (-5.0, 2.0, 2.0), (0.1, 6.0, 0.0)):
        exact = gloss.exact(eye, sky=sky)
        np.testing.assert_allclose(gloss.shine(eye, gloss.coefficients(sky=sky)), exact, rtol=0.03)


def test_light_from_below_the_horizon_and_no_light_give_nothing(shiny_plane):
    scene, gloss = shiny_plane
    below = np.tile(np.float32([0, -1, 0]), (len(gloss.rows), 1, 1))
    lights = below, np.ones_like(below)
    assert not gloss.coefficients(lights=lights).any()
    dark = gloss.coefficients(sky=0 * even_sky(), surfaces=np.zeros_like(scene.albedo))
    assert not dark.any()
    assert not gloss.toward((0, 3, 0), dark, np.zeros_like(scene.albedo)).any()


def test_light_adds_up(shiny_plane, rng):
    _, gloss = shiny_plane
    a, b = (rng.random((6, CELLS, CELLS, 3)).astype(np.float32) for _ in range(2))
    both = gloss.coefficients(sky=a + 2 * b)
    parts = gloss.coefficients(sky=a) + 2 * gloss.coefficients(sky=b)
    assert np.abs(both - parts).max() < 1e-4 * np.abs(both).max()


def test_a_closed_room_mirrors_its_own_light():
    """Everywhere irradiance/π 1 and reflectance r: every direction shows r, so r × directional albedo is mirrored."""
    scene = made_of(room(cells=4), GOLD)
    part = part_of(scene, order=6)
    gloss = opened(scene, part)
    assert (part.seen.codes >> 28 > 0).mean() < 1e-3, "no sky in a closed room, but between walls"
    coefficients = gloss.coefficients(sky=even_sky(), surfaces=np.ones_like(scene.albedo))
    floor = np.flatnonzero(
        (scene.normals[part.rows, 1] > 0.9) & (np.abs(scene.positions[part.rows, 0] - 2) < 0.1)
    )
    shine = gloss.shine((2.0, 1.5, 2.5), coefficients)[floor]
    lobes = lobes_of(scene, SurfaceScene(scene), part.rows[:1], 6)
    share = lobes.reflectance[0] - lobes.matt[0]
    assert (np.abs(shine / (share * part.lobes.reflectance[0]) - 1) < 0.12).all(), shine


def test_rows_see_sky_and_surfaces():
    scene = made_of(ball_on_floor(side=9, rings=8), GOLD)
    part = part_of(scene, order=2)
    ends = np.cumsum(part.seen.counts, dtype=np.int64)
    sky, surface = part.seen.codes >> 28, part.seen.codes >> 25 & 7
    assert ((sky + surface >= 1) & (sky + surface <= 4)).all()
    assert ((part.seen.codes & NONE)[surface > 0] < len(scene.positions)).all()
    floor = np.flatnonzero(part.rows >= len(scene.positions) - 81)
    top = part.rows[scene.positions[part.rows, 1].argmax()]
    k = int(np.searchsorted(part.rows, top))
    assert not surface[ends[k] - part.seen.counts[k] : ends[k]].any(), (
        "the top of the ball sees the sky alone"
    )
    own = np.concatenate([np.arange(ends[k] - part.seen.counts[k], ends[k]) for k in floor])
    assert surface[own].any(), "the floor sees the ball"
    d = texel_directions(part.seen.texels[own].astype(np.int32), CELLS)
    assert (d[:, 1] > -0.1).all(), "and nothing below itself"


def test_frames_are_frames(rng):
    n = rng.normal(size=(500, 3)).astype(np.float32)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n[:2] = [(0, 0, -1), (0, 0, 1)]
    F = frames(n)
    assert np.abs(np.einsum("rij,rkj->rik", F, F) - np.eye(3)).max() < 1e-5
    assert np.abs(np.linalg.det(F.astype(np.float64)) - 1).max() < 1e-5
    assert (F[:, 2] == n).all()


@pytest.mark.parametrize("R", [5, 16, 24, 64])
def test_cells_have_all_light_of_the_map(R, rng):
    cube = rng.random((6, R, R, 3)).astype(np.float32)
    light = on_cells(cube)
    whole = np.einsum("frcx,rc->fx", cube.astype(np.float64), solid_angles(R).astype(np.float64))
    assert np.abs(light.sum(axis=(1, 2)) - whole).max() < 1e-5 * whole.max()
    flat = on_cells(np.ones((6, R, R, 3), np.float32))
    assert np.abs(flat - even_sky()).max() < (1e-6 if R % CELLS == 0 else 2e-3)


@pytest.mark.parametrize("order", [0, 17, True, 2.0, "8"])
def test_orders_out_of_range_are_refused(order):
    scene = made_of(plane(3), GOLD)
    with pytest.raises(InputError, match="glossy-order"):
        ExitantPart.of(scene, Occluders(scene.positions, scene.triangles), order=order)


def test_shapes_that_do_not_fit_are_refused(shiny_plane):
    _, gloss = shiny_plane
    with pytest.raises(InputError, match="sky"):
        gloss.coefficients(sky=np.zeros((6, 8, 8, 3), np.float32))
    with pytest.raises(InputError, match="surfaces"):
        gloss.coefficients(surfaces=np.zeros((3, 3), np.float32))
    with pytest.raises(InputError, match="lights"):
        gloss.coefficients(lights=(np.zeros((2, 1, 3), np.float32), np.zeros((2, 1, 3), np.float32)))


def test_a_part_is_the_same_bytes_again():
    scene = made_of(ball_on_floor(side=7, rings=6), GOLD)
    a, b = part_of(scene, order=4), part_of(scene, order=4)
    for name in ("counts", "texels", "codes"):
        assert (getattr(a.seen, name) == getattr(b.seen, name)).all()
    for name in ("tables", "highlights", "matt", "strength", "reflectance"):
        assert (getattr(a.lobes, name) == getattr(b.lobes, name)).all()


def test_light_bounces_with_all_that_a_surface_reflects():
    """Lacquer sends on its base colour and what its coat reflects; Phong's closed form is known."""
    scene = made_of(plane(4), LACQUER)
    part = part_of(scene)
    sent = part.bouncing(scene).albedo
    assert (sent > scene.albedo + 0.02).all()
    assert (sent < scene.albedo + 0.2).all()
    phong = made_of(plane(4), PHONG)
    wanted = 0.2 + 0.5 * exitant.mean_albedo(phong_values())[0]
    np.testing.assert_allclose(part_of(phong).bouncing(phong).albedo, wanted, rtol=5e-3)


# ---- what these tests would not let pass -----------------------------------------------------------------


def spoilt(scene: Scene, part: ExitantPart, fault: str) -> Exitant:
    """The same vertices with something wrong with them."""
    lobes, at = part.lobes, exitant.starts(8)
    tables = lobes.tables.copy()
    if fault == "mirrors back to the light":
        for m in range(1, 9, 2):
            tables[..., at[m] : at[m + 1]] *= -1
    wrong = {
        "mirrors back to the light": {"tables": tables},
        "the matt part twice": {"matt": lobes.matt * 2},
        "lobes 3 % too bright": {"strength": lobes.strength * np.float32(1.03)},
        "highlights of another angle": {"highlights": np.roll(lobes.highlights, 1, axis=1).copy()},
    }[fault]
    return opened(scene, dataclasses.replace(part, lobes=dataclasses.replace(lobes, **wrong)))


@pytest.mark.parametrize(
    ("fault", "test"),
    [
        ("mirrors back to the light", test_one_light_is_mirrored_where_it_should_be),
        ("the matt part twice", test_an_even_sky_gives_the_directional_albedo),
        ("lobes 3 % too bright", test_an_even_sky_gives_the_directional_albedo),
        ("highlights of another angle", test_by_the_brdf_itself_a_light_is_as_sharp_as_the_material),
    ],
)
def test_seeded_faults_are_found(fault, test):
    scene = made_of(plane(4), PHONG)
    with pytest.raises(AssertionError):
        test((scene, spoilt(scene, part_of(scene), fault)))
