"""Stand-ins: vertices that tell what the others get, while a hand drags."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest

from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.outside import Outside, OutsideObject, Path
from prelight.lighting.rig import Rig
from prelight.relighting.among_few import AmongFew
from prelight.relighting.first_bounce import FirstBounce
from prelight.relighting.portals import PortalsRelighter
from prelight.relighting.stand_ins import StandIns
from prelight.storage.bake import Bake

from .portal_rooms import portals_of, under_glass
from .test_shells import write_box

SIDE = 60
SUN = Disc((0.3, 0.9, 0.3), 0.3, (3e4, 3e4, 3e4), 0.0)
SKY = Environment.constant((0.4, 0.5, 0.7)).with_disc(SUN)


def plate(y: float, up: float) -> tuple[np.ndarray, np.ndarray]:
    """SIDE × SIDE vertices of a square of two metres, and their normals."""
    line = np.linspace(-1, 1, SIDE)
    x, z = np.meshgrid(line, line, indexing="ij")
    positions = np.stack([x.ravel(), np.full(x.size, y), z.ravel()], axis=1).astype(np.float32)
    return positions, np.tile(np.float32((0, up, 0)), (x.size, 1))


@pytest.fixture(scope="module")
def shelf() -> tuple[np.ndarray, StandIns]:
    """A board a millimetre thick, its upper side first."""
    (above, up), (below, down) = plate(0.001, 1.0), plate(0.0, -1.0)
    positions = np.concatenate([above, below])
    places = StandIns.of(positions, np.concatenate([up, down]), count=SIDE * SIDE // 4)
    assert places is not None
    return positions, places


def test_what_rises_evenly_stays_so_and_sides_do_not_mix(shelf) -> None:
    positions, places = shelf
    assert (places.weights >= 0).all()
    assert np.abs(places.weights.sum(axis=1) - 1).max() < 1e-5
    upper = np.arange(len(positions)) < SIDE * SIDE
    light = np.where(upper[:, None], positions + np.float32(2), np.float32(0))
    found = places.spread(light[places.rows])
    assert (found[~upper] == 0).all()
    inner = upper & (np.abs(positions[:, [0, 2]]).max(axis=1) < 0.9)
    nearest = light[places.rows][places.near[:, 0]]
    assert np.abs(found - light)[inner].mean() < 0.35 * np.abs(nearest - light)[inner].mean()
    np.testing.assert_allclose(found[places.rows], light[places.rows], atol=1e-2)
    assert StandIns.of(positions, np.zeros_like(positions), count=len(positions)) is None


def test_detail_comes_back_and_goes_with_the_light(shelf, rng) -> None:
    positions, places = shelf
    light = rng.uniform(0, 1, positions.shape).astype(np.float32)
    detail = places.detail(light)
    np.testing.assert_allclose(places.spread(light[places.rows], detail), light, atol=1e-6)
    np.testing.assert_allclose(places.spread(light[places.rows] / 2, detail), light / 2, atol=1e-6)
    assert not places.spread(np.zeros((len(places), 3), np.float32), detail).any()
    assert (places.spread(3 * light[places.rows], detail) >= 0).all()


def test_rows_are_gathered_as_light_is_spread(shelf, rng) -> None:
    _, places = shelf
    rows = rng.integers(-127, 128, (len(places.near), 5)).astype(np.int8)
    light = rng.uniform(0, 1, (len(places), 3)).astype(np.float32)
    np.testing.assert_allclose(
        light.T @ places.gathered(rows), places.spread(light).T @ rows.astype(np.float32), rtol=1e-3, atol=1.0
    )


# ---- A room with a sun -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sunny(tmp_path_factory) -> Bake:
    path = tmp_path_factory.mktemp("sunny") / "a.prelight"
    portals_of(under_glass(cells=16), path)
    return Bake.open(path)


def few_of(bake: Bake) -> StandIns:
    places = StandIns.of(bake.receivers.positions, bake.receivers.normals, count=len(bake.receivers) // 4)
    assert places is not None
    return places


def glass(degrees: float, blind: float = 0.0) -> tuple[Glass, ...]:
    return (Glass("clear glass", "frosted" if degrees else "clear", None, degrees or 10.0, blind),)


def off(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.sqrt(((found - exact) ** 2).mean() / (exact**2).mean()))


def test_a_drag_is_near_and_the_hand_at_rest_exact(sunny) -> None:
    """Frost, a blind, another sun: coarse within a few percent, and afterwards as if nothing had been coarse."""
    live, places = PortalsRelighter(sunny), few_of(sunny)
    live.light(Rig(SKY, portals=glass(0)))
    assert not live.is_coarse
    other = replace(SUN, direction=(0.4, 0.85, 0.2))
    for rig, most in (
        (Rig(SKY, portals=glass(0, 0.4)), 0.03),
        (Rig(SKY, portals=glass(12)), 0.15),
        (Rig(SKY.with_discs([other]), portals=glass(0)), 0.25),
    ):
        live.light(rig, coarse=places)
        found = live.irradiance
        assert live.is_coarse
        fresh = PortalsRelighter(sunny)
        fresh.light(rig)
        assert 0 < off(found, fresh.irradiance) < most
        assert live.light(rig)
        assert not live.is_coarse
        np.testing.assert_array_equal(live.irradiance, fresh.irradiance)
        assert not live.light(rig)


def test_a_blind_that_goes_down_slowly_takes_what_bounced_along(sunny) -> None:
    """What is taken away bounces too: after forty steps the room is no brighter than it must be."""
    live, places = PortalsRelighter(sunny), few_of(sunny)
    live.warm(places)
    live.light(Rig(SKY, portals=glass(0)))
    for blind in np.linspace(0, 0.8, 41).tolist():
        live.light(Rig(SKY, portals=glass(0, blind)), coarse=places)
    fresh = PortalsRelighter(sunny)
    fresh.light(Rig(SKY, portals=glass(0, 0.8)))
    found, exact = live.irradiance - live.direct, fresh.irradiance - fresh.direct
    assert found.sum() == pytest.approx(exact.sum(), rel=0.02)
    assert off(found, exact) < 0.05


@pytest.mark.parametrize(("of_each", "most"), [(4, 1e-5), (16, 0.1)])
def test_what_has_bounced_goes_on_among_stand_ins(sunny, of_each: int, most: float) -> None:
    """What all vertices and the whole tree say, or near it where the tree is cut; light taken away is its opposite."""
    operator, (positions, normals) = (
        PortalsRelighter(sunny).layer.first,
        (sunny.receivers.positions, sunny.receivers.normals),
    )
    places = StandIns.of(positions, normals, count=len(positions) // of_each)
    assert operator is not None
    assert places is not None
    chosen, rows = operator.chosen(places.rows), positions[places.rows]
    light = np.ascontiguousarray(np.abs(rows - rows.min(axis=0)) + np.float32(0.1))
    found, whole = AmongFew(chosen, places).bounce(light), chosen.bounce(places.spread(light))
    assert off(found, whole) < most
    assert found.sum() == pytest.approx(whole.sum(), rel=most)
    np.testing.assert_allclose(AmongFew(chosen, places).bounce(-light), -found, atol=1e-3 * found.max())


def test_an_update_of_a_drag_reads_the_light_of_all_vertices_once(sunny, monkeypatch) -> None:
    """However often light bounces in it: more would cost a drag most of its time."""
    live, places, seen = PortalsRelighter(sunny), few_of(sunny), []
    bounce = FirstBounce.bounce

    def counted(self: FirstBounce, light: np.ndarray) -> np.ndarray:
        seen.append(len(light))
        return bounce(self, light)

    live.light(Rig(SKY))
    live.warm(places)
    monkeypatch.setattr(FirstBounce, "bounce", counted)
    live.light(Rig(SKY, portals=glass(9)), coarse=places)
    assert seen.count(live.vertices) == 1
    assert len(seen) > 1


def test_an_exact_answer_given_up_leaves_nothing_wrong(sunny) -> None:
    """Wherever it is given up: the next call, whatever it asks for, is right."""
    rig, places = Rig(SKY, portals=glass(9)), few_of(sunny)
    expected = PortalsRelighter(sunny)
    expected.light(rig)
    for after in count():
        live, calls = PortalsRelighter(sunny), iter(range(after))
        live.light(Rig(SKY))

        def check(calls: Any = calls) -> None:
            if next(calls, None) is None:
                raise TimeoutError

        try:
            live.light(rig, check=check)
        except TimeoutError:
            live.light(rig, coarse=places)
            assert off(live.irradiance, expected.irradiance) < 0.2
            live.light(rig)
            np.testing.assert_array_equal(live.irradiance, expected.irradiance)
            continue
        break
    assert after >= 2


def test_a_coarse_answer_given_up_leaves_nothing_rough(sunny, tmp_path) -> None:
    """A world captured roughly, and given up before it lit the room, is captured anew."""
    beam = write_box(tmp_path / "beam.obj", (-1.0, 3.1, 0.4), (9.0, 3.3, 0.6), (0.7, 0.1, 0.1))
    rig = Rig(SKY, outside=Outside((OutsideObject(beam, Path.resting()),), bounce=False))
    expected, live = PortalsRelighter(sunny), PortalsRelighter(sunny)
    expected.light(rig)
    live.light(Rig(SKY))

    def give_up() -> None:
        raise TimeoutError

    with pytest.raises(TimeoutError):
        live.light(rig, coarse=few_of(sunny), check=give_up)
    live.light(rig)
    assert not live.is_coarse
    np.testing.assert_array_equal(live.irradiance, expected.irradiance)
