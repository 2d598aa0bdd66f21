"""Lamps whose light is steered after tracing: where they are, and the functions that span their emission.

Every one of these functions is traced at once (`basis_images`). What a lamp sends out is a combination of them;
which one, is decided at run time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import ModuleType
from typing import Any

import numpy as np

from ..arrays import Float64
from ..bases.exponentials import ExponentialAxis
from ..errors import InputError

MOST_DEGREE = 24
MOST_PERIODS = 16
MOST_FUNCTIONS = 1024

Vector = tuple[float, float, float]
Terms = tuple[tuple[float, float, int], ...]


@dataclass(frozen=True)
class SteeredSpot:
    """A small ball (or a point) that sends light by direction.

    Its intensity in direction ω, world axes, is Σ w_s Y_s(ω) W/sr, with the real spherical harmonics up to
    ``degree`` in the order of ``docs/conventions.md``. The radiance of a ball of radius r is intensity / πr² in
    that direction, all over its surface, so that its size changes no intensity.

    Parameters
    ----------
    position
        Metres.
    degree
        N; (N+1)² functions. 0 to 24.
    radius
        Metres; 0 is a point, which no mirror shows.
    """

    position: Vector
    degree: int
    radius: float = 0.02

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", _vector("spot position", self.position))
        _check_whole("degree", self.degree, MOST_DEGREE)
        _check_number("radius", self.radius, 0.0, 100.0)

    @property
    def waves(self) -> tuple[int, int, int]:
        """Functions of its place: it has but one."""
        return 1, 1, 1

    @property
    def functions(self) -> int:
        """How many functions span its light."""
        return (self.degree + 1) ** 2

    @property
    def is_point(self) -> bool:
        return self.radius == 0

    @property
    def middle(self) -> Vector:
        return self.position

    def to_dict(self) -> dict[str, Any]:
        """Plain data with its kind."""
        return {"kind": "spot", **_plain(asdict(self))}

    def emitting_shape(self, emitter: Any) -> Any:
        """What Mitsuba loads: a black ball that ``emitter`` makes shine."""
        ball = {"type": "sphere", "center": list(self.position), "radius": self.radius, "emitter": emitter}
        return ball | {"bsdf": _BLACK}

    def emitter(self, mi: ModuleType) -> Any:
        """The lamp with intensity 1 W/sr in all directions, for a scene of Mitsuba's."""
        if self.is_point:
            intensity = {"type": "rgb", "value": 1.0}
            return {"type": "point", "position": list(self.position), "intensity": intensity}
        return self.emitting_shape(_shining(1 / (math.pi * self.radius**2)))


