"""Photometric files: what is right is read as measured, what is wrong is one line with its place."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prelight.bases.steering import SpotBasis
from prelight.errors import InputError
from prelight.lighting.distributions import fitted
from prelight.lighting.ies import Photometry, parsed

HEAD = "IESNA:LM-63-2002\n[TEST] none\n[MANUFAC] nobody\n"


def written(  # noqa: PLR0913  (the lines of the file)
    vertical, horizontal, candela, *, head=HEAD, tilt="TILT=NONE", lamps="1 1000 1", kind=1, ballast="1 1 50"
) -> bytes:
    def row(values) -> str:
        return " ".join(f"{v:g}" for v in values)

    counts = f"{len(vertical)} {len(horizontal)} {kind} 2 0.1 0.1 0"
    rows = "\r\n".join(row(c) for c in candela)
    text = f"{head}{tilt}\n{lamps} {counts}\n{ballast}\n{row(vertical)}\n{row(horizontal)}\n{rows}\n"
    return text.encode()


DOWN = np.arange(0.0, 91.0, 5.0)
LAMBERT = written(DOWN, [0], [[100.0 * math.cos(math.radians(v)) for v in DOWN]])


def at(photometry: Photometry, vertical: float, horizontal: float) -> float:
    """Relative intensity at angles of the file: right is −x of the lamp's frame."""
    v, h = math.radians(vertical), math.radians(horizontal)
    d = np.array([[-math.sin(v) * math.cos(h), math.sin(v) * math.sin(h), math.cos(v)]])
    return float(photometry.along(d)[0, 0])


def test_a_cosine_lamp() -> None:
    lamp = parsed(LAMBERT, name="lamp.ies")
    assert lamp.lumens == 1000.0
    assert at(lamp, 0, 0) == 1.0
    assert at(lamp, 60, 200) == pytest.approx(0.5, abs=1e-6)
    assert at(lamp, 62.5, 10) == pytest.approx(0.5 * (0.5 + math.cos(math.radians(65))), abs=1e-6)
    assert at(lamp, 95, 0) == 0.0
    peak, power = lamp.watts  # ∫ I cos = π·I
    assert peak == pytest.approx(100 / 683)
    assert power == pytest.approx(math.pi * peak, rel=3e-3)
    fit = fitted(lamp, SpotBasis(6))
    assert 0.005 < fit.error < 0.05  # a clamped cosine's best approximation
    assert fitted(lamp, SpotBasis(2)).error > 2 * fit.error
    assert "% RMS" in fit.words


def test_planes_are_mirrored_all_around() -> None:
    """A quarter, a half and the whole of the same lamp, whose C0 is to the right and C90 above."""

    def intensity(h: float) -> float:
        return 60.0 + 40.0 * math.cos(2.0 * math.radians(h))

    vertical = [0.0, 45.0, 90.0]

    def lamp(angles) -> Photometry:
        return parsed(written(vertical, angles, [[50, intensity(h), 0] for h in angles]), name="x")

    quarter, half = lamp(np.arange(0, 91, 10)), lamp(np.arange(0, 181, 10))
    whole, open_end = lamp(np.arange(0, 361, 10)), lamp(np.arange(0, 360, 10))
    other_half = lamp(np.arange(90, 271, 10))
    for h in (0, 15, 90, 100, 180, 255, 275, 359):
        wanted = at(whole, 45, h)
        for other in (quarter, half, open_end, other_half):
            assert at(other, 45, h) == pytest.approx(wanted, abs=1e-6)
    assert at(whole, 45, 0) == 1.0
    assert at(whole, 45, 90) == pytest.approx(0.2)
    to_the_right = parsed(
        written(vertical, [0, 90, 180, 270, 360], [[50, c, 0] for c in (100, 60, 20, 40, 100)]), name="x"
    )
    assert [at(to_the_right, 45, h) for h in (0, 90, 180, 270)] == pytest.approx([1.0, 0.6, 0.2, 0.4])
    lopsided = parsed(written(vertical, [90, 180, 270], [[50, 10, 0], [50, 20, 0], [50, 30, 0]]), name="x")
    assert at(lopsided, 45, 180) == pytest.approx(20 / 50)
    assert at(lopsided, 45, 0) == pytest.approx(20 / 50)  # the mirror image of 180
    assert at(lopsided, 45, 90) == pytest.approx(10 / 50)
    assert at(lopsided, 45, 315) == pytest.approx(25 / 50)


