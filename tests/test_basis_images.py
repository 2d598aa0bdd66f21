"""Basis images against Mitsuba's path tracer under the real light, and against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from prelight.bases import spherical_harmonics as sh
from prelight.bases.exponentials import ExponentialAxis, ExponentialBasis
from prelight.bases.panels import PanelBasis
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.checking.comparison import compare
from prelight.encoding.octahedral import decoded_directions, encoded_directions
from prelight.errors import InputError
from prelight.lighting.distributions import Power
from prelight.lighting.places import Place
from prelight.lighting.spot import Spot
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.deep_buffer import DeepBuffer
from prelight.scene.geometry import Scene
from prelight.transport.basis_images import BasisTracer, ImageSettings, TracedRows
from prelight.transport.deep_buffer import deep_samples
from prelight.transport.span_kernels import add_pixels, span_shape
from prelight.transport.steered_lamps import (
    SteeredBox,
    SteeredLamp,
    SteeredPanel,
    SteeredSky,
    SteeredSpot,
    lamp_from_dict,
)
from prelight.transport.steered_reference import Emission, path_traced_picture

from .steered import EYE, LAMP_AT, room

W = H = 12
DEPTH = 5


@pytest.fixture(scope="module")
def mirrored() -> tuple[Scene, SurfaceScene]:
    scene = room(mirror=True)
    return scene, SurfaceScene(scene)


@pytest.fixture(scope="module")
def bare() -> tuple[Scene, SurfaceScene]:
    scene = room()
    return scene, SurfaceScene(scene)


def _traced(
    place: tuple[Scene, SurfaceScene], lamp: SteeredLamp, weights: np.ndarray, **how: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Pictures (pixels, P, 3) of lamps with these weights, and their variances."""
    settings = ImageSettings(
        W, H, **{"samples": 1024, "particles": 1024, "depth": DEPTH, "by_chance": True, **how}
    )
    tracer = BasisTracer(place[0], lamp, EYE, settings=settings, surfaces=place[1])
    rows, total = tracer.pixels(0, W * H, weights=weights), tracer.nothing(poses=len(weights))
    for batch in range(tracer.batches):
        tracer.add_batch(batch, total, weights=weights)
    return rows.posed + total.posed, rows.posed_variance + total.posed_variance


def _held(
    place: tuple[Scene, SurfaceScene], lamp: SteeredLamp, emission: Emission, weights: np.ndarray
) -> list[Any]:
    """Figures of each set of weights against the path tracer with the real light."""
    mean, variance = _traced(place, lamp, weights)
    theirs, noise = path_traced_picture(
        place[1], lamp, EYE, emission=emission, width=W, height=H, samples=1024, depth=DEPTH, seed=3
    )
    reference, noise = theirs.reshape(-1, 3), noise.reshape(-1, 3)
    return [compare(mean[:, p], reference, variance[:, p] + noise) for p in range(len(weights))]


def _sees(figures: Any) -> bool:
    """Whether a difference is beyond what both noises explain; the path tracer may miss rare paths."""
    return not figures.is_unbiased or figures.z_rejected_share > 0.08


@pytest.mark.parametrize("degree", [1, 3, 5, 9])
def test_spots_equal_the_path_tracer_and_one_degree_less_does_not(
    mirrored: tuple[Scene, SurfaceScene], degree: int
) -> None:
    """A Legendre polynomial: its top band is all there is, so that a degree less shows."""
    rng = np.random.default_rng(degree)
    aim = rng.uniform((-0.6, 0.0, -0.6), (0.6, 0.4, 0.6)) - LAMP_AT
    aim /= np.linalg.norm(aim)
    powers = np.polynomial.legendre.leg2poly([0] * degree + [1])
    powers[0] += 1

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        cosine, total = d.x * float(aim[0]) + d.y * float(aim[1]) + d.z * float(aim[2]), 0
        for factor in powers[::-1]:
            total = total * cosine + float(factor)
        return mi.Color3f(total)

    basis = SpotBasis(degree)
    weights = basis.coefficients(sh.polynomial_factors(powers.tolist()), aim)
    less = weights.copy()
    less[degree**2 :] = 0
    right, wrong = _held(mirrored, SteeredSpot(LAMP_AT, degree, 0.25), emission, np.stack([weights, less]))
    assert not _sees(right), right
    assert _sees(wrong), wrong


