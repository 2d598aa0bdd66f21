"""Light that bounces on and on, followed as it changes: the series is never begun anew for little."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from prelight.relighting.sun_bounces import LITTLE, BouncedSuns, SunBounces

SIDE = 40


class Mixed:
    """An operator whose series is known: half of all light, spread by a fixed matrix that keeps sums."""

    def __init__(self, rng: np.random.Generator) -> None:
        spread = rng.uniform(0, 1, (SIDE, SIDE))
        self.matrix = 0.5 * spread / spread.sum(axis=0)
        self.calls = 0

    def bounce(self, light: np.ndarray) -> np.ndarray:
        self.calls += 1
        return (self.matrix @ light).astype(np.float32)

    def whole(self, light: np.ndarray) -> np.ndarray:
        return np.linalg.solve(np.eye(SIDE) - self.matrix, self.matrix @ light)


def test_the_sum_stays_right_however_often_a_little_changes(rng) -> None:
    """A hundred small changes: never farther from the closed form than one run of the series, and far cheaper."""
    operator: Any = Mixed(rng)
    bounces = SunBounces(operator)
    light = rng.uniform(0, 1, (SIDE, 3)).astype(np.float32)
    first = bounces.of(light)
    assert np.abs(first - operator.whole(light)).sum() <= 1.01 * LITTLE * light.sum()
    at_once, operator.calls = operator.calls, 0
    for _ in range(100):
        light = light.copy()
        light[rng.integers(SIDE)] *= np.float32(rng.uniform(0.7, 1.3))
        found = bounces.of(light)
        assert np.abs(found - operator.whole(light)).sum() <= 1.05 * LITTLE * light.sum()
    assert operator.calls < 0.4 * 100 * at_once
    assert bounces.of(np.zeros_like(light)).max() == 0.0


def test_a_great_change_and_a_bounded_series_begin_anew(rng) -> None:
    operator: Any = Mixed(rng)
    light = rng.uniform(0, 1, (SIDE, 3)).astype(np.float32)
    bounces = SunBounces(operator)
    bounces.of(light)
    assert np.array_equal(bounces.of(3 * light), SunBounces(operator).of(3 * light))
    twice = SunBounces(operator, most=2)
    twice.of(light)
    more = light * np.float32(1.01)
    expected = operator.matrix @ more + operator.matrix @ (operator.matrix @ more)
    assert twice.of(more) == pytest.approx(expected, rel=1e-5)


def test_an_answer_that_comes_sooner_catches_up(rng) -> None:
    """One bounce at a time: what is left is kept, and nothing of it is lost."""
    operator: Any = Mixed(rng)
    bounces, light = SunBounces(operator), rng.uniform(0, 1, (SIDE, 3)).astype(np.float32)
    errors = []
    for _ in range(12):
        found = bounces.of(light, at_once=1)
        errors.append(np.abs(found - operator.whole(light)).sum())
    assert errors[0] > 10 * LITTLE * light.sum()
    assert errors[-1] <= 1.01 * LITTLE * light.sum()
    assert (np.diff(errors) <= 1e-4).all()


def test_an_exact_answer_knows_nothing_of_the_one_before(rng) -> None:
    operator: Any = Mixed(rng)
    suns, light = BouncedSuns(operator, most=None), rng.uniform(0, 1, (SIDE, 3)).astype(np.float32)
    first = suns.of(light, None, lambda: None)
    suns.of(light * np.float32(1.1), None, lambda: None)
    assert np.array_equal(suns.of(light, None, lambda: None), first)
