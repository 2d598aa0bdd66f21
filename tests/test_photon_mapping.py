"""Photon maps: energy, closed forms, refraction; the same whatever the batches; nothing lost and nothing twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.bases import spherical_harmonics
from prelight.errors import InputError
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.lamps import LuminousTriangles, SphereLamps, lamp_light, triangle_light
from prelight.transport.photon_density import LitSurface, PhotonDensity
from prelight.transport.photon_mapping import CAUSTICS, PhotonMap, final_gathered
from prelight.transport.photon_sources import SkySource, SphereSource, SunSource, TriangleSource
from prelight.transport.photon_tracing import BATCH, BOUNCED, CAUSTIC, DIRECT, Photons
from prelight.transport.specular import without_specular
from prelight.transport.vantage import vantage_points

from .glass import GLASS, GREEN_GLASS, ball_above_floor, ball_in_room, floor, slab_above_floor
from .rooms import SIZE, room

LAMP = SphereLamps(np.float32([[2.9, 2.2, 1.4]]), np.float32([0.0]), np.float32([[10, 20, 30]]))
PORTAL = np.float32([[[0, 1, 1], [0, 1, 3], [0, 2, 3]], [[0, 1, 1], [0, 2, 3], [0, 2, 1]]])[:, ::-1].copy()


def mapped(scene, source, photons=4 * BATCH, **options) -> PhotonMap:
    found = PhotonMap(scene, Occluders(scene.positions, scene.triangles), source, **options)
    found.more(photons)
    return found


def areas(scene) -> np.ndarray:
    a, b, c = (scene.positions[scene.triangles[:, k]].astype(np.float64) for k in range(3))
    out = np.zeros(len(scene.positions))
    for k in range(3):
        np.add.at(out, scene.triangles[:, k], np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6)
    return out


# ---- closed forms ---------------------------------------------------------------------------------------


def test_all_light_of_a_lamp_in_a_closed_room_lands_once() -> None:
    scene = room(6)
    photons = mapped(scene, SphereSource(LAMP), BATCH, ways=DIRECT).photons
    power = photons.power.sum(axis=0, dtype=np.float64) / photons.emitted
    np.testing.assert_allclose(power, LAMP.power[0], rtol=1e-4)
    assert (photons.way == DIRECT).all()


@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_a_lamp_above_a_floor(radius) -> None:
    """E = Φ cos θ / (4π d²), of a point and of a sphere wholly above the horizon alike."""
    scene = floor(size=4.0, cells=40)
    lamp = SphereLamps(np.float32([[0, 1, 0]]), np.float32([radius]), np.float32([[1, 2, 3]]))
    found = mapped(scene, SphereSource(lamp), ways=DIRECT).light(nearest=1500)
    near = np.linalg.norm(scene.positions, axis=1) < 1.2
    d2 = (scene.positions[near].astype(np.float64) ** 2).sum(axis=1) + 1
    expected = (d2**-1.5 / (4 * np.pi**2))[:, None] * [1, 2, 3]
    ratio = found.light[near, 0] / expected
    assert abs(ratio.mean() - 1) < 0.004
    assert ratio.std() < 0.04  # the kernel's own width and what noise evenly spread photons leave
    assert (found.noise[near, 0] < 0.1 * expected).all()


def test_a_panel_sends_light_with_the_cosine_and_forgetting_it_is_seen(monkeypatch) -> None:
    scene = room(10)
    radiance, light_of = np.float32([[1, 2, 4]] * 2), np.int32([0, 0])
    occluders = Occluders(scene.positions, scene.triangles)
    expected = triangle_light(
        occluders, vantage_points(scene, occluders), scene.normals,
        lights=LuminousTriangles(PORTAL, radiance, light_of, 1), rays=1024,
    )  # fmt: skip
    source = TriangleSource(PORTAL, radiance, light_of)
    lit = expected[:, 0, 0] > 0.05 * expected[:, 0, 0].max()

    def differs() -> float:
        light = mapped(scene, source, ways=DIRECT).light().light
        return float(np.abs(light[lit] / expected[lit] - 1).mean())

    assert differs() < 0.04
    mi = occluders.mi
    monkeypatch.setattr(mi.warp, "square_to_cosine_hemisphere", mi.warp.square_to_uniform_hemisphere)
    assert differs() > 0.2


def test_a_furnace_is_even_to_its_corners() -> None:
    """Walls that shine with 1 and reflect half of what falls on them: irradiance / π is 2 everywhere."""
    scene = room(8, albedo=0.5)
    corners = scene.positions[scene.triangles]
    source = TriangleSource(corners, np.ones((len(corners), 3), np.float32), np.zeros(len(corners), np.int32))
    found = mapped(scene, source, 3 * BATCH)
    light = found.light(nearest=2000).light[:, 0, 0]
    assert light.mean() == pytest.approx(2, rel=0.004)
    on_edges = ((scene.positions == 0) | (scene.positions == SIZE)).sum(axis=1) >= 2
    assert light[on_edges].mean() == pytest.approx(2, rel=0.015)
    assert light[~on_edges].mean() == pytest.approx(2, rel=0.01)
    parts = [found.light(ways=way, nearest=2000).light.mean() for way in (DIRECT, BOUNCED)]
    np.testing.assert_allclose(parts, [1, 1], rtol=0.01)


def test_the_sun_through_a_slab_is_refracted_twice_and_dimmed() -> None:
    """Snell's law moves its light sideways; of what falls on both faces straight 2n / (n² + 1) passes."""
    thickness, n = 0.2, 1.5
    scene = slab_above_floor(thickness=thickness)
    straight = mapped(
        scene, SunSource(np.float32([[0, 1, 0]]), np.float32([[3, 3, 3]]), radius_deg=0.01), ways=CAUSTIC
    ).light(nearest=1000)
    middle = np.abs(scene.positions[:, [0, 2]]).max(axis=1) + 9 * (scene.positions[:, 1] > 0.1) < 0.25
    expected = 3 / np.pi * 2 * n / (n * n + 1)
    assert straight.light[middle, 0, 0].mean() == pytest.approx(expected, rel=0.005)

    s = np.float32(np.sqrt(0.5))
    found = mapped(
        scene, SunSource(np.float32([[s, s, 0]]), np.float32([[1, 1, 1]]), radius_deg=0.001), ways=CAUSTIC
    )
    photons = found.photons
    d = photons.direction.astype(np.float64)
    top = photons.origin + ((0.5 + thickness - photons.origin[:, 1]) / d[:, 1])[:, None] * d
    inner = np.abs(top[:, [0, 2]]).max(axis=1) < 0.2
    inside = np.arcsin(s / n)
    moved = -(thickness * np.tan(inside) + 0.5)  # along x, falling toward −x at 45° outside
    landed = photons.position[inner, 0] - top[inner, 0]
    assert abs(np.median(landed) - moved) < 1e-3
    assert (np.abs(landed - moved) < 2e-3).mean() > 0.85  # the others were reflected within