def test_panels_equal_the_path_tracer_where_they_slide_and_turn(bare: tuple[Scene, SurfaceScene]) -> None:
    lamp = SteeredPanel((-0.5, 1.5, -0.4), (1.0, 0, 0), (0, 0, 1.0), (2, 2), 2)
    basis = ProductBasis(PanelBasis((2, 2)), SpotBasis(2))
    at, aim = np.array([0.41, 0.63]), np.array([0.3, -0.9, 0.1])
    aim /= np.linalg.norm(aim)

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        import drjit as dr

        cosine = d.x * float(aim[0]) + d.y * float(aim[1]) + d.z * float(aim[2])
        value = ((1 + cosine) / 2) ** 2
        for x, place in ((u, at[0]), (v, at[1])):
            value = value * ((1 + dr.cos(2 * np.pi * (x - float(place)))) / 2) ** 2
        return mi.Color3f(value)

    directed = basis.spot.coefficients(sh.power_factors(2), aim)
    panel = basis.panel
    weights, beside = (
        basis.coefficients(panel.shifted(panel.own_shape, p), directed)
        for p in (at, at + np.array([0.3, 0.0]))
    )
    right, wrong = _held(bare, lamp, emission, np.stack([weights, beside]))
    assert not _sees(right), right
    assert _sees(wrong), wrong


def test_paths_from_the_lamp_bring_what_those_from_the_eye_meet_by_chance() -> None:
    """Light through glass onto the floor, once by each direction; counted twice or not at all it would show."""
    scene = room(glass=True)
    place, lamp = (scene, SurfaceScene(scene)), SteeredSpot(LAMP_AT, 1, 0.3)
    even = np.array([[np.sqrt(4 * np.pi), 0.0, 0.0, 0.0]])
    theirs, noise = _traced(place, lamp, even, samples=2048, particles=0)
    ours, own = _traced(place, lamp, even, samples=2048)
    only_eye = BasisTracer(
        scene, lamp, EYE, settings=ImageSettings(W, H, 512, 1, DEPTH, by_chance=True), surfaces=place[1]
    ).pixels(0, W * H, weights=even)
    figures = compare(ours[:, 0], theirs[:, 0], noise[:, 0] + own[:, 0])
    assert figures.is_unbiased, figures
    missing = compare(only_eye.posed[:, 0], theirs[:, 0], only_eye.posed_variance[:, 0] + noise[:, 0])
    assert missing.signed_mean < -0.01, missing


def test_pixels_are_the_same_however_the_picture_is_cut(mirrored: tuple[Scene, SurfaceScene]) -> None:
    settings = ImageSettings(W, H, samples=16384, particles=64, depth=4)
    lamp = SteeredSpot(LAMP_AT, 2)
    tracer = BasisTracer(mirrored[0], lamp, EYE, settings=settings, surfaces=mirrored[1])
    whole = tracer.pixels(40, 23)
    parts = [tracer.pixels(first, count) for first, count in ((40, 3), (43, 20))]
    assert np.array_equal(whole.images, np.concatenate([part.images for part in parts]))

    def splatted() -> TracedRows:
        total = tracer.nothing()
        tracer.add_batch(0, total)
        return total

    assert np.array_equal(splatted().images, splatted().images)
    assert splatted().images.any()


def test_nothing_is_compiled_from_one_tile_to_the_next(mirrored: tuple[Scene, SurfaceScene]) -> None:
    import drjit as dr

    settings = ImageSettings(W, H, samples=16384, particles=64, depth=4)
    lamp = SteeredSpot(LAMP_AT, 2)
    tracer = BasisTracer(mirrored[0], lamp, EYE, settings=settings, surfaces=mirrored[1])
    tracer.pixels(0, 8)
    tracer.add_batch(0, tracer.nothing())
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        tracer.pixels(8, 16)
        tracer.add_batch(1, tracer.nothing())
        launched = [kernel for kernel in dr.kernel_history() if "cache_hit" in kernel]
    assert launched
    assert all(kernel["cache_hit"] for kernel in launched)


def test_span_functions_are_those_of_the_bases(rng: np.random.Generator) -> None:
    """One path with one contribution: the image of each function is its value."""
    d, at = rng.normal(size=3), rng.uniform(size=3)
    d /= np.linalg.norm(d)
    sides = (0, 0, 0), (1, 0, 0), (0, 1, 0)
    terms = ((0.0, 0.0, 3), (-2.0, 5.0, 1))
    directed, flat = sh.evaluate(3, d.reshape(1, 3))[0], at[None, :2]
    axis = ExponentialAxis(tuple((complex(a, b), k) for a, b, k in terms))
    for lamp, expected in (
        (SteeredSpot((0, 0, 0), 3), directed),
        (SteeredSpot((0, 0, 0), 0), directed[:1]),
        (SteeredSky(3), directed),
        (SteeredPanel(*sides, (2, 3)), PanelBasis((2, 3)).evaluate(flat)[0]),
        (SteeredPanel(*sides, (1, 2), 3), np.kron(PanelBasis((1, 2)).evaluate(flat)[0], directed)),
        (SteeredPanel(*sides, (0, 0), None, terms), ExponentialBasis((axis, axis)).evaluate(flat)[0]),
        (SteeredBox(*sides, (0, 0, 1), (1, 2, 3)), PanelBasis((1, 2, 3)).evaluate(at[None])[0]),
    ):
        left = np.array([[*d, at[1]]], np.float32)
        if isinstance(lamp, SteeredBox):
            left[0, :3] = at[2], 0.0, 0.0
        carried = np.array([[2.0, 1.0, 0.5, at[0]]], np.float32)
        assert lamp.functions == len(expected)
        mean, variance = np.empty((1, 3, len(expected)), np.float32), np.empty((1, len(expected)), np.float32)
        add_pixels(
            1, (carried, left), np.ones(1, np.uint32), span_shape(lamp),
            np.zeros((0, len(expected))), mean, variance, *np.zeros((2, 1, 0, 3)),
        )  # fmt: skip
        for channel, colour in enumerate((2.0, 1.0, 0.5)):
            assert np.allclose(mean[0, channel], colour * expected, atol=2e-5), lamp


