"""What every test shares: the folder of public test data, a seeded generator, strict floating point."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import numpy as np
import pytest

if TYPE_CHECKING:
    from .workshop import Answer

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


@pytest.fixture
def prelight(capfd) -> Callable[..., Answer]:
    """Run a command in this process; what it printed, by Python or below it."""
    from prelight.cli.main import run

    from .workshop import Answer

    def call(*arguments: str | Path) -> Answer:
        capfd.readouterr()
        code = run([str(a) for a in arguments])
        return Answer(code, *capfd.readouterr())

    return call


@pytest.fixture(scope="module")
def workshop(tmp_path_factory) -> Path:
    """A folder of good and bad inputs for the command line."""
    from .workshop import make_workshop

    return make_workshop(tmp_path_factory.mktemp("workshop"))
