"""The chapel, the car and the town: no light but through their glass, and what stands in them touches nothing."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.rays.mitsuba import Occluders
from prelight.rays.offset import ray_offset
from prelight.scene.geometry import Scene
from prelight.scene.normals import vertex_normals
from prelight.scene.stock import car as cars
from prelight.scene.stock import chapel as chapels
from prelight.scene.stock.catalogue import stock_scene
from prelight.scene.stock.openings import Opening, Wall
from prelight.scene.stock.town import town

INSIDE = {
    "portals-small": ((-2.0, 0.3, -4.5), (2.0, 4.0, 7.0)),
    "car-small": ((-0.5, 0.95, -0.2), (0.5, 1.3, 0.6)),
}


def out_of(scene: Scene, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n,) whether each ray meets nothing."""
    occluders = Occluders(scene.positions, scene.triangles)
    mi = occluders.mi
    o, d = (mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in a.T)) for a in (origins, directions))
    return ~occluders.scene.ray_test(mi.Ray3f(mi.Point3f(o), d)).numpy()


@pytest.mark.parametrize("name", INSIDE)
def test_light_comes_in_through_glass_alone(name: str, rng: np.random.Generator) -> None:
    """With its panes a room is closed; without them light comes in."""
    scene = stock_scene(name)
    d = rng.normal(size=(400_000, 3)).astype(np.float32)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    origins = rng.uniform(*INSIDE[name], (len(d), 3)).astype(np.float32)
    assert not out_of(scene, origins, d).any()
    glass = np.array([material.transmission > 0 for material in scene.materials])[scene.material_of]
    open_ = Scene("open", scene.positions, scene.normals, scene.triangles[~glass], scene.albedo)
    assert 0.01 < out_of(open_, origins, d).mean() < 0.5


@pytest.mark.parametrize("name", INSIDE)
def test_panes_are_flat_sheets_of_their_own(name: str) -> None:
    scene = stock_scene(name)
    of = scene.material_of_vertex
    for k, material in enumerate(scene.materials):
        is_glass = "glass" in material.name
        assert is_glass == (material.transmission == 1.0)
        if is_glass:
            own = scene.triangles[scene.material_of == k]
            assert (of[own] == k).all()  # no vertex is shared with a wall
            assert not np.isin(own, scene.triangles[scene.material_of != k]).any()
            faces = vertex_normals(scene.positions, own)
            assert (faces * scene.normals)[np.unique(own)].sum(axis=1).min() > 0.9999
    assert sum("glass" in material.name for material in scene.materials) == (5 if "portals" in name else 6)


def test_the_open_chapel_is_the_chapel_without_its_panes() -> None:
    closed, open_ = stock_scene("portals-small"), stock_scene("chapel-open-small")
    glass = np.array([material.transmission > 0 for material in closed.materials])[closed.material_of]
    assert np.array_equal(closed.positions[closed.triangles[~glass]], open_.positions[open_.triangles])


def test_what_stands_in_the_chapel_touches_nothing() -> None:
    scene = stock_scene("portals-small")
    offset = ray_offset(scene.positions)
    of = scene.material_of_vertex
    names = [material.name for material in scene.materials]
    for name in ("oak", "door"):
        own = scene.positions[of == names.index(name)]
        assert own[:, 1].min() > 1.3 * offset
        assert own[:, 2].max() < chapels.HALF_LENGTH - 1.3 * offset


@pytest.mark.parametrize("arch", ["round", "pointed", "circle"])
def test_a_wall_its_opening_and_its_pane_fit(arch: str, rng: np.random.Generator) -> None:
    """Their areas add up to the whole wall's, and the arch's own is known."""
    opening = Opening(1.0, 0.5, 1.0, 1.0 if arch == "circle" else 2.0, arch)
    wall = Wall((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    around = opening.around(wall, (0.0, 2.5), (0.0, 4.0), step=0.02)
    area = triangle_area(around.positions, around.triangles)
    upper = {"round": np.pi / 8, "circle": np.pi / 4, "pointed": (np.pi / 3 - np.sqrt(3) / 4) * 1.0}[arch]
    expected = 10.0 - upper - (0.0 if arch == "circle" else 1.0)
    assert area == pytest.approx(expected, abs=2e-3)
    reveal = opening.reveal(wall, depth=0.3, step=0.02)
    middle = np.array([1.0, 1.0 if arch == "circle" else 1.8, -0.15])
    assert ((middle - reveal.positions) * reveal.normals).sum(axis=1).min() > 0  # seen from within


def triangle_area(positions: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_the_town_is_as_large_as_it_is_asked_to_be() -> None:
    assert 49_000 < len(stock_scene("town").triangles) < 52_000
    assert len(town(trees=0).triangles) < 35_000
    scene = stock_scene("town")
    road = np.abs(scene.positions[:, 0] - 21.8) < 1.5
    above = (scene.positions[:, 1] > 0.1) & (np.abs(scene.positions[:, 2]) < 70)
    assert not (road & above).any()  # a car can drive there
    with pytest.raises(InputError, match=r"^detail: 9"):
        town(detail=9)
    with pytest.raises(InputError, match=r"^detail: 0.1"):
        cars.car(detail=0.1)
