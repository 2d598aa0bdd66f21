"""The paper's claims in small, each by counting: what the benchmark measures at full size."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.relighting.relighter import Relighter
from prelight.transport.exact import integrate_exactly

from .scenes import ball_on_floor


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    """Bakes of a ball on a floor, made when first asked for."""
    folder, known = tmp_path_factory.mktemp("claims"), {}

    def bake(resolution: int, tolerance: float):
        key = resolution, tolerance
        if key not in known:
            path = folder / f"{resolution}-{tolerance}.prelight"
            known[key] = bake_environment(
                ball_on_floor(), path, resolution=resolution, tolerance=tolerance, bounces=0
            )
        return known[key]

    return bake


def clusters(bake) -> int:
    return bake.layers["environment"].coefficients


def test_sixteen_times_the_lights_are_hardly_more_clusters(baked):
    """Table 2: 1.11 times at the looser threshold."""
    coarse, fine = (clusters(baked(R, 0.05)) for R in (64, 256))
    assert coarse > 100
    assert fine < 1.15 * coarse


def test_the_error_falls_with_the_tolerance(baked):
    """Section 6.1 and figure 9: fewer clusters, larger errors, shadows that blur."""
    cube = np.full((6, 32, 32, 3), 0.1, np.float32)
    cube[2, 8:12, 20:24] = 20
    counts, errors = [], []
    for tolerance in (0.01, 0.03, 0.09):
        light = Relighter(baked(32, tolerance), trace_strong=False)
        light.environment = Environment.from_cube(cube)
        receivers = light.bake.receivers
        true = integrate_exactly(
            receivers.positions, light.bake.triangles, receivers.normals,
            receivers=np.arange(len(receivers), dtype=np.int32), cube=cube,
        ) * receivers.albedo  # fmt: skip
        counts.append(clusters(light.bake))
        errors.append(float(np.sqrt(((light.radiance - true) ** 2).sum() / (true**2).sum())))
    assert counts == sorted(counts, reverse=True)
    assert errors == sorted(errors)
    assert errors[0] < 0.01
    assert errors[2] > 3 * errors[0]


def test_two_discs_read_a_twentieth(baked):
    """Section 6.2: two discs of 5 % and 10 % of a face, brightened: nothing is read; moved: a fraction of all."""
    light = Relighter(baked(128, 0.02))
    sky = Environment.stock("overcast")
    light.environment = sky
    whole = light.refresh().bytes_read

    def discs(turn: float, strength: float):
        small = Disc.at(90 + turn, 35, radius_deg=5.7, radiance=(20 * strength, 1, 1))
        large = Disc.at(-turn, 35, radius_deg=11.3, radiance=(1, 6 * strength, 1))
        return sky.with_discs([small, large])

    light.environment = discs(0, 0.1)
    light.environment = discs(0, 1)
    assert (light.last.kind, light.last.bytes_read) == ("local", 0)
    read, at_hand = [], light._live._discs._columns
    copied = needed = 0
    for turn in range(1, 20):
        before = at_hand._quad_in.copy()
        light.environment = discs(0.75 * turn, 1)
        assert light.last.kind == "local"
        read.append(light.last.bytes_read)
        copied += (at_hand._quad_in != before).sum()
        needed += (at_hand._needed == at_hand._now).sum()
    assert np.mean(read) < whole / 20
    assert 0 < copied < needed / 5  # out of tiles; others were at hand
    fresh = Relighter(light.bake)
    fresh.environment = discs(0.75 * 19, 1)
    assert light.radiance == pytest.approx(fresh.radiance, rel=1e-6, abs=1e-6)
