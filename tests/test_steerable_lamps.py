"""Boxes of light, skies and panels of exponentials: against closed forms, the path tracer, and each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from prelight.bases import spherical_harmonics as sh
from prelight.bases.exponentials import ExponentialAxis, ExponentialBasis
from prelight.bases.panels import PanelBasis
from prelight.bases.steering import SpotBasis
from prelight.camera import Camera
from prelight.checking.comparison import compare
from prelight.lighting.panel import Panel, axis_shape
from prelight.lighting.places import Place
from prelight.material import Material
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.scene.stock.parts import rectangle, scene_of
from prelight.transport.basis_images import BasisTracer, ImageSettings
from prelight.transport.steered_lamps import SteeredBox, SteeredPanel, SteeredSky
from prelight.transport.steered_reference import path_traced_picture

from .steered import EYE, room

GREY, MIRROR = (
    Material("grey", (0.6, 0.6, 0.6)),
    Material("m", bsdf={"type": "conductor", "material": "none"}),
)
BOX = SteeredBox((-0.3, 0.4, -0.2), (0.6, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.5), (1, 1, 1))
DOWN = Camera((0.0, 2.0, 0.001), (0.0, 0.0, 0.0), vertical_fov_deg=0.2)
ASIDE = Camera((0.0, 2.0, 0.6), (0.0, 0.0, 0.0), vertical_fov_deg=0.2)


def floor(material: Material) -> Scene:
    """A sheet on the ground, seen from above."""
    x, z = np.array([4.0, 0, 0]), np.array([0, 0, -4.0])
    sheet = rectangle(np.array([-2.0, 0, 2.0]), x, z, cells=(1, 1))
    return scene_of("floor", [(sheet, material)], cameras={"down": DOWN})


def one_pixel(
    scene: Scene, lamp: Any, camera: Camera, samples: int, depth: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Value and standard error of every function at one pixel."""
    tracer = BasisTracer(scene, lamp, camera, settings=ImageSettings(1, 1, samples, 0, depth))
    rows = tracer.pixels(0, 1)
    return rows.images[0, 0].astype(np.float64), np.sqrt(rows.variance[0], dtype=np.float64)


