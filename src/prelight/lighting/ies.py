"""Measured lamps: photometric files of the Illuminating Engineering Society (LM-63 of 1986, 1991, 1995 and 2002).

Photometry of type C is read, with TILT=NONE or TILT=INCLUDE. The file names nothing else that would be opened. The
vertical angle is 0 along the beam; the plane of horizontal angle 0 lies to the right of somebody who looks along the
beam, that of 90 above.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from ..files import read_regular
from .distributions import measured_harmonics

LUMENS_PER_WATT = 683.0  # docs/conventions.md
_LARGEST_FILE = 4_000_000
_MOST_ANGLES, _MOST_TILTS = 2_000, 1_000
_LARGEST = 1e9  # of any number in a file: candela, lumens, watts
_HEADER = re.compile(r"IESNA(?::LM-63-\d{4}|91)|IES:LM-63-\d{4}")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_SEPARATOR = re.compile(r"[\s,]+")


@dataclass(frozen=True, eq=False)
class Photometry:
    """A measured distribution of type C.

    ``vertical`` (v,) degrees from the beam, ``horizontal`` (h,) degrees around it, over the whole circle; ``candela``
    (h, v), with the multipliers of the file. ``lumens``: what the file says its lamps give, None where it says that its
    values are absolute. ``source``: the file.
    """

    vertical: Float64[np.ndarray, "vertical"]
    horizontal: Float64[np.ndarray, "horizontal"]
    candela: Float64[np.ndarray, "horizontal vertical"]
    lumens: float | None = None
    source: str = ""

    @classmethod
    def open(cls, path: str | Path) -> Photometry:
        """Read a file. Raises InputError with the line where something is wrong."""
        return parsed(read_regular(path, limit=_LARGEST_FILE), name=path)

    @property
    def watts(self) -> tuple[float, float]:
        """(largest radiant intensity in W/sr, radiant flux in W), at 683 lm/W."""
        node, weight = np.polynomial.legendre.leggauss(256)
        angle = 2.0 * np.pi * (np.arange(360) + 0.5) / 360
        sine = np.sqrt(1.0 - node * node)
        d = np.stack(np.broadcast_arrays(
            np.outer(sine, np.cos(angle)), np.outer(sine, np.sin(angle)), node[:, None]
        ), -1).reshape(-1, 3)  # fmt: skip
        flux = np.repeat(weight, 360) @ self.along(d)[:, 0] * (2.0 * np.pi / 360)
        peak = float(self.candela.max()) / LUMENS_PER_WATT
        return peak, float(flux) * peak

    def along(self, directions: np.ndarray) -> np.ndarray:
        """Intensity (n, 1) relative to the largest, between the angles of the file linearly; zero outside them."""
        d = np.asarray(directions, np.float64)
        polar = np.degrees(np.arccos(np.clip(d[:, 2], -1.0, 1.0)))
        around = np.degrees(np.arctan2(d[:, 1], -d[:, 0])) % 360.0  # x of the frame is to the left
        i, s = _between(self.vertical, polar)
        j, t = _between(self.horizontal, around)
        c = self.candela / max(float(self.candela.max()), 1e-300)
        next_j = np.minimum(j + 1, len(self.horizontal) - 1)
        near = c[j, i] * (1.0 - s) + c[j, i + 1] * s
        far = c[next_j, i] * (1.0 - s) + c[next_j, i + 1] * s
        inside = (polar >= self.vertical[0] - 1e-9) & (polar <= self.vertical[-1] + 1e-9)
        return np.where(inside, near * (1.0 - t) + far * t, 0.0)[:, None]

    def harmonics(self, degree: int) -> np.ndarray:
        """Coefficients by a fine rule over the sphere."""
        finest = np.diff(self.vertical).min()
        return measured_harmonics(self, degree, detail=180.0 / max(float(finest), 0.5))


def _between(angles: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The interval of each wanted angle, and where in it, 0 to 1."""
    if len(angles) == 1:
        return np.zeros(len(wanted), int), np.zeros(len(wanted))
    i = np.clip(np.searchsorted(angles, wanted, side="right") - 1, 0, len(angles) - 2)
    return i, np.clip((wanted - angles[i]) / (angles[i + 1] - angles[i]), 0.0, 1.0)


