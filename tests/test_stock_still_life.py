"""The still life and the Cornell box: closed bodies, true normals, nothing inside another, no leak of light."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.images.tonemap import srgb_decode
from prelight.scene.normals import vertex_normals
from prelight.scene.stock import cornell as box
from prelight.scene.stock import still_life as table
from prelight.scene.stock.catalogue import stock_scene
from prelight.scene.stock.cloth import Napkin
from prelight.scene.stock.floor_plots import Plot, floor_around
from prelight.scene.stock.parts import Part
from prelight.scene.stock.patterns import glazed, oak
from prelight.scene.stock.plinth import slab
from prelight.scene.stock.revolved import Profile
from prelight.transport.visibility import ray_offset

from .test_stock import is_closed, volume, winding_numbers

pytestmark = pytest.mark.filterwarnings("error")
DETAIL = 0.38


@pytest.fixture(scope="module")
def bodies() -> list[tuple[Part, str]]:
    """All that is closed and stands on the table."""
    found = [*table._vessels(DETAIL), *table._fruit(DETAIL), *table._metal(DETAIL)]
    return [(part, of.name) for part, of in found]


def test_bodies_are_closed(bodies: list[tuple[Part, str]]) -> None:
    for part, name in bodies:
        assert is_closed(part), name
        assert volume(part) > 0, name
    assert is_closed(slab(half=(0.7, 0.3), height=0.05, chamfer=0.005, gap=0.0, cells=(6, 4, 2)))


def test_no_ray_begins_inside_another_body(bodies: list[tuple[Part, str]], rng: np.random.Generator) -> None:
    scene = stock_scene("still-life")
    offset = ray_offset(scene.positions)
    for part, name in bodies:
        for other, what in bodies:
            low, high = part.positions.min(axis=0) - 0.01, part.positions.max(axis=0) + 0.01
            starts = other.positions + 1.3 * offset * other.normals
            near = np.flatnonzero(((starts > low) & (starts < high)).all(axis=1))
            if other is not part and len(near):
                some = rng.choice(near, min(40, len(near)), replace=False)
                assert np.abs(winding_numbers(part, starts[some])).max() < 0.2, (what, name)
        assert part.positions[:, 1].min() - table.TABLE > 1.3 * offset


def test_the_napkin_stays_above_the_table(rng: np.random.Generator) -> None:
    napkin = Napkin(side=0.33, turn_deg=36.0, ahead=0.05).part(60)
    _, y, z = napkin.positions.T
    on, before = z < 0, z >= 0
    assert y[on].min() > 0.001
    depth = np.maximum(-y[before], 0)
    assert (z[before] > np.where(depth > 0.011, 0.010, 0.0)).all()
    found = vertex_normals(napkin.positions.astype(np.float32), napkin.triangles)
    assert (found * napkin.normals).sum(axis=1).min() > 0.97


def test_a_profile_makes_the_sphere_it_should() -> None:
    ball = Profile(table._half_circle(0.5)).part(along=80, around=64)
    out = np.linalg.norm(ball.positions, axis=1)
    assert np.abs(out - 0.5).max() < 0.002
    assert ((ball.normals * ball.positions).sum(axis=1) / out).min() > 0.999
    assert volume(ball) == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=0.01)


def test_a_texture_runs_once_around_and_along() -> None:
    bowl = table.BOWL.part(along=20, around=12, textured=True)
    assert bowl.uv is not None
    assert is_closed(bowl)
    ring = bowl.positions[:-2].reshape(20, 13, 3)
    assert np.allclose(ring[:, 0], ring[:, -1])
    u, v = np.moveaxis(bowl.uv[:-2].reshape(20, 13, 2), -1, 0)
    assert np.allclose(u, np.arange(13) / 12)
    assert (np.diff(v[:, 0]) < 0).all()
    assert (v[0, 0], v[-1, 0]) == (1, 0)
    seen = bowl.positions[:-2].reshape(20, 13, 3)[10]
    turning = np.cross(seen[0], seen[1])[1]
    assert turning > 0  # counter-clockwise from above: u runs to the right for one who looks at the outside


def test_textured_vertices_have_the_texture_s_colour() -> None:
    scene = stock_scene("still-life-small")
    assert scene.uv is not None
    assert scene.tint is not None
    names = [m.name for m in scene.materials]
    for name, texture in (("glaze", glazed()), ("oak", oak())):
        here = scene.material_of_vertex == names.index(name)
        height, width = texture.shape[:2]
        u, v = (scene.uv[here] % 1 * (width, height)).astype(int).T
        texel = srgb_decode(texture[v.clip(0, height - 1), u.clip(0, width - 1)])
        assert np.abs(scene.albedo[here] - texel).mean() < 0.03
        assert (scene.tint[here] == 1).all()
    plain = scene.material_of_vertex == names.index("linen")
    assert np.array_equal(scene.albedo[plain], scene.tint[plain])


def test_patterns_repeat_around() -> None:
    for texture in (glazed(), oak()):
        values = srgb_decode(texture)
        across = np.abs(np.diff(values, axis=1)).mean()
        assert np.abs(values[:, 0] - values[:, -1]).mean() < 2 * across + 1e-3


def test_gloss_is_never_too_narrow() -> None:
    scene = stock_scene("still-life-small")
    glossy = [m for m in scene.materials if not m.is_lambertian]
    assert len(glossy) >= 6
    assert min(m.roughness for m in glossy) >= 0.15
    assert all(m.clearcoat_roughness >= 0.15 for m in glossy if m.clearcoat)


def meets(origin: np.ndarray, d: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Whether each ray meets any triangle (Möller and Trumbore 1997)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    found = np.zeros(len(origin), bool)
    for n, (o, w) in enumerate(zip(origin, d, strict=True)):
        h = np.cross(w, c - a)
        det = np.einsum("ij,ij->i", b - a, h)
        det = np.where(np.abs(det) < 1e-14, np.inf, det)
        u = np.einsum("ij,ij->i", o - a, h) / det
        q = np.cross(o - a, b - a)
        v, t = q @ w / det, np.einsum("ij,ij->i", c - a, q) / det
        found[n] = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).any()
    return found


def test_no_light_comes_into_the_box_but_through_its_front(rng: np.random.Generator) -> None:
    """Rays from receivers within the room that leave away from the opening all meet the box."""
    scene = stock_scene("cornell-small")
    inside = (np.abs(scene.positions[:, [0, 2]]).max(axis=1) <= box.HALF) & (scene.positions[:, 1] > 0.01)
    room = np.isin(scene.material_of_vertex, [0, 1, 2]) & inside
    starts = scene.positions[room] + ray_offset(scene.positions) * scene.normals[room]
    chosen = starts[rng.choice(len(starts), 400)]
    d = rng.normal(size=(400, 3))
    d[:, 2] = -np.abs(d[:, 2])
    assert meets(chosen, d, scene.positions[scene.triangles].astype(float)).all()


def test_receivers_of_the_room_see_the_room_only() -> None:
    """Of each wall the visible vertices stand off the next wall; the others are within its thickness."""
    scene = stock_scene("cornell")
    offset = ray_offset(scene.positions)
    middle = np.array([0, box.GAP + box.WALL + box.HALF, 0])
    for material in (0, 1, 2):
        corners = np.unique(scene.triangles[scene.material_of == material])
        beyond = np.abs(scene.positions[corners] - middle)[:, :2].max(axis=1) - box.HALF
        touching = np.abs(beyond) < 1.3 * offset
        flat = np.abs(scene.normals[corners][:, :2]).max(axis=1) > 0.99
        own = flat & touching  # a wall's vertices lie in its own plane
        across = np.sort(np.abs(scene.positions[corners] - middle)[:, :2], axis=1)[:, 0] - box.HALF
        assert not (own & (np.abs(across) < 1.3 * offset)).any()
    for material in (1, 2):  # each side wall goes on behind its neighbours, and to the front
        wall = scene.positions[np.unique(scene.triangles[scene.material_of == material])] - middle
        reach = box.HALF + box.GAP
        assert wall.min(axis=0)[1:] == pytest.approx([-reach, -reach], abs=1e-6)
        assert wall.max(axis=0)[1:] == pytest.approx([reach, box.OUTER], abs=1e-6)


@pytest.mark.parametrize("spacing", [0.025, 0.06])
def test_the_room_s_floor_is_whole_and_flat(spacing: float) -> None:
    """Its triangles add up to the room's floor and the strips under the walls, none turned over."""
    floor = box._floor(spacing=spacing)
    a, b, c = (floor.positions[floor.triangles[:, k]] for k in range(3))
    up = np.cross(b - a, c - a)[:, 1] / 2
    assert up.min() > 0
    width = 2 * (box.HALF + box.GAP)
    assert up.sum() == pytest.approx(width * (box.OUTER + box.HALF + box.GAP), rel=1e-9)
    assert np.array_equal(np.unique(floor.triangles), np.arange(len(floor.positions)))


