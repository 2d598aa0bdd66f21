"""Spherical harmonics: orthonormal, in the stated order and sign, turned exactly, zonal ones in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from prelight.bases import spherical_harmonics as sh
from prelight.errors import InputError


def directions(rng: np.random.Generator, number: int = 200) -> np.ndarray:
    d = rng.standard_normal((number, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def rotation(rng: np.random.Generator) -> np.ndarray:
    R = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return R * np.sign(np.linalg.det(R))


@pytest.mark.parametrize("order", [0, 1, 4, 9, 20, 40])
def test_orthonormal(order: int) -> None:
    nodes, weights = sh.quadrature(2 * order)
    assert weights.sum() == pytest.approx(4.0 * np.pi, rel=1e-13)
    Y = sh.evaluate(order, nodes)
    assert Y.shape == (len(nodes), (order + 1) ** 2)
    np.testing.assert_allclose(Y.T @ (Y * weights[:, None]), np.eye(sh.count(order)), atol=1e-12)


def test_order_and_signs(rng: np.random.Generator) -> None:
    """The first nine, written out."""
    x, y, z = directions(rng).T
    a, b = math.sqrt(3.0 / (4.0 * math.pi)), math.sqrt(15.0 / (4.0 * math.pi))
    expected = [
        np.full_like(x, math.sqrt(0.25 / math.pi)), a * y, a * z, a * x,
        b * x * y, b * y * z, b * (3.0 * z * z - 1.0) / math.sqrt(12.0), b * x * z, b * (x * x - y * y) / 2.0,
    ]  # fmt: skip
    np.testing.assert_allclose(sh.evaluate(2, np.stack([x, y, z], -1)), np.stack(expected, -1), atol=1e-14)


@pytest.mark.parametrize("order", [1, 3, 9])
def test_turned_exactly(order: int, rng: np.random.Generator) -> None:
    c, R, d = rng.standard_normal((sh.count(order), 3)), rotation(rng), directions(rng)
    turned = sh.rotated(c, R)
    np.testing.assert_allclose(sh.evaluate(order, d) @ turned, sh.evaluate(order, d @ R) @ c, atol=1e-12)
    bands = sh.bands(order)  # a rotation mixes no bands
    for band in range(order + 1):
        assert np.linalg.norm(turned[bands == band]) == pytest.approx(np.linalg.norm(c[bands == band]))


def test_turning_refuses_what_is_no_rotation() -> None:
    with pytest.raises(InputError, match="a rotation"):
        sh.rotated(np.ones(4), np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(InputError, match=r"expected \(n \+ 1\)²"):
        sh.rotated(np.ones(5), np.eye(3))


@pytest.mark.parametrize("power", [0, 1, 5, 9, 20])
def test_powers_in_closed_form(power: int, rng: np.random.Generator) -> None:
    d = directions(rng)
    p = d[0]
    c = sh.zonal(sh.power_factors(power), p[None])[0]
    np.testing.assert_allclose(sh.evaluate(power, d) @ c, ((1.0 + d @ p) / 2.0) ** power, atol=1e-13)
    assert sh.power_factors(power)[0] == pytest.approx(4.0 * math.pi / (power + 1))  # its power


def test_polynomials_and_profiles_agree(rng: np.random.Generator) -> None:
    c = rng.standard_normal(6)
    d = directions(rng)
    zonal = sh.zonal(sh.polynomial_factors(c), d[:1])[0]
    wanted = np.polynomial.polynomial.polyval(d @ d[0], c)
    np.testing.assert_allclose(sh.evaluate(5, d) @ zonal, wanted, atol=1e-12)
    by_rule = sh.profile_factors(lambda t: np.polynomial.polynomial.polyval(t, c), 5)
    np.testing.assert_allclose(by_rule, sh.polynomial_factors(c), atol=1e-12)
    # A cone of 1 within 60°: λ₀ is its solid angle, λ₁ = π·(1 − t₀²).
    cone = sh.profile_factors(lambda t: (t > 0.5).astype(float), 1, breaks=[0.5])
    np.testing.assert_allclose(cone, [math.pi, 0.75 * math.pi], rtol=1e-12)
    # A power that is no whole number, against the rule.
    uneven = sh.profile_factors(lambda t: ((1.0 + t) / 2.0) ** 4.5, 8)
    np.testing.assert_allclose(sh.power_factors(4.5, 8), uneven, atol=1e-6)


def test_projection_finds_what_is_there(rng: np.random.Generator) -> None:
    c = rng.standard_normal((sh.count(4), 3))
    nodes, _ = sh.quadrature(8)
    np.testing.assert_allclose(sh.project(sh.evaluate(4, nodes) @ c, 4, degree=8), c, atol=1e-12)


@pytest.mark.parametrize("order", [-1, 41, 2.5, True, "3"])
def test_orders_are_checked(order: object) -> None:
    with pytest.raises(InputError, match="expected a whole number from 0 to 40"):
        sh.checked_order(order)  # ty: ignore[invalid-argument-type]
