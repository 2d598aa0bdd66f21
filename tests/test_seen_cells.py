"""What glossy vertices see through windows, and how the reference looks for them; against form factors."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases.cube_map import solid_angles, texel_directions
from prelight.lighting.environment import Environment
from prelight.rays.mitsuba import Occluders, triangle_scene
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.scene.variant import mitsuba
from prelight.transport import seen_cells
from prelight.transport.eye import vertex_points
from prelight.transport.opening_emitter import opening_emitter
from prelight.transport.path_tracing import path_traced_view
from prelight.transport.seen_cells import CELLS, Glazing, Seen, seen_from

from .portal_rooms import skylight_form_factor, wall_with_hole
from .rooms import rectangle, scene_of_rectangles

# Its sides lie a little beyond the middles of quarters: all of those would count.
LOW, HIGH, HEIGHT = (-0.3145, -0.2583), (0.3708, 0.4270), 0.9
HOLE = tuple(((x + 8) / 16, (z + 8) / 16) for x, z in (LOW, HIGH))
_FLAT = 0.3
UP = np.float32([0, 1, 0])


def under_a_hole() -> tuple[Scene, np.ndarray]:
    """A screen with a hole along the axes, and places below it that see it nearly alike."""
    screen = wall_with_hole((-8, HEIGHT, -8), (16, 0, 0), (0, 0, 16), hole=HOLE, cells=2)
    line = np.linspace(-0.001, 0.001, 12)
    x, z = (a.ravel() for a in np.meshgrid(line, line))
    return scene_of_rectangles(*screen), np.stack([x, 0 * x, z], axis=1).astype(np.float32)


def glazed(scene: Scene, places: np.ndarray, glazing: Glazing | None = None) -> Seen:
    occluders = Occluders(scene.positions, scene.triangles)
    return seen_from(occluders, scene, origins=places, normals=np.tile(UP, (len(places), 1)), glazing=glazing)


def of_sky(seen: Seen, places: int) -> np.ndarray:
    """(rows,) irradiance / π of an even sky, from the cells, those that see it beyond the screen's end left out."""
    d = texel_directions(np.arange(6 * CELLS**2, dtype=np.int32), CELLS)
    omega = np.tile(solid_angles(CELLS).ravel(), 6)
    row = np.repeat(np.arange(places), seen.counts)
    cosine = d[seen.texels] @ UP
    share = (seen.codes >> 28) / 4 * omega[seen.texels] * np.where(cosine > _FLAT, cosine, 0) / np.pi
    return np.bincount(row, share, minlength=places)


def window_error() -> float:
    scene, places = under_a_hole()
    known = skylight_form_factor(places[:, [0, 2]].astype(np.float64), LOW, HIGH, HEIGHT).mean()
    return abs(float(of_sky(glazed(scene, places), len(places)).mean()) / known - 1)


def test_a_window_along_the_axes_is_as_large_as_it_is():
    assert window_error() < 0.01