class _Numbers:
    """The numbers of the data part, one after another, with the line each stands in."""

    def __init__(self, lines: list[tuple[int, str]], name: object) -> None:
        self.name = name
        self._tokens = [
            (at, token) for at, line in lines for token in _SEPARATOR.split(line.strip()) if token
        ]
        self._next = 0

    def refuse(self, reason: str, at: int | None = None) -> InputError:
        """The error to raise for the last number taken, or of a line."""
        if at is None:
            at = self._tokens[min(max(self._next - 1, 0), len(self._tokens) - 1)][0] if self._tokens else 1
        return InputError(self.name, reason, f"line {at}")

    def take(self, count: int, what: str) -> list[float]:
        """The next ``count`` numbers."""
        if len(self._tokens) - self._next < count:
            left = len(self._tokens) - self._next
            self._next = len(self._tokens)
            raise self.refuse(f"ends too early: {left} numbers left, expected {count} for {what}")
        found = []
        for _ in range(count):
            _, token = self._tokens[self._next]
            self._next += 1
            number = float(token) if len(token) <= 40 and _NUMBER.fullmatch(token) else math.nan
            if not abs(number) <= _LARGEST:
                raise self.refuse(f"{token[:40]!r} is no number that {what} can have")
            found.append(number)
        return found

    def whole(self, what: str, least: int, most: int) -> int:
        """The next number, which is a whole one within bounds."""
        (number,) = self.take(1, what)
        if number != int(number) or not least <= number <= most:
            raise self.refuse(f"{number:g} is no {what}, expected a whole number from {least} to {most}")
        return int(number)

    def end(self) -> None:
        """Raises InputError if numbers are left."""
        if self._next < len(self._tokens):
            left = len(self._tokens) - self._next
            at = self._tokens[self._next][0]
            raise self.refuse(f"{left} numbers too many behind the last candela value", at)


def parsed(data: bytes, *, name: object) -> Photometry:
    """The photometry in the bytes of a file; ``name`` is for messages. Raises InputError with the line."""
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # makers' names; the numbers are ASCII or refused
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n\x1a ").split("\n")
    tilt = next((n for n, line in enumerate(lines) if line.lstrip().upper().startswith("TILT=")), None)
    if tilt is None:
        raise InputError(name, "no line TILT=; expected a photometric file of LM-63")
    first = lines[0].strip()
    if first.upper().startswith(("IESNA", "IES:")) and not _HEADER.fullmatch(first.upper()):
        raise InputError(name, f"{first[:40]!r}, expected LM-63 of 1986, 1991, 1995 or 2002", "line 1")
    numbers = _Numbers([(n + 1, lines[n]) for n in range(tilt + 1, len(lines))], name)
    kind = lines[tilt].strip().upper().removeprefix("TILT=").strip()
    if kind == "INCLUDE":
        _skip_tilt(numbers)
    elif kind != "NONE":
        raise InputError(
            name,
            f"TILT={kind[:40]}, expected NONE or INCLUDE; other files are not opened",
            f"line {tilt + 1}",
        )
    return _luminaire(numbers, name)


def _skip_tilt(numbers: _Numbers) -> None:
    """How the lamp's output depends on its tilt: read for its form, as a lamp that is aimed is at no stated tilt."""
    numbers.whole("geometry of the lamp", 1, 3)
    pairs = numbers.whole("number of tilt angles", 1, _MOST_TILTS)
    numbers.take(pairs, "tilt angles")
    if min(numbers.take(pairs, "tilt factors")) < 0.0:
        raise numbers.refuse("a tilt factor is negative")


