"""Transfer layers that are damaged, forged, stopped half-way or asked for wrongly: refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from prelight.baking import transfer as baking
from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.errors import DamagedBakeError, InterruptedBakeError, MissingExtraError
from prelight.lighting.environment import Environment
from prelight.lighting.placed_lights import Lamp, PlacedPanel
from prelight.lighting.spot import Spot
from prelight.material import Material
from prelight.relighting.transfer import TransferRelighter
from prelight.scene import variant
from prelight.storage.bake import Bake

from .disk import copy, rewrite_manifest
from .scenes import ball_on_floor
from .test_forged_bakes import changed, replace_array
from .test_ies import LAMBERT

AT = "layers/transfer"
SETTINGS = TransferSettings(gather_rays=64, entries=64, modes=12)


@pytest.fixture(scope="module", autouse=True)
def few_lights():
    """Modes from fewer lights: nothing here looks at how good they are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(baking, "TRIALS", 31)
        yield


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("original")
    return bake_transfer(ball_on_floor(), folder / "ball.prelight", settings=SETTINGS).path


@pytest.fixture
def bake(original: Path, tmp_path: Path) -> Path:
    return copy(original, tmp_path / "ball.prelight")


ARRAYS = {
    "modes": {
        "a group more": lambda v: np.concatenate([v, v[:1]]),
        "a mode less": lambda v: v[:, 1:],
        "unsigned": lambda v: v.view(np.uint8),
    },
    "scales": {"no number": lambda v: changed(v, 0, np.nan), "one more": lambda v: np.append(v, v[:1])},
    "sources": {"a vertex less": lambda v: v[:, 1:], "two": lambda v: v[:2], "unsigned": lambda v: v.view("u1")},
    "source_scales": {"infinite": lambda v: changed(v, (0, 0), np.inf), "huge": lambda v: changed(v, (0, 0), 1e30)},
    "origins": {"no number": lambda v: changed(v, (0, 0), np.nan), "one less": lambda v: v[1:]},
    "first/order": {"one twice": lambda v: changed(v, 0, v[1]), "outside": lambda v: changed(v, 0, 10**6)},
    "first/steps": {"far away": lambda v: np.full_like(v, 60_000), "none": lambda v: changed(v, 0, 0)},
    "first/counts": {"too many": lambda v: changed(v, 0, v[0] + 1)},
    "first/sums": {"more than all": lambda v: changed(v, 0, 2.0)},
    "later/order": {"one twice": lambda v: changed(v, 0, v[1])},
    "later/steps": {"far away": lambda v: np.full_like(v, 60_000)},
}  # fmt: skip


@pytest.mark.parametrize(("name", "how"), [(n, h) for n, ways in ARRAYS.items() for h in ways])
def test_forged_arrays_are_refused(bake: Path, name: str, how: str) -> None:
    values = Bake.open(bake).array(f"{AT}/{name}")
    replace_array(bake, f"{AT}/{name}", np.ascontiguousarray(ARRAYS[name][how](values)))
    with pytest.raises(DamagedBakeError, match=r"transfer|first|later|modes|sources|scales|origins") as error:
        TransferRelighter(bake)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "change",
    [
        lambda layer: layer["parameters"].pop("operator_bounces"),
        lambda layer: layer["parameters"].update(operator_bounces=9),
        lambda layer: layer["parameters"].update(operator_bounces="1"),
        lambda layer: layer["statistics"].pop("error"),
        lambda layer: layer["statistics"].update(first_entries=1),
        lambda layer: layer["statistics"].pop("later_entries"),
        lambda layer: layer.update(coefficients=300),
        lambda layer: layer.update(coefficients=11),
    ],
)
def test_forged_records_are_refused(bake: Path, change) -> None:
    rewrite_manifest(bake, lambda manifest: change(manifest["layers"]["transfer"]))
    with pytest.raises(DamagedBakeError):
        TransferRelighter(bake)


def test_a_damaged_chunk_is_named(bake: Path) -> None:
    chunk = bake / AT / "modes" / "c" / "0" / "0" / "0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(bytes(data))
    with pytest.raises(DamagedBakeError, match="layers/transfer/modes"):
        TransferRelighter(bake)


def test_two_bakes_are_the_same_bytes_and_so_is_one_that_was_stopped(
    original: Path, tmp_path, monkeypatch
) -> None:
    target = tmp_path / "ball.prelight"

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(baking, "later_bounces", stop)
        with pytest.raises(InterruptedBakeError, match="the first bounce kept"):
            bake_transfer(ball_on_floor(), target, settings=SETTINGS)
    with monkeypatch.context() as patch:
        patch.setattr(baking.Gathering, "trace", stop)  # what is done is not done again
        bake_transfer(ball_on_floor(), target, settings=SETTINGS, resume=True)
    mine, theirs = (
        {p.relative_to(r): p.read_bytes() for p in r.rglob("*") if p.is_file()} for r in (target, original)
    )
    assert mine == theirs