def test_coloured_glass_colours_its_caustic() -> None:
    sun = SunSource(np.float32([[0, 1, 0]]), np.float32([[1, 1, 1]]))
    grey, green = (
        mapped(ball_above_floor(material=m, cells=20, rings=24), sun, BATCH, ways=CAUSTIC)
        for m in (GLASS, GREEN_GLASS)
    )
    ratio = green.light().light.sum(axis=(0, 1)) / grey.light().light.sum(axis=(0, 1))
    assert ratio[0] < 0.2
    assert 0.65 < ratio[1] < 0.9
    assert ratio[2] < 0.25


# ---- one map for every function, and more of it -----------------------------------------------------------


def harmonics(order: int):
    return lambda photons: spherical_harmonics.evaluate(order, -photons.direction).astype(np.float32)


def test_more_photons_go_on_and_batches_do_not_know_each_other() -> None:
    scene = ball_in_room(cells=5)
    source = TriangleSource(PORTAL, np.ones((2, 3), np.float32), np.zeros(2, np.int32), beyond=False)
    at_once, in_steps = (
        PhotonMap(scene, Occluders(scene.positions, scene.triangles), source) for _ in range(2)
    )
    at_once.more(3 * BATCH)
    in_steps.more(BATCH)
    in_steps.light(harmonics(1))
    in_steps.more(BATCH + 1)
    for name in ("position", "power", "direction", "origin", "triangle", "light", "way"):
        assert (getattr(at_once.photons, name) == getattr(in_steps.photons, name)).all(), name
    assert at_once.photons.emitted == in_steps.photons.emitted == 3 * BATCH
    elsewhere = PhotonMap(scene, Occluders(scene.positions, scene.triangles), source)
    elsewhere.add(elsewhere.batch(0))
    late = elsewhere.batch(2)
    elsewhere.add(elsewhere.batch(1))
    elsewhere.add(late)
    assert (elsewhere.photons.power == at_once.photons.power).all()
    other = PhotonMap(scene, Occluders(scene.positions, scene.triangles), source, seed=1)
    other.more(BATCH)
    assert not np.array_equal(other.photons.position[:100], at_once.photons.position[:100])


