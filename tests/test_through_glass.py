"""Looking through panes: what is behind them in full, times what the glass lets through."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.drawing.view import View
from prelight.relighting.through_glass import Panes

EYE = Camera(eye=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), vertical_fov_deg=40.0)
SIZE = 48


def square(z: float, half: float, x: float = 0.0) -> np.ndarray:
    return np.array(
        [(x - half, -half, z), (x + half, -half, z), (x + half, half, z), (x - half, half, z)], np.float32
    )


def looked(panes_clear: tuple[bool, bool]) -> np.ndarray:
    """A white card behind a red pane at the left, a grey card before a blue pane at the right, sky of 2 around."""
    positions = np.concatenate(
        [square(0.0, 0.3, -0.5), square(1.0, 0.4, -0.38), square(0.0, 0.5, 0.6), square(1.0, 0.1, 0.45)]
    )
    triangles = np.concatenate([4 * k + np.array([(0, 1, 2), (0, 2, 3)]) for k in range(4)]).astype(np.int32)
    radiance = np.repeat([(1.0, 1, 1), (9, 9, 9), (9, 9, 9), (0.5, 0.5, 0.5)], 4, axis=0).astype(np.float32)
    factors = np.repeat([(0.8, 0.1, 0.05), (0.1, 0.2, 0.9)], 4, axis=0).astype(np.float32)
    panes = Panes(np.arange(4, 12, dtype=np.int32), factors, np.repeat(panes_clear, 4))
    left = panes.are_left(triangles)
    assert left.tolist() == [True] * 2 + [False] * 4 + [True] * 2
    open_ = View(positions, triangles[left], camera=EYE, width=SIZE, height=SIZE).draw(
        radiance, background=(2.0, 2, 2)
    )
    whole = View(positions, triangles, camera=EYE, width=SIZE, height=SIZE)
    assert panes.without_clear(radiance)[4:12].any(axis=1).tolist() == [
        not c for c in np.repeat(panes_clear, 4)
    ]
    return panes.before(open_, whole, len(positions)).linear


def at(picture: np.ndarray, x: float, y: float, z: float) -> np.ndarray:
    focal = SIZE / (2 * np.tan(np.radians(20)))
    return picture[round(SIZE / 2 - y / (4 - z) * focal - 0.5), round(SIZE / 2 + x / (4 - z) * focal - 0.5)]


def test_what_is_behind_is_filtered_and_what_is_in_front_is_not() -> None:
    picture = looked((True, True))
    assert at(picture, -0.38, 0.0, 1.0) == pytest.approx((0.8, 0.1, 0.05))  # the white card through red glass
    assert at(picture, -0.38, 0.35, 1.0) == pytest.approx((1.6, 0.2, 0.1))  # the sky through it
    assert at(picture, 0.9, 0.3, 0.0) == pytest.approx((0.2, 0.4, 1.8))
    assert at(picture, 0.45, 0.0, 1.0) == pytest.approx((0.5, 0.5, 0.5))  # the card before the blue pane
    assert at(picture, 0.0, 1.2, 0.0) == pytest.approx((2.0, 2.0, 2.0))


def test_frosted_panes_let_nothing_be_seen() -> None:
    picture = looked((False, True))
    assert at(picture, -0.38, 0.0, 1.0) == pytest.approx(0.0, abs=1e-6)  # their own shine is added elsewhere
    assert at(picture, 0.9, 0.3, 0.0) == pytest.approx((0.2, 0.4, 1.8))