def test_without_the_renderer_shadows_are_traced_all_the_same(bake: Path, monkeypatch) -> None:
    lights = [
        Lamp((0.3, 1.6, 0.2), Spot((1, 1, 1), direction=(0, -1, 0))),
        PlacedPanel((-0.5, 1.5, 0.3), (0.4, 0.3), Spot((1, 1, 1), direction=(0.2, -1, 0))),
    ]
    ours = TransferRelighter(bake)
    ours.shine(lights, Environment.constant((1.0, 1.0, 1.0)))

    def missing() -> None:
        raise MissingExtraError("this needs Mitsuba: pip install 'prelight[bake]'")

    monkeypatch.setattr(variant, "_imported", missing)
    with pytest.raises(MissingExtraError, match=r"pip install 'prelight\[bake\]'"):
        bake_transfer(ball_on_floor(), bake.with_name("other.prelight"), settings=SETTINGS)
    plain = TransferRelighter(bake)
    plain.shine(lights, Environment.constant((1.0, 1.0, 1.0)))
    np.testing.assert_allclose(plain.irradiance.mean(), ours.irradiance.mean(), rtol=2e-3)
    differ = np.abs(plain.irradiance - ours.irradiance).max(axis=1) > 0.02 * ours.irradiance.max()
    assert differ.mean() < 0.01


# ---- the command line -------------------------------------------------------------------------------------------

LAMP = "[[lamp]]\nposition = [0.2, 1.6, 0.3]\npower_w = 10\n"


def test_from_a_scene_to_a_picture(prelight, tmp_path: Path) -> None:
    bake, rig, out = tmp_path / "b.prelight", tmp_path / "rig.toml", tmp_path / "out.npy"
    ply = tmp_path / "ball.ply"
    scene = ball_on_floor(side=9, rings=6)
    write_ply(ply, scene.positions, scene.triangles)
    options = ["--gather-rays", "64", "--entries", "32", "--modes", "8"]
    plan = json.loads(prelight("bake", "transfer", ply, "--dry-run", "--json", *options).out)
    assert plan["vertices"] == len(scene.positions)
    assert plan["rays"] == 64 * len(scene.positions)
    assert plan["seconds"] > 0
    answer = prelight("bake", "transfer", ply, "-o", bake, *options)
    assert answer.code == 0, answer.err
    assert "errs by" in answer.out
    (layer,) = json.loads(prelight("inspect", bake, "--json").out)["layers"]
    assert (layer["kind"], layer["basis_lights"]) == ("transfer", len(scene.positions))
    rig.write_text(LAMP)
    answer = prelight("relight", bake, rig, "-o", out)
    assert answer.code == 0, answer.err
    live = TransferRelighter(bake)
    from prelight.lighting.rig import Rig

    live.light(Rig.open(str(rig)))
    np.testing.assert_allclose(np.load(out), live.irradiance * live.bake.receivers.albedo, rtol=1e-5)


def write_ply(path: Path, positions: np.ndarray, triangles: np.ndarray) -> None:
    head = f"ply\nformat ascii 1.0\nelement vertex {len(positions)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(str, p)) for p in positions.tolist()] + [
        f"3 {a} {b} {c}" for a, b, c in triangles.tolist()
    ]
    path.write_text(head + "\n".join(rows) + "\n")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAMP.replace("10", "-10"), "power_w"),
        (LAMP.replace("10", "nan"), "finite number"),
        (LAMP + 'ies = "broken.ies"\n', "broken.ies"),
        ("[[spot]]\nintensity = [1, 1, 1]\ndirection = [0, -1, 0]\n", "bake steerable"),
    ],
)
def test_bad_rigs_are_one_line(prelight, bake: Path, tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "broken.ies").write_bytes(LAMBERT[:150])
    (tmp_path / "rig.toml").write_text(text)
    answer = prelight("relight", bake, tmp_path / "rig.toml")
    assert answer.code == 2
    assert answer.err.count("\n") == 1
    assert said in answer.err


def test_an_environment_bake_has_no_place_for_lamps_and_says_who_has(prelight, tmp_path: Path) -> None:
    from .disk import quick_bake

    other = quick_bake(tmp_path / "sky.prelight").path
    (tmp_path / "rig.toml").write_text(LAMP)
    answer = prelight("relight", other, tmp_path / "rig.toml")
    assert answer.code == 2
    assert "bake transfer" in answer.err


def test_what_is_not_diffuse_is_told_before_it_is_baked() -> None:
    from dataclasses import replace

    from prelight.baking.transfer_plan import plan_transfer

    scene = replace(ball_on_floor(), materials=(Material("clear glass", transmission=1.0, specular=1.0),))
    (note,) = plan_transfer(scene, replace(SETTINGS, caustics=False)).notes
    assert "clear glass" in note
    assert "no reflections" in note


def test_too_little_memory_is_told_before_anything_is_traced() -> None:
    from prelight.baking.transfer_plan import plan_transfer
    from prelight.errors import InputError

    with pytest.raises(InputError, match=r"not enough for .* vertices; at least"):
        plan_transfer(ball_on_floor(), TransferSettings(gather_rays=4096, memory=500_000_000))


def test_the_bake_is_whole(original: Path) -> None:
    bake = Bake.open(original)
    assert list(bake.verify())
    statistics = bake.layers["transfer"].statistics
    assert 0 < statistics["error"] <= statistics["worst_error"]
