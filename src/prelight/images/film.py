"""Moving pictures: mp4 where imageio-ffmpeg is installed, WebP and GIF always. One file, whole or not at all."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..errors import InputError, MissingExtraError, OutputError
from ..files import publish, refuse_existing

FILMS = (".mp4", ".webp", ".gif")
_MOST_FILM = 4_000_000_000  # bytes
_CONSTANT_QUALITY = 17  # of x264, 0 to 51: nobody sees it

# What we send is sRGB; without these words players guess, and colours shift.
_COLOURS = (
    "-vf", "scale=out_color_matrix=bt709:out_range=tv", "-colorspace", "bt709", "-color_primaries", "bt709",
    "-color_trc", "iec61966-2-1", "-color_range", "tv", "-crf", str(_CONSTANT_QUALITY), "-movflags", "+faststart",
)  # fmt: skip


def check_film(path: Path) -> None:
    """Raises InputError for a name that is not a film's, MissingExtraError for mp4 without imageio-ffmpeg."""
    kind = path.suffix.lower()
    if kind not in FILMS:
        raise InputError(path, f"expected a name ending in {', '.join(FILMS[:-1])} or {FILMS[-1]}")
    if kind == ".mp4":
        _ffmpeg()


def write_film(
    path: Path, frames: Iterable[np.ndarray], *, fps: float, force: bool = False, loop: bool = True
) -> int:
    """Write a film and say how many frames it has.

    Parameters
    ----------
    path
        A name ending in .mp4, .webp or .gif.
    frames
        (height, width, 3) uint8 sRGB, all of one size, at least one. An mp4 takes them one by one; the others hold
        all in memory. An mp4 of odd size gains a column or row, like the last: its colours are shared by two pixels.
    fps
        Frames a second, above 0.
    force
        Replace what is there.
    loop
        Of WebP and GIF: play for ever.

    Raises
    ------
    InputError
        Another name, no frames, or frames of several sizes.
    MissingExtraError
        mp4 without imageio-ffmpeg.
    OutputError
        ``path`` exists, or cannot be written.
    """
    check_film(path)
    refuse_existing(path, force=force)
    if not (math.isfinite(fps) and fps > 0):
        raise InputError("fps", f"{fps:g}, expected more than 0")
    counted = _Counted(frames)
    data = _mp4(counted, fps) if path.suffix.lower() == ".mp4" else _pillow(path, counted, fps, loop=loop)
    publish(path, data)
    return counted.number


class _Counted:
    """Frames as they are asked for, checked."""

    def __init__(self, frames: Iterable[np.ndarray]) -> None:
        self._frames, self.number = iter(frames), 0
        self.shape: tuple[int, ...] | None = None

    def __iter__(self) -> Iterator[np.ndarray]:
        for frame in self._frames:
            shape = self.shape = self.shape or frame.shape
            if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape != shape or shape[2] != 3:
                raise InputError(
                    "frames", f"{frame.dtype} {frame.shape}, expected uint8 {shape} as the first"
                )
            self.number += 1
            yield frame
        if not self.number:
            raise InputError("frames", "none given")


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg  # ty: ignore[import-not-found]
    except ImportError:
        what = "an mp4 needs imageio-ffmpeg: pip install imageio-ffmpeg; or write .webp"
        raise MissingExtraError(what) from None
    return imageio_ffmpeg


def _mp4(frames: Iterable[np.ndarray], fps: float) -> bytes:
    writer = None
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "film.mp4"
        try:
            for frame in frames:
                height, width = frame.shape[:2]
                even = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
                if writer is None:
                    writer = _ffmpeg().write_frames(
                        str(made), even.shape[1::-1], fps=fps, codec="libx264", quality=None, macro_block_size=2,
                        output_params=list(_COLOURS), ffmpeg_log_level="error",
                    )  # fmt: skip
                    writer.send(None)
                writer.send(np.ascontiguousarray(even))
        except (OSError, RuntimeError) as error:
            if isinstance(error, OutputError):
                raise
            raise OutputError("film.mp4", f"ffmpeg stopped: {str(error).splitlines()[0][:120]}") from None
        finally:
            if writer is not None:
                writer.close()
        if not made.is_file() or not 0 < made.stat().st_size <= _MOST_FILM:
            raise OutputError("film.mp4", "ffmpeg wrote no film, or one beyond 4 GB; try fewer frames")
        return made.read_bytes()


def _pillow(path: Path, frames: Iterable[np.ndarray], fps: float, *, loop: bool) -> bytes:
    from io import BytesIO

    pictures = [Image.fromarray(frame) for frame in frames]
    kind = path.suffix.lower().removeprefix(".")
    options: dict[str, Any] = {"quality": 90, "method": 4} if kind == "webp" else {}
    if loop:
        options["loop"] = 0
    data = BytesIO()
    pictures[0].save(
        data,
        format=kind.upper(),
        save_all=True,
        append_images=pictures[1:],
        duration=1000 / fps,
        **options,
    )
    return data.getvalue()
