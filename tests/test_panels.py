"""The position of a light: shifted exactly, within the range that is free of copies; other families; products."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases.exponentials import ExponentialAxis, ExponentialBasis
from prelight.bases.panels import (
    PanelBasis,
    axis_functions,
    box_coefficients,
    power_coefficients,
    raised_cosine_coefficients,
)
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.errors import InputError

LINE = (np.arange(20_000) + 0.5) / 20_000


def around(x: np.ndarray) -> np.ndarray:
    return (x + 0.5) % 1.0 - 0.5


def test_functions_are_orthonormal() -> None:
    basis = PanelBasis((2, 3))
    u, v = np.meshgrid(np.arange(16) / 16, np.arange(16) / 16)
    values = basis.evaluate(np.stack([u.ravel(), v.ravel()], -1))
    assert basis.functions == values.shape[1] == 35
    np.testing.assert_allclose(values.T @ values / 256, np.eye(35), atol=1e-12)


@pytest.mark.parametrize("harmonics", [(4, 4), (2, 3), (1, 2, 2), (0, 1)])
def test_shifted_exactly(harmonics: tuple[int, ...], rng: np.random.Generator) -> None:
    basis = PanelBasis(harmonics)
    c, x = rng.standard_normal((basis.functions, 2)), rng.random((50, len(harmonics)))
    by = rng.random(len(harmonics))
    np.testing.assert_allclose(
        basis.evaluate(x) @ basis.shifted(c, by), basis.evaluate(x - by) @ c, atol=1e-10
    )


def test_shifted_copies_steer_a_panel(rng: np.random.Generator) -> None:
    """The paper's 81 lights: any place is a sum of copies of one shape, with weights of norm one."""
    basis = PanelBasis((4, 4))
    assert basis.lights == 81
    x, at = rng.random((200, 2)), rng.random(2)

    def light(middle: np.ndarray) -> np.ndarray:
        return (((1.0 + np.cos(2.0 * np.pi * (x - middle))) / 2.0) ** 4).prod(axis=1)

    w = basis.weights(basis.shifted(basis.own_shape, at))
    steered = sum(w[i] * light(basis.positions[i]) for i in range(81))
    np.testing.assert_allclose(steered, light(at), atol=1e-6)
    assert np.linalg.norm(w) == pytest.approx(basis.largest_norm, abs=1e-9)


def test_one_period_too_few_fails(rng: np.random.Generator) -> None:
    wanted = ((1.0 + np.cos(2.0 * np.pi * LINE)) / 2.0) ** 4
    held = axis_functions(3, LINE) @ power_coefficients(4, 3)
    assert np.abs(held - wanted).max() > 5e-3
    assert np.abs(axis_functions(4, LINE) @ power_coefficients(4, 4) - wanted).max() < 1e-12


@pytest.mark.parametrize("width", [0.1, 0.25, 0.6, 1.0])
def test_approximations_are_the_best(width: float) -> None:
    """Closed forms against integrals: the functions are orthonormal, so that is least squares."""
    x, F = around(LINE), axis_functions(6, LINE)
    raised = np.where(np.abs(x) < width / 2, 0.5 + 0.5 * np.cos(2.0 * np.pi * x / width), 0.0)
    np.testing.assert_allclose(raised_cosine_coefficients(width, 6), F.T @ raised / len(x), atol=1e-7)
    box = (np.abs(x) < width / 2).astype(float)
    np.testing.assert_allclose(box_coefficients(width, 6), F.T @ box / len(x), atol=2e-4)
    soft = np.abs(np.cos(np.pi * x)) ** 5.0
    np.testing.assert_allclose(power_coefficients(2.5, 6), F.T @ soft / len(x), atol=1e-9)


