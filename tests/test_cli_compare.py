"""`prelight compare`: the figures it tells are true, it sees what is wrong, and its pictures are whole."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.cli.main import run
from prelight.relighting.relighter import Relighter
from prelight.transport import cube_emitter, path_tracing

from .disk import copy
from .scenes import grid, scene_of
from .workshop import assert_refusal, ply

NAMES = {
    "relative_rms", "mean_difference", "signed_mean", "worst", "detectable_bias", "z_rejected_share", "pooled_z",
    "reference_seconds",
}  # fmt: skip
STILL_LIFE = ["stock:still-life-small", "--resolution", "8"]
BAKES = {
    "roof": ["roof.ply", "--resolution", "32"],
    "coarse": ["roof.ply", "--resolution", "32", "--tolerance", "0.2"],
    "eye": [*STILL_LIFE, "--camera", "front"],
    "pixels": [*STILL_LIFE, "--receivers", "pixels", "--camera", "front", "--size", "24x16", "--pixel-samples", "1"],
}  # fmt: skip


@pytest.fixture(scope="module")
def bakes(tmp_path_factory) -> Path:
    """A folder with bakes: a roof eight metres above a wide floor, without any curve; a glossy still life."""
    folder = tmp_path_factory.mktemp("bakes")
    scene = scene_of(grid(14, size=60.0), grid(4, size=20.0, height=8.0))
    rows = [" ".join(map(str, p)) for p in scene.positions.tolist()]
    faces = ["3 " + " ".join(map(str, t)) for t in scene.triangles.tolist()]
    (folder / "roof.ply").write_bytes(ply(rows, faces))
    for name, (mesh, *options) in BAKES.items():
        scene_file = str(folder / mesh) if mesh.endswith(".ply") else mesh
        target = folder / f"{name}.prelight"
        options += [
            "--bounces",
            "0",
            "-o",
            str(target),
            "--json",
        ]  # of direct light; ``test_bounced`` has the rest
        assert run(["bake", "environment", scene_file, *options]) == 0
    return folder


def figures_of(answer) -> dict:
    assert (answer.code, answer.err) == (0, ""), answer
    figures = json.loads(answer.out)
    assert figures.keys() >= NAMES
    assert all(np.isfinite(figures[name]) for name in NAMES)
    return figures


@pytest.mark.parametrize("bake", ["roof", "eye", "pixels"])
def test_exact_integration_finds_what_clusters_lose(prelight, bakes, bake):
    """Little, where the tolerance is the usual one; and it is without noise."""
    path = bakes / f"{bake}.prelight"
    figures = figures_of(prelight("compare", path, "stock:studio", "--exact", "--receivers", "150", "--json"))
    assert (figures["receivers"], figures["reference"], figures["samples"]) == (150, "exact", None)
    assert 0 < figures["relative_rms"] < 0.02
    assert abs(figures["signed_mean"]) <= figures["mean_difference"] <= figures["worst"] < 0.2
    assert (figures["noise"], figures["detectable_bias"], figures["pooled_z"]) == (0, 0, 0)
    assert figures["z_rejected_share"] < 0.01


def test_a_coarse_bake_is_found_out(prelight, bakes):
    fine, coarse = (
        figures_of(prelight("compare", bakes / f"{name}.prelight", "stock:sunset", "--exact", "--json"))
        for name in ("roof", "coarse")
    )
    assert coarse["relative_rms"] > 0.05
    assert coarse["relative_rms"] > 10 * fine["relative_rms"]
    assert coarse["z_rejected_share"] > 0.2 > 0.01 > fine["z_rejected_share"]


@pytest.mark.parametrize("light", ["good.exr", "stock:overcast"])
def test_the_path_tracer_agrees_within_what_it_can_tell(prelight, workshop, bakes, light):
    """Shadows from eight metres above, too: its shadow rays go all the way. (R = 16 would be 0.3 % too bright.)"""
    light = workshop / light if light.endswith(".exr") else light
    figures = figures_of(
        prelight("compare", bakes / "roof.prelight", light, "--receivers", 0, "--samples", 1024, "--json")
    )
    assert (figures["receivers"], figures["samples"]) == (14**2 + 4**2, 1024)
    assert 0 < figures["detectable_bias"] < 0.005
    assert abs(figures["signed_mean"]) < figures["detectable_bias"]
    assert figures["relative_rms"] < 2 * figures["noise"]


def test_a_path_tracer_that_sees_two_metres_disagrees(prelight, workshop, bakes, monkeypatch):
    """The test above can fail: an occluder farther off than shadow rays go is missed."""
    monkeypatch.setattr(cube_emitter, "_FAR", 2.0)
    answer = prelight("compare", bakes / "roof.prelight", workshop / "good.exr", "--json")
    figures = figures_of(answer)
    assert figures["signed_mean"] < -3 * figures["detectable_bias"]


def test_fixed_eyes_are_looked_at_from_close_by(prelight, bakes, monkeypatch):
    """A ray to a vertex that begins far outside begins inside something else."""
    call = ["compare", bakes / "eye.prelight", "stock:overcast", "--samples", "64", "--json"]
    near = figures_of(prelight(*call))
    monkeypatch.setattr(path_tracing, "_LIFTS", 100)
    far = figures_of(prelight(*call))
    assert near["relative_rms"] < 0.15
    assert far["relative_rms"] > 1.5 * near["relative_rms"]


def test_what_is_wrong_by_a_factor_is_told_in_words(prelight, bakes, monkeypatch):
    honest = Relighter.radiance.fget
    monkeypatch.setattr(Relighter, "radiance", property(lambda self: np.float32(1.05) * honest(self)))
    call = ["compare", bakes / "roof.prelight", "stock:overcast"]
    assert figures_of(prelight(*call, "--exact", "--json"))["signed_mean"] == pytest.approx(0.05, abs=0.003)
    said = prelight(*call, "--samples", "1024")
    assert (said.code, said.err) == (0, "")
    assert "differ by more than noise explains" in said.out
    monkeypatch.undo()
    said = prelight(*call)
    assert "can tell from noise" in said.out
    assert "detectable" in said.out
    assert "noise" not in prelight(*call, "--exact").out


@pytest.mark.parametrize(
    ("bake", "options", "wide", "high"),
    [
        ("roof", ["--size", "64x36", "--exact"], 64 * 5, 36 * 5),  # small pictures are enlarged
        ("eye", ["--size", "480x32", "--exact", "--emphasis", "20"], 480, 32),
        ("pixels", ["--samples", "64"], 24 * 13, 16 * 13),
        ("pixels", ["--samples", "64", "--size", "24x16"], 24 * 13, 16 * 13),
    ],
)
def test_pictures(prelight, bakes, tmp_path, bake, options, wide, high):
    """Bake, reference and difference beside each other, of all receivers that are seen."""
    output = tmp_path / "p.png"
    call = ["compare", bakes / f"{bake}.prelight", "stock:studio", "-o", output, "--json", *options]
    figures = figures_of(prelight(*call))
    assert figures["output"] == str(output)
    pixels = np.asarray(Image.open(output).convert("RGB"))
    gap = 12
    assert pixels.shape[1] == 3 * wide + 4 * gap
    assert high + 2 * gap < pixels.shape[0] < high + 150
    ours, theirs, difference = (
        pixels[gap : gap + high, gap + k * (wide + gap) : (k + 1) * (wide + gap)].astype(float)
        for k in range(3)
    )
    assert ours.std() > 10  # a picture, not an even colour
    assert np.abs(ours - theirs).mean() < (12 if "--samples" in options else 3)
    assert difference.mean() < 128
    if bake == "pixels":
        assert figures["receivers"] <= 24 * 16
    assert_refusal(prelight(*call), 3, "--force")
    assert prelight(*call, "--force").code == 0


BAD_OPTIONS = {
    "--samples": ["15", "65537", "x", "1e3"],
    "--receivers": ["-1", "x"],
    "--seed": ["x"],
    "--emphasis": ["0", "nan", "-1", "1001", "inf", "x"],
    "--size": ["0x0", "64", ""],
    "--camera": ["nowhere", "missing.json"],
    "--layout": ["odd"],
    "-o": ["picture.jpg", "picture", ""],
}  # fmt: skip


@pytest.mark.parametrize(("option", "value"), [(o, v) for o, values in BAD_OPTIONS.items() for v in values])
def test_bad_options(prelight, bakes, workshop, tmp_path, monkeypatch, option, value):
    monkeypatch.chdir(tmp_path)
    assert_refusal(
        prelight("compare", bakes / "roof.prelight", workshop / "good.exr", "--exact", option, value), 2
    )
    assert not list(tmp_path.iterdir())


def test_other_refusals(prelight, bakes, tmp_path):
    pixels, output = bakes / "pixels.prelight", tmp_path / "p.png"
    assert_refusal(
        prelight("compare", pixels, "stock:noon", "-o", output, "--size", "32x16"), 2, "--size", "24x16"
    )
    assert_refusal(prelight("compare", pixels, "stock:noon", "--camera", "close"), 2, "camera")
    assert_refusal(prelight("compare", tmp_path / "none.prelight", "stock:noon"), 2, "no such bake")
    assert_refusal(prelight("compare", pixels, "stock:nothing"), 2, "stock:nothing")
    away = tmp_path / "away.json"
    away.write_text(json.dumps({"eye": [0, 500, 0], "target": [0, 900, 0.1]}))
    assert_refusal(
        prelight("compare", bakes / "roof.prelight", "stock:noon", "-o", output, "--camera", away),
        2,
        "sees nothing",
    )
    assert not output.exists()
    where = tmp_path / "nowhere" / "p.png"
    assert_refusal(prelight("compare", pixels, "stock:noon", "--exact", "-o", where), 3, "p.png")
    damaged = copy(pixels, tmp_path / "damaged.prelight")
    chunk = next((damaged / "layers/environment/tiles").rglob("c/0/0/0"))
    chunk.write_bytes(bytes([chunk.read_bytes()[0] ^ 1]) + chunk.read_bytes()[1:])
    assert_refusal(prelight("compare", damaged, "stock:noon", "--exact"), 4, "tiles")
