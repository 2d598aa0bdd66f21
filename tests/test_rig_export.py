"""A rig goes out as Mitsuba's XML, whose picture is the one that ``prelight relight`` draws."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.images.formats import read_radiance_map

from .scenes import ball_on_floor

mi_there = pytest.importorskip("mitsuba", reason="the renderer is not installed")
WIDTH, HEIGHT, BLOCK = 96, 54, 6
# Each where a picture by vertices holds it: no sharp edge of a shadow, nothing of it seen.
LIGHTS = {
    "sky": '[environment]\nmap = "stock:overcast"\nrotate_deg = 50\ntint = [1.0, 0.8, 0.6]\n',
    "panel": "[[panel]]\nposition = [0, 3.5, 0]\nsize = [3, 3]\ntarget = [0, 0, 0]\nlumens = 9000\nkelvin = 3000\n",
    "lamp": "[[lamp]]\nposition = [-1.5, 3.5, 1]\nradius = 0.5\nlumens = 9000\n",
    "spot": "[[spot]]\nposition = [1, 4, 2.5]\ntarget = [0, 0, 0.5]\nradius = 0.05\n"
    "width_deg = 70\nintensity = [90, 60, 30]\n",
}


def _blocks(picture: np.ndarray) -> np.ndarray:
    parts = picture.reshape(HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK, 3)
    return parts.mean(axis=(1, 3))


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "ball.prelight"
    bake_transfer(
        ball_on_floor(side=31), path, settings=TransferSettings(gather_rays=400, entries=128, modes=32)
    )
    return path


def _rendered(xml) -> np.ndarray:
    from prelight.scene.variant import mitsuba

    mi = mitsuba()
    return np.array(mi.render(mi.load_file(str(xml)), seed=3))


@pytest.mark.parametrize("light", LIGHTS)
def test_mitsuba_draws_what_relight_draws(light, bake, tmp_path, prelight) -> None:
    rig = tmp_path / "a.toml"
    rig.write_text(LIGHTS[light])
    camera = tmp_path / "eye.json"
    camera.write_text('{"eye": [0, 2.6, 5.2], "target": [0, 0.2, 0], "vertical_fov_deg": 20}')
    ours = tmp_path / "ours.exr"
    size, samples = f"{WIDTH}x{HEIGHT}", 512 if light == "spot" else 128
    assert prelight("relight", bake, rig, "-o", ours, "--size", size, "--camera", camera).code == 0
    made = prelight("rig", "export", bake, rig, "-o", tmp_path / "a.xml", "--size", size, "--samples", samples,
                    "--camera", camera)  # fmt: skip
    assert made.code == 0, made.err
    mine, theirs = _blocks(read_radiance_map(ours).astype(np.float64)), _blocks(_rendered(tmp_path / "a.xml"))
    seen = theirs > 0.2 * np.median(theirs)
    difference = np.abs(mine / np.where(seen, theirs, 1.0) - 1)[seen]
    assert seen.mean() > 0.6
    assert mine[seen].sum() == pytest.approx(theirs[seen].sum(), rel=0.02)
    assert np.median(difference) < 0.02, np.median(difference)
    assert np.quantile(difference, 0.9) < 0.08, np.quantile(difference, 0.9)


@pytest.mark.parametrize("scene", ["still-life-small", "steerable-small"])
def test_mitsuba_reads_every_material_of_the_stock_scenes(scene, tmp_path, prelight) -> None:
    told = prelight("rig", "export", f"stock:{scene}", "stock:noon", "-o", tmp_path / "a.xml", "--size", "16x9",
                    "--samples", "4", "--camera", "front")  # fmt: skip
    assert told.code == 0, told.err
    picture = _rendered(tmp_path / "a.xml")
    assert picture.shape == (9, 16, 3)
    assert np.isfinite(picture).all()
    assert picture.mean() > 0 or scene == "steerable-small"  # a closed room: its lamps are its layers'
    root = ElementTree.parse(tmp_path / "a.xml").getroot()
    named = {node.get("value") for node in root.iter("string") if node.get("name") == "filename"}
    assert {f"a-files/{path.name}" for path in (tmp_path / "a-files").iterdir()} == named


def test_what_cannot_go_out_is_said(tmp_path, prelight) -> None:
    rig = tmp_path / "a.toml"
    rig.write_text('[environment]\nmap = "stock:noon"\n[outside]\nscene = "stock:town"\n')
    for arguments, said in [
        (("stock:sculpture-small", rig, "-o", tmp_path / "a.xml"), "outside"),
        (("stock:sculpture-small", "stock:noon", "-o", tmp_path / "a.txt"), ".xml"),
        (("stock:sculpture-small", "stock:noon", "-o", tmp_path / "a.xml", "--camera", "no"), "front"),
        (("stock:sculpture-small", "stock:noon", "-o", tmp_path / "a.xml", "--samples", "0"), "--samples"),
    ]:
        answer = prelight("rig", "export", *arguments)
        assert (answer.code, said in answer.err) == (2, True), answer.err
    assert list(tmp_path.iterdir()) == [rig]
