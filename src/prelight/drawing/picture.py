"""A picture: linear radiance a pixel, shown through exposure and tone curve, saved as EXR, PNG or NPY."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Float32, UInt8
from ..arrays import Picture as Pixels
from ..errors import InputError
from ..files import refuse_existing

BACKGROUND_WHITE = 2.0  # what is behind an edge counts as no brighter than this, after exposure

_SAVED_AS = ".exr (linear radiance), .png (as displayed) or .npy (linear radiance)"


@dataclass(frozen=True)
class Picture:
    """What a camera sees: scene-linear Rec.709 radiance, row 0 at the top.

    ``linear`` (H, W, 3) is the mean over each pixel's filter, background included. ``coverage`` (H, W) is the
    part of each pixel that objects fill, 0 to 1, and ``background`` (H, W, 3) the radiance behind them; both
    are None if unknown, the latter also where there is none.
    """

    linear: Pixels
    coverage: Float32[np.ndarray, "height width"] | None = None
    background: Pixels | None = None

    def stops(self, exposure: str | float = "auto") -> float:
        """The exposure in stops; "auto" suits the objects, not the sky behind them.

        Raises InputError for anything but "auto" or a finite number.
        """
        if exposure != "auto":
            try:
                stops = float(exposure)
            except (TypeError, ValueError):
                stops = np.nan
            if not np.isfinite(stops):
                raise InputError("exposure", f'{exposure!r}, expected "auto" or stops such as -1.5')
            return stops
        from ..images.tonemap import exposure_for

        covered = None if self.coverage is None else self.coverage > 0.5
        if covered is not None and not covered.any():
            covered = None
        return float(exposure_for(self.linear, mask=covered))

    def display(
        self, *, exposure: str | float = "auto", curve: str = "filmic"
    ) -> UInt8[np.ndarray, "height width 3"]:
        """sRGB bytes for a screen.

        Along silhouettes a background brighter than display white counts as twice white: a sun or a lamp behind
        an edge would otherwise outweigh the object in the mean and leave the edge jagged. ``linear`` keeps it.

        Raises InputError for an unknown exposure or curve.
        """
        from ..images.tonemap import tonemap

        stops = self.stops(exposure)
        return tonemap(
            self._with_tamed_edges(2.0 ** min(max(stops, -120.0), 120.0)), exposure=stops, curve=curve
        )

    def _with_tamed_edges(self, gain: float) -> Pixels:
        if self.coverage is None or self.background is None:
            return self.linear
        edge = (self.coverage > 0) & (self.coverage < 1)
        behind = self.background[edge]
        excess = behind - np.minimum(behind, np.float32(BACKGROUND_WHITE / gain))
        tamed = self.linear.copy()
        tamed[edge] = np.maximum(tamed[edge] - (1 - self.coverage[edge, None]) * excess, 0)
        return tamed

    def save(
        self,
        path: str | Path,
        *,
        force: bool = False,
        exposure: str | float = "auto",
        curve: str = "filmic",
    ) -> None:
        """Write .exr or .npy (linear float32 radiance) or .png (what ``display`` returns), by the extension.

        Raises InputError for another extension, OutputError for an existing file unless ``force``, or where
        writing fails.
        """
        path = Path(path)
        kind = path.suffix.lower()
        if kind not in (".exr", ".png", ".npy"):
            raise InputError(path, f"a picture is saved as {_SAVED_AS}; choose one of these extensions")
        refuse_existing(path, force=force)
        from ..images import formats

        if kind == ".png":
            formats.write_png(path, self.display(exposure=exposure, curve=curve))
        else:
            {".exr": formats.write_exr, ".npy": formats.write_npy}[kind](path, self.linear)

    def show(self, *, exposure: str | float = "auto", curve: str = "filmic") -> None:
        """Open the picture in the system's viewer."""
        from PIL import Image

        Image.fromarray(self.display(exposure=exposure, curve=curve)).show()