def test_what_leaves_one_edge_comes_in_at_the_other() -> None:
    """Shifting by one is nothing at all, and past the edge the light is back at the start."""
    basis = PanelBasis((4,))
    shape = basis.own_shape
    np.testing.assert_allclose(basis.shifted(shape, [1.0]), shape, atol=1e-12)
    at_edge = basis.evaluate(LINE[:, None]) @ basis.shifted(shape, [0.98])
    assert at_edge[LINE < 0.02].min() > 0.9
    inside = basis.evaluate(LINE[:, None]) @ basis.shifted(shape, [0.5])
    assert np.abs(inside[(LINE < 0.02) | (LINE > 0.98)]).max() < 1e-6


TERMS = [((0.0, 3),), ((-3.0, 1), (2j * np.pi, 1)), ((-2.0 + 5.0j, 2),)]


@pytest.mark.parametrize("terms", TERMS)
def test_exponentials_times_polynomials_are_steered(terms, rng: np.random.Generator) -> None:
    axis = ExponentialAxis(terms)
    basis = ExponentialBasis((axis, axis))
    c, x, by = rng.standard_normal(basis.functions), rng.random((40, 2)), np.array([0.3, -0.2])
    wanted = basis.evaluate(x - by) @ c
    np.testing.assert_allclose(basis.evaluate(x) @ basis.shifted(c, by), wanted, rtol=1e-9, atol=1e-9)
    w = basis.weights(basis.shifted(c, by))
    np.testing.assert_allclose(basis.evaluate(x) @ (basis.to_lights.T @ w), wanted, rtol=1e-6, atol=1e-6)
    assert basis.lights == basis.functions == axis.functions**2


def test_exponentials_without_a_copy() -> None:
    """A fading light that leaves over one edge does not come back, as a sinusoid does."""
    axis = ExponentialAxis(((-8.0, 1),))
    c = np.array([0.0, 1.0])  # x·e^(−8x), zero at its start
    moved = axis.evaluate(np.array([0.05])) @ axis.shift(0.05) @ c
    np.testing.assert_allclose(moved, 0.0, atol=1e-12)
    found, error = axis.fitted(lambda x: 3.0 * np.exp(-8.0 * x) - x * np.exp(-8.0 * x))
    np.testing.assert_allclose(found, [3.0, -1.0], atol=1e-9)
    assert error < 1e-12
    assert axis.fitted(lambda x: (x > 0.5).astype(float))[1] > 0.3
    with pytest.raises(InputError, match="depend on each other"):
        ExponentialAxis(((1.0, 1), (1.0, 0)))
    with pytest.raises(InputError, match="expected pairs"):
        ExponentialAxis((("x",),))  # ty: ignore[invalid-argument-type]


def test_position_times_direction(rng: np.random.Generator) -> None:
    """The paper's 400 lights: first steered in position, then in direction; the same as all at once."""
    basis = ProductBasis(PanelBasis((2, 2)), SpotBasis(3))
    assert basis.lights == basis.functions == 400
    at, p = np.array([0.3, 0.8]), np.array([2.0, -1.0, 2.0]) / 3.0
    c = basis.coefficients(
        basis.panel.shifted(basis.panel.own_shape, at), basis.spot.coefficients(basis.spot.factors, p)
    )
    w = basis.weights(c)
    np.testing.assert_allclose(basis.to_lights.T @ w, c, atol=1e-9)
    x, d = rng.random((100, 2)), rng.standard_normal((100, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    wanted = (((1.0 + np.cos(2.0 * np.pi * (x - at))) / 2.0) ** 2).prod(axis=1) * ((1.0 + d @ p) / 2.0) ** 3
    np.testing.assert_allclose(basis.evaluate(x, d) @ c, wanted, atol=1e-6)
    colours = rng.random((basis.functions, 3))
    np.testing.assert_allclose(basis.weights(colours)[:, 1], basis.weights(colours[:, 1]), atol=1e-9)


@pytest.mark.parametrize("harmonics", [(), (1, 2, 3, 4), (21, 1), (1, 0.5), "22", None])
def test_what_is_no_panel_is_refused(harmonics: object) -> None:
    with pytest.raises(InputError, match=r"harmonics.*expected"):
        PanelBasis(harmonics)  # ty: ignore[invalid-argument-type]
