"""Textures: pictures on surfaces, 8 bits a channel, read from picture files and looked up at coordinates."""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Float64, Texture, TextureCoordinates
from ..errors import InputError

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

LARGEST_FILE = 256_000_000
_MOST_PIXELS, _LONGEST_SIDE = 64 << 20, 16_384
_MOST_SCANS = 100  # of a progressive JPEG, each of which goes over the whole picture
_RATIO, _SMALL = 1000, 16 << 20  # decoded bytes a byte of the file may claim, beyond the first 16 MiB
# What Pillow may meet in damaged bytes; anything else is a fault of ours.
_DAMAGE = (
    OSError, SyntaxError, ValueError, KeyError, IndexError, TypeError, EOFError, OverflowError, AttributeError,
    struct.error, zlib.error,
)  # fmt: skip


def read_texture(data: bytes, *, name: str) -> Texture:
    """The picture in a PNG, JPEG, BMP or TGA file as (H, W, 3) bytes, sRGB as stored, the top row first.

    Grey and palettes become RGB, 16 bits a channel 8; alpha is left out, and so are colour profiles and the
    camera's orientation. TGA has no mark of its own and is known by ``name``.

    Raises InputError, whose ``path`` is ``name``: another kind of file, damaged or cut short, more than
    16,384 pixels a side or 64 Mpx, or far more than so few bytes can hold. Sizes are checked before decoding.
    """
    try:
        with warnings.catch_warnings():  # of oddities in metadata, which are not looked at
            warnings.simplefilter("ignore")
            picture = _opened(data, name)
            _check_size(picture, data, name)
            picture.load()
            return _as_bytes(picture)
    except InputError:
        raise
    except MemoryError:
        raise InputError(name, "needs more memory than there is; make the picture smaller") from None
    except _DAMAGE as error:
        said = f": {error}" if isinstance(error, OSError | SyntaxError) and str(error) else ""
        raise InputError(name, f"damaged or truncated picture{said}") from None


def _opened(data: bytes, name: str) -> ImageFile:
    """Only the header is read. The decoder is chosen here, never by Pillow's own search through all it has."""
    file = io.BytesIO(data)
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        from PIL.PngImagePlugin import PngImageFile

        if b"IEND\xaeB`\x82" not in data:  # Pillow is content with all rows
            raise InputError(name, "truncated picture: the end of the PNG is missing")
        return PngImageFile(file)
    if data.startswith(b"\xff\xd8\xff"):
        from PIL.JpegImagePlugin import JpegImageFile

        if data.count(b"\xff\xda") > _MOST_SCANS:
            raise InputError(name, f"a JPEG of more than {_MOST_SCANS} scans; save it anew")
        return JpegImageFile(file)
    if data.startswith(b"BM"):
        from PIL.BmpImagePlugin import BmpImageFile

        picture = BmpImageFile(file)
        if any(tile[0] != "raw" for tile in picture.tile):
            raise InputError(name, "a compressed BMP, which is not read; save it as PNG")
        return picture
    if name.lower().endswith(".tga"):
        from PIL.TgaImagePlugin import TgaImageFile

        return TgaImageFile(file)
    raise InputError(name, "neither PNG nor JPEG, BMP or TGA; save the texture as PNG")


def _check_size(picture: ImageFile, data: bytes, name: str) -> None:
    width, height = picture.size
    if width < 1 or height < 1:
        raise InputError(name, f"a picture of {width}×{height} pixels")
    if max(width, height) > _LONGEST_SIDE or width * height > _MOST_PIXELS:
        most = f"at most {_LONGEST_SIDE:,} a side and 64 Mpx are read"
        raise InputError(name, f"a picture of {width:,}×{height:,} pixels, {most}; make it smaller")
    if width * height * 3 > _SMALL + _RATIO * len(data):
        raise InputError(name, f"claims {width:,}×{height:,} pixels in {len(data):,} bytes; save it anew")


def _as_bytes(picture: ImageFile) -> Texture:
    if picture.mode.startswith("I"):  # grey of 16 bits
        wide = np.clip(np.asarray(picture), 0, 65535).astype(np.uint32)
        grey = ((wide * 255 + 32767) // 65535).astype(np.uint8)
        return np.ascontiguousarray(np.broadcast_to(grey[:, :, None], (*grey.shape, 3)))
    return np.array(picture.convert("RGB"), np.uint8)


def sample(texture: Texture, uv: TextureCoordinates) -> Float64[np.ndarray, "n 3"]:
    """Bilinear lookup of coordinates (n, 2), repeating; 0 to 255, in the texture's own encoding.

    u runs to the right, v down from the first row; the middle of the first texel is at half a texel.
    """
    height, width = texture.shape[:2]
    uv = np.asarray(uv, np.float64)
    x, y = (uv[:, 0] % 1) * width - 0.5, (uv[:, 1] % 1) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - left)[:, None], (y - top)[:, None]
    corners = [texture[(top + j) % height, (left + i) % width] for j in (0, 1) for i in (0, 1)]
    upper = corners[0] * (1 - fx) + corners[1] * fx
    lower = corners[2] * (1 - fx) + corners[3] * fx
    return upper * (1 - fy) + lower * fy
