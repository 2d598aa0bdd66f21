"""Tone mapping and error figures against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prelight.errors import InputError
from prelight.images import metrics, tonemap


def grey(*values: float) -> np.ndarray:
    return np.repeat(np.array(values, np.float32)[None, :, None], 3, axis=2)


def shown(*values: float, curve: str = "filmic", exposure: float = 0.0) -> list[int]:
    return [int(v) for v in tonemap.tonemap(grey(*values), exposure=exposure, curve=curve)[0, :, 0]]


def test_srgb_by_the_standard() -> None:
    linear = np.array([0.0, 0.0031308, 0.18, 0.5, 1.0, 2.0, -1.0], np.float32)
    np.testing.assert_allclose(
        tonemap.srgb_encode(linear), [0, 0.04045, 0.46136, 0.73536, 1, 1, 0], atol=2e-5
    )


def test_decoding_undoes_encoding() -> None:
    linear = np.linspace(0, 1, 1001, dtype=np.float32)
    np.testing.assert_allclose(tonemap.srgb_decode(tonemap.srgb_encode(linear)), linear, atol=1e-6)
    every = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(np.rint(tonemap.srgb_encode(tonemap.srgb_decode(every)) * 255), every)


def test_the_linear_curve_is_srgb_and_nothing_else() -> None:
    every = np.arange(256, dtype=np.uint8)
    picture = np.broadcast_to(tonemap.srgb_decode(every)[None, :, None], (2, 256, 3))
    np.testing.assert_array_equal(tonemap.tonemap(picture, curve="linear")[1, :, 2], every)
    assert shown(0.25, curve="linear", exposure=1.0) == shown(0.5, curve="linear")
    assert shown(7.0, curve="linear") == [255]


def test_middle_grey_stays_and_white_is_reached_softly() -> None:
    assert shown(0.18) == shown(0.18, curve="linear") == [118]
    assert shown(16.0) == [255]
    assert shown(8.0)[0] < 255
    assert shown(0.0) == [0]
    assert 200 <= shown(1.0)[0] <= 235


def test_the_filmic_curve_rises_and_keeps_grey_grey() -> None:
    levels = np.geomspace(1e-4, 16, 4000)
    picture = tonemap.tonemap(grey(*levels))
    assert (np.diff(picture[0, :, 0].astype(int)) >= 0).all()
    assert (picture.max(axis=2) - picture.min(axis=2)).max() <= 1


def test_contrast_at_middle_grey_is_gentle() -> None:
    up, down = tonemap._shoulder(np.array([0.18 * 1.02, 0.18 / 1.02], np.float32))
    slope = math.log(up / down) / (2 * math.log(1.02))
    assert slope == pytest.approx(1.375 * 0.82, abs=0.02)


@pytest.mark.parametrize("strong", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0.4, 0), (0.1, 0.3, 1)])
def test_strong_colours_fade_to_white_and_keep_their_order(strong) -> None:
    stops = np.arange(-4, 12, 0.5)
    picture = (np.array(strong) * 2.0 ** stops[:, None])[None].astype(np.float32)
    display = tonemap.srgb_decode(tonemap.tonemap(picture))[0]
    saturation = 1 - display.min(axis=1) / display.max(axis=1)
    assert (np.diff(saturation[stops >= 1]) <= 0.01).all()
    assert saturation[-1] < 0.05
    assert saturation[stops == 0][0] > 0.75
    order = np.argsort(strong, kind="stable")
    assert (np.diff(display[:, order], axis=1) >= -1e-3).all()  # red never becomes yellow


def test_bright_orange_does_not_turn_yellow() -> None:
    orange = np.array([[[4.0, 1.6, 0.0]]], np.float32)
    red, green, blue = tonemap.srgb_decode(tonemap.tonemap(orange))[0, 0]
    assert (green - blue) / (red - blue) < 0.8  # 0.4 before; clipping gives 1


def test_what_is_no_number_is_shown_too() -> None:
    odd = np.array([[[np.nan] * 3, [np.inf] * 3, [-np.inf] * 3, [-1.0] * 3]], np.float32)
    for curve in tonemap.CURVES:
        assert tonemap.tonemap(odd, curve=curve)[0, :, 0].tolist() == [0, 255, 0, 0]
    assert shown(0.0, 1.0, exposure=500.0) == [0, 255]
    assert shown(0.0, 1.0, exposure=-500.0) == [0, 0]


def test_the_picture_given_is_left_alone(rng) -> None:
    picture = rng.random((5, 6, 3), np.float32)
    before = picture.copy()
    for curve in tonemap.CURVES:
        tonemap.tonemap(picture, curve=curve)
    np.testing.assert_array_equal(picture, before)


def test_many_blocks_are_as_one(rng) -> None:
    picture = rng.lognormal(0, 2, (300, 256, 3)).astype(np.float32)
    whole = tonemap.tonemap(picture)
    for row in (0, 127, 128, 299):
        np.testing.assert_array_equal(whole[row : row + 1], tonemap.tonemap(picture[row : row + 1]))


@pytest.mark.parametrize(
    ("arguments", "name"), [({"curve": "aces"}, "filmic"), ({"exposure": math.nan}, "finite")]
)
def test_unknown_settings_are_named(arguments, name) -> None:
    with pytest.raises(InputError, match=name):
        tonemap.tonemap(grey(1.0), **arguments)


@given(st.floats(-60, 60))
def test_exposure_follows_the_light(stops) -> None:
    picture = grey(*np.geomspace(0.01, 3, 50))
    brighter = (picture * np.float32(2.0**stops)).astype(np.float32)
    assert tonemap.exposure_for(brighter) == pytest.approx(tonemap.exposure_for(picture) - stops, abs=1e-3)


def test_exposure_brings_a_plain_picture_near_middle_grey() -> None:
    stops = tonemap.exposure_for(grey(5.0, 5.0))
    assert 0.18 <= 5.0 * 2.0**stops <= 0.45


def test_a_sun_and_what_is_behind_do_not_count() -> None:
    picture = np.full((40, 40, 3), 0.5, np.float32)
    plain = tonemap.exposure_for(picture)
    picture[:3] = 1e5
    assert tonemap.exposure_for(picture) == pytest.approx(plain, abs=0.01)
    picture[:30] = 1e5
    mask = np.zeros((40, 40), bool)
    mask[30:] = True
    assert tonemap.exposure_for(picture, mask=mask) == pytest.approx(plain, abs=0.01)
    assert tonemap.exposure_for(picture) < plain - 10


def test_exposure_of_odd_pictures() -> None:
    assert tonemap.exposure_for(grey(0.0, 0.0)) == 0.0
    odd = grey(math.nan, math.inf, -1.0, 0.5)
    assert tonemap.exposure_for(odd) == tonemap.exposure_for(grey(0.5))
    assert tonemap.exposure_for(grey(0.5, 0.5), mask=np.zeros((1, 2), bool)) == tonemap.exposure_for(
        grey(0.5)
    )


def test_error_figures_of_known_numbers() -> None:
    reference, a = np.array([1.0, 2.0, 2.0, 3.0], np.float32), np.array([1.0, 2.5, 1.5, 4.0], np.float32)
    assert metrics.relative_rms(a, reference) == pytest.approx(math.sqrt(1.5 / 18))
    assert metrics.mean_difference(a, reference) == pytest.approx(2.0 / 8)
    assert metrics.signed_mean(a, reference) == pytest.approx(1.0 / 8)
    assert metrics.signed_mean(reference, 2 * reference) == pytest.approx(-0.5)
    assert metrics.worst(a, reference) == pytest.approx(1.0 / 2)
    assert metrics.worst(reference, a) == pytest.approx(1.0 / 2.25)


FIGURES = [metrics.relative_rms, metrics.mean_difference, metrics.signed_mean, metrics.worst]


@pytest.mark.parametrize("figure", FIGURES)
def test_error_figures_do_not_depend_on_the_unit(figure, rng) -> None:
    reference, a = rng.random((5, 6, 3), np.float32), rng.random((5, 6, 3), np.float32)
    assert figure(a * np.float32(1024), reference * np.float32(1024)) == pytest.approx(figure(a, reference))
    assert figure(reference, reference) == 0.0
    assert figure(np.zeros(4), np.zeros(4)) == 0.0
    assert figure(np.ones(4), np.zeros(4)) == math.inf
    assert math.isnan(figure(np.array([math.nan, 1.0]), np.ones(2)))
    assert math.isnan(figure(np.array([math.nan, 1.0]), np.zeros(2)))
    with pytest.raises(InputError, match="shapes"):
        figure(np.ones(3), np.ones(4))
    with pytest.raises(InputError, match="nothing to compare"):
        figure(np.ones(0), np.ones(0))
