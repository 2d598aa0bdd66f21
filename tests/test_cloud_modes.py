"""Modes of bounced light, learnt from lamps, and what light at a vertex brings of them."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.cloud_modes import Sources, mixtures, products
from prelight.baking.cloud_trials import Metric, Trials

AREAS = np.linspace(0.5, 2, 40).astype(np.float32)


def brought(lamps: int = 12, rank: int = 4) -> np.ndarray:
    chance = np.random.default_rng(1)
    sizes = np.logspace(-1, 1, lamps)[:, None, None]
    return (sizes * np.einsum("lr,rvc->lvc", *_factors(chance, lamps, rank))).astype(np.float32)


def _factors(chance, lamps: int, rank: int):
    return chance.normal(size=(lamps, rank)), chance.normal(size=(rank, 40, 3))


def test_modes_are_orthogonal_and_span_what_lamps_bring():
    Y = brought()
    gram = products((Y[:, part], AREAS[part]) for part in (slice(0, 15), slice(15, 40)))
    np.testing.assert_allclose(gram, np.einsum("v,lvc,mvc->lm", AREAS, Y, Y), rtol=1e-4)
    found = mixtures(gram, 12)
    assert len(found) == 4
    modes = np.einsum("lvc,lk->kvc", Y, found.shares)
    inner = np.einsum("v,kvc,jvc->kj", AREAS, modes, modes)
    np.testing.assert_allclose(inner, np.diag(found.squares), atol=1e-4 * found.squares[0])
    share = np.einsum("v,kvc,lvc->lk", AREAS, modes, Y) / found.squares
    np.testing.assert_allclose(np.einsum("lk,kvc->lvc", share, modes), Y, atol=1e-3)


def test_bright_and_faint_lamps_count_alike():
    first, second = (mixtures(products([(Y, AREAS)]), 2) for Y in (brought(), brought() * np.float32(7)))
    np.testing.assert_allclose(second.squares, 49 * first.squares, rtol=1e-4)
    np.testing.assert_allclose(np.abs(second.shares), np.abs(first.shares), rtol=1e-3, atol=1e-4)


def test_there_are_no_modes_in_the_dark():
    assert len(mixtures(products([(np.zeros((5, 40, 3), np.float32), AREAS)]), 4)) == 0


def test_sources_are_bytes_per_area():
    chance = np.random.default_rng(2)
    values, light = chance.normal(size=(40, 3)).astype(np.float32), chance.random((40, 2)).astype(np.float32)
    found = Sources.of(values, AREAS).brought(light)
    expected = light.T.astype(np.float64) @ (values * AREAS[:, None])
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(values).max() * AREAS.sum() / 10)


def test_what_lamps_ask_of_columns_is_turned_back_exactly():
    chance = np.random.default_rng(3)
    trials = Trials(chance.normal(size=(9, 30)) * np.logspace(-2, 2, 9)[:, None], np.full(30, 2.0))
    metric = Metric.of(trials, np.ones(6), group_of=np.array([0, 0, 1, 1, 2, 3]), groups=4)
    rows = chance.normal(size=(5, 7)).astype(np.float32)
    np.testing.assert_allclose(metric.unweighed(metric.weighed(rows)), rows, rtol=2e-3, atol=1e-4)
    weights = trials.of_groups(np.array([0, 0, 1, 1, 2, 3]), 4)
    seen = np.square(metric.weighed(rows)).sum(axis=1)
    asked = (np.square(rows @ weights) / 4).mean(axis=1)
    assert (seen > 0.9 * asked).all()  # and what the lights ask by themselves, and a little of every column
    assert seen == pytest.approx(asked, rel=0.5)


def test_lamps_and_lights_that_see_nothing_ask_for_nothing():
    weights = np.zeros((5, 8))
    weights[:, :3] = np.random.default_rng(4).normal(size=(5, 3))
    bright = np.zeros(8)
    bright[:3] = 1.0
    metric = Metric.of(Trials(weights, bright), np.array([0.0, 0, 2]), group_of=np.array([0, 1, 2]), groups=3)
    rows = np.ones((2, 5), np.float32)
    assert np.isfinite(metric.weighed(rows)).all()
    np.testing.assert_allclose(metric.unweighed(metric.weighed(rows)), rows, rtol=2e-3)
