"""The bytes of a glTF file's buffers and images: in its GLB, written into its JSON, or in files beside it."""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass, field

from ...errors import InputError
from ...files import Resolver
from ...images.textures import LARGEST_FILE as LARGEST_PICTURE
from ..mesh import UnreadableMesh, short_name
from .document import Document

_MOST_BYTES = 2_000_000_000  # of all buffers together
_DATA = "data:"


@dataclass
class Bytes:
    """All bytes that a document may point at; what several parts name is read once."""

    document: Document
    chunk: memoryview  # the binary chunk of a GLB, empty where there is none
    files: Resolver | None  # the folder of the file; None where it has none
    _read: dict[str, memoryview] = field(default_factory=dict)
    _buffers: dict[int, memoryview] = field(default_factory=dict)
    _total: int = 0

    def view(self, index: int) -> memoryview:
        """The bytes of a bufferView whose bounds were checked; its buffer is read when first asked for.

        Raises UnreadableMesh.
        """
        view = self.document.bufferViews[index]
        if view.buffer not in self._buffers:
            self._buffers[view.buffer] = self._buffer(view.buffer)
        return self._buffers[view.buffer][view.byteOffset : view.byteOffset + view.byteLength]

    def _buffer(self, index: int) -> memoryview:
        buffer, where = self.document.buffers[index], f"/buffers/{index}"
        self._total += buffer.byteLength
        if self._total > _MOST_BYTES:
            raise UnreadableMesh("more than 2 GB of buffers; simplify the mesh", where)
        if buffer.uri is not None:
            data = self._of_uri(buffer.uri, where)
        else:
            data = self.chunk if index == 0 else memoryview(b"")
        if buffer.byteLength > len(data):
            reason = f"the buffer has {buffer.byteLength:,} bytes, its data {len(data):,}"
            raise UnreadableMesh(f"damaged glTF file: {reason}", where)
        return data

    def image(self, index: int) -> tuple[str, bytes]:
        """Name and bytes of an image's file, not yet decoded. Raises UnreadableMesh."""
        image, where = self.document.images[index], f"/images/{index}"
        name = f"image {index}"
        if image.uri is not None:
            name = name if image.uri.startswith(_DATA) else image.uri
            data = self._of_uri(image.uri, where, limit=LARGEST_PICTURE)
        elif image.bufferView is None or image.bufferView >= len(self.document.bufferViews):
            raise UnreadableMesh(f"{name} names no file and no bufferView that there is", where)
        else:
            data = self.view(image.bufferView)
        if len(data) > LARGEST_PICTURE:
            reason = f"{name} has {len(data) / 1e6:.0f} MB, at most {LARGEST_PICTURE / 1e6:.0f} MB are read"
            raise UnreadableMesh(reason, where)
        return name, bytes(data)

    def _of_uri(self, uri: str, where: str, *, limit: int = _MOST_BYTES) -> memoryview:
        if uri not in self._read:
            data = _decoded(uri, where) if uri.startswith(_DATA) else self._file(uri, where, limit)
            self._read[uri] = memoryview(data)
        return self._read[uri]

    def _file(self, uri: str, where: str, limit: int) -> bytes:
        if self.files is None:
            raise UnreadableMesh(f"'{short_name(uri)}' cannot be read: the file has no folder", where)
        try:
            return self.files.read(uri, limit=limit, uri=True)
        except InputError as error:
            raise UnreadableMesh(f"'{short_name(uri)}': {error.reason}", where) from None


def _decoded(uri: str, where: str) -> bytes:
    """The bytes of a data: URI in base64, the only encoding that glTF has."""
    head, comma, text = uri.partition(",")
    if not comma or not head.endswith(";base64"):
        raise UnreadableMesh("damaged glTF file: a data: address that is not in base64", where)
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise UnreadableMesh("damaged glTF file: its base64 is cut short or broken", where) from None
