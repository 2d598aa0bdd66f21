"""Stock scenes: sound geometry, no way for light to leak, the promised size."""

from __future__ import annotations

import re

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.normals import vertex_normals, zero_area
from prelight.scene.stock import room as rooms
from prelight.scene.stock import sculpture as made_here
from prelight.scene.stock.catalogue import STOCK_SCENES, stock_scene
from prelight.scene.stock.ground import ground
from prelight.scene.stock.parts import Part, split_quads
from prelight.scene.stock.plinth import plinth
from prelight.scene.stock.sculpture import sculpture, winding_band
from prelight.transport.visibility import ray_offset

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(scope="module", params=["sculpture", "sculpture-small"])
def statue(request: pytest.FixtureRequest) -> Scene:
    return stock_scene(request.param)


@pytest.fixture(scope="module", params=[name for name in STOCK_SCENES if name != "environment"])
def scene(request: pytest.FixtureRequest) -> Scene:
    return stock_scene(request.param)


def volume(part: Part) -> float:
    a, b, c = (part.positions[part.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def welded(part: Part) -> np.ndarray:
    """Triangles by place: vertices that coincide become one."""
    _, place = np.unique(part.positions.round(9), axis=0, return_inverse=True)
    return place.reshape(-1)[part.triangles]


def edges(triangles: np.ndarray) -> np.ndarray:
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def is_closed(part: Part) -> bool:
    """Every directed edge is there once, and once the other way."""
    found = edges(welded(part))
    once = len(np.unique(found, axis=0)) == len(found)
    return once and np.array_equal(np.unique(found, axis=0), np.unique(found[:, ::-1], axis=0))


def winding_numbers(part: Part, points: np.ndarray) -> np.ndarray:
    """How often the surface encloses each point (Van Oosterom and Strackee 1983)."""
    out = np.empty(len(points))
    corners = part.positions[part.triangles]
    for n, point in enumerate(points):
        a, b, c = np.moveaxis(corners - point, 1, 0)
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        triple = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
        out[n] = np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb).sum() / (2 * np.pi)
    return out


def test_arrays_are_sound(scene: Scene) -> None:
    n = len(scene.positions)
    assert scene.positions.dtype == scene.normals.dtype == scene.albedo.dtype == np.float32
    assert scene.triangles.dtype == np.int32
    assert scene.positions.shape == scene.normals.shape == scene.albedo.shape == (n, 3)
    assert np.isfinite(scene.positions).all()
    assert np.abs(np.linalg.norm(scene.normals, axis=1) - 1).max() < 1e-6
    matte = np.array([material.transmission == 0 for material in scene.materials])[scene.material_of_vertex]
    assert scene.albedo[matte].min() >= 0.01
    assert scene.albedo[matte].max() <= 0.86
    assert np.array_equal(np.unique(scene.triangles), np.arange(n))
    assert not zero_area(scene.positions, scene.triangles).any()


def test_normals_agree_with_the_triangles(scene: Scene) -> None:
    found = vertex_normals(scene.positions, scene.triangles)
    coarse = scene.name in ("still-life-small", "room-small", "car", "car-small", "town")
    least = 0.7 if scene.name == "steerable-small" else 0.85 if coarse else 0.97  # necks of chessmen
    assert (found * scene.normals).sum(axis=1).min() > least
    a, b, c = (scene.positions[scene.triangles[:, k]].astype(float) for k in range(3))
    facing = np.einsum("ij,ikj->ik", np.cross(b - a, c - a), scene.normals[scene.triangles])
    assert facing.min() > 0


@pytest.mark.parametrize("name", STOCK_SCENES)
def test_sizes_are_as_the_catalogue_says(name: str) -> None:
    scene = stock_scene(name)
    count = len(scene.positions)
    large = 2 if name.startswith(("portals", "chapel", "car", "town")) else 1
    assert count <= large * (5_000 if "small" in name else 30_000)
    assert count >= (3_000 if "small" in name else 15_000)
    assert scene.name == {"environment": "sculpture", "cloud": "maze"}.get(name, name)
    said = re.search(r"[\d,]+ receivers", STOCK_SCENES[name].title)
    assert said is None or said[0] == f"{count:,} receivers"
    assert list(scene.cameras) == ["front", "close"]


def test_a_scene_is_the_same_every_time() -> None:
    assert stock_scene("sculpture").digest == stock_scene("sculpture").digest
    assert stock_scene("environment").digest == stock_scene("sculpture").digest
    assert stock_scene("sculpture-small").digest != stock_scene("sculpture").digest


def test_an_unknown_name_lists_the_known() -> None:
    with pytest.raises(InputError, match=r"stock:teapot: .*sculpture, cornell, .*environment, .*-small"):
        stock_scene("teapot")
    with pytest.raises(InputError, match=r"^detail: 9"):
        sculpture(detail=9)


def test_the_body_is_closed_and_nowhere_runs_into_itself(rng: np.random.Generator) -> None:
    band = winding_band()
    body = band.part(along=150, around=24)
    assert is_closed(body)
    assert volume(body) > 0
    few = rng.choice(len(body.positions), 120, replace=False)
    near = 4e-3 * body.normals[few]
    assert np.abs(winding_numbers(body, body.positions[few] + near)).max() < 0.1
    assert np.abs(winding_numbers(body, body.positions[few] - near) - 1).max() < 0.1


def test_the_body_s_normals_are_the_surface_s(rng: np.random.Generator) -> None:
    """Against a far finer mesh's, which know nothing of the formula's derivatives."""
    fine = winding_band().part(along=1500, around=160)
    found = vertex_normals(fine.positions.astype(np.float32), fine.triangles)
    assert (found * fine.normals).sum(axis=1).min() > 0.9999


def test_the_plinth_is_a_closed_block_with_flat_faces() -> None:
    h, height, c, gap = 0.25, 0.8, 0.01, 0.005
    block = plinth(half_width=h, height=height, chamfer=c, gap=gap, cells=(6, 5))
    assert is_closed(block)
    octagon = (2 * h) ** 2 - 2 * c**2
    slanted = (
        4 * (h**3 - (h - c) ** 3) / 3 - 2 * c**3 / 3
    )  # squares of half side h − s, corners c − s cut off
    assert volume(block) == pytest.approx(octagon * (height - gap - c) + slanted, rel=1e-12)
    a, b, d = (block.positions[block.triangles[:, k]] for k in range(3))
    flat = np.cross(b - a, d - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.abs(block.normals[block.triangles] - flat[:, None]).max() < 1e-9


@pytest.mark.parametrize("spacing", [0.03, 0.1])
def test_the_floor_is_one_disc_without_holes_or_folds(spacing: float) -> None:
    floor = ground(radius=12.0, half_width=0.24, spacing=spacing)
    a, b, c = (floor.positions[floor.triangles[:, k]] for k in range(3))
    up = np.cross(b - a, c - a)[:, 1] / 2
    assert up.min() > 0
    rim = np.hypot(floor.positions[:, 0], floor.positions[:, 2]) > 12 - 1e-9
    n = rim.sum()
    assert up.sum() == pytest.approx(n / 2 * np.sin(2 * np.pi / n) * 144, rel=1e-9)
    assert np.unique(floor.positions.round(9), axis=0).shape == floor.positions.shape
    found = edges(floor.triangles)
    inside = np.unique(found, axis=0)
    assert len(inside) == len(found)
    border = {tuple(e) for e in found} - {tuple(e) for e in found[:, ::-1]}
    assert len(border) == n
    assert (floor.normals == (0, 1, 0)).all()


@pytest.mark.parametrize("spacing", [0.03, 0.038, 0.1])
def test_the_open_floor_has_no_slivers(spacing: float) -> None:
    floor = ground(radius=12.0, half_width=0.24, spacing=spacing)
    p = floor.positions[floor.triangles]
    side = np.roll(p, -1, axis=1) - p
    side /= np.linalg.norm(side, axis=2, keepdims=True)
    angles = np.degrees(np.arccos(-np.einsum("ijk,ijk->ij", side, np.roll(side, 1, axis=1)).clip(-1, 1)))
    beyond_the_wall = np.abs(p[..., [0, 2]]).max(axis=2).min(axis=1) > 0.2435
    assert angles[beyond_the_wall].min() > 17
    assert angles[beyond_the_wall].max() < 135


def test_quads_are_cut_along_the_shorter_diagonal() -> None:
    positions = np.array([(0, 0, 0), (1, 0, 0), (1.5, 1, 0), (0.5, 1, 0)])
    assert split_quads(positions, np.array([[0, 1, 2, 3]])).tolist() == [[0, 1, 3], [1, 2, 3]]
    assert split_quads(positions, np.array([[1, 2, 3, 0]])).tolist() == [[1, 2, 3], [1, 3, 0]]


def test_no_triangle_of_the_floor_bleeds_the_plinth_s_shadow() -> None:
    floor = ground(radius=12.0, half_width=0.24, spacing=0.03)
    beyond = np.abs(floor.positions[:, [0, 2]]).max(axis=1) - 0.24  # metres outside the wall
    corners = beyond[floor.triangles]
    crossing = (corners.min(axis=1) < 0) & (corners.max(axis=1) > 0)
    assert crossing.any()
    assert corners[crossing].max() < 0.0031


def test_nothing_touches(statue: Scene) -> None:
    """Rays begin a little off the surface; what stands on something must not begin them inside it."""
    terracotta = (statue.albedo == np.float32(made_here.TERRACOTTA)).all(axis=1)
    plaster = (statue.albedo == np.float32(made_here.PLASTER)).all(axis=1)
    offset = ray_offset(statue.positions)
    top = statue.positions[plaster, 1].max()
    assert top == pytest.approx(made_here.PLINTH_HEIGHT)
    assert statue.positions[terracotta, 1].min() - top > 1.3 * offset
    assert statue.positions[plaster, 1].min() > 1.3 * offset
    assert np.ptp(statue.positions[terracotta, 1]) == pytest.approx(made_here.HEIGHT, rel=1e-5)
    foot = statue.positions[terracotta][statue.positions[terracotta, 1].argmin()]
    assert np.hypot(foot[0], foot[2]) < 1e-6


def test_the_front_camera_holds_the_work_and_its_floor(statue: Scene) -> None:
    camera = statue.cameras["front"]
    seen = (statue.positions - camera.eye) @ camera.axes().T
    up = np.tan(np.radians(camera.vertical_fov_deg) / 2)
    with np.errstate(divide="ignore"):
        x, y = seen[:, 0] / -seen[:, 2] / (up * 16 / 9), seen[:, 1] / -seen[:, 2] / up
    work = statue.positions[:, 1] > 0
    assert np.abs(x[work]).max() < 0.5
    assert np.abs(y[work]).max() < 0.95
    rim = np.linalg.norm(statue.positions, axis=1) > made_here.FLOOR_RADIUS - 1e-3
    ahead = rim & (seen[:, 2] < 0)
    assert x[ahead].min() < -1
    assert x[ahead].max() > 1
    assert y[ahead & (np.abs(x) < 1)].max() < 0.35  # the far edge: sky above it


@pytest.mark.parametrize("name", ["room", "room-small"])
def test_light_comes_into_the_room_by_its_window_alone(name: str, rng: np.random.Generator) -> None:
    inside = stock_scene(name)
    occluders = Occluders(inside.positions, inside.triangles)
    d = rng.normal(size=(400_000, 3)).astype(np.float32)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    origin = rng.uniform((-1.6, 0.9, -0.3), (0.1, 2.6, 2.3), (len(d), 3)).astype(np.float32)
    mi = occluders.mi
    o, way = (mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in a.T)) for a in (origin, d))
    out = ~occluders.scene.ray_test(mi.Ray3f(mi.Point3f(o), way)).numpy()
    assert 0.02 < out.mean() < 0.2
    reach = (-rooms.HALF_WIDTH - rooms.WALL - origin[out, 0]) / d[out, 0]  # to the outside of the left wall
    assert (d[out, 0] < 0).all()
    y, z = (origin[out, k] + reach * d[out, k] for k in (1, 2))
    (z0, z1), (y0, y1) = rooms.WINDOW
    assert z0 - 1e-4 < z.min() < z0 + 0.05 < z1 - 0.05 < z.max() < z1 + 1e-4
    assert y0 - 1e-4 < y.min() < y0 + 0.05 < y1 - 0.05 < y.max() < y1 + 1e-4


def test_what_stands_in_the_room_touches_nothing() -> None:
    """Rays begin a little off the surface; what stands on something must not begin them inside it."""
    inside = stock_scene("room")
    offset = ray_offset(inside.positions)
    assert offset < 0.4 * rooms.GAP
    of = inside.material_of_vertex
    names = [material.name for material in inside.materials]
    low = {name: inside.positions[of == k].min(axis=0) for k, name in enumerate(names)}
    assert low["stone"][1] > offset
    assert low["coral stool"][1] > offset
    assert low["teal glaze"][1] > rooms.PLINTH_HEIGHT + offset
    assert low["shelf"][2] > -rooms.HALF_DEPTH + offset
    assert inside.positions[of == names.index("indigo canvas"), 0].max() < rooms.HALF_WIDTH - offset
    walls = np.isin(of, [names.index(name) for name in ("plaster", "ochre wall", "boards")])
    toward_middle = inside.normals[walls] * (np.float32([0, rooms.HEIGHT / 2, 0]) - inside.positions[walls])
    in_the_room = np.abs(inside.positions[walls, 0]) <= rooms.HALF_WIDTH
    assert (toward_middle.sum(axis=1) > 0)[in_the_room].mean() > 0.99  # all but the reveal
