"""Pictures whose pixels are receivers."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.drawing.pixels import pixel_picture
from prelight.drawing.view import View
from prelight.errors import InputError

EYE = Camera(eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), vertical_fov_deg=60.0)


def test_rows_are_pixels_from_the_top() -> None:
    radiance = np.arange(18, dtype=np.float32).reshape(6, 3)
    picture = pixel_picture(radiance, np.ones((2, 3)))
    assert np.array_equal(picture.linear, radiance.reshape(2, 3, 3))
    assert picture.background is None
    assert picture.linear[1, 0].tolist() == [9, 10, 11]


def test_what_is_behind_comes_in_where_nothing_is_seen() -> None:
    coverage = np.array([[1.0, 0.25], [0.0, 0.5]])
    radiance = np.repeat(coverage.reshape(-1, 1), 3, axis=1)  # white where seen
    picture = pixel_picture(radiance, coverage, background=(0.0, 2.0, 4.0))
    assert np.allclose(picture.linear[..., 0], coverage)
    assert np.allclose(picture.linear[..., 1], coverage + (1 - coverage) * 2)
    assert np.allclose(picture.background, (0, 2, 4))


def test_it_looks_behind_as_a_view_does() -> None:
    """A view whose vertices are black, and its own coverage handed on, show the same sky."""
    mesh = np.array([(-1, -1, 0), (1, -1, 0), (0, 1.5, 0)], np.float32), np.array([[0, 1, 2]], np.int32)
    view = View(*mesh, camera=EYE, width=31, height=17)
    expected = view.draw(np.zeros((3, 3)), background=lambda d: d + 1)
    black = np.zeros((31 * 17, 3))
    found = pixel_picture(black, view.coverage, camera=EYE, background=lambda d: d + 1)
    assert np.array_equal(found.linear, expected.linear)
    assert np.array_equal(found.background, expected.background)


def test_enlarging_repeats_pixels() -> None:
    radiance = np.arange(12, dtype=np.float32).reshape(4, 3)
    picture = pixel_picture(radiance, np.ones((2, 2)), background=(0, 0, 0), enlarge=3)
    assert picture.linear.shape == picture.background.shape == (6, 6, 3)
    assert picture.coverage.shape == (6, 6)
    assert (picture.linear[3:, :3] == radiance[2]).all()


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"radiance": np.zeros((5, 3))}, "radiance"),
        ({"radiance": np.full((4, 3), np.nan)}, "radiance"),
        ({"coverage": np.full((2, 2), 1.5)}, "coverage"),
        ({"coverage": np.zeros(4)}, "coverage"),
        ({"enlarge": 0}, "enlarge"),
        ({"enlarge": 1.5}, "enlarge"),
        ({"background": lambda d: d}, "camera"),
        ({"background": "sky"}, "background"),
    ],
)
def test_what_does_not_fit_is_refused(options: dict, what: str) -> None:
    given = {"radiance": np.zeros((4, 3)), "coverage": np.zeros((2, 2)), **options}
    with pytest.raises(InputError, match=f"^{what}"):
        pixel_picture(given.pop("radiance"), given.pop("coverage"), **given)
