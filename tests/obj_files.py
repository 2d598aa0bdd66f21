"""A square as OBJ, and loading it with files beside it."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from prelight.errors import InputError
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n"


def png(pixels: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(out, "PNG")
    return out.getvalue()


class Folder:
    """Where an OBJ and what it names are written."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def __call__(self, text: bytes, files: dict[str, bytes] | None = None) -> Scene:
        """Load an OBJ of these bytes, with files beside it."""
        for name, content in {"scene.obj": text, **(files or {})}.items():
            (self.root / name).write_bytes(content)
        return load_scene(self.root / "scene.obj")


def outcome(path: Path) -> Scene | InputError:
    try:
        return load_scene(path)
    except InputError as error:
        return error