def test_one_more_order_is_the_same_as_both_at_once() -> None:
    scene = room(5)
    source = TriangleSource(PORTAL, np.ones((2, 3), np.float32), np.zeros(2, np.int32))
    found = mapped(scene, source, BATCH)
    first, more = found.light(harmonics(2)), found.light(harmonics(3))
    assert (more.light[:, :9] == first.light).all()
    assert (more.noise[:, :9] == first.noise).all()


def test_an_environment_weighs_the_photons_of_the_sky() -> None:
    """The sun by the sky's photons, those within a cone, is the sun by its own."""
    scene, radius = floor(cells=10), 12.0
    toward = np.float32([0.36, 0.8, 0.48])
    solid_angle = 2 * np.pi * (1 - np.cos(np.radians(radius)))

    def cone(photons: Photons) -> np.ndarray:
        return ((-photons.direction @ toward > np.cos(np.radians(radius))) / solid_angle)[:, None].astype(
            np.float32
        )

    sky = mapped(scene, SkySource(), 12 * BATCH, ways=DIRECT).light(cone, nearest=400)
    expected = 0.8 / np.pi  # ∫ L dω = 1
    assert sky.light[..., 0].mean() == pytest.approx(expected, rel=0.03)


# ---- together with the operator -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def glass_room():
    """All light by photons, and by direct light, caustics and the operator."""
    scene = ball_in_room(cells=10, albedo=0.6)
    occluders = Occluders(scene.positions, scene.triangles)
    lamp = SphereLamps(np.float32([[2.0, 2.6, 2.5]]), np.float32([0.15]), np.float32([[10, 10, 10]]))
    source = SphereSource(lamp)
    everything = PhotonMap(scene, occluders, source)
    everything.more(5 * BATCH)
    aimed = PhotonMap(scene, occluders, source, ways=CAUSTIC)
    aimed.more(2 * BATCH)
    stand = vantage_points(scene, occluders)
    D = lamp_light(occluders, stand, scene.normals, lamps=lamp, rays=256)
    gathering = Gathering.trace(without_specular(scene), occluders, origins=stand, rays=256)
    return scene, everything, aimed, D, gathering


def test_caustics_and_the_operator_have_all_light_and_none_of_it_twice(glass_room) -> None:
    scene, everything, aimed, D, gathering = glass_room
    C = aimed.light(nearest=1000).light + everything.light(ways=CAUSTICS & ~CAUSTIC, nearest=500).light
    E = D + C
    ours = E + bounced(gathering, np.ascontiguousarray(E)).indirect
    theirs = everything.light(nearest=1000).light
    diffuse = np.arange(len(scene.positions)) < len(scene.positions) - 50
    diffuse[np.unique(scene.triangles[scene.material_of == 1])] = False
    weight = areas(scene) * diffuse

    def mean(light) -> float:
        return float((light[:, 0, 0] * weight).sum() / weight.sum())

    assert mean(ours) == pytest.approx(mean(theirs), rel=0.01)
    assert mean(C) > 0.015 * mean(ours)  # so that it would be seen
    twice = Gathering.trace(scene, Occluders(scene.positions, scene.triangles), rays=100)
    wrong = E + bounced(twice, np.ascontiguousarray(E)).indirect
    assert mean(wrong) > 1.015 * mean(theirs)


def test_the_two_ways_to_a_caustic_agree(glass_room) -> None:
    _, everything, aimed, *_ = glass_room
    a, b = (m.photons.of(CAUSTIC) for m in (everything, aimed))
    assert len(a) < len(b) / 6  # with more than twice as many photons
    power = [p.power.sum(dtype=np.float64) / p.emitted for p in (a, b)]
    assert power[0] == pytest.approx(power[1], rel=0.02)


