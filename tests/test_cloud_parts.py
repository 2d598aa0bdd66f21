"""Parts of a cloud of lights against what is known without them: closed cases, exactness, the renderer."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.cloud_grid import light_grid
from prelight.encoding.clustered_pca import allocated, clustered_components
from prelight.encoding.light_clustering import (
    kept_apart,
    merged,
    near_pairs,
    pair_distances,
    suggested_weights,
)
from prelight.encoding.light_fit import bounded, fitted, kernel, nearest, normalised, prior
from prelight.errors import InputError
from prelight.rays.plain_light_rays import PlainLightRays
from prelight.rays.segments import PlainSegments

from .rooms import SIZE, box, room, scene_of_rectangles


def groups(positions, answers, *, w1: float, w2: float, hidden=()) -> list[int]:
    pairs = near_pairs(np.float64(positions), w1=w1)
    seen = np.array([tuple(pair) not in hidden for pair in pairs.which.tolist()], bool)
    found = merged(pair_distances(pairs.chosen(seen), np.float32(answers), w2=w2))
    return found.group_of.tolist()


def dark(lights: int) -> np.ndarray:
    return np.zeros((lights, 4, 3), np.float32)


ROW = [(0.0, 0, 0), (1.0, 0, 0), (2.0, 0, 0), (3.5, 0, 0)]


def test_lights_merge_by_distance_alone_where_they_light_alike():
    assert groups(ROW, dark(4), w1=0.9, w2=5.0) == [0, 0, 1, 2]  # 0–1 first; 0–2 is too far for one group
    assert groups(ROW, dark(4), w1=0.45, w2=5.0) == [0, 0, 1, 1]  # 2–3 is nearer than 0–2
    assert groups(ROW, dark(4), w1=1.01, w2=5.0) == [0, 1, 2, 3]


def test_lights_that_do_not_see_each_other_never_merge():
    assert groups(ROW[:2], dark(2), w1=0.1, w2=0.0) == [0, 0]
    assert groups(ROW[:2], dark(2), w1=0.1, w2=0.0, hidden={(0, 1)}) == [0, 1]


def test_the_largest_difference_at_any_receiver_counts_over_all_numbers():
    answers = dark(2)
    answers[1, 2] = 0.3, 0.0, 0.4  # 0.5 at one receiver, 0 at the others
    assert groups(ROW[:2], answers, w1=0.1, w2=1.79) == [0, 0]  # 0.1 + 1.79 · 0.5 < 1
    assert groups(ROW[:2], answers, w1=0.1, w2=1.81) == [0, 1]


def test_dim_lights_stay_apart_where_merging_would_change_most_of_what_they_bring():
    answers = dark(3)
    answers[:, :, 0] = [[1.0], [1.01], [0.02]]
    answers[2, 1, 0] = 0.03
    distances = pair_distances(near_pairs(np.float64(ROW[:3]), w1=0.1), answers, w2=0.1)
    assert merged(distances).count == 1
    size = np.sqrt(np.square(answers).sum(axis=(1, 2)))
    assert merged(kept_apart(distances, answers, 0.05 * size)).group_of.tolist() == [0, 0, 1]
    assert merged(kept_apart(distances, answers, 0.005 * size)).group_of.tolist() == [0, 1, 2]


def test_no_group_has_a_pair_at_or_above_one_and_no_two_groups_could_merge():
    chance = np.random.default_rng(1)
    places, answers = chance.random((60, 3)), chance.random((60, 9, 3)).astype(np.float32) * 0.4
    distances = pair_distances(near_pairs(places, w1=1.3), answers, w2=0.9)
    found = merged(distances)
    assert 5 < found.count < 50
    whole = np.array(
        [
            [distances[np.ix_(found.group_of == a, found.group_of == b)].max() for b in range(found.count)]
            for a in range(found.count)
        ]
    )
    assert np.diag(whole).max() < 1
    assert (whole + 2 * np.eye(found.count)).min() >= 1


def test_directional_lights_that_aim_apart_stay_apart():
    aims = np.array([(0, -1, 0), (0, -1, 0), (0, 1, 0)], np.float64)
    pairs = near_pairs(np.zeros((3, 3)), w1=0.5, aims=aims)
    assert pairs.which.tolist() == [[0, 1]]


def test_means_of_groups_are_arithmetic():
    pairs = near_pairs(np.float64(ROW), w1=0.45)
    found = merged(pair_distances(pairs, dark(4), w2=0.0))
    np.testing.assert_allclose(found.means(np.float32([1, 2, 6, 5])), [1.5, 5.5])


def test_weights_are_suggested_by_size_and_brightness():
    small, large = suggested_weights(2.0, 0.5), suggested_weights(20.0, 0.05)
    assert small.w1 == pytest.approx(10 * large.w1)
    assert large.w2 == pytest.approx(10 * small.w2)


def rows(receivers: int = 90, columns: int = 24, rank: int = 5) -> np.ndarray:
    chance = np.random.default_rng(2)
    return (chance.normal(size=(3, receivers, rank)) @ chance.normal(size=(rank, columns))).astype(np.float32)


def test_allocated_components_go_where_they_gain_most_in_all_zones():
    even, rich = rows(rank=2), rows(rank=12)
    zones = [clustered_components(X, clusters=1, mean_components=12)[0] for X in (even, rich)]
    few = allocated(zones, mean_components=7)
    assert len(few[0].basis) <= 2 or few[0].gains[2] < 1e-9
    assert sum(len(cluster.basis) for cluster in few) <= 14
    for X, cluster in zip((even, rich), few, strict=True):
        assert cluster.left == pytest.approx(
            left_over(X, [cluster]) ** 2 * float(np.square(X).sum()), rel=1e-3, abs=1e-3
        )


def test_important_receivers_are_approximated_better():
    X, importance = rows(rank=12), np.ones(90, np.float32)
    importance[:9] = 100
    plain, weighed = (
        clustered_components(X, clusters=1, mean_components=5, importance=w)[0] for w in (None, importance)
    )
    off = [
        np.square(np.stack([c.approximation(k) for k in range(3)]) - X)[:, :9].sum() for c in (plain, weighed)
    ]
    assert off[1] < 0.8 * off[0]


def left_over(X: np.ndarray, clusters) -> float:
    off = sum(
        float(np.square(cluster.approximation(c) - X[c][cluster.rows]).sum())
        for cluster in clusters
        for c in range(len(X))
    )
    return (off / float(np.square(X).sum())) ** 0.5


@pytest.mark.parametrize("count", [1, 4])
def test_components_are_exact_at_full_rank(count):
    X = rows()
    found = clustered_components(X, clusters=count, mean_components=24)
    assert left_over(X, found) < 3e-6
    assert sorted(np.concatenate([cluster.rows for cluster in found]).tolist()) == list(range(90))
    assert left_over(X, clustered_components(X, clusters=count, mean_components=2)) > 0.05


def test_the_mean_number_of_components_is_kept_to_and_more_clusters_lose_less():
    chance = np.random.default_rng(3)
    bends = np.linspace(0, 3, 120)[:, None] * np.linspace(1, 4, 40)
    X = np.sin(bends)[None].astype(np.float32) + 0.01 * chance.normal(size=(1, 120, 40)).astype(np.float32)
    lost = []
    for count in (1, 3, 6):
        found = clustered_components(X, clusters=count, mean_components=3)
        used = sum(len(c.rows) * len(c.basis) for c in found) / 120
        assert used <= 3
        lost.append(left_over(X, found))
    assert lost[0] > lost[1] > lost[2]


def test_components_stop_at_the_error_that_is_asked_for():
    X = rows(rank=12)
    few = clustered_components(X, clusters=1, mean_components=12, error=0.2)
    assert left_over(X, few) <= 0.2
    assert len(few[0].basis) < 12


def test_the_paper_s_kernel_ends_at_its_rim():
    distances = np.array([0.0, 0.5, 1.0, 1.5])
    np.testing.assert_allclose(kernel(distances, 1.0), [1, 0.0625, 0, 0])
    np.testing.assert_allclose(normalised(kernel(distances, 1.0)).sum(), 1)


def test_nearest_are_the_nearest_in_order():
    places = np.random.default_rng(4).random((50, 3))
    found, far = nearest(places, np.array([0.5, 0.5, 0.5]), 7)
    every = np.linalg.norm(places - 0.5, axis=1)
    np.testing.assert_array_equal(found, np.argsort(every)[:7])
    np.testing.assert_allclose(far, np.sort(every)[:7])


def test_a_lamp_on_a_light_is_that_light():
    chance = np.random.default_rng(5)
    fluxes, far = chance.random((6, 40)).astype(np.float32), np.array([0.0, 0.4, 0.5, 0.7, 0.8, 1.0])
    shape = kernel(far, 1.0)
    w = fitted(fluxes[0].astype(np.float64), fluxes, prior(far, shape), np.sqrt(shape))
    np.testing.assert_allclose(w, [1, 0, 0, 0, 0, 0], atol=1e-6)


def test_fitted_weights_find_a_mixture_and_the_rim_has_none():
    chance = np.random.default_rng(6)
    fluxes = chance.random((5, 60)).astype(np.float32)
    far, shape = np.array([0.1, 0.2, 0.3, 0.4, 1.0]), kernel(np.array([0.1, 0.2, 0.3, 0.4, 1.0]), 1.0)
    target = np.array([0.1, 0.6, 0.2, 0.1, 0.0]) @ fluxes.astype(np.float64)
    w = fitted(target, fluxes, prior(far, shape), np.sqrt(shape))
    assert w[4] == 0
    left = np.linalg.norm(target - w @ fluxes) / np.linalg.norm(target)
    assert left < 0.3 * np.linalg.norm(target - prior(far, shape) @ fluxes) / np.linalg.norm(target)


def test_a_lamp_whose_light_falls_nowhere_has_no_weights():
    w = fitted(np.zeros(9), np.ones((3, 9), np.float32), np.full(3, 1 / 3), np.ones(3))
    np.testing.assert_allclose(w, 0, atol=1e-12)


def test_light_sent_on_is_no_more_than_a_surface_can_have():
    areas = np.float32([0.01, 0.04])
    np.testing.assert_allclose(bounded(np.float32([1e6, 1.0]), areas), [200.0, 1.0])


def test_segments_see_what_the_renderer_sees():
    scene = room(6, more=box((1, 0.2, 2), (2, 1.5, 3)))
    segments = PlainSegments(scene.positions, scene.triangles, scene.normals)
    from prelight.rays.mitsuba import Occluders

    chance = np.random.default_rng(7)
    a, b = (np.float64((4.4, 3.4, 5.4)) * chance.random((2, 4000, 3)) - 0.2).astype(np.float32)
    occluders = Occluders(scene.positions, scene.triangles)
    mi = occluders.mi
    o, d = (mi.Point3f(*(mi.Float(np.ascontiguousarray(x)) for x in v.T)) for v in (a, b - a))
    ray = mi.Ray3f(o, mi.Vector3f(d))
    ray.maxt = 1.0
    free = ~occluders.scene.ray_test(ray).numpy()
    assert 0.2 < free.mean() < 0.9
    assert (segments.are_free(a, b) == free).mean() > 0.999


def test_points_in_solids_see_backs_alone():
    scene = room(4, more=box((1, 0.2, 2), (2, 1.5, 3)))
    segments = PlainSegments(scene.positions, scene.triangles, scene.normals)
    shares = segments.shares_of_backs(np.array([(1.5, 1, 2.5), (3, 1, 1), (3, 2.5, 4.5)], np.float64))
    assert shares[0] == 1
    assert (shares[1:] == 0).all()


def test_light_rays_without_the_renderer_are_those_with_it():
    scene = room(6, more=box((1, 0.2, 2), (2, 1.5, 3)))
    from prelight.rays.mitsuba import Occluders
    from prelight.transport.light_rays import LightRays
    from prelight.transport.vantage import vantage_points

    occluders = Occluders(scene.positions, scene.triangles)
    origins = vantage_points(scene, occluders)
    plain = PlainLightRays(scene.positions, scene.triangles, normals=scene.normals, origins=origins)
    known = LightRays(scene, occluders, origins)
    everywhere = np.arange(len(scene.positions), dtype=np.int32)
    at, corners = np.array([3.0, 2.0, 4.0]), np.array([(1.0, 2.9, 1), (2, 2.9, 1), (2, 2.9, 4), (1, 2.9, 4)])
    facing = np.einsum("ij,ij->i", scene.normals, at - scene.positions) > 0.3
    for ours, theirs, off in (
        (plain.of_ball(everywhere, at, 0.0, rays=1), known.of_ball(everywhere, at, 0.0, rays=1), 0.02),
        (plain.of_ball(everywhere, at, 0.3, rays=64), known.of_ball(everywhere, at, 0.3, rays=64), 0.02),
        (plain.of_panel(everywhere, corners, rays=64), known.of_panel(everywhere, corners, rays=64), 0.04),
    ):
        assert 0.05 < theirs[facing].mean() < 1
        assert np.abs(ours - theirs)[facing].mean() < off


def test_two_sheets_have_no_inside():
    scene = scene_of_rectangles(*box((0, 0, 0), (1, 1, 1))[:2])
    segments = PlainSegments(scene.positions, scene.triangles, scene.normals)
    assert segments.shares_of_backs(np.array([[9.0, 9.0, 9.0]]))[0] <= 1


def test_lights_are_twice_as_dense_along_walls():
    scene = room(4)
    segments = PlainSegments(scene.positions, scene.triangles, scene.normals)
    plain, dense = (light_grid(scene, segments, lights=60, shell=shell) for shell in (0.0, 0.45))
    walls, of_plain = (
        np.min([*grid.positions.T, *(np.array(SIZE) - grid.positions).T], axis=0) for grid in (dense, plain)
    )
    apart = np.linalg.norm(dense.positions[:, None] - dense.positions[None], axis=2)
    np.fill_diagonal(apart, 9)
    half = dense.step.min() / 2
    assert apart.min(axis=1)[walls < 0.3].max() <= half + 1e-9
    assert apart.min() > 0.8 * half
    assert (walls > 1.2).sum() == (of_plain > 1.2).sum()
    with pytest.raises(InputError, match="fewer --lights"):
        light_grid(scene, segments, lights=4000, shell=3.0)


def test_a_box_that_makes_no_sense_is_refused():
    from prelight.baking.cloud_settings import CloudSettings

    for settings in (
        {"box": ((0, 0, 0), (1, 1, 0))}, {"box": ((0, 0, 0), (1, 1, float("nan")))}, {"lights": 0}, {"zone": 3},
        {"coefficients": -1.0}, {"modes": 0}, {"codes": "nibbles"}, {"merge": "max"}, {"w1": float("inf")},
        {"gather_rays": 1000}, {"radius": -1.0}, {"memory": 1000}, {"lights": 10**6}, {"shell": -1.0},
    ):  # fmt: skip
        with pytest.raises(InputError):
            CloudSettings(**settings)
