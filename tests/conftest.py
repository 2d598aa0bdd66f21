"""What every test shares: the folder of public test data, a seeded generator, strict floating point."""

from __future__ import annotations

import os
from pathlib import Path

import hypothesis
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]

hypothesis.settings.register_profile("prelight", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("prelight")


def pytest_configure() -> None:
    # A NaN or a division by zero is a bug where it arises, not three modules later.
    np.seterr(divide="raise", over="raise", invalid="raise")


@pytest.fixture(scope="session")
def data() -> Path:
    """The public meshes and light probes, which are too large and not ours to keep in the tree."""
    folder = Path(os.environ.get("PRELIGHT_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(
            f"no test data: {folder} is missing; PRELIGHT_DATA may name a folder with bunny/ and probes/"
        )
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """The same random numbers in every run and order of tests."""
    return np.random.default_rng(20260101)
