"""What is seen from a room's windows: where things stand, what light they send, how they pass; beside the renderer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.errors import InputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.outside import Outside, OutsideObject, Path
from prelight.lighting.rig import Rig
from prelight.relighting.exterior import irradiance_polynomial
from prelight.relighting.shells import Shells

R = 16
HERE = (0.0, 0.0, 0.0)
EVEN = Environment.constant((1.0, 1.0, 1.0))
FACES = {"+X": 0, "-X": 1, "+Y": 2, "-Y": 3, "+Z": 4, "-Z": 5}
SUN = Disc.at(-90.0, 45.0, radius_deg=0.265, radiance=(3e4, 3e4, 3e4))
RED, WHITE = (0.8, 0.1, 0.05), (1.0, 1.0, 1.0)


def write_box(path: File, low: Sequence[float], high: Sequence[float], colour: Sequence[float]) -> str:
    """A box as OBJ and MTL; the colour is linear."""
    corners = [[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)]
    sides = ("1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6")
    lines = [f"mtllib {path.stem}.mtl", "usemtl m", *("v {} {} {}".format(*c) for c in corners)]
    path.write_text("\n".join([*lines, *(f"f {side}" for side in sides)]) + "\n")
    path.with_suffix(".mtl").write_text("newmtl m\nKd {} {} {}\n".format(*colour))
    return str(path)


@pytest.fixture
def cube(tmp_path: File) -> str:
    """A metre each way, red."""
    return write_box(tmp_path / "cube.obj", (-0.5,) * 3, (0.5,) * 3, RED)


def room(reach: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A closed box around the middle, seen from within."""
    low, high = (-reach,) * 3, (reach,) * 3
    corners = np.array(
        [[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)], np.float32
    )
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    inward = np.concatenate([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]])
    return corners, inward.astype(np.int32)


def standing(source: str, position: tuple[float, float, float], **more: float) -> OutsideObject:
    return OutsideObject(source, Path.resting(position), **more)


def shells(rig: Rig) -> Shells:
    found = Shells(*room())
    found.light(rig)
    return found


def world(*objects: OutsideObject, environment: Environment = EVEN, **more) -> Rig:
    return Rig(environment, outside=Outside(objects, **{"bounce": False, **more}))


def redness(shell: np.ndarray) -> np.ndarray:
    """(6,) mean of red minus green on each face."""
    return (shell[..., 0] - shell[..., 1]).mean(axis=(1, 2))


def test_with_nothing_outside_it_is_the_environment_s_cube() -> None:
    environment = Environment.stock("noon").rotated(20).with_disc(SUN)
    live = shells(Rig(environment))
    assert live.same_everywhere
    assert np.array_equal(live.shell_of((3.0, 1.0, 2.0), R), environment.cube(R))
    assert np.array_equal(live.shell_of(HERE, R, discs=False), environment.with_discs([]).cube(R))
    assert live.discs_of(HERE) == (SUN,)
    assert not live.light(Rig(environment))
    assert live.light(Rig(environment.scaled(2)))