def test_all_of_the_standards_and_multipliers(tmp_path: Path) -> None:
    plain = parsed(LAMBERT, name="x")
    candela = plain.candela[:1]
    for head in ("", "IESNA91\n", "IESNA:LM-63-1995\n[LAMP] one\n", "a note of 1986\n"):
        same = parsed(written(DOWN, [0], candela, head=head), name="x")
        np.testing.assert_allclose(same.candela, plain.candela, rtol=1e-5)
    tilted = written(DOWN, [0], candela, tilt="TILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.8")
    np.testing.assert_allclose(parsed(tilted, name="x").candela, plain.candela, rtol=1e-5)
    more = parsed(written(DOWN, [0], candela, lamps="2 -1 1.5", ballast="0.8 1 50"), name="x")
    assert more.lumens is None  # absolute photometry
    np.testing.assert_allclose(more.candela, plain.candela * 1.2, rtol=1e-5)
    (tmp_path / "a.ies").write_bytes(LAMBERT)
    assert Photometry.open(tmp_path / "a.ies").source.endswith("a.ies")


BAD = {
    "no tilt": (b"IESNA:LM-63-2002\n1 2 3\n", "no line TILT="),
    "other header": (LAMBERT.replace(b"LM-63-2002", b"LM-99"), r"expected LM-63 .*line 1"),
    "tilt file": (LAMBERT.replace(b"TILT=NONE", b"TILT=/etc/passwd"), "expected NONE or INCLUDE"),
    "cut": (LAMBERT[: len(LAMBERT) // 2], "ends too early|do not rise"),
    "too many": (LAMBERT + b"1 2 3\n", "3 numbers too many"),
    "word": (LAMBERT.replace(b"1 1 50", b"1 one 50"), "'one' is no number .*line 6"),
    "nan": (LAMBERT.replace(b"1 1 50", b"1 nan 50"), "'nan' is no number"),
    "hexadecimal": (LAMBERT.replace(b"1 1 50", b"1 0x10 50"), "'0x10' is no number"),
    "underscore": (LAMBERT.replace(b"1 1 50", b"1 1_0 50"), "'1_0' is no number"),
    "huge": (LAMBERT.replace(b"1 1 50", b"1 1e300 50"), "'1e300' is no number"),
    "negative candela": (written([0, 90], [0], [[1, -1]]), "a candela value is negative"),
    "dark": (written([0, 90], [0], [[0, 0]]), "this lamp is dark"),
    "falling angles": (written([0, 50, 40, 90], [0], [[1] * 4]), "vertical angles do not rise"),
    "angles end early": (written([0, 50], [0], [[1, 1]]), "vertical angles from 0 to 50"),
    "horizontal": (written([0, 90], [0, 100], [[1, 1], [1, 1]]), "horizontal angles from 0 to 100"),
    "one horizontal": (written([0, 90], [45], [[1, 1]]), "one horizontal angle, 45"),
    "type B": (written([0, 90], [0], [[1, 1]], kind=2), "photometry of type B"),
    "type 9": (written([0, 90], [0], [[1, 1]], kind=9), "photometric type"),
    "million angles": (
        b"TILT=NONE\n1 1 1 1000000 1000000 1 1 0 0 0\n1 1 1\n",
        "expected a whole number from 2 to 2000",
    ),
    "no ballast": (written([0, 90], [0], [[1, 1]], ballast="0 1 50"), "ballast factor is 0"),
    "half a lamp": (written([0, 90], [0], [[1, 1]], lamps="0.5 100 1"), "0.5 is no number of lamps"),
    "negative multiplier": (written([0, 90], [0], [[1, 1]], lamps="1 100 -1"), "multiplier"),
}


@pytest.mark.parametrize("fault", BAD)
def test_errors_are_one_line(fault: str) -> None:
    data, message = BAD[fault]
    with pytest.raises(InputError, match=message) as caught:
        parsed(data, name="lamp.ies")
    assert "\n" not in str(caught.value)


@given(st.binary(max_size=300), st.integers(0, len(LAMBERT)), st.integers(0, 40))
def test_no_bytes_do_anything_else(noise: bytes, where: int, cut: int) -> None:
    """Noise put anywhere is read or refused, never a fault."""
    try:
        lamp = parsed(LAMBERT[:where] + noise + LAMBERT[where + cut :], name="x")
    except InputError:
        return
    assert np.isfinite(lamp.candela).all()
    assert np.isfinite(lamp.along(np.eye(3))).all()