def test_rays_through_the_middles_of_quarters_are_found_out(monkeypatch):
    honest = seen_cells.quarters

    def middles(cells):
        corner, sides = honest(cells)
        face = np.repeat(np.arange(6), len(corner) // 6)
        return corner + 0.5 * sides[face].sum(axis=1), 0 * sides

    monkeypatch.setattr(seen_cells, "quarters", middles)
    assert window_error() > 0.05


def test_what_is_seen_does_not_depend_on_how_many_look(monkeypatch):
    scene, places = under_a_hole()
    whole = glazed(scene, places)
    monkeypatch.setattr(seen_cells, "_LANES", seen_cells._QUARTERS * 7)
    parts = glazed(scene, places)
    np.testing.assert_array_equal(whole.texels, parts.texels)
    np.testing.assert_array_equal(whole.codes >> 25, parts.codes >> 25)


def test_the_sky_is_seen_through_its_pane_and_through_nothing_else():
    scene, places = under_a_hole()
    corner = np.array((LOW[0], HEIGHT + 0.01, LOW[1]))
    size = np.array((HIGH[0] - LOW[0], 0, HIGH[1] - LOW[1]))
    middle = corner[0] + size[0] / 2
    begin, wide = corner - (0.1, 0, 0.1), (middle - corner[0] + 0.1, 0, 0)
    panes = [
        rectangle(begin + np.array((0, up, 0)), wide, (0, 0, 2), cells=1) for up in (0.0, 0.02)
    ]  # the upper one counts
    panes.append(rectangle((middle, corner[1], corner[2] - 0.1), (2, 0, 0), (0, 0, 2), cells=1))
    positions = np.concatenate([p for p, _, _ in panes]).astype(np.float32)
    triangles = np.concatenate([t + 4 * k for k, (_, _, t) in enumerate(panes)]).astype(np.int32)
    glass = Glazing(triangle_scene(positions, triangles)[1], np.repeat([0, 1, 2], 2).astype(np.int32), 4)
    seen = glazed(scene, places[:1], glass)
    assert seen.panes is not None
    sky = (seen.codes >> 28) > 0
    x = texel_directions(seen.texels.astype(np.int32), CELLS)[:, 0]
    assert set(seen.panes[sky & (x < -0.1)]) == {1}
    assert set(seen.panes[sky & (x > 0.15)]) == {2}
    none = glazed(scene, places[:1], Glazing(triangle_scene(positions + 50, triangles)[1], glass.pane_of))
    assert not (none.codes >> 28).any()


def test_the_reference_finds_the_same_light_sooner_when_it_knows_the_window():
    scene, _ = under_a_hole()
    floor = rectangle((-1, 0, -1), (0, 0, 2), (2, 0, 0), cells=2)
    screen = wall_with_hole((-8, HEIGHT, -8), (16, 0, 0), (0, 0, 16), hole=HOLE, cells=2)
    scene = scene_of_rectangles(floor, *screen)
    cube = Environment.stock("overcast").cube(16)
    rows = np.arange(9, dtype=np.int32)
    window = [[LOW[0], HEIGHT, LOW[1]], [HIGH[0] - LOW[0], 0, 0], [0, 0, HIGH[1] - LOW[1]]]
    surfaces, points = SurfaceScene(scene), vertex_points(scene, (0.0, 0.5, 0.0))
    (a, noise_a), (b, noise_b) = (
        path_traced_view(surfaces, points, cube=cube, receivers=rows, bounces=None, samples=4096, openings=o)
        for o in (None, np.array([window]))
    )
    assert noise_b.mean() < 0.5 * noise_a.mean()
    assert abs((a - b).mean()) < 4 * np.sqrt((noise_a + noise_b).sum()) / a.size
    assert b.mean() == pytest.approx(a.mean(), rel=0.05)


@pytest.mark.parametrize("windows", [1, 3])
@pytest.mark.parametrize("height", [0.5 * HEIGHT, HEIGHT], ids=["below the window", "on its rim"])
def test_looking_for_windows_finds_no_more_light_than_there_is(height, windows):
    import drjit as dr

    mi = mitsuba()
    window = [[LOW[0], HEIGHT, LOW[1]], [HIGH[0] - LOW[0], 0, 0], [0, 0, HIGH[1] - LOW[1]]]
    wall = [[9.0, 0.2, 0.0], [0, 2.0, 0], [0, 0, 3.0]]
    openings = np.array([window, wall, np.add(wall, [[0.0, 0.5, 4.0], [0, 0, 0], [0, 0, 0]])][:windows])
    even = np.ones((6, 4, 4, 3), np.float32)
    scene = mi.load_dict({"type": "scene", "sky": opening_emitter(mi, even, openings)})
    sampler, count = mi.load_dict({"type": "independent"}), 1 << 16
    sampler.seed(1, count)
    here = dr.zeros(mi.SurfaceInteraction3f, count)
    here.p = mi.Point3f(mi.Float(np.full(count, LOW[0], np.float32)), height, LOW[1])
    _, found = scene.sample_emitter_direction(here, sampler.next_2d(), False)
    assert np.array(found.x).mean() == pytest.approx(4 * np.pi, rel=0.03)  # ∫ 1 dω
