"""What a session lights, and what of it depends on the eye."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Radiance, UInt32
from ..lighting.quantities import Triple
from .protocol import State
from .protocol_values import LayerPace

_LARGEST_HALF = 6e4


class Lighting(Protocol):
    """What a session lights: the rows of a bake. Owned by one thread."""

    @property
    def rows(self) -> int: ...

    @property
    def layers(self) -> tuple[LayerPace, ...]:
        """What each layer did at the last ``relight``."""
        ...

    def relight(self, state: State, *, exact: bool, check: Callable[[], None]) -> tuple[bool, str, int]: ...

    def frame(self, state: State) -> bytearray: ...

    def warm(self, state: State) -> None: ...

    def view(self, state: State, eye: Triple) -> View: ...


@dataclass(frozen=True)
class View:
    """What depends on the eye: what vertices (V, 4) add toward it, in half floats, the fourth unused; and a map."""

    shine: np.ndarray | None
    world: UInt32[np.ndarray, "texels"] | None

    @property
    def is_any(self) -> bool:
        return self.shine is not None or self.world is not None


def halves(radiance: Radiance) -> np.ndarray:
    """(V, 4) half floats of three numbers."""
    out = np.zeros((len(radiance), 4), np.float16)
    out[:, :3] = np.clip(radiance, -_LARGEST_HALF, _LARGEST_HALF)
    return out
