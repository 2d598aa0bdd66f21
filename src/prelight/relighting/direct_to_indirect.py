"""From direct light at the vertices, of any source whatever, to what of it bounces (Hašan, Pellacini and Bala 2006).

The first bounces by the operator itself, thinned; what follows, smooth by then, by few modes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Float32, Float64, Int32, Radiance
from ..encoding.sparse_tiles import GROUP
from .bounced_kernels import blocks_of, bounce, project
from .first_bounce import FirstBounce
from .stand_ins import StandIns

BY_ITSELF = 3  # bounces followed one by one, at most; then light is smooth enough for modes
_LITTLE = 0.05  # of the light that falls: what bounces of it may be left to modes
_NOTHING = 1e-4  # may be forgotten, where the number of bounces is given

Coefficients = Float64[np.ndarray, "modes 3"]


@dataclass(frozen=True)
class DirectToIndirect:
    """Indirect irradiance / π of direct irradiance / π, both at vertices; see docs/bake-format.md.

    ``sources`` say what light at a vertex brings of each mode. ``most`` is how many bounces were asked for, None for
    all; ``by_itself`` is how many the operator makes at most before modes take over; ``later`` is a coarser operator
    for light that has bounced before.
    """

    modes: np.ndarray  # (groups, modes, 32) int8, in the order of ``order``
    scales: Float32[np.ndarray, "modes"]
    sources: np.ndarray | None  # (colours, vertices, modes) int8
    source_scales: Float32[np.ndarray, "colours modes"] | None
    first: FirstBounce | None
    order: Int32[np.ndarray, "stored"] | None  # the row of each that is stored, or −1; None: as they are
    rows: int
    most: int | None = None
    by_itself: int = BY_ITSELF
    later: FirstBounce | None = None

    @property
    def bytes(self) -> int:
        """Of what a change of light reads."""
        first = sum(operator.bytes for operator in (self.first, self.later) if operator is not None)
        return self.modes.nbytes + first + (0 if self.sources is None else self.sources.nbytes)

    def bounced(self, direct: np.ndarray, *, check: Callable[[], None] = lambda: None) -> Radiance:
        """(vertices, 3) of direct light (vertices, 3): as many bounces by the operator as it takes, then the modes.

        ``check`` is called in between, and may raise to give up.
        """
        if self.first is None:
            return self.by_modes(direct)
        total, light, fallen = np.zeros((len(direct), 3), np.float32), direct, float(direct.sum())
        for n in range(self.by_itself if self.most is None else self.most):
            operator = self.later if n and self.later is not None else self.first
            light = operator.bounce(light)
            check()
            total += light
            if float(light.sum(dtype=np.float64)) <= (_LITTLE if self.most is None else _NOTHING) * fallen:
                break
        return total if self.most is not None else total + self.by_modes(light)

    def by_modes(self, light: np.ndarray) -> Radiance:
        """(rows, 3) every bounce of light (vertices, 3), by the modes alone."""
        return in_rows(self.multiplied(self.projected(light)), self.order, rows=self.rows)

    def projected(self, light: np.ndarray) -> Coefficients:
        """How much light at the vertices brings of each mode."""
        sources, scales = self.sources, self.source_scales
        assert sources is not None
        found = np.empty((blocks_of(len(light)), 3, sources.shape[2]), np.float32)
        project(sources, np.ascontiguousarray(light, np.float32), found)
        return (found.sum(axis=0, dtype=np.float64) * scales).T

    def multiplied(
        self, coefficients: Coefficients, out: Float32[np.ndarray, "groups 96"] | None = None
    ) -> Float32[np.ndarray, "groups 96"]:
        """Modes times coefficients: three channels of 32 receivers, as stored."""
        out = np.empty((len(self.modes), 3 * GROUP), np.float32) if out is None else out
        weights = (coefficients * self.scales[:, None]).astype(np.float32)
        every = np.arange(self.modes.shape[1], dtype=np.int32)
        bounce(self.modes, every, np.ascontiguousarray(weights), out)
        return out


class AtStandIns:
    """What bounces of direct light, at stand-ins alone: one bounce by the operator, what follows by modes.

    Modes take what light at all vertices brings of them from the stand-ins too, as if it were spread.
    """

    def __init__(self, whole: DirectToIndirect, places: StandIns) -> None:
        rows, groups = places.rows, -(-len(places) // GROUP)
        few = np.zeros((groups * GROUP, whole.modes.shape[1]), np.int8)
        few[: len(rows)] = whole.modes[rows // GROUP, :, rows % GROUP]
        assert whole.sources is not None  # a transfer layer has them
        sums = np.stack([places.gathered(of_colour) for of_colour in whole.sources])
        steps = np.maximum(np.abs(sums).max(axis=1, keepdims=True), np.float32(1e-30)) / np.float32(127)
        self._places, self._first = places, None if whole.first is None else whole.first.chosen(rows)
        self._modes = replace(
            whole,
            modes=_frozen(few.reshape(groups, GROUP, -1).transpose(0, 2, 1)),
            sources=_frozen(np.rint(sums / steps).astype(np.int8)),
            source_scales=whole.source_scales * steps[:, 0],
            rows=len(rows),
        )

    def bounced(self, direct: Radiance) -> Float32[np.ndarray, "n 3"]:
        """Of direct light (V, 3) at all vertices, what bounces of it at the stand-ins."""
        if self._first is None:
            return self._modes.by_modes(direct[self._places.rows])
        light = self._first.bounce(direct)
        return light + self._modes.by_modes(light)


def _frozen(values: np.ndarray) -> np.ndarray:
    whole = np.ascontiguousarray(values)
    whole.setflags(write=False)
    return whole


def in_rows(sums: Float32[np.ndarray, "groups 96"], order: np.ndarray | None, *, rows: int) -> Radiance:
    """(rows, 3) from storage order."""
    stored = sums.reshape(-1, 3, GROUP).transpose(0, 2, 1).reshape(-1, 3)
    if order is None:
        return stored[:rows]
    out = np.empty((rows, 3), np.float32)
    out[order[order >= 0]] = stored[order >= 0]
    return out
