"""Looking through clear panes: what is behind them, pixel by pixel, times what their glass lets through."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Float32, Int32, Radiance, Triangles
from ..drawing.picture import Picture
from ..drawing.view import View


@dataclass(frozen=True)
class Panes:
    """The vertices of glass, ascending, and what they let through now; frosted ones are not looked through."""

    vertices: Int32[np.ndarray, "some"]
    factors: Float32[np.ndarray, "some 3"]
    clear: np.ndarray  # (some,) bool

    def are_left(self, triangles: Triangles) -> np.ndarray:
        """(F,) bool: the triangles that are no panes."""
        glass = np.zeros(int(triangles.max(initial=0)) + 1, bool)
        glass[self.vertices[self.vertices < len(glass)]] = True
        return ~glass[triangles].all(axis=1)

    def without_clear(self, shine: Radiance) -> Radiance:
        """Radiance (V, 3) of vertices, but for those of clear panes: these have none of their own."""
        out = shine.copy()
        out[self.vertices[self.clear]] = 0
        return out

    def before(self, picture: Picture, whole: View, vertices: int) -> Picture:
        """A picture without panes, ``whole`` the view of the same with them: filtered where they are in front."""
        there, through = (np.zeros((vertices, 3), np.float32) for _ in range(2))
        there[self.vertices] = 1
        through[self.vertices[self.clear]] = self.factors[self.clear]
        kept = 1 - whole.draw(there).linear + whole.draw(through).linear
        behind = None if picture.background is None else picture.background * kept
        return replace(picture, linear=picture.linear * kept, background=behind)
