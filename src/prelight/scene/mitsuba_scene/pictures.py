"""Bitmaps of a Mitsuba scene as textures of 8 bits, each kept once."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ...arrays import Texture
from ...errors import InputError
from ...files import read_regular
from ...images.textures import LARGEST_FILE, read_texture
from ..mesh import UnreadableMesh
from .node import Node, essence

_EIGHT_BIT = (".png", ".jpg", ".jpeg", ".bmp", ".tga")
_MOST_PIXELS = 64 << 20


class Pictures:
    """The textures of a scene, in the order they are first met."""

    def __init__(self, mi: ModuleType, unread: Counter[str]) -> None:
        self._mi, self._unread = mi, unread
        self._index: dict[tuple[Any, bool], int] = {}
        self._kept: list[Any] = []  # what is known by its identity must stay
        self.textures: list[Texture] = []

    def index(self, bitmap: Node) -> tuple[int, bool]:
        """The texture of a ``bitmap``, and whether its bytes are raw numbers, not sRGB. Raises UnreadableMesh."""
        raw = bool(bitmap.values.get("raw", False))
        source = next((bitmap.values[k] for k in ("filename", "bitmap", "data") if k in bitmap.values), None)
        if source is None:
            raise UnreadableMesh("a bitmap without a file or data", bitmap.where)
        key = (source if isinstance(source, str) else id(source), raw)
        if key not in self._index:
            self._kept.append(source)
            self._index[key] = len(self.textures)
            self.textures.append(self._read(source, raw))
        if bitmap.values.get("wrap_mode", "repeat") != "repeat":
            self._unread["textures that do not repeat: read as repeating"] += 1
        return self._index[key], raw

    def _read(self, source: Any, raw: bool) -> Texture:
        mi = self._mi
        try:
            if isinstance(source, str):
                if source.lower().endswith(_EIGHT_BIT):
                    name = source.rpartition("/")[2]
                    return read_texture(read_regular(source, limit=LARGEST_FILE), name=name)
                read_regular(source, limit=LARGEST_FILE)
                source = mi.Bitmap(source)
            elif not isinstance(source, mi.Bitmap):
                source = mi.Bitmap(np.array(source, np.float32))
                source.set_srgb_gamma(False)
            width, height = source.size()
            if width * height > _MOST_PIXELS:
                raise UnreadableMesh(f"a texture of {width} × {height} pixels, at most 64 Mpx are read")
            self._note_range(source)
            encoded = source.srgb_gamma() if raw else True
            return np.array(
                source.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, srgb_gamma=encoded), np.uint8
            )
        except (RuntimeError, TypeError) as error:
            raise UnreadableMesh(f"texture: {essence(error)}") from None
        except InputError as error:
            raise UnreadableMesh(f"texture {Path(str(error.path)).name}: {error.reason}") from None

    def _note_range(self, bitmap: Any) -> None:
        values = np.array(bitmap, copy=False)
        if values.dtype.kind != "f":
            return
        self._unread["textures of floating point kept with 8 bits a channel"] += 1
        if values.size and not (np.nanmin(values) >= 0 and np.nanmax(values) <= 1):
            self._unread["textures with values outside 0 to 1: clipped"] += 1