def test_no_triangle_of_the_room_bleeds_from_under_a_block() -> None:
    floor = box._floor(spacing=0.026)
    for (x, z), turn in ((box.TALL_AT, box.TALL_TURN_DEG), (box.SHORT_AT, box.SHORT_TURN_DEG)):
        foot = Part(floor.positions - (x, 0, z), floor.normals, floor.triangles).turned(-turn)
        beyond = np.abs(foot.positions[:, [0, 2]]).max(axis=1) - box.BLOCK  # metres outside its walls
        corners = beyond[floor.triangles]
        crossing = (corners.min(axis=1) < -1e-9) & (corners.max(axis=1) > 1e-9)
        dark = crossing & (corners.min(axis=1) < -0.001)
        assert dark.any()
        assert corners[dark].max() < 0.0031


def test_a_plot_is_cut_in_two() -> None:
    square = Plot(np.array([(0.0, 0), (2, 0), (2, 2), (0, 2)]), (True, False, True, True))
    upper = square.cut(np.array([0.0, 1.0]), np.array([1.0, 0.0]))
    lower = square.cut(np.array([0.0, 1.0]), np.array([-1.0, 0.0]))
    assert sorted(map(tuple, upper.corners)) == [(0, 1), (0, 2), (2, 1), (2, 2)]
    assert sorted(map(tuple, lower.corners)) == [(0, 0), (0, 1), (2, 0), (2, 1)]
    assert sum(upper.hems) == 2
    assert sum(lower.hems) == 2
    part = floor_around(upper, middle=(1.0, -1.5), half_width=0.2, turn_deg=10, spacing=0.1, hem=0.01)
    a, b, c = (part.positions[part.triangles[:, k]] for k in range(3))
    # A strip above, one on the left: the right side is open, and so is the cut.
    assert (np.cross(b - a, c - a)[:, 1] / 2).sum() == pytest.approx(2.01 * 1.01, rel=1e-9)
