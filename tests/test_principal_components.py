"""Fewer images for the same pictures: MᵀM against the singular values of M itself, rules, and bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.bases.panels import PanelBasis
from prelight.bases.steering import SpotBasis
from prelight.encoding.byte_planes import BytePlanes, encoded, one_plane_errors, two_planes_needed
from prelight.encoding.principal_components import (
    Keep,
    basis_lights,
    gram,
    principal_components,
    remaining_errors,
    to_bytes,
)
from prelight.errors import InputError


@pytest.fixture
def scene(rng: np.random.Generator) -> tuple[SpotBasis, np.ndarray]:
    """Span images (S, pixels, 3) of 500 coloured points around a spot, half of them in shadow."""
    basis = SpotBasis(4)
    d = rng.standard_normal((500, 3))
    d[:, 1] = -np.abs(d[:, 1]) - 0.3
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    seen = (d[:, 0] > -0.2)[:, None] * rng.random((500, 3))
    return basis, (basis.evaluate(d)[:, None, :] * seen[:, :, None]).transpose(2, 0, 1).astype(np.float32)


def test_components_are_those_of_the_matrix_itself(scene) -> None:
    basis, span = scene
    M = basis.basis_images(span.astype(np.float64)).reshape(basis.lights, -1).T
    U, S, _ = np.linalg.svd(M, full_matrices=False)
    found = principal_components(gram(span), basis, keep=Keep(count=6))
    np.testing.assert_allclose(found.singular_values[:10], S[:10], rtol=1e-5)
    images = found.images(span).reshape(6, -1)
    for k in range(6):  # M·V = U·S, up to sign
        np.testing.assert_allclose(np.abs(images[k] @ U[:, k]), S[k], rtol=1e-4)
    assert found.error == pytest.approx(np.sqrt(np.square(S[6:]).sum() / np.square(S).sum()), rel=1e-3)


def test_all_components_give_every_light(scene, rng: np.random.Generator) -> None:
    basis, span = scene
    c = basis.coefficients(basis.factors, np.array([0.6, -0.8, 0.0]))
    wanted = np.tensordot(c, span, 1)
    for components in (
        principal_components(gram(span), basis, keep=Keep(count=basis.lights)),
        basis_lights(basis),
    ):
        got = np.tensordot(components.mixing @ c, components.images(span), 1)
        np.testing.assert_allclose(got, wanted, atol=1e-5 * np.abs(wanted).max())
    few = principal_components(gram(span), basis, keep=Keep(count=2))
    assert np.abs(np.tensordot(few.mixing @ c, few.images(span), 1) - wanted).max() > 0.01 * wanted.max()


def test_a_strip_at_a_time_is_all_at_once(scene, monkeypatch: pytest.MonkeyPatch) -> None:
    basis, span = scene
    whole = gram(span)
    monkeypatch.setattr("prelight.encoding.principal_components._STRIP", 3 * basis.functions * 7)
    np.testing.assert_allclose(gram(span), whole, rtol=1e-12, atol=1e-12)
    components = principal_components(whole, basis, keep=Keep(count=3))
    strips = components.images(span)
    monkeypatch.undo()
    np.testing.assert_allclose(components.images(span), strips, atol=1e-6)


def test_the_papers_rule_and_the_others() -> None:
    s = np.array([8.0, 1.0, 0.6, 0.3, 0.1])  # sums: 8, 9, 9.6, 9.9, 10
    assert Keep().number(s) == 2  # 90 % exactly
    assert Keep(share=0.91).number(s) == 3
    assert Keep(share=1.0).number(s) == 5
    assert Keep(count=4).number(s) == 4
    left = remaining_errors(s)
    assert left[0] == 1.0
    assert left[-1] == 0.0
    assert Keep(error=float(left[3]) * 1.001).number(s) == 3
    assert Keep(error=0.0).number(s) == 5
    for rule in (Keep(count=6), Keep(count=0), Keep(error=1.0), Keep(share=0.0), Keep(error=-0.1)):
        with pytest.raises(InputError, match="expected"):
            rule.number(s)


def test_bytes_hold_what_they_promise(rng: np.random.Generator) -> None:
    images = rng.standard_normal((3, 130, 3)).astype(np.float32)
    images[1] *= 100.0
    one = encoded(images)
    np.testing.assert_array_equal(one.image_of, [0, 1, 2])
    for kept, image in zip(one.decoded(3), images, strict=True):
        assert np.abs(kept - image).max() <= np.abs(image).max() / 254 * 1.001
    errors = one_plane_errors(images)
    np.testing.assert_allclose(errors, np.square(one.decoded(3) - images).mean(axis=(1, 2)), rtol=1e-4)
    twice = two_planes_needed(errors, errors[0] + errors[2])
    np.testing.assert_array_equal(twice, [False, True, False])
    two = encoded(images, twice=twice)
    np.testing.assert_array_equal(two.image_of, [0, 1, 1, 2])
    assert np.abs(two.decoded(3)[1] - images[1]).max() < np.abs(one.decoded(3)[1] - images[1]).max() / 100
    np.testing.assert_allclose(two.salience[0], np.abs(images[0]).mean(axis=0), rtol=1e-6)
    assert not two_planes_needed(errors, errors.sum()).any()
    assert two_planes_needed(errors, 0.0).all()


def test_zero_is_exactly_zero() -> None:
    images = np.zeros((1, 70, 3), np.float32)
    images[0, 69, 1] = 2.0
    kept = encoded(images)
    np.testing.assert_allclose(kept.decoded(1), images, rtol=1e-6)
    assert np.count_nonzero(kept.decoded(1)) == 1


def test_bytes_cost_at_most_half_a_decibel(scene, rng: np.random.Generator) -> None:
    """Of the error of twelve components, over pictures of spots aimed anywhere."""
    basis, span = scene
    components = principal_components(gram(span), basis, keep=Keep(count=12))
    images = components.images(span)
    kept = to_bytes(components, images).decoded(12)
    coarse = encoded(images).decoded(12)
    squares = np.zeros(3)
    for p in rng.standard_normal((40, 3)):
        c = basis.coefficients(basis.factors, p / np.linalg.norm(p))
        wanted = np.tensordot(c, span, 1)
        for n, some in enumerate((images, kept, coarse)):
            squares[n] += np.square(np.tensordot(components.mixing @ c, some, 1) - wanted).mean()
    loss = 10.0 * np.log10(squares[1:] / squares[0])
    assert -0.1 < loss[0] <= 0.5
    assert loss[1] > 0.5  # one plane each would not do here


def test_a_lamp_in_a_mirror_does_not_spoil_its_neighbours(scene) -> None:
    """Three pixels of a thousand times the rest: bytes beside them would be worth nothing."""
    basis, span = scene
    lamps = np.sort(np.argsort(np.abs(span).sum(axis=(0, 2)))[[-1, -20, -50]])
    lamp = span.copy()
    lamp[:, lamps] *= 1000.0
    components = principal_components(gram(span), basis, keep=Keep(count=12))
    images, plain = components.images(lamp), components.images(span)
    kept = to_bytes(components, images)
    np.testing.assert_array_equal(kept.bright, lamps)
    got, before = kept.decoded(12), to_bytes(components, plain).decoded(12)
    np.testing.assert_allclose(got[:, lamps], images[:, lamps], rtol=1e-6)
    others = np.setdiff1d(np.arange(500), lamps)
    assert np.abs(got - images)[:, others].max() < 2.0 * np.abs(before - plain).max()
    spoilt = encoded(images).decoded(12)
    assert np.abs(spoilt - images)[:, others].max() > 50.0 * np.abs(before - plain).max()
    np.testing.assert_array_equal(kept.decoded(12, slice(64, 450)), got[:, 64:450])
    picture, w = np.zeros((500, 3), np.float32), np.arange(36.0).reshape(3, 12)
    kept.add_bright(w, picture)
    np.testing.assert_allclose(picture[lamps[1]], np.einsum("ck,kc->c", w, images[:, lamps[1]]), rtol=1e-5)
    assert np.count_nonzero(picture.any(axis=1)) == 3
    with pytest.raises(InputError, match="do not fit"):
        replace(kept, bright=kept.bright[::-1].copy())
    with pytest.raises(InputError, match="do not fit"):
        replace(kept, bright=kept.bright + np.int32(500))


def test_what_does_not_fit_is_refused(scene) -> None:
    basis, span = scene
    with pytest.raises(InputError, match="MᵀM is"):
        principal_components(gram(span[:-1]), basis)
    with pytest.raises(InputError, match="all basis images are black"):
        principal_components(gram(np.zeros_like(span)), basis)
    broken = span.copy()
    broken[0, 0, 0] = np.nan
    with pytest.raises(InputError, match="not finite"):
        gram(broken)
    with pytest.raises(InputError, match="not finite"):
        encoded(broken)
    good = encoded(span)
    with pytest.raises(InputError, match="do not fit together"):
        BytePlanes(good.pixels + 64, good.bytes, good.scales, good.image_of, good.salience)
    assert PanelBasis((1, 1)).lights == 9
