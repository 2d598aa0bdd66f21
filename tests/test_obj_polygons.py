"""Polygons cut into triangles: covered once, whatever their shape."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prelight.scene.obj.polygons import triangles_of


@st.composite
def stars(draw: st.DrawFn) -> np.ndarray:
    """Simple polygons about a point, most of them concave, somewhere in space."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    size = draw(st.integers(4, 24))
    angles = (np.arange(size) + rng.uniform(0, 0.9, size)) * 2 * math.pi / size
    flat = rng.uniform(0.1, 1, size)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    return flat @ axes * rng.uniform(1e-3, 1e3) + rng.normal(size=3) * 5


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


@given(st.lists(stars(), min_size=1, max_size=4))
def test_polygons_are_covered_once(polygons: list[np.ndarray]) -> None:
    """Triangles wound as the polygon whose areas add up to its own can neither overlap nor stick out."""
    notes: list[str] = []
    corners = np.concatenate(polygons)
    sizes = np.array([len(polygon) for polygon in polygons])
    triangles, of = triangles_of(corners, sizes, notes)
    assert notes == []
    np.testing.assert_array_equal(of, np.repeat(np.arange(len(sizes)), sizes - 2))
    for k, polygon in enumerate(polygons):
        own = areas(corners, triangles[of == k])
        whole = np.cross(polygon, np.roll(polygon, -1, axis=0)).sum(axis=0) / 2
        normal = whole / np.linalg.norm(whole)
        assert (own @ normal > -1e-9 * np.linalg.norm(whole)).all()
        assert np.linalg.norm(own, axis=1).sum() == pytest.approx(np.linalg.norm(whole), rel=1e-7)


def test_straight_corners_and_doubled_places_are_part_of_the_surface() -> None:
    """A corner in the middle of an edge gets a triangle with an area; so does a hole joined by a slit."""
    straight = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], float)
    triangles, _ = triangles_of(straight, np.array([5]), [])
    assert (areas(straight, triangles)[:, 2] > 0).all()
    frame = np.array([(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)], float)
    points = np.pad(frame, [(0, 0), (0, 1)])
    triangles, _ = triangles_of(points, np.array([10]), [])
    found = areas(points, triangles)[:, 2]
    assert found.sum() == pytest.approx(8)
    assert np.abs(found).sum() == pytest.approx(8)


def test_concave_polygons_beyond_the_limits_are_fans_and_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("prelight.scene.obj.polygons._MOST_TESTS", 45)
    arrow = np.array([(2, 2, 0), (0, 1, 0), (-2, 2, 0), (0, 0, 0)] * 3, float)
    notes: list[str] = []
    triangles, _ = triangles_of(arrow, np.array([4, 4, 4]), notes)
    assert notes == ["concave faces too many or too large to cut well, cut as fans: 1"]
    assert np.abs(areas(arrow, triangles)[:, 2]).sum() == pytest.approx(2 + 2 + 6)
