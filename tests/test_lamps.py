"""Direct light of lamps and luminous triangles: closed forms, and the same whatever the tiles."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.transport import lamps as lamps_module
from prelight.transport.cube_emitter import cube_emitter
from prelight.transport.lamps import LuminousTriangles, SphereLamps, lamp_light, triangle_light

from .scenes import grid, scene_of

FAR = scene_of(grid(2, size=0.1, height=-50.0), name="far away")  # shadows nothing; its size sets the offset


@pytest.fixture(scope="module")
def nothing() -> Occluders:
    return Occluders(FAR.positions, FAR.triangles)


def lamps(*of: tuple[tuple[float, float, float], float], power=(1.0, 2.0, 3.0)) -> SphereLamps:
    centres, radii = zip(*of, strict=True)
    return SphereLamps(np.float32(centres), np.float32(radii), np.float32([power] * len(of)))


UP = np.float32([[0, 1, 0]])


def test_a_sphere_above_a_plane_is_as_a_point_at_its_centre(nothing) -> None:
    """E = Φ cos θ / (4π d²) for a sphere wholly above the horizon, whatever its radius."""
    at = np.float32([[0, 0, 0], [0.7, 0, 0.2], [-3, 0, 1]])
    of = lamps(((0, 1, 0), 0.0), ((0, 1, 0), 0.05), ((0, 1, 0), 0.9))
    E = np.pi * lamp_light(nothing, at, np.repeat(UP, 3, axis=0), lamps=of, rays=1024)
    d2 = (at**2).sum(axis=1) + 1
    expected = (1 / np.sqrt(d2) / (4 * np.pi * d2))[:, None] * np.float32([1, 2, 3])
    np.testing.assert_allclose(E[:, 0], expected, rtol=2e-4)
    np.testing.assert_allclose(E[:, 1], expected, rtol=2e-4)
    np.testing.assert_allclose(E[:, 2], expected, rtol=5e-3)


def test_a_sphere_half_below_the_horizon_gives_what_is_above(nothing) -> None:
    """Centre on the horizon: the upper half of its cone, whose form factor is known (Naraghi and Chung 1982)."""
    h = np.float32(2.0)  # distance over radius
    E = np.pi * lamp_light(
        nothing, np.zeros((1, 3), np.float32), UP, lamps=lamps(((1, 0, 0), 0.5)), rays=16384
    )
    exact = (np.arctan(1 / np.sqrt(h * h - 1)) - np.sqrt(h * h - 1) / (h * h)) / np.pi
    radiance = 1 / (4 * np.pi**2 * 0.5**2)
    assert E[0, 0, 0] == pytest.approx(np.pi * radiance * exact, rel=5e-3)


def test_inside_a_lamp_it_is_dark_and_behind_a_roof_too(nothing) -> None:
    at = np.float32([[0, 1.1, 0], [0, 0, 0]])
    E = lamp_light(nothing, at, np.repeat(UP, 2, axis=0), lamps=lamps(((0, 1, 0), 0.5)))
    assert (E[0] == 0).all()
    assert (E[1] > 0).all()
    roof = scene_of(grid(3, size=1.0, height=0.5))
    shadowed = lamp_light(
        Occluders(roof.positions, roof.triangles), at[1:], UP, lamps=lamps(((0, 1, 0), 0.3))
    )
    assert (shadowed == 0).all()
    beyond = lamp_light(
        Occluders(roof.positions, roof.triangles), at[1:], UP, lamps=lamps(((0, 0.3, 0), 0.1))
    )
    assert (beyond > 0).all()  # the roof is farther than the lamp


def half_shadow() -> tuple[Occluders, np.ndarray, np.ndarray]:
    wall = np.float32([[0, 0.2, -1], [0, 0.2, 1], [1, 0.2, 1], [1, 0.2, -1]])  # over all x > 0
    occluders = Occluders(wall, np.int32([[0, 1, 2], [0, 2, 3]]))
    return occluders, np.zeros((1, 3), np.float32), UP


def test_half_of_a_sphere_behind_an_edge_is_half_the_light() -> None:
    E = lamp_light(*half_shadow(), lamps=lamps(((0, 1, 0), 0.3)), rays=4096)
    assert np.pi * E[0, 0, 0] == pytest.approx(0.5 / (4 * np.pi), rel=4e-3)


def square(height: float, half: float = 0.5) -> np.ndarray:
    """Two triangles that look down."""
    a, b, c, d = ((x * half, height, z * half) for x, z in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.float32([[a, b, c], [a, c, d]])


def disc(height: float, radius: float, sides: int = 128) -> np.ndarray:
    angle = 2 * np.pi * np.arange(sides + 1) / sides
    rim = np.stack([radius * np.cos(angle), np.full(sides + 1, height), radius * np.sin(angle)], axis=1)
    middle = np.broadcast_to([0.0, height, 0.0], (sides, 3))
    return np.stack([middle, rim[:-1], rim[1:]], axis=1).astype(np.float32)


def test_a_rectangle_over_a_plane_is_its_form_factor(nothing) -> None:
    """From above a corner: F = (X/√(1+X²) atan(Y/√(1+X²)) + Y/√(1+Y²) atan(X/√(1+Y²))) / 2π, in units of height."""
    shining = LuminousTriangles(
        square(1.0), np.float32([[1, 2, 4]] * 2), np.zeros(2, np.int32), 1
    )  # corners over ±0.5
    at = np.float32([[0, 0, 0], [0.5, 0, 0.5]])
    E = triangle_light(nothing, at, np.repeat(UP, 2, axis=0), lights=shining, rays=4096)

    def corner(X: float, Y: float) -> float:
        p, q = np.sqrt(1 + X * X), np.sqrt(1 + Y * Y)
        return (X / p * np.arctan(Y / p) + Y / q * np.arctan(X / q)) / (2 * np.pi)

    np.testing.assert_allclose(E[0, 0], 4 * corner(0.5, 0.5) * np.float32([1, 2, 4]), rtol=1e-3)
    np.testing.assert_allclose(E[1, 0], corner(1.0, 1.0) * np.float32([1, 2, 4]), rtol=3e-3)


def test_discs_over_a_plane_are_lights_of_their_own(nothing) -> None:
    """On the axis F = r² / (r² + h²); each group of triangles is one light, an empty one is dark."""
    parts = [disc(1.0, 1.0), disc(0.5, 0.1), disc(2.0, 3.0)[:, ::-1]]
    shining = LuminousTriangles(
        np.concatenate(parts), np.ones((384, 3), np.float32), np.repeat([3, 0, 2], 128).astype(np.int32), 4
    )
    E = triangle_light(nothing, np.zeros((1, 3), np.float32), UP, lights=shining, rays=4096)
    assert E.shape == (1, 4, 3)
    assert E[0, 3, 0] == pytest.approx(0.5, rel=2e-3)
    assert E[0, 0, 0] == pytest.approx(0.01 / 0.26, rel=2e-3)
    assert (E[0, [1, 2]] == 0).all()  # none there; seen from behind


def test_bright_and_dark_triangles_of_one_light_share_its_rays_without_bias(nothing) -> None:
    both = np.concatenate([square(1.0), square(1.0) + np.float32([2.0, 0, 0])])
    colours = np.float32([[9, 0, 0]] * 2 + [[0, 1, 0]] * 2)
    together = LuminousTriangles(both, colours, np.zeros(4, np.int32), 1)
    apart = LuminousTriangles(both, colours, np.int32([0, 0, 1, 1]), 2)
    at, up = np.float32([[0.9, 0, 0.1]]), UP
    a = triangle_light(nothing, at, up, lights=together, rays=8192).sum(axis=1)
    b = triangle_light(nothing, at, up, lights=apart, rays=8192).sum(axis=1)
    np.testing.assert_allclose(a, b, rtol=5e-3)


def test_a_finely_divided_light_in_any_order_is_that_light(nothing) -> None:
    """Triangles in an order with a period, as subdivision leaves them: rays fall on all of them alike."""
    side = np.linspace(-1, 1, 33)
    parts = []
    for x0, x1 in pairwise(side):
        for z0, z1 in pairwise(side):
            a, b, c, d = (x0, 1, z0), (x1, 1, z0), (x1, 1, z1), (x0, 1, z1)
            parts += [(a, b, c), (a, c, d)]
    corners = np.float32(parts)
    quarter = np.argsort((corners[:, 0, 0] < 0) * 2 + (corners[:, 0, 2] < 0), kind="stable").reshape(4, -1)
    corners = corners[quarter.T.ravel()]  # every fourth triangle is in the same quarter
    shining = LuminousTriangles(corners, np.ones((2048, 3), np.float32), np.zeros(2048, np.int32), 1)
    at = np.float32([[0.8, 0, 0.8]])
    whole = LuminousTriangles(square(1.0, 1.0), np.ones((2, 3), np.float32), np.zeros(2, np.int32), 1)
    E = triangle_light(nothing, at, UP, lights=shining, rays=512)
    expected = triangle_light(nothing, at, UP, lights=whole, rays=16384)
    assert E[0, 0, 0] == pytest.approx(expected[0, 0, 0], rel=0.05)  # in order of memory: a quarter of it


def test_a_scene_s_luminous_materials_are_found() -> None:
    scene = scene_of(grid(3, height=1.0), grid(3))
    lit = replace(
        scene,
        materials=(Material(), Material(emission=(1, 2, 3)), Material(emission=(4, 5, 6))),
        material_of=np.int32([0, 2, 2, 1] * 4),
    )
    whole, each = LuminousTriangles.of_scene(lit), LuminousTriangles.of_scene(lit, each=True)
    assert (len(whole), len(each)) == (1, 2)
    assert whole.corners.shape == (12, 3, 3)
    assert (each.radiance[each.light_of == 0] == (1, 2, 3)).all()
    assert (each.radiance[each.light_of == 1] == (4, 5, 6)).all()
    dark = LuminousTriangles.of_scene(scene)
    occluders = Occluders(scene.positions, scene.triangles)
    assert not triangle_light(occluders, scene.positions, scene.normals, lights=dark).any()


def test_tiles_change_nothing_and_seeds_do(nothing, monkeypatch) -> None:
    at = np.random.default_rng(3).random((50, 3)).astype(np.float32)
    up = np.repeat(UP, 50, axis=0)
    of = lamps(((0, 1.5, 0), 0.2), ((1, 2, 0), 0.5))
    once = lamp_light(nothing, at, up, lamps=of, rays=16)
    monkeypatch.setattr(lamps_module, "_LANES", 16 * 7)
    np.testing.assert_array_equal(once, lamp_light(nothing, at, up, lamps=of, rays=16))
    assert (once != lamp_light(nothing, at, up, lamps=of, rays=16, seed=1)).any()


def test_errors_fall_with_the_number_of_rays() -> None:
    """Half a shadow: evenly spread rays do better than 1/√n, and no pair shares its numbers with another."""
    occluders, at, up = half_shadow()
    many = (
        np.repeat(at, 400, axis=0)
        + np.float32([0, 1e-3, 0]) * np.arange(400, dtype=np.float32)[:, None] / 400
    )
    of = lamps(((0.05, 1, 0), 0.3))
    deviations = []
    for rays in (16, 256):
        E = lamp_light(occluders, many, np.repeat(up, 400, axis=0), lamps=of, rays=rays)[:, 0, 0]
        deviations.append(E.std() / E.mean())
    assert deviations[0] > 1e-3
    assert deviations[1] < deviations[0] / 6  # random rays: a quarter


def test_what_cannot_be_is_refused(nothing) -> None:
    with pytest.raises(InputError, match="radii"):
        lamps(((0, 0, 0), -1.0))
    with pytest.raises(InputError, match="power"):
        SphereLamps(np.zeros((2, 3), np.float32), np.zeros(2, np.float32), np.zeros((1, 3), np.float32))
    with pytest.raises(InputError, match="rays"):
        lamp_light(nothing, UP, UP, lamps=lamps(((0, 9, 0), 0.1)), rays=0)


def test_a_sky_in_an_opening_is_that_sky(nothing) -> None:
    """Through a pane: the form factor of the pane where the sky is even, and only that half which shines."""
    pane = LuminousTriangles(square(1.0), np.float32([[1, 1, 1]] * 2), np.zeros(2, np.int32), 1)
    at = np.zeros((1, 3), np.float32)
    even = np.full((6, 4, 4, 3), 2.0, np.float32)
    found = triangle_light(nothing, at, UP, lights=pane, rays=1024, beyond=cube_emitter(nothing.mi, even))
    same = triangle_light(nothing, at, UP, lights=pane, rays=1024)
    np.testing.assert_allclose(found, 2 * same, rtol=1e-5)
    half = even.copy()
    half[2, :, :2] = 0  # of +Y: toward −Z
    seen = triangle_light(nothing, at, UP, lights=pane, rays=4096, beyond=cube_emitter(nothing.mi, half))
    np.testing.assert_allclose(seen, found / 2, rtol=5e-3)
    lid = Occluders(square(3.0, 5.0).reshape(-1, 3), np.int32([[0, 1, 2], [3, 4, 5]]))
    assert (triangle_light(lid, at, UP, lights=pane, beyond=cube_emitter(lid.mi, even)) == 0).all()
