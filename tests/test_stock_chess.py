"""The chessmen: closed bodies on the board, apart from each other, in a room without a gap."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.rays.mitsuba import Occluders
from prelight.rays.offset import ray_offset
from prelight.scene.stock import chess
from prelight.scene.stock.catalogue import stock_scene
from prelight.scene.stock.chessmen import BISHOP, PAWN, QUEEN, ROOK, ball, turned

from .test_stock import is_closed, volume

pytestmark = pytest.mark.filterwarnings("error")


def test_men_are_closed_and_stand_on_the_board() -> None:
    for part in (*(turned(shape, 0.5) for shape in (PAWN, ROOK, BISHOP, QUEEN)), ball(0.06, 0.5)):
        assert is_closed(part)
        assert volume(part) > 0
    offset = ray_offset(stock_scene("steerable").positions)
    for part, _ in chess._men(0.5):
        lowest = part.positions[:, 1].min()
        assert chess.THICK + chess.GAP + 1.3 * offset < lowest < chess.THICK + 4 * chess.GAP


def test_men_keep_apart() -> None:
    men = [part.positions for part, _ in chess._men(0.5)]
    for k, one in enumerate(men):
        for other in men[k + 1 :]:
            a, b = (p[:, [0, 2]] for p in (one, other))
            middle_a, middle_b = (p.min(axis=0) + np.ptp(p, axis=0) / 2 for p in (a, b))
            reach = max(np.ptp(a, axis=0)) / 2 + max(np.ptp(b, axis=0)) / 2
            assert np.linalg.norm(middle_a - middle_b) > reach


def test_no_ray_leaves_the_room() -> None:
    scene = stock_scene("steerable-small")
    occluders = Occluders(scene.positions, scene.triangles)
    mi, rng = occluders.mi, np.random.default_rng(0)
    d = rng.normal(size=(3, 20_000))
    rays = mi.Ray3f(
        mi.Point3f(*chess.SPOT_AT), mi.Vector3f(*(mi.Float(x) for x in d / np.linalg.norm(d, axis=0)))
    )
    assert occluders.scene.ray_test(rays).numpy().all()


def test_lamps_and_eyes_are_in_the_room() -> None:
    low, high = (np.array([chess.LEFT, 0, chess.BACK]), np.array([chess.ROOM, chess.CEILING, chess.ROOM]))
    corner, across, along = (np.array(x) for x in chess.PANEL)
    inside = [chess.SPOT_AT, corner, corner + across + along, *(c.eye for c in chess.CAMERAS.values())]
    for point in inside:
        assert (point > low).all()
        assert (point < low + high).all()
    assert np.cross(across, along)[1] < 0  # shines down