def in_box(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (n, 3) of small cells of the box, and their middles."""
    at = (np.arange(side) + 0.5) / side
    cells = np.stack(np.meshgrid(at, at, at, indexing="ij"), -1).reshape(-1, 3)
    return cells, np.array(BOX.corner) + cells @ BOX.sides


@pytest.mark.parametrize("near", [False, True])
def test_a_box_of_light_over_a_floor(near: bool) -> None:
    """ρ/π·∫ ε·cos θ/r² dV; ``near``, a box that stands on the floor and is met by chance more than by aim."""
    lamp = BOX
    if near:
        lamp = SteeredBox((-0.3, 0.02, -0.2), BOX.side_u, BOX.side_v, BOX.side_w, BOX.periods)
    cells, p = in_box(40)
    p = p + np.array(lamp.corner) - np.array(BOX.corner)
    r2 = (p**2).sum(axis=1)
    brought = p[:, 1] / r2**1.5 * (lamp.volume / len(cells)) * 0.6 / np.pi
    expected = brought @ PanelBasis((1, 1, 1)).evaluate(cells)
    found, noise = one_pixel(floor(GREY), lamp, DOWN, 60_000)
    assert expected[0] > 0.01
    assert np.abs(found - expected).max() < 4.5 * noise.max() + 0.002 * expected[0]
    assert noise[0] < 0.01 * expected[0]


def test_a_box_of_light_in_a_mirror() -> None:
    """The eye's ray leaves the mirror upward and crosses the box: ∫ ε ds along it."""
    d = np.array([0.0, 2.0, -0.6]) / np.sqrt(4.36)
    t = (np.arange(200_000) + 0.5) / 200_000 * 2.0
    u = (t[:, None] * d - np.array(BOX.corner)) / np.array([0.6, 0.3, 0.5])
    inside = ((u >= 0) & (u < 1)).all(axis=1)
    assert inside.any()
    expected = PanelBasis((1, 1, 1)).evaluate(u[inside]).sum(axis=0) * (2.0 / len(t))
    found, noise = one_pixel(floor(MIRROR), BOX, ASIDE, 20_000)
    assert np.abs(found - expected).max() < 4.5 * noise.max() + 0.004


def test_the_eye_does_not_see_the_box_itself() -> None:
    across = Camera((0.0, 0.5, 2.0), (0.0, 0.5, 0.0), vertical_fov_deg=0.2)
    found, _ = one_pixel(floor(GREY), BOX, across, 64)
    assert not found.any()


def test_skies_equal_the_path_tracer_and_one_degree_less_does_not() -> None:
    scene = room(mirror=True)
    surfaces, degree, size = SurfaceScene(scene), 3, 12
    aim = np.array([0.3, 0.8, 0.52])
    aim /= np.linalg.norm(aim)
    powers = np.polynomial.legendre.leg2poly([0] * degree + [1])
    powers[0] += 1
    weights = SpotBasis(degree).coefficients(sh.polynomial_factors(powers.tolist()), aim)
    less = weights.copy()
    less[degree**2 :] = 0

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        cosine, total = d.x * float(aim[0]) + d.y * float(aim[1]) + d.z * float(aim[2]), 0
        for factor in powers[::-1]:
            total = total * cosine + float(factor)
        return mi.Color3f(total)

    tracer = BasisTracer(scene, SteeredSky(degree), EYE, settings=ImageSettings(size, size, 1024, 8, 5))
    assert not tracer.traces_from_lamp
    assert tracer.left_out == ()
    rows = tracer.pixels(0, size * size, weights=np.stack([weights, less]))
    theirs, noise = path_traced_picture(
        surfaces,
        SteeredSky(degree),
        EYE,
        emission=emission,
        width=size,
        height=size,
        samples=1024,
        depth=5,
        seed=3,
    )
    right, wrong = (
        compare(rows.posed[:, p], theirs.reshape(-1, 3), rows.posed_variance[:, p] + noise.reshape(-1, 3))
        for p in (0, 1)
    )
    assert right.is_unbiased, right
    assert right.z_rejected_share < 0.02, right
    assert wrong.z_rejected_share > 0.08 or not wrong.is_unbiased, wrong


def test_the_sky_is_all_that_a_white_floor_sees() -> None:
    """Under a sky of radiance 1, a floor of albedo ρ has radiance ρ; the eye sees no sky beside it."""
    found, noise = one_pixel(floor(GREY), SteeredSky(0), DOWN, 20_000)
    assert found[0] * np.sqrt(4 * np.pi) == pytest.approx(0.6, abs=5 * noise[0] * np.sqrt(4 * np.pi))
    up = Camera((0.0, 1.0, 0.0), (0.0, 2.0, 0.01), vertical_fov_deg=1.0)
    assert not one_pixel(floor(GREY), SteeredSky(0), up, 16)[0].any()


def test_panels_of_exponentials_are_the_same_panel() -> None:
    """The same paths: what polynomials make of a wave is what sinusoids say, as far as degree 7 goes."""
    sides = (-0.5, 1.5, -0.4), (1.0, 0, 0), (0, 0, 1.0)
    settings = ImageSettings(6, 6, 128, 0, 4)
    terms = ((0.0, 0.0, 7),)
    images = [
        BasisTracer(room(), SteeredPanel(*sides, (1, 1), None, own), EYE, settings=settings)
        .pixels(0, 36)
        .images
        for own in ((), terms)
    ]
    axis = ExponentialAxis(((0j, 7),))
    wave, error = axis.fitted(lambda x: np.sqrt(2.0) * np.cos(2 * np.pi * x))
    one, _ = axis.fitted(np.ones_like)
    assert error < 0.01
    held = images[1].astype(np.float64) @ np.multiply.outer(wave, one).ravel()
    assert np.abs(held - images[0][:, :, 3]).max() < 0.01 * np.abs(images[0][:, :, 0]).max()


def test_a_panel_of_exponentials_holds_a_shape_anywhere_without_copies() -> None:
    basis = ExponentialBasis((ExponentialAxis(((0j, 9),)),) * 2, orthonormal=True)
    place = Place("panel", (0, 0, 0), ((1, 0, 0), (0, 0, 1)))
    points = np.random.default_rng(2).uniform(size=(4000, 2))
    for at in ((0.5, 0.5), (0.05, 0.95)):
        panel = Panel(at, (0.8, 0.8), (1.0, 1.0, 1.0))
        held = basis.evaluate(points) @ panel.coefficients(basis, place)[:, 0]
        wanted = axis_shape("raised-cosine", 0.8, points[:, 0] - at[0])
        wanted = wanted * axis_shape("raised-cosine", 0.8, points[:, 1] - at[1])
        assert np.abs(held - wanted).max() < 0.05
        assert not any("opposite edge" in note for note in panel.notes(basis, place))
    wrapped = Panel((0.05, 0.95), (0.8, 0.8), (1.0, 1.0, 1.0))
    assert any("opposite edge" in note for note in wrapped.notes(PanelBasis((4, 4)), place))
    weights = basis.weights(panel.coefficients(basis, place))
    held = basis.to_lights.T @ weights
    assert np.allclose(held, panel.coefficients(basis, place), rtol=1e-5, atol=1e-5 * np.abs(held).max())
    assert np.linalg.norm(weights[:, 0]) < 1.0  # as long as the light itself, in root mean square