def _luminaire(numbers: _Numbers, name: object) -> Photometry:
    lamps = numbers.whole("number of lamps", 1, 10_000)
    (lumens, multiplier) = numbers.take(2, "lumens and multiplier")
    if multiplier <= 0.0:
        raise numbers.refuse(f"the multiplier of candela is {multiplier:g}, expected more than 0")
    verticals = numbers.whole("number of vertical angles", 2, _MOST_ANGLES)
    horizontals = numbers.whole("number of horizontal angles", 1, _MOST_ANGLES)
    photometric = numbers.whole("photometric type", 1, 3)
    if photometric != 1:
        raise numbers.refuse(
            f"photometry of type {' CBA'[photometric]}, expected type C (1); convert the file"
        )
    numbers.whole("unit of length", 1, 2)
    numbers.take(3, "the luminous opening")
    (ballast, _, _) = numbers.take(3, "ballast factor and watts")
    if ballast <= 0.0:
        raise numbers.refuse(f"the ballast factor is {ballast:g}, expected more than 0")
    vertical = _angles(numbers, verticals, "vertical angles", 180.0)
    horizontal = _angles(numbers, horizontals, "horizontal angles", 360.0)
    if vertical[0] not in (0.0, 90.0) or vertical[-1] not in (90.0, 180.0):
        raise numbers.refuse(
            f"vertical angles from {vertical[0]:g} to {vertical[-1]:g}, expected 0 or 90 to 90 or 180"
        )
    candela = np.array(numbers.take(horizontals * verticals, "candela values")).reshape(
        horizontals, verticals
    )
    if candela.min() < 0.0:
        raise numbers.refuse("a candela value is negative")
    numbers.end()
    candela *= multiplier * ballast
    if not candela.max() > 0.0:
        raise numbers.refuse("all candela values are zero: this lamp is dark")
    horizontal, candela = _all_around(numbers, horizontal, candela)
    return Photometry(vertical, horizontal, candela, None if lumens < 0.0 else lumens * lamps, str(name))


def _angles(numbers: _Numbers, count: int, what: str, most: float) -> np.ndarray:
    found = np.array(numbers.take(count, what))
    if found.min() < 0.0 or found.max() > most or (np.diff(found) <= 0.0).any():
        raise numbers.refuse(f"{what} do not rise from 0 or more to {most:g} or less")
    return found


def _all_around(numbers: _Numbers, angles: np.ndarray, candela: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal planes over the whole circle: mirrored where the file gives a quarter or a half, closed at 360."""
    first, last = float(angles[0]), float(angles[-1])
    if len(angles) == 1:
        if first != 0.0:
            raise numbers.refuse(f"one horizontal angle, {first:g}, expected 0")
        return np.array([0.0, 360.0]), np.repeat(candela, 2, axis=0)
    if (first, last) == (0.0, 90.0):
        angles, candela = _mirrored(angles, candela, 90.0)
        last = 180.0
    elif (first, last) == (90.0, 270.0):  # a half about the plane 90 to 270
        angles, candela = _mirrored(angles, candela, 270.0)
        order = np.argsort(angles[:-1] % 360.0, kind="stable")
        angles, candela = angles[:-1][order] % 360.0, candela[:-1][order]
        if angles[0] > 0.0:  # between the last before 360 and the first
            share = (360.0 - angles[-1]) / (angles[0] + 360.0 - angles[-1])
            at_zero = candela[-1] * (1.0 - share) + candela[0] * share
            angles, candela = np.append(0.0, angles), np.concatenate([at_zero[None], candela])
        return np.append(angles, 360.0), np.concatenate([candela, candela[:1]])
    if (first, last) == (0.0, 180.0) or last == 180.0:
        return _mirrored(angles, candela, 180.0)
    if first == 0.0 and 180.0 < last < 360.0:  # the plane at 360 is left out, as that at 0
        return np.append(angles, 360.0), np.concatenate([candela, candela[:1]])
    if (first, last) == (0.0, 360.0):
        return angles, candela
    raise numbers.refuse(
        f"horizontal angles from {first:g} to {last:g}, expected 0 to 90, 180 or 360, or 90 to 270"
    )


def _mirrored(angles: np.ndarray, candela: np.ndarray, about: float) -> tuple[np.ndarray, np.ndarray]:
    return (
        np.concatenate([angles, 2.0 * about - angles[-2::-1]]),
        np.concatenate([candela, candela[-2::-1]]),
    )
