"""From direct light at the vertices, of any source whatever, to what of it bounces (Hašan, Pellacini and Bala 2006).

The first bounces by the operator itself, thinned; what follows, smooth by then, by few modes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32, Radiance
from ..encoding.sparse_tiles import GROUP
from .bounced_kernels import blocks_of, bounce, project
from .first_bounce import FirstBounce

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

    def bounced(self, direct: np.ndarray, *, coarse: bool = False) -> Radiance:
        """(vertices, 3) of direct light (vertices, 3): as many bounces by the operator as it takes, then the modes.

        ``coarse``: one bounce by the operator, where modes follow; half of the time.
        """
        if self.first is None:
            return self.by_modes(direct)
        total, light, fallen = np.zeros((len(direct), 3), np.float32), direct, float(direct.sum())
        many = min(self.by_itself, 1) if coarse else self.by_itself
        for n in range(many if self.most is None else self.most):
            operator = self.later if n and self.later is not None else self.first
            light = operator.bounce(light)
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


def in_rows(sums: Float32[np.ndarray, "groups 96"], order: np.ndarray | None, *, rows: int) -> Radiance:
    """(rows, 3) from storage order."""
    stored = sums.reshape(-1, 3, GROUP).transpose(0, 2, 1).reshape(-1, 3)
    if order is None:
        return stored[:rows]
    out = np.empty((rows, 3), np.float32)
    out[order[order >= 0]] = stored[order >= 0]
    return out
