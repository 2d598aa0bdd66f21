"""Lamplight that falls out of a room, against closed forms and the rows themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.encoding.pulse_or_haar import encoded
from prelight.errors import InputError
from prelight.lighting.glass import Glass
from prelight.relighting.light_sent_out import areas_around, sent_out, transposed

from .portal_rooms import SIZE, portals_of, under_glass


def test_the_transpose_is_that_of_the_rows() -> None:
    rng = np.random.default_rng(2)
    lengths = np.where(
        np.arange(40) % 2, 384, rng.integers(5, 60, 40)
    )  # few cells: pulses; all of them: Haar
    starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    inside = np.arange(starts[-1]) - np.repeat(starts[:-1], lengths)
    weights = np.where(
        np.repeat(lengths, lengths) == 384, 1.0 + (inside // 64), rng.uniform(0.4, 1, starts[-1])
    )
    rows, kept, _ = encoded(starts, inside.astype(np.int32), weights.astype(np.float32), 8)
    assert len(np.unique(rows.kind)) == 2
    values = rng.standard_normal((len(kept), 2))
    assert transposed(rows, values) == pytest.approx(
        rows.dense(np.arange(len(kept))).T @ values, rel=1e-4, abs=1e-5
    )


def test_a_room_of_even_radiance_sends_as_its_window_would(tmp_path: Path) -> None:
    """Wherever one looks in, there is radiance 1: the window shines as a Lambertian panel, A·cos θ."""
    scene = under_glass(cells=10, tint=(1.0, 0.5, 0.25))
    room = portals_of(scene, tmp_path / "room.prelight", bounces=0)
    light = np.ones((len(scene.positions), 3), np.float32)
    areas = areas_around(scene.positions, scene.triangles)
    found = sent_out(room.layer, light, areas)[0]
    n, area = room.layer.cube, SIZE[0] * SIZE[2]
    solid = np.tile(cube_map.solid_angles(n).ravel(), 6)
    total = solid @ found.reshape(-1, 3)
    assert total == pytest.approx(np.pi * area * np.array((1.0, 0.5, 0.25)), rel=0.03)
    d = cube_map.texel_directions(np.arange(6 * n * n, dtype=np.int32), n)
    for low, high in ((0.9, 1.0), (0.6, 0.8), (0.3, 0.5)):
        ring = (d[:, 1] > low) & (d[:, 1] < high)
        mean = (solid[ring] @ found.reshape(-1, 3)[ring, 0]) / solid[ring].sum()
        assert mean == pytest.approx(area * (solid[ring] @ d[ring, 1]) / solid[ring].sum(), rel=0.06)
    assert not found.reshape(-1, 3)[d[:, 1] < -0.05].any()
    half = sent_out(room.layer, light, areas, [Glass("*", blind=0.5)])[0]
    assert half == pytest.approx(0.5 * found)
    with pytest.raises(InputError, match=r"^radiance"):
        sent_out(room.layer, light[:5], areas)
