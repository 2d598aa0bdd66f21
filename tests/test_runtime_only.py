"""Without the offline half installed: a bake is opened, lit, drawn and written; baking says what is missing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from prelight.storage.bake import Bake

from .disk import quick_bake
from .zoned_bake import random_zones, write_bake

BARE = """
import sys

class Without:
    names = {"mitsuba", "drjit", "trimesh", "scipy", "zarr"}

    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, path=None, target=None):
        return None if name.partition(".")[0] in self.names else self.finder.find_spec(name, path, target)

    def __getattr__(self, name):
        return getattr(self.finder, name)

sys.meta_path[:] = [Without(finder) for finder in sys.meta_path]
"""

NOTEBOOK = """
import numpy as np
import prelight as pl

bake = pl.Bake.open(sys.argv[1])
light = pl.Relighter(bake)
light.environment = pl.Environment.stock("sunset").rotated(30)
np.save("radiance.npy", light.radiance)
light.edit(2, slice(0, 2), slice(0, 2), np.array([9.0, 9.0, 9.0]))
light.environment = light.environment.with_disc(pl.Disc.at(40, 30, radius_deg=5, radiance=(9, 8, 7)))
assert light.last.kind == "local"
for name in ("notebook.png", "notebook.exr"):
    light.picture(width=64, height=36).save(name)
rig = pl.Rig.open("stock:noon")
loaded = {name.partition(".")[0] for name in sys.modules} & Without.names
assert not loaded, loaded
"""

COMMAND = "from prelight.cli.main import main; main()"


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Bake:
    return quick_bake(tmp_path_factory.mktemp("bake") / "ball.prelight")


def bare(code: str, *arguments: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run code where nothing of the offline half can be imported."""
    source = str(Path(__file__).resolve().parents[1] / "src")
    path = os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-c", BARE + code, *map(str, arguments)],
        cwd=folder, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_notebook_without_the_renderer(bake, tmp_path):
    ran = bare(NOTEBOOK, bake.path, folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "notebook.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "notebook.exr").read_bytes().startswith(b"v/1\x01")
    assert (tmp_path / "radiance.npy").read_bytes().startswith(b"\x93NUMPY")


def test_pixels_without_the_renderer(tmp_path, rng):
    """Three channels toward an eye, in two zones; light that is strong stays in its clusters."""
    zones = random_zones(rng, 12 * 8, (3, 3), resolution=8)
    pixels = write_bake(tmp_path / "pixels.prelight", zones, resolution=8, rows=96, picture=(12, 8))
    code = NOTEBOOK.replace("picture(width=64, height=36)", "picture()")
    ran = bare(code, pixels.path, folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "notebook.png").read_bytes().startswith(b"\x89PNG")


def test_relight_without_the_renderer(bake, tmp_path):
    ran = bare(
        COMMAND, "relight", bake.path, "stock:sunset", "-o", "a.png", "--size", "64x36", folder=tmp_path
    )
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_inspect_and_verify_without_the_renderer(bake, tmp_path):
    both = "from prelight.cli.main import run; sys.exit(max(run([c, sys.argv[1]]) for c in ('inspect', 'verify')))"
    ran = bare(both, bake.path, folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "whole" in ran.stdout


def test_baking_says_how_to_get_the_rest(tmp_path):
    """In one line, before any work, and nothing is left behind."""
    mesh = tmp_path / "triangle.ply"
    rows = ["0 0 0", "1 0 0", "0 0 1", "3 0 2 1"]
    head = ["ply", "format ascii 1.0", "element vertex 3", *(f"property float {axis}" for axis in "xyz")]
    head += ["element face 1", "property list uchar int vertex_indices", "end_header"]
    mesh.write_text("\n".join(head + rows) + "\n")
    for more in ([], ["--dry-run", "--json"]):
        ran = bare(COMMAND, "bake", "environment", mesh, "-o", "new.prelight", *more, folder=tmp_path)
        assert ran.returncode == 2
        assert not ran.stdout
        assert ran.stderr.startswith("prelight: ")
        assert ran.stderr.count("\n") == 1
        assert "pip install" in ran.stderr
        assert os.listdir(tmp_path) == ["triangle.ply"]
    ran = bare(COMMAND, "demo", "-o", "demo", folder=tmp_path)
    assert (ran.returncode, ran.stderr.count("\n")) == (2, 1)
    assert "pip install" in ran.stderr


def test_doctor_without_the_renderer(tmp_path):
    ran = bare(COMMAND, "doctor", "--json", folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    found = json.loads(ran.stdout)
    assert found["can_bake"] is False
    assert any("pip install" in advice for advice in found["advice"])