@dataclass(frozen=True)
class SteeredPanel:
    """A rectangle that sends light by place and direction.

    Its radiance at corner + x_u·side_u + x_v·side_v is Σ w_s a(x_u) b(x_v) Y(ω) on the side from which ``side_u``
    turns counter-clockwise into ``side_v``, and nothing on the other. a and b run through 1, √2·cos 2πx,
    √2·sin 2πx, √2·cos 4πx, … up to so many whole periods, Y through the spherical harmonics up to ``degree``
    (world axes) if there is one; function number (a·(2J+1) + b)·(n+1)² + Y. With ``terms`` a and b run through
    those of `bases.exponentials.ExponentialAxis` instead, which do not come back at the opposite edge.

    Parameters
    ----------
    corner, side_u, side_v
        Metres.
    periods
        I and J: (2I+1)·(2J+1) functions of the place. 0 to 16; (0, 0) beside ``terms``.
    degree
        n over directions; None is light alike in all directions, of which Y is 1.
    terms
        Real and imaginary part of a rate α and the highest power k of e^(αx)·x^k, of each axis; none for sinusoids.
    """

    corner: Vector
    side_u: Vector
    side_v: Vector
    periods: tuple[int, int] = (4, 4)
    degree: int | None = None
    terms: Terms = ()

    def __post_init__(self) -> None:
        for name in ("corner", "side_u", "side_v"):
            object.__setattr__(self, name, _vector(f"panel {name}", getattr(self, name)))
        _check_periods(self.periods, 2)
        if self.degree is not None:
            _check_whole("degree", self.degree, MOST_DEGREE)
        if self.terms:
            object.__setattr__(self, "terms", tuple(_term(one) for one in self.terms))
            object.__setattr__(self, "periods", (0, 0))
            _ = self.axis
        if not self.area > 1e-12:
            raise InputError("panel", "its sides are parallel or of no length; give it two that span an area")
        across = abs(float(np.dot(self.side_u, self.side_v)))
        if across > 1e-4 * float(np.linalg.norm(self.side_u) * np.linalg.norm(self.side_v)):
            raise InputError("panel", "its sides are not at right angles; a panel is a rectangle")
        if self.functions > MOST_FUNCTIONS:
            what = (
                f"{self.functions:,} functions, at most {MOST_FUNCTIONS:,}; fewer periods or a lower degree"
            )
            raise InputError("panel", what)

    @property
    def functions(self) -> int:
        """How many functions span its light."""
        over_directions = 1 if self.degree is None else (self.degree + 1) ** 2
        return self.waves[0] * self.waves[1] * over_directions

    @property
    def axis(self) -> ExponentialAxis | None:
        """What an axis holds in place of sinusoids. Raises InputError where its functions depend on each other."""
        return ExponentialAxis(tuple((complex(a, b), k) for a, b, k in self.terms)) if self.terms else None

    @property
    def waves(self) -> tuple[int, int, int]:
        """How many functions each axis has."""
        if self.axis is not None:
            return self.axis.functions, self.axis.functions, 1
        return 2 * self.periods[0] + 1, 2 * self.periods[1] + 1, 1

    @property
    def area(self) -> float:
        """Square metres."""
        return float(np.linalg.norm(np.cross(self.side_u, self.side_v)))

    @property
    def normal(self) -> Float64[np.ndarray, "3"]:
        """Unit vector out of the shining side."""
        n = np.cross(self.side_u, self.side_v)
        return n / np.linalg.norm(n)

    @property
    def is_point(self) -> bool:
        return False

    @property
    def middle(self) -> Vector:
        x, y, z = (np.array(self.corner) + np.array(self.side_u) / 2 + np.array(self.side_v) / 2).tolist()
        return x, y, z

    def to_dict(self) -> dict[str, Any]:
        """Plain data with its kind."""
        return {"kind": "panel", **_plain(asdict(self))}

    def emitting_shape(self, emitter: Any) -> Any:
        """What Mitsuba loads: a black rectangle that ``emitter`` makes shine."""
        from ..scene.variant import mitsuba

        frame = np.eye(4)
        frame[:3, 0], frame[:3, 1] = np.array(self.side_u) / 2, np.array(self.side_v) / 2
        frame[:3, 2], frame[:3, 3] = self.normal, self.middle
        to_world = mitsuba().ScalarTransform4f(frame)
        return {"type": "rectangle", "to_world": to_world, "emitter": emitter, "bsdf": _BLACK}

    def emitter(self, mi: ModuleType) -> Any:
        """The lamp with radiance 1 all over, for a scene of Mitsuba's."""
        return self.emitting_shape(_shining(1.0))


@dataclass(frozen=True)
class SteeredBox:
    """A box of light: a glow that fills it and that nothing else sees, for light shines through it.

    What it sends out at corner + x_u·side_u + x_v·side_v + x_w·side_w is Σ w_s a(x_u) b(x_v) c(x_w) W·sr⁻¹·m⁻³, alike
    in all directions; functions as those of a panel, number (a·(2J+1) + b)·(2K+1) + c.

    Parameters
    ----------
    corner, side_u, side_v, side_w
        Metres; the sides at right angles.
    periods
        I, J and K: (2I+1)·(2J+1)·(2K+1) functions.
    """

    corner: Vector
    side_u: Vector
    side_v: Vector
    side_w: Vector
    periods: tuple[int, int, int] = (2, 2, 2)

    degree = None
    is_point = False

    def __post_init__(self) -> None:
        for name in ("corner", "side_u", "side_v", "side_w"):
            object.__setattr__(self, name, _vector(f"box {name}", getattr(self, name)))
        _check_periods(self.periods, 3)
        lengths = np.linalg.norm(self.sides, axis=1)
        if not lengths.min() > 1e-6:
            raise InputError("box", "one of its sides has no length; give it three that span a volume")
        unit = self.sides / lengths[:, None]
        if np.abs(unit @ unit.T - np.eye(3)).max() > 1e-4:
            raise InputError("box", "its sides are not at right angles")
        if self.functions > MOST_FUNCTIONS:
            what = f"{self.functions:,} functions, at most {MOST_FUNCTIONS:,}; fewer periods"
            raise InputError("box", what)

    @property
    def sides(self) -> Float64[np.ndarray, "3 3"]:
        """One in each row, metres."""
        return np.array([self.side_u, self.side_v, self.side_w])

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return float(abs(np.linalg.det(self.sides)))

    @property
    def waves(self) -> tuple[int, int, int]:
        """How many functions each axis has."""
        i, j, k = self.periods
        return 2 * i + 1, 2 * j + 1, 2 * k + 1

    @property
    def functions(self) -> int:
        """How many functions span its light."""
        return math.prod(self.waves)

    @property
    def middle(self) -> Vector:
        x, y, z = (np.array(self.corner) + self.sides.sum(axis=0) / 2).tolist()
        return x, y, z

    def to_dict(self) -> dict[str, Any]:
        """Plain data with its kind."""
        return {"kind": "box", **_plain(asdict(self))}

    def emitter(self, mi: ModuleType) -> None:
        """None: no surface of it shines."""


