"""The first bounce of lights that are traced: read from a bake, every number checked that a kernel follows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Float32, Int32, Int64
from ..encoding.row_wavelet_kernels import colour_halves, first_wrong_row, multiply_rows
from ..errors import DamagedBakeError
from ..storage.bake import Bake
from ..storage.environment_layer import tree_size
from .pace import Pace

_MOST_SUM = 1 + 1e-3  # of a row: no place receives more than is sent
_MOST_COLOUR = 3 + 1e-3  # of a mean of three that is at most 1
_LEAST_WEIGHT = 1e-5  # of an entry, where entries are weighed
_MOST_BOUNCED = 8.0  # of light of 1 everywhere, by an operator that is weighed: about 1 if it is whole


@dataclass(frozen=True)
class FirstBounce:
    """Rows of the one-bounce operator in the basis of a tree over vertices; see docs/bake-format.md."""

    order: Int32[np.ndarray, "vertices"]
    left: Float32[np.ndarray, "size"]
    colours: Float32[np.ndarray, "vertices 3"]
    sums: Float32[np.ndarray, "vertices"]
    scales: Float32[np.ndarray, "vertices"]
    starts: Int64[np.ndarray, "vertices_and_one"]
    steps: np.ndarray  # (entries,) uint16
    codes: np.ndarray  # (entries,) int8
    _pace: Pace = field(default_factory=lambda: Pace(multiply_rows), compare=False)

    @property
    def bytes(self) -> int:
        """Of what a bounce reads."""
        return self.steps.nbytes + self.codes.nbytes

    def chosen(self, rows: Int32[np.ndarray, "n"]) -> FirstBounce:
        """What arrives at some vertices, of light at all of them."""
        counts = np.diff(self.starts)[rows]
        starts = np.concatenate([[0], np.cumsum(counts)])
        entries = np.arange(starts[-1]) + np.repeat(self.starts[rows] - starts[:-1], counts)
        arrays = {
            "sums": self.sums[rows], "scales": self.scales[rows], "starts": starts,
            "steps": self.steps[entries], "codes": self.codes[entries],
        }  # fmt: skip
        for array in arrays.values():
            array.setflags(write=False)
        return replace(self, **arrays, _pace=Pace(multiply_rows))

    def bounce(self, direct: np.ndarray) -> Float32[np.ndarray, "n 3"]:
        """Irradiance / π by one bounce of direct irradiance / π (vertices, 3): at all of them, or those chosen.

        Light that was taken away is negative, and so is what bounced of it; of light that is there nothing is.
        """
        light, out = np.ascontiguousarray(direct, np.float32), np.empty((len(self.sums), 3), np.float32)
        nodes, means = (
            np.empty((len(self.left), 4), np.float32),
            np.empty((2 * len(self.left), 4), np.float32),
        )
        colour_halves(light, self.colours, self.order, self.left, means, nodes)
        rows = self.starts, self.steps, self.codes, self.sums, self.scales
        least = np.float32(0 if light.min(initial=0) >= 0 else -np.inf)
        self._pace(self.bytes, rows, nodes, least, out)
        return out


def read_first_bounce(bake: Bake, at: str, *, weighed: bool = False) -> FirstBounce | None:
    """None where a bake has none; ``weighed``: of entries with weights, which are in sums and colours.

    Raises DamagedBakeError; shapes are checked with the manifest.
    """
    if f"{at}/order" not in bake.manifest.arrays:
        return None

    def within(name: str, most: float) -> np.ndarray:
        values = bake.array(f"{at}/{name}")
        if not ((values >= 0) & (values <= most)).all():
            raise DamagedBakeError(bake.path, f"{at}/{name} has values outside 0 to {most:g}")
        return values

    order, counts = bake.array(f"{at}/order"), bake.array(f"{at}/counts")
    steps, codes = bake.array(f"{at}/steps"), bake.array(f"{at}/codes")
    vertices = len(order)
    once = (order >= 0) & (order < vertices)
    if not once.all() or (np.bincount(order, minlength=vertices) != 1).any():
        raise DamagedBakeError(bake.path, f"{at}/order does not name every vertex once")
    starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    if max(1, int(starts[-1])) != len(steps):
        raise DamagedBakeError(bake.path, f"{at}/counts are not those of its {len(steps):,} steps")
    if (row := first_wrong_row(starts, steps, tree_size(vertices))) >= 0:
        raise DamagedBakeError(bake.path, f"{at}/steps of row {row} leave the tree of {vertices:,} vertices")
    found = FirstBounce(
        order=order,
        left=within("left", 1 + 1e-6),
        colours=within("colours", _MOST_COLOUR / (_LEAST_WEIGHT if weighed else 1)),
        sums=within("sums", _MOST_SUM),
        scales=within("scales", 1.0),
        starts=starts,
        steps=steps,
        codes=codes,
    )
    if weighed and not (found.bounce(np.ones((vertices, 3), np.float32)) <= _MOST_BOUNCED).all():
        raise DamagedBakeError(bake.path, f"{at} makes more of light than it gets")
    return found
