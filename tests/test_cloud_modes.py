"""Modes of bounced light, learnt from lamps, and what light at a vertex brings of them."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.cloud_modes import Sources, mixtures, products
from prelight.baking.cloud_regions import modes_there, regions_of, zones_of
from prelight.baking.cloud_trials import Metric, Trials, bright_for
from prelight.encoding.light_clustering import Groups

AREAS = np.linspace(0.5, 2, 40).astype(np.float32)


def brought(lamps: int = 12, rank: int = 4) -> np.ndarray:
    chance = np.random.default_rng(1)
    sizes = np.logspace(-1, 1, lamps)[:, None, None]
    return (sizes * np.einsum("lr,rvc->lvc", *_factors(chance, lamps, rank))).astype(np.float32)


def _factors(chance, lamps: int, rank: int):
    return chance.normal(size=(lamps, rank)), chance.normal(size=(rank, 40, 3))


def test_modes_are_orthogonal_and_span_what_lamps_bring():
    Y = brought()
    gram = products(Y, AREAS)
    np.testing.assert_allclose(gram, np.einsum("v,lvc,mvc->lm", AREAS, Y, Y), rtol=1e-4)
    found = mixtures([gram], 12)
    assert len(found) == 4
    modes = np.einsum("lvc,lk->kvc", Y, found.shares)
    inner = np.einsum("v,kvc,jvc->kj", AREAS, modes, modes)
    np.testing.assert_allclose(inner, np.diag(found.squares), atol=1e-4 * found.squares[0])
    share = np.einsum("v,kvc,lvc->lk", AREAS, modes, Y) / found.squares
    np.testing.assert_allclose(np.einsum("lk,kvc->lvc", share, modes), Y, atol=1e-3)


def test_bright_and_faint_lamps_count_alike():
    first, second = (mixtures([products(Y, AREAS)], 2) for Y in (brought(), brought() * np.float32(7)))
    np.testing.assert_allclose(second.squares, 49 * first.squares, rtol=1e-4)
    np.testing.assert_allclose(np.abs(second.shares), np.abs(first.shares), rtol=1e-3, atol=1e-4)


def test_there_are_no_modes_in_the_dark():
    assert len(mixtures([products(np.zeros((5, 40, 3), np.float32), AREAS)], 4)) == 0


def test_each_region_has_modes_of_its_own_and_dark_ones_too():
    """Far from all lamps is a thousandth of the light; what lamps bring there is spanned as well as elsewhere."""
    Y = brought(rank=6)
    Y[:, 20:] *= np.float32(1e-3)
    parts = [slice(0, 20), slice(20, 40)]
    found = mixtures([products(Y[:, part], AREAS[part]) for part in parts], 12)
    assert found.region.tolist() == [0] * 6 + [1] * 6
    for number, part in enumerate(parts):
        own = found.region == number
        modes = np.einsum("lvc,lk->kvc", Y[:, part], found.shares[:, own])
        inner = np.einsum("v,kvc,jvc->kj", AREAS[part], modes, modes)
        np.testing.assert_allclose(inner, np.diag(found.squares[own]), atol=1e-3 * inner.max())
        share = np.einsum("v,kvc,lvc->lk", AREAS[part], modes, Y[:, part]) / found.squares[own]
        back = np.einsum("lk,kvc->lvc", share, modes)
        np.testing.assert_allclose(back, Y[:, part], atol=2e-3 * np.abs(Y[:, part]).max())


def test_modes_know_the_means_of_cells_whatever_lamps_bring():
    """Light that no lamp has, and that modes learnt from lamps miss, is projected onto them with its means."""
    Y, even = brought(lamps=30, rank=20), np.zeros((2, 40, 3), np.float32)
    even[0, :15], even[1, 15:] = 1, 1
    other = np.random.default_rng(7).random((40, 3)).astype(np.float32) * Y.std()
    for fixed, worst in ((0, None), (2, 0.01)):
        samples = np.concatenate([Y, even[:fixed]])
        found = mixtures([products(samples, AREAS)], 6, fixed=fixed)
        assert len(found) == 6
        modes = np.einsum("lvc,lk->kvc", samples, found.shares)
        inner = np.einsum("v,kvc,jvc->kj", AREAS, modes, modes)
        np.testing.assert_allclose(inner, np.diag(found.squares), atol=1e-3 * found.squares.max())
        share = np.einsum("v,kvc,vc->k", AREAS, modes, other) / found.squares
        left = other - np.einsum("k,kvc->vc", share, modes)
        means = [
            abs((AREAS[part] @ left[part]).sum() / (AREAS[part] @ other[part]).sum())
            for part in (slice(15), slice(15, 40))
        ]
        assert max(means) < worst if worst else max(means) > 0.05


def test_modes_are_where_they_gain_most_and_no_more_than_wanted():
    Y = brought(lamps=30, rank=20)
    Y[:, 20:] = Y[:, 20:21]  # one shape there
    found = mixtures([products(Y[:, part], AREAS[part]) for part in (slice(0, 20), slice(20, 40))], 14)
    assert np.bincount(found.region).tolist() == [11, 3]  # a shape of three colours
    assert len(mixtures([products(Y[:, :20], AREAS[:20])] * 5, 14)) == 14


def test_modes_of_a_zone_are_those_of_its_regions():
    places = np.random.default_rng(6).random((500, 3)).astype(np.float32)
    for modes, zone in ((512, 200), (128, 40)):
        regions, region_of = regions_of(places, modes), np.empty(500, int)
        for number, rows in enumerate(regions):
            region_of[rows] = number
        mode_region = np.repeat(np.arange(len(regions)), 3)
        for part in zones_of(places, zone):
            which = modes_there(mode_region, region_of, part)
            assert set(mode_region[which]) == set(region_of[part])
            assert which.stop - which.start == 3 * len(set(region_of[part]))


def test_sources_are_fine_enough_for_light_on_a_single_vertex():
    chance = np.random.default_rng(2)
    values, light = chance.normal(size=(40, 3)).astype(np.float32), chance.random((40, 2)).astype(np.float32)
    found = Sources.of(values, AREAS, np.random.default_rng(5).permutation(40)).brought(light)
    expected = light.T.astype(np.float64) @ (values * AREAS[:, None])
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3)
    dim = values * np.float32([1, 1e-2, 1]) ** np.arange(3)
    alone = np.eye(40, 1, -7, dtype=np.float32)
    found = Sources.of(dim, AREAS, np.arange(40)).brought(alone)
    np.testing.assert_allclose(found[0], AREAS[7] * dim[7], rtol=2e-3)


def test_what_lamps_ask_of_columns_is_turned_back_exactly():
    chance, groups = np.random.default_rng(3), Groups(np.array([0, 0, 1, 1, 2, 3], np.int32), 4)
    weights = chance.normal(size=(7, 30)) * np.logspace(-2, 2, 7)[:, None] / 2
    metric = Metric.of(weights, np.ones(6), groups)
    rows = chance.normal(size=(5, 7)).astype(np.float32)
    np.testing.assert_allclose(metric.unweighed(metric.weighed(rows)), rows, rtol=2e-3, atol=1e-4)
    seen = np.square(metric.weighed(rows)).sum(axis=1)
    asked = np.square(rows @ weights).mean(axis=1)
    assert (seen > 0.9 * asked).all()  # and what the lights ask by themselves, and a little of every column
    assert seen == pytest.approx(asked, rel=0.5)


def test_lamps_and_lights_that_see_nothing_ask_for_nothing():
    weights = np.zeros((5, 8))
    weights[:, :3] = np.random.default_rng(4).normal(size=(5, 3))
    targets, squares, modes = np.zeros((2, 8)), np.ones(2), slice(0, 2)
    targets[:, :3] = 1
    trials = Trials(weights[:3], targets, np.sqrt((targets**2).sum(axis=0)))
    lights = bright_for(np.array([0.0, 0, 2]), np.zeros((3, 2), np.float32), squares, modes)
    groups = Groups(np.array([0, 1, 2], np.int32), 3)
    metric = Metric.of(weights / trials.bright_in(squares, modes), lights, groups)
    rows = np.ones((2, 5), np.float32)
    assert np.isfinite(metric.weighed(rows)).all()
    np.testing.assert_allclose(metric.unweighed(metric.weighed(rows)), rows, rtol=2e-3)


def test_modes_make_up_for_what_merging_changes():
    chance, groups = np.random.default_rng(5), Groups(np.array([0, 0, 1], np.int32), 2)
    brought, weights = chance.random((3, 4)).astype(np.float32), chance.random((3, 6))
    trials = Trials(weights, chance.random((4, 6)), np.ones(6))
    own = slice(1, 3)
    for columns, means in (
        (trials.of_lights(brought, own), brought),
        (trials.of_groups(groups, brought, own), groups.means(brought)),
    ):
        all_brought = np.concatenate([means[:, own], np.eye(2)]).T @ columns
        np.testing.assert_allclose(all_brought, trials.targets[own], atol=1e-6)