@pytest.mark.parametrize("face", FACES)
def test_what_stands_at_plus_x_is_seen_on_the_face_plus_x(face: str, cube: str) -> None:
    way = cube_map.AXIS[FACES[face]]
    shell = shells(world(standing(cube, tuple(4.0 * way)))).shell_of(HERE, R)
    red = redness(shell) > 1e-3
    assert red.tolist() == [name == face for name in FACES]
    n = FACES[face]
    there = shell[n, R // 2 - 1 : R // 2 + 1, R // 2 - 1 : R // 2 + 1]
    assert there == pytest.approx(np.broadcast_to(RED, there.shape), rel=0.01)  # an even sky: albedo · L
    assert (shell[n, 0] == 1).all()
    assert (shell[(n + 2) % 6] == 1).all()


def test_the_texels_are_those_whose_directions_meet_it(cube: str) -> None:
    """Off the middle and unlike in every axis: a texel is red where its own direction meets the box."""
    place = np.array((2.5, 1.3, -3.1))
    shell = shells(world(standing(cube, tuple(place)), samples=1)).shell_of((0.2, -0.1, 0.3), R)
    d = cube_map.texel_directions(np.arange(6 * R * R, dtype=np.int32), R).astype(np.float64)
    with np.errstate(divide="ignore"):
        a, b = (place - 0.5 - (0.2, -0.1, 0.3)) / d, (place + 0.5 - (0.2, -0.1, 0.3)) / d
    near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    expected = (near < far) & (far > 0)
    found = (shell.reshape(-1, 3) != 1).any(axis=1)
    assert expected.sum() > 5
    assert np.array_equal(found, expected)


def test_a_white_world_under_an_even_sky_cannot_be_seen(tmp_path: File) -> None:
    """The furnace: albedo 1 and no corners that face each other, so that every direction has the sky's radiance."""
    white = write_box(tmp_path / "white.obj", (-1, -1, -1), (1, 1, 1), WHITE)
    rig = world(*(standing(white, p) for p in ((4.0, 0.5, 0.0),)), environment=EVEN.scaled(3.0))
    assert shells(rig).shell_of(HERE, R) == pytest.approx(3.0, rel=2e-3)


def test_irradiance_of_an_environment_is_a_polynomial_of_the_normal() -> None:
    """Of linear light exactly; (1 + y)/2 gives π·(1/2 + y/3)."""
    n = 64
    d = cube_map.texel_directions(np.arange(6 * n * n, dtype=np.int32), n).reshape(6, n, n, 3)
    ramp = Environment.from_cube(np.repeat(0.5 + 0.5 * d[..., 1:2], 3, axis=-1).astype(np.float32))
    found = irradiance_polynomial(ramp)
    assert found[0] == pytest.approx(0.5 * np.pi, rel=2e-3)
    assert found[2] == pytest.approx(np.pi / 3, rel=2e-3)
    assert found[[1, 3, 4, 5, 6, 7, 8]] == pytest.approx(0.0, abs=2e-3)


def test_suns_light_what_faces_them_and_cast_shadows(tmp_path: File, cube: str) -> None:
    floor = write_box(tmp_path / "floor.obj", (-8, -2.1, -8), (8, -2, 8), WHITE)
    rig = world(
        standing(floor, (0, 0, 0)),
        standing(cube, (-3.0, 1.0, 0.0)),
        environment=Environment.dark().with_disc(SUN),
    )
    live = shells(rig)
    n = 64
    below = live.shell_of(HERE, n, discs=False)[FACES["-Y"]]
    full = SUN.total[0] * np.sin(np.pi / 4) / np.pi
    assert below[n // 4, n // 2] == pytest.approx(full, rel=1e-3)
    d = cube_map.texel_directions(np.arange(3 * n * n, 4 * n * n, dtype=np.int32), n).astype(np.float64)
    x, z = -2.0 * d[:, 0] / d[:, 1], -2.0 * d[:, 2] / d[:, 1]
    at_box = x - 3.0  # along the light from the floor up to the box's middle height, 3 m
    inner = (np.abs(at_box + 3.0) < 0.85) & (np.abs(z) < 0.4)
    outer = (np.abs(at_box + 3.0) > 1.15) | (np.abs(z) > 0.6)
    grey = below.reshape(-1, 3)[:, 1]
    assert inner.sum() > 20
    assert (grey[inner] == 0).all()
    near = np.abs(x) + np.abs(z) < 4
    assert grey[outer & near] == pytest.approx(full, rel=1e-3)


def test_a_sun_is_dimmed_by_as_much_as_is_hidden(cube: str) -> None:
    sky = Environment.dark().with_disc(Disc((0.0, 0.0, -1.0), 0.265, (100.0, 90.0, 80.0)))
    whole = sky.discs[0].total
    for x, share in ((2.0, 1.0), (0.5, 0.5), (0.0, 0.0)):
        live = shells(world(standing(cube, (x, 0.0, -6.0)), environment=sky))
        left = sum((disc.total for disc in live.discs_of(HERE)), np.zeros(3))
        assert left == pytest.approx(share * whole, abs=0.08 * whole[0])
        cube_sum = np.einsum(
            "fijk,ij->k",
            live.shell_of(HERE, R) - live.shell_of(HERE, R, discs=False),
            cube_map.solid_angles(R),
        )
        assert cube_sum == pytest.approx(left, rel=1e-3, abs=1e-6)


def test_a_room_that_turns_sees_the_world_and_the_sky_turn(cube: str) -> None:
    sky = Environment.stock("sunset").with_disc(SUN)
    still = shells(world(standing(cube, (4.0, 0.0, 0.0)), environment=sky))
    heading = world(
        standing(cube, (14.0, 0.0, -3.0)), environment=sky, room=Path.resting((10.0, 0.0, -3.0), 90.0)
    )
    turned = shells(heading)
    a, b = still.shell_of(HERE, R), turned.shell_of(HERE, R)
    assert np.argmax(redness(still.shell_of(HERE, R) - sky.cube(R))) == FACES["+X"]
    from prelight.lighting.layouts import quarter_turned

    assert b == pytest.approx(quarter_turned(a, 1), rel=1e-3, abs=2e-3)  # the room's ahead is the world's +X
    assert turned.discs_of(HERE)[0].direction == pytest.approx((0.0, 0.5**0.5, 0.5**0.5), abs=1e-6)


def test_what_passes_at_three_metres_darkens_nearer_windows_first(tmp_path: File) -> None:
    """A black van before an even sky drives past three windows in a row; each sees least when it is before it."""
    van = write_box(tmp_path / "van.obj", (-1.0, -1, -2), (1.0, 1.2, 2), (0.02, 0.02, 0.02))
    drives = Path(
        (0.0, 8.0), ((-4.0, 0.0, 12.0), (-4.0, 0.0, -12.0)), curved=False
    )  # 3 m from the wall at x = −1
    rig = Rig(EVEN, outside=Outside((OutsideObject(van, drives, name="van"),), bounce=False))
    live = Shells(*room())
    windows = [(-1.0, 0.0, z) for z in (4.0, 0.0, -4.0)]
    seen = []
    for seconds in np.linspace(0.0, 8.0, 49):
        live.light(rig.at(float(seconds)))
        seen.append([1.0 - live.shell_of(window, R)[FACES["-X"]].mean() for window in windows])
    dark = np.array(seen)
    peaks = dark.argmax(axis=0) * 8 / 48
    assert peaks == pytest.approx([8 * (12 - z) / 24 for z in (4.0, 0.0, -4.0)], abs=0.2)
    starts = [int(np.flatnonzero(dark[:, k] > 0.02)[0]) for k in range(3)]
    assert starts[0] < starts[1] < starts[2]
    assert dark[:, 0] == pytest.approx(dark[::-1, 2], abs=0.02)


def test_paths_go_through_their_keys() -> None:
    path = Path((0.0, 1.0, 3.0), ((0, 0, 0), (4, 0, 0), (4, 0, -8)))
    for t, place in zip(path.times, path.positions, strict=True):
        assert path.at(t).position == pytest.approx(place)
    assert path.at(9.0).position == path.positions[-1]
    assert path.at(0.01).heading_deg == pytest.approx(90, abs=2)
    assert path.at(2.99).heading_deg == pytest.approx(0, abs=2)
    assert 20 < path.at(1.0).heading_deg < 70  # in the bend
    step = 1e-3
    ways = [np.subtract(path.at(1 + s).position, path.at(1 + s - step).position) / step for s in (0, step)]
    assert ways[0] == pytest.approx(ways[1], abs=0.05)  # no jerk at a key
    line = replace(path, curved=False)
    assert line.at(0.5).position == pytest.approx((2, 0, 0))
    turning = Path((0.0, 1.0), ((0, 0, 0), (0, 0, 0)), (170.0, -170.0))
    assert turning.at(0.5).heading_deg == pytest.approx(180)
    ahead = Path.resting((0, 0, 0), 90.0).at(0).rotation @ (0, 0, -1)
    assert ahead == pytest.approx((1, 0, 0), abs=1e-12)


def test_files_are_read_again_when_they_change(tmp_path: File, cube: str) -> None:
    rig = world(standing(cube, (4.0, 0.0, 0.0)))
    live = Shells(*room())
    assert live.light(rig)
    assert not live.light(rig)
    before = live.shell_of(HERE, R)
    write_box(File(cube), (-1, -1, -1), (1, 1, 1.25), RED)
    assert live.light(rig)
    assert redness(live.shell_of(HERE, R)).max() > 2 * redness(before).max()


def test_a_world_inside_the_room_is_refused(tmp_path: File, cube: str) -> None:
    ball = write_box(tmp_path / "ball.obj", (-0.1,) * 3, (0.1,) * 3, RED)
    with pytest.raises(InputError, match=r"^outside: ball is inside the room, near \("):
        shells(world(standing(ball, (0.2, 0.0, 0.0), name="ball")))
    through = OutsideObject(ball, Path((0.0, 4.0), ((-3, 0, 0), (3, 0, 0)), curved=False), name="bird")
    with pytest.raises(InputError, match=r"bird is inside the room at 1\.\d+ s"):
        shells(Rig(EVEN, outside=Outside((through,))))
    shells(world(standing(ball, (0.0, 0.7, 0.0))))  # on the roof
    big = write_box(tmp_path / "big.obj", (-9, -1.2, -9), (9, -0.6, 9), RED)
    shells(world(standing(big, (0, 0, 0)), standing(cube, (1.2, 0.0, 0.0))))  # the ground, and beside a wall
    inner, outer = room(0.5), room(0.8)  # a room with walls as thick as a hand
    thick = np.concatenate([inner[0], outer[0]]), np.concatenate([inner[1], 8 + outer[1][:, ::-1]])
    Shells(*thick).light(world(standing(ball, (0.0, 0.65, 0.0))))  # within a wall nobody sees it
    with pytest.raises(InputError, match="inside the room"):
        Shells(*thick).light(world(standing(ball, (0.2, 0.0, 0.0))))
