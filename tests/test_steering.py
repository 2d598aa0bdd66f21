"""The direction of a spot: exact steering from sampled basis lights, at the degree and not one below."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from prelight.bases import spherical_harmonics as sh
from prelight.bases.steering import SpotBasis
from prelight.bases.well_spread import largest_norm, of_full_rank, singular_ratio, spiral, well_spread
from prelight.errors import InputError


def directions(rng: np.random.Generator, number: int = 300) -> np.ndarray:
    d = rng.standard_normal((number, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def power(degree: int):
    return lambda t: ((1.0 + t) / 2.0) ** degree


@pytest.mark.parametrize("degree", [1, 3, 5, 7, 9])
def test_a_steered_spot_is_the_spot(degree: int, rng: np.random.Generator) -> None:
    basis, omega, f = SpotBasis(degree), directions(rng), power(degree)
    assert basis.lights == basis.functions == (degree + 1) ** 2
    for p in directions(rng, 5):
        steered = f(omega @ basis.directions.T) @ basis.aimed(p)
        np.testing.assert_allclose(steered, f(omega @ p), atol=1e-6 * f(1.0))


@pytest.mark.parametrize("degree", [1, 3, 5, 9])
def test_one_degree_too_few_fails(degree: int, rng: np.random.Generator) -> None:
    """The best that the lights of degree N − 1 can do for a spot of degree N is off by more than steering ever is.

    At N = 9 by 2·10⁻⁵ of it only: high bands are nearly empty in ((1 + t)/2)^N. In (ω·p)^N they are not.
    """
    small, omega, p = SpotBasis(degree - 1), directions(rng), directions(rng, 1)[0]
    lights = power(degree - 1)(omega @ small.directions.T)
    wanted = power(degree)(omega @ p)
    best = lights @ np.linalg.lstsq(lights, wanted, rcond=None)[0]
    assert np.linalg.norm(best - wanted) > 1e-5 * np.linalg.norm(wanted)
    pure = (omega @ p) ** degree
    best = lights @ np.linalg.lstsq(lights, pure, rcond=None)[0]
    assert np.linalg.norm(best - pure) > 5e-3 * np.linalg.norm(pure)
    with pytest.raises(InputError, match="bake with a higher degree"):
        small.coefficients(sh.power_factors(degree), p)


@pytest.mark.parametrize(("degree", "parity"), [(4, "even"), (5, "odd"), (9, "odd"), (8, "even")])
def test_odd_and_even_need_half(degree: int, parity, rng: np.random.Generator) -> None:
    basis, omega, p = SpotBasis(degree, parity), directions(rng), directions(rng, 1)[0]
    assert basis.lights == basis.functions == (degree + 1) * (degree + 2) // 2
    steered = (omega @ basis.directions.T) ** degree @ basis.aimed(p)
    np.testing.assert_allclose(steered, (omega @ p) ** degree, atol=1e-6)
    with pytest.raises(InputError, match=f"is no {parity} polynomial"):
        basis.coefficients(sh.power_factors(degree), p)


def test_any_polynomial_up_to_the_degree(rng: np.random.Generator) -> None:
    """Shape changes at run time: the basis lights are of one shape, the light of another."""
    basis, omega, p = SpotBasis(7), directions(rng), directions(rng, 1)[0]
    lights = power(7)(omega @ basis.directions.T)
    for degree in range(8):
        c = rng.standard_normal(degree + 1)
        w = basis.weights(basis.coefficients(sh.polynomial_factors(c), p))
        wanted = np.polynomial.polynomial.polyval(omega @ p, c)
        np.testing.assert_allclose(lights @ w, wanted, atol=1e-6 * np.abs(c).sum() + 1e-6)


def test_the_papers_own_matrix_gives_the_same_light(rng: np.random.Generator) -> None:
    """Equation 5: monomials ω_x^i ω_y^j ω_z^k with N!/((N−n)! i! j! k!)·p^ijk, M wide and its pseudo-inverse."""
    N = 4
    powers = [e for e in itertools.product(range(N + 1), repeat=3) if sum(e) <= N]
    assert len(powers) == (N + 1) * (N + 2) * (N + 3) // 6
    factor = np.array(
        [math.factorial(N) / math.factorial(N - sum(e)) / math.prod(map(math.factorial, e)) for e in powers]
    )

    def alpha(p: np.ndarray) -> np.ndarray:
        return factor * np.prod(np.atleast_2d(p)[:, None, :] ** np.array(powers), axis=-1)

    basis, omega, p = SpotBasis(N), directions(rng), directions(rng, 1)[0]
    M = alpha(basis.directions)
    w = (alpha(p) @ np.linalg.pinv(M))[0]  # least norm; (MᵀM)⁻¹Mᵀ is singular, M being wide
    assert np.linalg.cond(M.T @ M) > 1e12
    theirs = (1.0 + omega @ basis.directions.T) ** N @ w
    np.testing.assert_allclose(theirs, (1.0 + omega @ p) ** N, atol=1e-9)
    ours = (1.0 + omega @ basis.directions.T) ** N @ basis.aimed(p)
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize(("degree", "parity"), [(1, "all"), (5, "all"), (9, "all"), (7, "all"), (9, "odd")])
def test_weights_stay_small(degree: int, parity, rng: np.random.Generator) -> None:
    basis = SpotBasis(degree, parity)
    assert basis.largest_norm <= 2.0 + 0.05
    assert basis.conditioned
    norms = [np.linalg.norm(basis.aimed(p)) for p in directions(rng, 50)]
    assert max(norms) <= basis.largest_norm * 1.02


def test_random_directions_multiply_errors(rng: np.random.Generator) -> None:
    """Why they are spread: what the paper allows, random ones, is of full rank and useless."""
    random = directions(rng, 100)
    assert singular_ratio(random, 9) > 1e-9
    assert largest_norm(random, 9) > 100.0 > 3.0 > largest_norm(well_spread(9), 9)


def test_directions_short_of_rank_are_perturbed() -> None:
    ring = np.stack([np.cos(np.arange(16.0)), np.sin(np.arange(16.0)), np.zeros(16)], -1)
    assert singular_ratio(ring, 3) < 1e-9
    found = of_full_rank(ring, 3)
    assert singular_ratio(found, 3) > 1e-9
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    np.testing.assert_array_equal(found, of_full_rank(ring, 3))
    assert SpotBasis(3, aims=ring).conditioned
    with pytest.raises(InputError, match="15 of them, degree 3 needs at least 16"):
        of_full_rank(spiral(15), 3)


def test_more_lights_than_needed_take_the_least_weights(rng: np.random.Generator) -> None:
    aims, omega, p = directions(rng, 60), directions(rng), directions(rng, 1)[0]
    basis = SpotBasis(5, aims=aims)
    w = basis.aimed(p)
    np.testing.assert_allclose(power(5)(omega @ aims.T) @ w, power(5)(omega @ p), atol=1e-6)
    other = w + np.linalg.svd(power(5)(omega @ aims.T))[2][-1]  # the same light, other weights
    np.testing.assert_allclose(power(5)(omega @ aims.T) @ other, power(5)(omega @ p), atol=1e-6)
    assert np.linalg.norm(w) < np.linalg.norm(other)


def test_images_of_either_kind_are_exchanged(rng: np.random.Generator) -> None:
    basis = SpotBasis(3)
    span = rng.standard_normal((basis.functions, 5, 3))
    lights = basis.basis_images(span)
    np.testing.assert_allclose(basis.span_images(lights), span, atol=1e-9)
    c = basis.coefficients(sh.power_factors(3), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(np.tensordot(basis.weights(c), lights, 1), np.tensordot(c, span, 1), atol=1e-9)


def test_what_is_no_basis_is_refused() -> None:
    with pytest.raises(InputError, match="degree 4 is not"):
        SpotBasis(4, "odd")
    with pytest.raises(InputError, match="expected one of all, even, odd"):
        SpotBasis(4, "both")  # ty: ignore[invalid-argument-type]
    with pytest.raises(InputError, match="none zero"):
        SpotBasis(2, factors=[1.0, 0.0, 1.0])
    with pytest.raises(InputError, match="all zero"):
        SpotBasis(0, aims=np.zeros((1, 3)))
    with pytest.raises(InputError, match="expected 4 of them"):
        SpotBasis(1).weights(np.ones(5))
