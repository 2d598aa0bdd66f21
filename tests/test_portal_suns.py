"""A sun through portals: what it draws is known in closed form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.relighting.light_sent_out import areas_around
from prelight.relighting.portal_openings import Openings
from prelight.relighting.portal_suns import PortalSuns, disc_points
from prelight.relighting.portals import PortalsRelighter
from prelight.storage.bake import Bake

from .portal_rooms import portals_of, under_glass

DOWN = np.array((0.3, 0.8, -0.25)) / np.linalg.norm((0.3, 0.8, -0.25))
SUN = Disc(tuple(DOWN.tolist()), 0.25, (4e4, 3e4, 2e4), 0.5)
LOW, HIGH, HEIGHT = np.array((-0.6, -0.4)), np.array((0.7, 0.5)), 2.0  # of an opening in the plane y = HEIGHT


def _opening(height: float, low=LOW, high=HIGH) -> np.ndarray:
    (x0, z0), (x1, z1) = low, high
    a, b, c, d = ((x, height, z) for x, z in ((x0, z0), (x0, z1), (x1, z1), (x1, z0)))
    return np.array([(a, b, c), (a, c, d)], np.float32)


def _floor(cells: int) -> np.ndarray:
    at = (np.arange(cells) + 0.5) / cells * 4 - 2
    x, z = np.meshgrid(at, at, indexing="ij")
    return np.stack([x.ravel(), np.zeros(cells * cells), z.ravel()], axis=1).astype(np.float32)


def _suns(points: np.ndarray, panes: list[np.ndarray], screen: np.ndarray | None = None) -> PortalSuns:
    """Points that look up at openings, under a screen (or a triangle far below)."""
    corners = np.concatenate(panes)
    far = (
        np.array([(0, -9, 0), (0, -9, 1), (1, -9, 0)], np.float32)
        if screen is None
        else screen.reshape(-1, 3)
    )
    positions = np.concatenate([points, far])
    normals = np.concatenate([np.tile(np.float32((0, 1, 0)), (len(points), 1)), np.zeros_like(far)])
    triangles = (len(points) + np.arange(len(far))).reshape(-1, 3).astype(np.int32)
    of = np.repeat(np.arange(len(panes)), [len(p) for p in panes]).astype(np.int32)
    openings = Openings(corners, of, positions, np.zeros(0, np.int32))
    return PortalSuns(openings, positions=positions, triangles=triangles, normals=normals)


def _light(suns: PortalSuns, count: int, panes: int = 1, disc: Disc = SUN) -> np.ndarray:
    """(count, 3) irradiance."""
    total = np.zeros((len(suns._normals), 3), np.float32)
    suns.unit(disc).onto(total, np.tile(disc.total, (panes, 1)))
    return np.pi * total[:count]


def test_a_sun_through_a_rectangle_draws_a_rectangle() -> None:
    """The opening's, moved by what the sun's slope is over the height; its edge as soft as the disc is wide."""
    points = _floor(160)
    found = _light(_suns(points, [_opening(HEIGHT)]), len(points))
    moved = points[:, [0, 2]] + HEIGHT * DOWN[[0, 2]] / DOWN[1]
    beside = np.minimum(moved - LOW, HIGH - moved).min(axis=1)  # metres inside of the rectangle
    penumbra = 1.6 * HEIGHT / DOWN[1] ** 2 * np.radians(SUN.radius_deg)
    facing = SUN.total * DOWN[1]
    assert found[beside > penumbra] == pytest.approx(
        np.tile(facing, (int((beside > penumbra).sum()), 1)), rel=1e-5
    )
    assert (found[beside < -penumbra] == 0).all()
    between = np.abs(beside) < penumbra
    assert 0 < between.mean() < 0.03  # 1.5 cm wide to either side: two degrees of a cell would be 8 cm
    assert ((found[between] >= 0) & (found[between] <= facing * 1.00001)).all()


def test_all_the_light_that_enters_falls_on_the_floor() -> None:
    points = _floor(400)
    found = _light(_suns(points, [_opening(HEIGHT)]), len(points))
    entered = float(np.prod(HIGH - LOW)) * SUN.total * DOWN[1]
    assert found.sum(axis=0) * (4 / 400) ** 2 == pytest.approx(entered, rel=2e-3)


@pytest.mark.parametrize("cells", [4, 9])
def test_what_bounces_is_all_that_falls_on_a_coarse_floor(cells: int) -> None:
    """Between few vertices, or beside all of them: Σ light · area is the sun through the opening."""
    at = np.linspace(-2, 2, cells + 1)
    x, z = (grid.ravel() for grid in np.meshgrid(at, at, indexing="ij"))
    floor = np.stack([x, 0 * x, z], axis=1).astype(np.float32)
    i, j = (grid.ravel() for grid in np.indices((cells, cells)))
    a = i * (cells + 1) + j
    triangles = np.concatenate(
        [np.stack([a, a + 1, a + cells + 2], 1), np.stack([a, a + cells + 2, a + cells + 1], 1)]
    )
    openings = Openings(_opening(HEIGHT), np.zeros(2, np.int32), floor, np.zeros(0, np.int32))
    up = np.tile(np.float32((0, 1, 0)), (len(floor), 1))
    suns = PortalSuns(openings, positions=floor, triangles=triangles.astype(np.int32), normals=up)
    areas = areas_around(floor, triangles)
    total = np.zeros((len(floor), 3), np.float32)
    suns.unit(SUN, spread=True).onto(total, SUN.total[None])
    entered = float(np.prod(HIGH - LOW)) * SUN.total * DOWN[1]
    assert np.pi * (areas @ total) == pytest.approx(entered, rel=0.05)  # 64 points a triangle
    at_vertices = np.pi * (areas @ _light(suns, len(floor))) / np.pi
    assert abs(at_vertices[0] / entered[0] - 1) > 0.05


def test_what_stands_in_the_way_shadows_on_either_side() -> None:
    points = _floor(40)
    whole = _light(_suns(points, [_opening(HEIGHT)]), len(points))
    for height in (0.5, 3.5):  # inside the room, and outside of it
        shift = (height - HEIGHT) * DOWN[[0, 2]] / DOWN[1]
        half = _opening(height, LOW - 0.1 + shift, np.array((0.05, HIGH[1] + 0.1)) + shift)
        found = _light(_suns(points, [_opening(HEIGHT)], half), len(points))
        moved = points[:, 0] + HEIGHT * DOWN[0] / DOWN[1]
        assert (found[moved < 0.0] == 0).all()
        assert found[moved > 0.1] == pytest.approx(
            whole[moved > 0.1], abs=0.1 * float(whole.max())
        )  # of its edge


def test_of_two_sheets_the_last_counts() -> None:
    points = _floor(30)
    shift = 0.3 * DOWN[[0, 2]] / DOWN[1]
    suns = _suns(points, [_opening(HEIGHT), _opening(HEIGHT + 0.3, LOW + shift, HIGH + shift)])
    unit = suns.unit(SUN)
    assert len(unit.pane)
    assert (unit.pane == 1).mean() > 0.9  # but at the edges, in the penumbra
    assert _light(suns, len(points), panes=2).sum() == pytest.approx(
        _light(_suns(points, [_opening(HEIGHT + 0.3, LOW + shift, HIGH + shift)]), len(points)).sum(),
        rel=0.05,
    )


@pytest.mark.parametrize("softness", [0.0, 0.5, 1.0])
def test_points_of_a_disc_are_spread_as_its_light(softness: float) -> None:
    disc = replace(SUN, softness=softness, radius_deg=2.0)
    points = disc_points(disc)
    inner, outer = disc.region.depths
    w = np.linspace(0, outer, 100_001)
    y = np.clip((w - inner) / max(outer - inner, 1e-30), 0, 1)
    share = 1 - y * y * (3 - 2 * y)
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.ones(len(points)))
    assert (1 - points @ np.array(disc.direction)).mean() == pytest.approx(
        (w * share).sum() / share.sum(), rel=5e-3
    )
    middle = points.mean(axis=0) / np.linalg.norm(points.mean(axis=0))
    assert np.degrees(np.arccos(middle @ np.array(disc.direction))) < 0.05


def test_the_layer_s_sun_is_sharp_and_follows_the_glass(tmp_path: Path) -> None:
    scene = under_glass(cells=12)
    room = portals_of(scene, tmp_path / "room.prelight")
    sky = Environment.constant((0.5, 0.5, 0.5))
    room.light(Rig(sky))
    plain = room.direct
    sun = Disc((0.5, 0.8, 0.0), 0.25, (4e4, 4e4, 4e4), 0.5)
    room.light(Rig(sky.with_disc(sun)))
    brought = np.pi * (room.direct - plain)[:, 0]
    p = scene.positions.astype(np.float64)
    floor = (p[:, 1] == 0) & (scene.normals[:, 1] > 0.9)
    # The room is 4 × 3 × 5 m and open above: only its wall at x = 4 shadows the floor, by 3·0.5/0.8 m.
    lit, dark = floor & (p[:, 0] < 4 - 1.875 - 0.03), floor & (p[:, 0] > 4 - 1.875 + 0.03)
    edge = (p[:, 0] < 1e-3) | (p[:, 2] < 1e-3) | (p[:, 2] > 5 - 1e-3)
    facing = sun.total[0] * sun.direction[1]
    assert brought[lit & ~edge] == pytest.approx(np.full((lit & ~edge).sum(), facing), rel=1e-4)
    assert np.abs(brought[dark]).max() < 1e-4 * facing
    tint = Glass("*", tint=(0.5, 0.25, 1.0))
    room.light(Rig(sky.with_disc(sun), portals=(tint,)))
    again = PortalsRelighter(Bake.open(tmp_path / "room.prelight"))
    again.light(Rig(sky.with_disc(sun)))
    assert room.irradiance == pytest.approx(
        again.irradiance * np.float32((0.5, 0.25, 1.0)), rel=1e-4, abs=1e-5
    )
    # Frost turns the sun's light aside: no sharp edge is left, and no light is gained.
    room.light(Rig(sky.with_disc(sun), portals=(Glass("*", kind="frosted", frost_deg=20.0),)))
    frosted = np.pi * (room.direct - plain)[:, 0]
    assert frosted[dark].max() > 0.05 * facing
    assert frosted[floor].max() < facing


def test_a_picture_s_pixels_find_the_sun_themselves(tmp_path: Path) -> None:
    """At the vertices it is the vertices' own; between them it is sharp where the mesh blurs."""
    scene = under_glass(cells=4)
    room = portals_of(scene, tmp_path / "room.prelight", bounces=0)
    assert room.point_lit is None
    sun = Disc((0.5, 0.8, 0.0), 0.25, (4e4, 3e4, 2e4), 0.5)
    room.light(Rig(Environment.dark().with_disc(sun), portals=(Glass("*", tint=(0.5, 1.0, 0.25)),)))
    lit = room.point_lit
    assert lit is not None
    openings = room.layer.openings
    found = lit.lamp_light_at(openings.origins, scene.normals, shadow_rays=64)
    assert found == pytest.approx(lit.lamp_light, rel=1e-5, abs=1e-6)
    x = np.linspace(0.5, 3.5, 301)
    line = np.stack([x, 0 * x, 2.3 + 0 * x], axis=1).astype(np.float32)
    up = np.tile(np.float32((0, 1, 0)), (len(x), 1))
    light = np.pi * lit.lamp_light_at(line, up, shadow_rays=32)
    facing = sun.total * sun.direction[1] * (0.5, 1.0, 0.25)
    edge = 4 - 3 * 0.5 / 0.8  # the shadow of the wall at x = 4
    assert light[x < edge - 0.03] == pytest.approx(np.tile(facing, ((x < edge - 0.03).sum(), 1)), rel=1e-4)
    assert not light[x > edge + 0.03].any()


def test_bakes_of_earlier_versions_keep_the_sun_in_their_cells(tmp_path: Path, monkeypatch) -> None:
    """The same light, less sharp: what falls on the floor in all is as much."""
    scene = under_glass(cells=12)
    exact = portals_of(scene, tmp_path / "room.prelight")
    monkeypatch.setattr("prelight.relighting.portals_layer.read_openings", lambda *_, **__: None)
    earlier = PortalsRelighter(Bake.open(tmp_path / "room.prelight"))
    rig = Rig(
        Environment.constant((0.5, 0.5, 0.5)).with_disc(Disc((0.3, 0.8, 0.1), 0.25, (4e4, 4e4, 4e4), 0.5))
    )
    areas = areas_around(scene.positions, scene.triangles)
    sums = []
    for room in (exact, earlier):
        room.light(rig)
        sums.append((areas @ room.direct, areas @ room.irradiance))
    assert earlier.point_lit is None
    assert sums[1][0] == pytest.approx(sums[0][0], rel=0.05)
    assert sums[1][1] == pytest.approx(sums[0][1], rel=0.05)
