"""The figures of a comparison: known answers, and whether they see what they should."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from prelight.checking.comparison import compare
from prelight.errors import InputError


def test_figures_of_a_known_difference():
    reference = np.float64([[1, 2, 3], [0, 4, 2]])
    radiance = reference + np.float64([[0.1, -0.2, 0], [0, 0, 0.6]])
    figures = compare(radiance, reference, np.full((2, 3), 0.04))
    assert figures.relative_rms == pytest.approx(math.sqrt(0.41 / 34))
    assert figures.mean_difference == pytest.approx(0.9 / 12)
    assert figures.signed_mean == pytest.approx(0.5 / 12)
    assert figures.worst == pytest.approx(0.6 / 2)
    assert figures.noise == pytest.approx(math.sqrt(6 * 0.04 / 34))
    spread = math.sqrt(2 * 0.6**2)  # three colours that share their noise, twice
    assert figures.pooled_z == pytest.approx(0.5 / spread)
    assert figures.detectable_bias == pytest.approx(3.5 * spread / 12)
    assert figures.z_rejected_share == 0


def test_without_a_variance_only_the_tolerance_counts():
    reference = np.ones((10, 3))
    radiance = reference.copy()
    radiance[0] += 0.5
    radiance[1] += 0.05
    figures = compare(radiance, reference, tolerance=0.1)
    assert figures.z_rejected_share == pytest.approx(0.1)
    assert (figures.noise, figures.detectable_bias, figures.pooled_z) == (0, 0, 0)
    told = figures.to_dict(reference_seconds=2.5)
    assert told["reference_seconds"] == 2.5
    assert {"relative_rms", "mean_difference", "signed_mean", "worst", "detectable_bias"} < told.keys()
    assert {"z_rejected_share", "pooled_z"} < told.keys()
    dark = compare(radiance, np.zeros((10, 3))).to_dict(reference_seconds=0)
    assert json.loads(json.dumps(dark, allow_nan=False))["relative_rms"] is None


@pytest.mark.parametrize("shared", [True, False])
def test_noise_passes_and_half_a_percent_of_bias_does_not(shared, rng):
    """4,000 receivers with 10 % of noise, the same in all colours or in each its own."""
    truth = rng.random((4000, 3)) + 0.5
    rejected = 0
    for _ in range(20):
        noise = rng.normal(size=(4000, 1 if shared else 3)) * 0.1
        figures = compare(truth, truth + noise, np.full((4000, 3), 0.01))
        assert figures.z_rejected_share < 0.0025
        rejected += not figures.is_unbiased
    assert rejected <= 1
    figures = compare(truth * 1.01, truth + noise, np.full((4000, 3), 0.01))
    assert not figures.is_unbiased
    assert figures.detectable_bias < 0.01
    single = truth.copy()
    single[7] += 1
    assert compare(single, truth + noise, np.full((4000, 3), 0.01)).z_rejected_share == pytest.approx(
        3 / 12000
    )


@pytest.mark.parametrize(
    ("radiance", "variance", "match"),
    [
        (np.ones((2, 3)), None, "shapes"),
        (np.full((3, 3), np.nan), None, "finite"),
        (np.ones((3, 3)), np.ones((3, 1)), "variance"),
        (np.ones((3, 3)), np.full((3, 3), -1.0), "variance"),
    ],
)
def test_what_cannot_be_compared_is_refused(radiance, variance, match):
    with np.errstate(invalid="ignore"), pytest.raises(InputError, match=match):
        compare(radiance, np.ones((3, 3)), variance)