def test_the_first_bounce_of_a_narrow_beam_is_exact(mirrored: tuple[Scene, SurfaceScene]) -> None:
    """A beam of 20°, which no low degree holds, from the deep buffer; kept in 16 bits a number."""
    surfaces = mirrored[1]
    lamp, beam = SteeredSpot(LAMP_AT, 2, 0.1), Power.of_width(20.0)
    found = deep_samples(surfaces, lamp, EYE, settings=ImageSettings(W, H), samples=4096)
    deep = DeepBuffer(found.starts, found.colours, encoded_directions(found.directions), 2)
    spot, place = Spot((3.0, 2.0, 1.0), target=(0.1, 0.0, 0.2), distribution=beam), Place("spot", LAMP_AT)
    ours, aim = deep.radiance(spot, place), spot.aim(place)

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        import drjit as dr

        cosine = d.x * float(aim[0]) + d.y * float(aim[1]) + d.z * float(aim[2])
        return mi.Color3f(3, 2, 1) * dr.power(dr.maximum((1 + cosine) / 2, 0), beam.power)

    theirs, noise = path_traced_picture(
        surfaces, lamp, EYE, emission=emission, width=W, height=H, samples=4096, depth=2, seed=5
    )
    figures = compare(ours, theirs.reshape(-1, 3), 2 * noise.reshape(-1, 3), tolerance=1e-3 * theirs.max())
    assert figures.is_unbiased, figures
    assert figures.z_rejected_share < 0.01, figures
    assert ours.max() > 20 * np.median(ours)


def test_octahedral_directions_come_back(rng: np.random.Generator) -> None:
    d = rng.normal(size=(2000, 3))
    d = np.concatenate([d / np.linalg.norm(d, axis=1, keepdims=True), np.eye(3), -np.eye(3)])
    assert np.abs(decoded_directions(encoded_directions(d)) - d).max() < 6e-5


def test_what_is_left_out_is_named() -> None:
    scene = room(mirror=True)
    settings = ImageSettings(4, 4, 2, 1, 4)
    said = BasisTracer(scene, SteeredSpot(LAMP_AT, 0, 0.0), EYE, settings=settings).left_out
    assert any("mirrors" in words for words in said)
    assert BasisTracer(room(), SteeredSpot(LAMP_AT, 0), EYE, settings=settings).left_out == ()


def test_lamps_refuse_nonsense() -> None:
    for make in (
        lambda: SteeredSpot((0.0, 0.0, float("nan")), 3),
        lambda: SteeredSpot((0.0, 0.0, 0.0), -1),
        lambda: SteeredSpot((0.0, 0.0, 0.0), 99),
        lambda: SteeredPanel((0, 0, 0), (1, 0, 0), (2, 0, 0)),
        lambda: SteeredPanel((0, 0, 0), (1, 0, 0), (1, 1, 0)),
        lambda: SteeredPanel((0, 0, 0), (1, 0, 0), (0, 1, 0), (16, 16), 3),
        lambda: lamp_from_dict({"kind": "sun"}),
        lambda: lamp_from_dict({"kind": "spot", "colour": 3}),
        lambda: ImageSettings(width=0),
        lambda: SteeredBox((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1, 1)),
        lambda: SteeredBox((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0)),
        lambda: SteeredBox((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (5, 5, 5)),
        lambda: SteeredBox((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1)),
        lambda: SteeredSky(-1),
        lambda: SteeredPanel((0, 0, 0), (1, 0, 0), (0, 1, 0), terms=((0.0, 0.0, 40),)),
        lambda: SteeredPanel((0, 0, 0), (1, 0, 0), (0, 1, 0), terms=((0.0, 0.0, 1), (0.0, 0.0, 1))),
        lambda: SteeredPanel((0, 0, 0), (1, 0, 0), (0, 1, 0), terms=((float("nan"), 0.0, 1),)),
    ):
        with pytest.raises(InputError):
            make()
    sides = (0, 0, 0), (1, 0, 0), (0, 1, 0)
    for lamp in (
        SteeredSpot((1, 2, 3), 4), SteeredPanel(*sides, (1, 2), 1), SteeredSky(3), SteeredBox(*sides, (0, 0, 2)),
        SteeredPanel(*sides, (0, 0), 2, ((0.0, 0.0, 2), (-1.0, 3.0, 0))),
    ):  # fmt: skip
        assert lamp_from_dict(lamp.to_dict()) == lamp
