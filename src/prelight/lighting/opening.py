"""Environment maps from files: one picture in a known layout, or six pictures, one for each face."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ..arrays import Float32
from ..errors import InputError
from ..images.formats import read_radiance_map
from ..images.map_checks import MAX_PIXELS
from . import layouts
from .layouts import FACE_PICTURES, PICTURE_LAYOUTS

FACE = "{face}"
# In the order of the faces of ``layouts.FACE_PICTURES``: right, left, top, bottom, front, back.
FACE_NAMES = (
    ("px", "nx", "py", "ny", "pz", "nz"),
    ("posx", "negx", "posy", "negy", "posz", "negz"),
    ("right", "left", "top", "bottom", "front", "back"),
)
_NAMES_IN_WORDS = "px nx py ny pz nz, or right left top bottom front back"
_ENDINGS = (".hdr", ".exr", ".pic")
_MOST_NAMES = 10_000  # in a folder


def read_map(path: str | Path, layout: str | None) -> tuple[Float32[np.ndarray, "... 3"], str]:
    """Pixels and layout of an environment in a file, in six files ``sky_{face}.hdr``, or in a folder of six.

    Raises InputError.
    """
    if FACE in os.path.basename(path) or _is_folder(path):
        if layout not in (None, "cube"):
            raise InputError(path, f"layout {layout!r}, but six pictures are the faces of a cube")
        return _read_faces(path), "cube"
    if layout is not None and layout not in PICTURE_LAYOUTS:
        raise InputError(path, f"layout {layout!r} is not known; known are {', '.join(PICTURE_LAYOUTS)}")
    pixels = read_radiance_map(path)
    height, width = pixels.shape[:2]
    layout = layout or layouts.recognised(height, width)
    if layout is None:
        known = ", ".join(f"{n} {k.ratio[0]}:{k.ratio[1]}" for n, k in PICTURE_LAYOUTS.items())
        raise InputError(
            path,
            f"{width}×{height} pixels, not the proportions of a known layout ({known}); "
            "crop it, or say which it is with --layout",
        )
    return pixels, layout


def _is_folder(path: str | Path) -> bool:
    try:
        return os.path.isdir(path)
    except ValueError:  # a NUL character
        return False


def _read_faces(path: str | Path) -> Float32[np.ndarray, "6 row column 3"]:
    files = _faces_in(Path(path)) if _is_folder(path) else _faces_named(Path(path))
    out, first = None, files[0].name
    for face, file in enumerate(files):
        pixels = read_radiance_map(file)
        height, width = pixels.shape[:2]
        if height != width:
            raise InputError(file, f"{width}×{height} pixels, expected a square picture of one face")
        if out is None:
            if 6 * width * width > MAX_PIXELS:
                raise InputError(file, f"six faces of {width}×{width} pixels, at most 5,792 a side are read")
            out = np.empty((6, width, width, 3), np.float32)
        if width != out.shape[1]:
            raise InputError(
                file, f"{width}×{width} pixels, but {first} has {out.shape[1]}; expected six of one size"
            )
        FACE_PICTURES.put(out, face, pixels)
    assert out is not None  # there are six files
    return out


def _faces_named(pattern: Path) -> list[Path]:
    """The six files of a pattern such as ``sky_{face}.hdr``."""
    known = [[pattern.with_name(pattern.name.replace(FACE, name)) for name in names] for names in FACE_NAMES]
    try:
        most = max(known, key=lambda files: sum(file.exists() for file in files))
        missing = [file.name for file in most if not file.exists()]
    except (OSError, ValueError):
        raise InputError(pattern, "no file can have such a name") from None
    if len(missing) == 6:
        raise InputError(pattern, f"no such files; {FACE} stands for {_NAMES_IN_WORDS}")
    if missing:
        raise InputError(pattern, f"six pictures are needed; missing: {', '.join(missing)}")
    return most


def _faces_in(folder: Path) -> list[Path]:
    """The six files of a folder whose names are, or end in, those of the faces."""
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry, _ in zip(entries, range(_MOST_NAMES), strict=False)]
    except OSError as error:
        raise InputError(folder, f"cannot read the folder: {error.strerror}") from None
    found: dict[str, list[str]] = {}
    for name in sorted(names):
        stem, ending = os.path.splitext(name.lower())
        if ending in _ENDINGS:
            found.setdefault(stem.replace("-", "_").replace(".", "_").rsplit("_", 1)[-1], []).append(name)
    for known in FACE_NAMES:
        there = [found.get(face, []) for face in known]
        if all(len(files) == 1 for files in there):
            return [folder / files[0] for files in there]
        if any(len(files) > 1 for files in there) and all(there):
            twice = ", ".join(next(files for files in there if len(files) > 1)[:2])
            raise InputError(
                folder, f"more than one picture of a face ({twice}); name them as a pattern with {FACE}"
            )
    raise InputError(folder, f"a folder without six pictures (.hdr or .exr) named {_NAMES_IN_WORDS}")