def test_a_final_gather_of_photons_is_a_bounce_without_their_noise(glass_room) -> None:
    _, everything, _, D, gathering = glass_room
    found = everything.light(nearest=200)
    once = final_gathered(gathering, found.light)
    solved = bounced(gathering, np.ascontiguousarray(D)).indirect
    walls = np.flatnonzero(D[:, 0, 0] > 0)
    assert once[walls].mean() == pytest.approx(solved[walls].mean(), rel=0.1)  # with the caustic's share
    rough, smooth = found.light[walls, 0, 0], once[walls, 0, 0]
    assert np.abs(np.diff(smooth)).mean() < np.abs(np.diff(rough)).mean()


# ---- the kernel ---------------------------------------------------------------------------------------------


def test_the_kernel_covers_half_a_disc_at_an_edge_and_a_quarter_in_a_corner() -> None:
    scene = room(8)
    far = Photons(*(np.zeros((1, 3), np.float32),) * 4, np.zeros(1, np.int32), np.zeros(1, np.int32),
                  np.full(1, 1, np.uint8), 1)  # fmt: skip
    density = PhotonDensity(LitSurface(scene), far, nearest=1, finest=2.5, widest=2.5)
    on = ((scene.positions == 0) | (scene.positions == SIZE)).sum(axis=1)
    disc = np.pi * density.radii.astype(np.float64) ** 2 / 2
    inner = on == 1
    share = density.areas / disc
    deep = inner & (_to_edge(scene) > density.radii)
    np.testing.assert_allclose(share[deep], 1, rtol=0.01)
    edges = (on == 2) & (_along_edge(scene) > density.radii)
    np.testing.assert_allclose(share[edges], 0.5, rtol=0.01)
    np.testing.assert_allclose(share[on == 3], 0.25, rtol=0.01)


def _to_edge(scene) -> np.ndarray:
    away = np.minimum(scene.positions, np.float32(SIZE) - scene.positions)
    return np.sort(away, axis=1)[:, 1]


def _along_edge(scene) -> np.ndarray:
    away = np.minimum(scene.positions, np.float32(SIZE) - scene.positions)
    return np.sort(away, axis=1)[:, 2]


# ---- what cannot be ------------------------------------------------------------------------------------------


def refusal(scene, source, **options) -> str:
    with pytest.raises(InputError) as caught:
        mapped(scene, source, BATCH, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("power", [0.0, -1.0, float("nan"), float("inf")])
def test_a_lamp_without_power_is_refused(power) -> None:
    lamp = SphereLamps(np.float32([[2, 1, 2]]), np.float32([0.1]), np.float32([[power] * 3]))
    assert "power" in refusal(room(3), SphereSource(lamp))


def test_a_lamp_inside_a_solid_is_refused_but_in_glass_it_shines() -> None:
    inside = SphereSource(
        SphereLamps(np.float32([[2, 0.7, 2.5]]), np.float32([0.05]), np.float32([[1, 1, 1]]))
    )
    stone = replace(ball_in_room(cells=4), materials=(Material("wall"), Material("stone")))
    assert "light 0: 100% of its light ends on the backs" in refusal(stone, inside)
    photons = mapped(ball_in_room(cells=4), inside, BATCH, ways=CAUSTIC).photons
    power = photons.power.sum(axis=0, dtype=np.float64) / photons.emitted
    np.testing.assert_allclose(
        power, 1, rtol=0.01
    )  # all of it comes out: flux, not radiance, passes from glass to air


def test_a_material_that_nothing_carries_and_wrong_numbers_are_refused() -> None:
    hair = replace(
        ball_in_room(cells=3), materials=(Material("wall"), Material("fur", bsdf={"type": "hair"}))
    )
    assert "material fur" in refusal(hair, SphereSource(LAMP))
    found = PhotonMap(room(3), Occluders(room(3).positions, room(3).triangles), SphereSource(LAMP))
    with pytest.raises(InputError, match="expected 1 to"):
        found.more(0)
    with pytest.raises(InputError, match="none are traced"):
        found.light()
    found.more(1)
    with pytest.raises(InputError, match="nearest"):
        found.light(nearest=0)


def test_where_nothing_is_clear_there_are_no_caustics_and_nothing_is_traced() -> None:
    found = mapped(room(3), SphereSource(LAMP), ways=CAUSTICS)
    assert found.emitted == 0
    assert not found.light().light.any()