@dataclass(frozen=True)
class SteeredSky:
    """Light from all around, as far away as the sky.

    Its radiance from direction d (world axes, toward the sky) is Σ w_s Y_s(d), up to ``degree``. The eye does not
    see it, mirrors do.
    """

    degree: int

    is_point = False
    middle = None

    def __post_init__(self) -> None:
        _check_whole("degree", self.degree, MOST_DEGREE)

    @property
    def waves(self) -> tuple[int, int, int]:
        """Functions of its place: it has none."""
        return 1, 1, 1

    @property
    def functions(self) -> int:
        """How many functions span its light."""
        return (self.degree + 1) ** 2

    def to_dict(self) -> dict[str, Any]:
        """Plain data with its kind."""
        return {"kind": "sky", "degree": self.degree}

    def emitter(self, mi: ModuleType) -> Any:
        """The sky with radiance 1 all over, for a scene of Mitsuba's."""
        return {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}


SteeredLamp = SteeredSpot | SteeredPanel | SteeredBox | SteeredSky
_KINDS: dict[str, Any] = {"spot": SteeredSpot, "panel": SteeredPanel, "box": SteeredBox, "sky": SteeredSky}

_BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}


def _shining(radiance: float) -> dict[str, Any]:
    return {"type": "area", "radiance": {"type": "rgb", "value": radiance}}


def lamp_from_dict(values: object) -> SteeredLamp:
    """From untrusted plain data, as ``to_dict`` gives it. Raises InputError."""
    if not isinstance(values, Mapping) or values.get("kind") not in _KINDS:
        raise InputError("lamp", f"expected a table of kind {', '.join(_KINDS)}")
    kind = _KINDS[values["kind"]]
    fields: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else v for k, v in values.items() if k != "kind"
    }
    try:
        return kind(**fields)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("lamp", f"its fields are wrong: {error}") from None


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {
        k: [list(x) if isinstance(x, tuple) else x for x in v] if isinstance(v, tuple) else v
        for k, v in values.items()
        if k != "terms" or v
    }


def _vector(name: str, value: Any) -> Vector:
    numbers = isinstance(value, tuple | list) and len(value) == 3
    if not (numbers and all(_is_number(x) and abs(x) < 1e7 for x in value)):
        raise InputError(name, f"{value!r}, expected three numbers in metres, below ten million each")
    return float(value[0]), float(value[1]), float(value[2])


def _check_periods(periods: Any, axes: int) -> None:
    if not isinstance(periods, tuple) or len(periods) != axes:
        raise InputError("periods", f"{periods!r}, expected {axes} whole numbers")
    for count in periods:
        _check_whole("periods", count, MOST_PERIODS)


def _term(value: Any) -> tuple[float, float, int]:
    """Two numbers and a power; what they may be, `ExponentialAxis` says."""
    if not (isinstance(value, tuple | list) and len(value) == 3 and all(_is_number(x) for x in value)):
        raise InputError(
            "terms", f"{str(value)[:60]}, expected a rate's real and imaginary part, and a power"
        )
    _check_whole("power in terms", value[2], 12)
    return float(value[0]), float(value[1]), value[2]


def _check_whole(name: str, value: object, most: int) -> None:
    if not (isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= most):
        raise InputError(name, f"{value!r}, expected a whole number from 0 to {most}")


def _check_number(name: str, value: object, least: float, most: float) -> None:
    if not (_is_number(value) and least <= value <= most):  # ty: ignore
        raise InputError(name, f"{value!r}, expected a number from {least:g} to {most:g}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
