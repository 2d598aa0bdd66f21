"""``prelight bake portals`` and what follows it, as a person types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .workshop import assert_refusal

WINDOW = "[[portal]]\nname = 'window'\npolygon = [[-2.3,0.8,-1.25],[-2.3,2.2,-1.25],[-2.3,2.2,0.55],[-2.3,0.8,0.55]]\n"
QUICK = ("--rays", "64", "--gather-rays", "16", "--order", "1", "--cube", "8", "--no-suns")
ROOM = "stock:room-small"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cli")
    (folder / "window.toml").write_text(WINDOW)
    (folder / "closed.toml").write_text(
        WINDOW.replace("-2.3,", "1.5,").replace("0.8", "-0.1").replace("2.2", "-0.05")
    )
    (folder / "wrong.toml").write_text('[environment]\nmap = "stock:noon"\n[[portal]]\nname = "door"\n')
    (folder / "blind.toml").write_text(
        '[environment]\nmap = "stock:noon"\n[[portal]]\nname = "win*"\nblind = 0.5\n'
    )
    return folder


def test_a_room_is_baked_told_and_lit(folder, prelight) -> None:
    bake = folder / "room.prelight"
    answer = prelight("bake", "portals", ROOM, "--portals", folder / "window.toml", "-o", bake, *QUICK)
    assert answer.code == 0, answer.err
    assert "1 portal: window (2.5 m²)" in answer.out
    assert "as near as" in answer.out
    told = prelight("inspect", bake)
    assert told.code == 0
    assert "pulses" in told.out
    assert "harmonics of order 1" in told.out
    lit = [
        json.loads(prelight("relight", bake, rig, "--json").out)
        for rig in ("stock:noon", folder / "blind.toml")
    ]
    assert all(one["receivers"] == 4548 for one in lit)
    assert (
        prelight("relight", bake, folder / "blind.toml", "-o", folder / "a.png", "--size", "64x36").code == 0
    )
    assert_refusal(prelight("relight", bake, folder / "wrong.toml"), 2, "[[portal]] 'door'", "window")
    assert prelight("verify", bake).code == 0


def test_a_dry_run_writes_nothing(folder, prelight) -> None:
    answer = prelight(
        "bake", "portals", ROOM, "--portals", folder / "window.toml", "--exterior-distance", "4", *QUICK,
        "--dry-run", "--json", "-o", folder / "none.prelight",
    )  # fmt: skip
    told = json.loads(answer.out)
    assert told["portals"] == len(told["names"]) > 1
    assert told["angle_deg"] < 5
    assert not (folder / "none.prelight").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ("no portal found in room-small", "--portals FILE")),
        (("--portal", "door"), ("no material 'door'", "boards")),
        (("--preset", "quick"), ("--preset", "expected paper")),
        (("--group", "colour"), ("expected material, window, one",)),
        (("--cube", "33"), ("expected 4, 8, 16, 32 or 64",)),
        (("--order", "13"), ("0 to 12",)),
        (("--gather-rays", "1000"), ("square number",)),
        (("--accuracy", "1"), ("below 1",)),
        (("--accuracy-for", "stock:noon"), ("without --accuracy",)),
        (("--refine", "1"), ("above 1 and up to 16",)),
        (("--refine-for", "stock:noon"), ("without --refine",)),
        (("--theta", "0"), ("above 0",)),
        (("--portals", "nothing.toml"), ("nothing.toml",)),
        (("--portals", "{folder}/closed.toml"), ("portal window: light cannot leave through it",)),
    ],
)
def test_what_is_wrong_is_said_in_a_line(folder, prelight, arguments, words) -> None:
    given = [argument.format(folder=folder) for argument in arguments]
    answer = prelight("bake", "portals", ROOM, "-o", folder / "x.prelight", *given)
    assert_refusal(answer, 2, *words)
