"""Pictures: shown for what matters in them, saved whole, refused clearly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.drawing.picture import Picture
from prelight.errors import InputError, OutputError
from prelight.images.formats import read_radiance_map


def ball_before_a_sky(sky: float, *, size: int = 64) -> Picture:
    """A disc of radiance 0.2 before a sky, its edge a pixel wide."""
    y, x = np.indices((size, size)) + 0.5
    coverage = np.clip(size / 3 - np.hypot(x - size / 2, y - size / 2), 0, 1).astype(np.float32)
    background = np.full((size, size, 3), sky, np.float32)
    linear = 0.2 * coverage[..., None] + (1 - coverage[..., None]) * background
    return Picture(linear.astype(np.float32), coverage, background)


def pixels_of(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def test_exposure_suits_the_object_whatever_is_behind_it() -> None:
    dim, bright = ball_before_a_sky(0.01), ball_before_a_sky(500.0)
    assert dim.stops() == pytest.approx(bright.stops(), abs=0.3)
    assert Picture(bright.linear).stops() < dim.stops() - 3  # without coverage the sky would decide
    middle = bright.display()[32, 32]
    assert (middle > 100).all()
    assert (middle < 190).all()


def test_exposure_without_an_object_is_the_sky_s() -> None:
    sky = Picture(np.full((4, 4, 3), 3.0, np.float32), np.zeros((4, 4), np.float32))
    assert sky.stops() == pytest.approx(Picture(sky.linear).stops())


def test_a_stop_is_a_factor_of_two() -> None:
    picture = ball_before_a_sky(0.1)
    brighter = Picture(2 * picture.linear, picture.coverage, 2 * picture.background)
    assert np.array_equal(picture.display(exposure=1.0), brighter.display(exposure=0))
    assert np.array_equal(picture.display(exposure="1.0"), picture.display(exposure=1))
    assert picture.display(exposure=5000.0, curve="linear").min() == 255


def test_edges_before_a_sun_stay_smooth() -> None:
    """Half covered must look about half way; the mean of linear radiance would be white."""
    picture = ball_before_a_sky(500.0)
    half = np.abs(picture.coverage - 0.5) < 0.1
    shown = picture.display(exposure=0.0, curve="linear")
    assert half.sum() > 10
    assert shown[half].max() == 255  # twice display white behind: 0.5 · 2 + 0.5 · 0.2
    most = picture.coverage > 0.8
    edge = most & (picture.coverage < 1)
    assert shown[edge].max() < 205  # 0.2 · 2 + 0.8 · 0.2 = 0.56 as sRGB is 196
    assert picture.linear[edge].min() > 1  # what is saved keeps the light
    assert np.array_equal(shown[picture.coverage == 0], np.full_like(shown[picture.coverage == 0], 255))


def test_dim_skies_are_left_alone() -> None:
    picture = ball_before_a_sky(0.5)
    plain = Picture(picture.linear, picture.coverage)
    assert np.array_equal(picture.display(exposure=0.0), plain.display(exposure=0.0))


@pytest.mark.parametrize("exposure", ["bright", float("nan"), float("inf"), None])
def test_an_exposure_must_be_auto_or_a_number(exposure: object) -> None:
    with pytest.raises(InputError, match=r'^exposure: .*expected "auto"'):
        ball_before_a_sky(1.0).display(exposure=exposure)
    with pytest.raises(InputError, match=r"^curve"):
        ball_before_a_sky(1.0).display(curve="magic")


def test_each_extension_keeps_its_promise(tmp_path: Path) -> None:
    picture = ball_before_a_sky(40.0)
    for name in ("a.exr", "a.npy", "a.png", "B.PNG"):
        picture.save(tmp_path / name)
    assert np.array_equal(np.load(tmp_path / "a.npy"), picture.linear)
    assert np.allclose(read_radiance_map(tmp_path / "a.exr"), picture.linear, rtol=1e-3)
    for name in ("a.png", "B.PNG"):
        assert np.array_equal(pixels_of(tmp_path / name), picture.display())
    picture.save(str(tmp_path / "c.png"), exposure=-3, curve="linear")
    assert np.array_equal(pixels_of(tmp_path / "c.png"), picture.display(exposure=-3, curve="linear"))


def test_other_extensions_and_existing_files_are_refused(tmp_path: Path) -> None:
    picture = ball_before_a_sky(1.0)
    for name in ("a.jpg", "picture"):
        with pytest.raises(InputError, match=r"\.exr .*\.png .*\.npy"):
            picture.save(tmp_path / name)
    path = tmp_path / "a.png"
    path.write_bytes(b"mine")
    with pytest.raises(OutputError, match="already exists"):
        picture.save(path)
    assert path.read_bytes() == b"mine"
    picture.save(path, force=True)
    with Image.open(path) as image:
        assert image.size == (64, 64)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_show_opens_what_display_returns(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = []
    monkeypatch.setattr(Image.Image, "show", lambda image: shown.append(np.asarray(image)))
    picture = ball_before_a_sky(1.0)
    picture.show(exposure=1)
    assert np.array_equal(shown[0], picture.display(exposure=1))
