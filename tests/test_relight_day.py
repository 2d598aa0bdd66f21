"""``prelight relight --day``: a day over a bake, as a film and as pictures, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

DAY = ("--day", "2026-06-21", "--place", "43.7,15.9")
SMALL = ("--size", "48x32")


def test_a_day_as_pictures(prelight, workshop: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "day_{frame}.png")
    bake = str(workshop / "ball.prelight")
    answer = prelight("relight", bake, "stock:noon", *DAY, "--steps", "5", "--json", "-o", out, *SMALL)
    assert answer.code == 0, answer.err
    figures = json.loads(answer.out)
    heights = [moment["sun_elevation_deg"] for moment in figures["moments"]]
    assert heights[2] == max(heights) > 65
    assert heights == pytest.approx(heights[::-1], abs=2.5)
    assert figures["frames"] == len(list(tmp_path.glob("day_*.png"))) == 5
    light = [np.asarray(Image.open(tmp_path / f"day_{n:04}.png")).mean() for n in range(5)]
    assert light[2] > 2 * max(light[0], light[4])


def test_a_day_as_a_film_by_a_rig(prelight, workshop: Path, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(
        '[sun]\nplace = [43.7, 15.9]\ntime = "2026-01-01T12:00"\nnorth_deg = 90\n'
    )
    film, bake = tmp_path / "day.webp", str(workshop / "ball.prelight")
    options = ("--day", "2026-06-21", "--hours", "6-18", "--zone", "UTC", "--steps", "4")
    answer = prelight("relight", bake, str(tmp_path / "rig.toml"), *options, "-o", str(film), *SMALL)
    assert answer.code == 0, answer.err
    assert "4 moments from 06:00 to 18:00 (UTC)" in answer.out
    with Image.open(film) as opened:
        assert opened.n_frames == 4
    assert (
        "already exists"
        in prelight("relight", bake, str(tmp_path / "rig.toml"), *options, "-o", str(film), *SMALL).err
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--day", "2026-06-31", "--place", "1,2", "-o", "a.webp"), "--day: '2026-06-31' is no date"),
        (("--day", "2026-06-21", "--place", "91,2", "-o", "a.webp"), "--place: '91,2': latitude 91"),
        (("--day", "2026-06-21", "-o", "a.webp"), "--place: missing"),
        ((*DAY,), "--day: needs --output"),
        ((*DAY, "-o", "a.png"), "a.png: expected a name ending in .mp4"),
        ((*DAY, "--steps", "0", "-o", "a.webp"), "--steps: 0, expected 1 to 2000"),
        ((*DAY, "--zone", "Nowhere", "-o", "a.webp"), "zone: 'Nowhere' is not known"),
        ((*DAY, "--hours", "9-5", "-o", "a.webp"), "--hours: '9-5', expected two hours"),
        ((*DAY, "--fps", "0", "-o", "a.webp"), "--fps: 0, expected 0.1 to 240"),
        ((*DAY, "--rotate", "5", "-o", "a.webp"), "--rotate: not with --day"),
        (("--place", "1,2", "-o", "a.png"), "--place, --zone, --hours: of --day"),
    ],
)  # fmt: skip
def test_what_is_refused(prelight, workshop: Path, tmp_path: Path, monkeypatch, options, said: str) -> None:
    monkeypatch.chdir(tmp_path)
    answer = prelight("relight", str(workshop / "ball.prelight"), "stock:noon", *options)
    assert answer.code == 2
    assert said in answer.err
    assert answer.err.count("\n") == 1
    assert not list(tmp_path.iterdir())
