"""One chunk of an array, one file: little-endian bytes in C order, then their crc32c (Zarr v3)."""

from __future__ import annotations

import errno
import hashlib
import itertools
import json
import math
import mmap
import os
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

import google_crc32c
import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from ..errors import DamagedBakeError, OutputError

DTYPES = {"uint8": "|u1", "int8": "|i1", "uint16": "<u2", "int32": "<i4", "int64": "<i8", "float32": "<f4"}
CHECKSUM_BYTES = 4
# A map keeps a second handle of its file where Python cannot be told not to: a bake may have thousands.
_WITHOUT_HANDLE = {"trackfd": False} if sys.version_info >= (3, 13) else {}


class ChunkRecord(BaseModel):
    """What the manifest knows of one chunk: enough to find any change to it."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    size: int = Field(ge=CHECKSUM_BYTES)
    crc32c: int = Field(ge=0, lt=2**32)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


class ArraySpec(BaseModel):
    """Shape, element type and chunk shape of an array."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    shape: list[int] = Field(min_length=1, max_length=4)
    dtype: str
    chunk_shape: list[int] = Field(min_length=1, max_length=4)

    def chunk_bytes(self) -> int:
        """Bytes of one chunk file, checksum included."""
        return math.prod(self.chunk_shape) * np.dtype(DTYPES[self.dtype]).itemsize + CHECKSUM_BYTES

    def grid(self) -> list[int]:
        return [-(-n // c) for n, c in zip(self.shape, self.chunk_shape, strict=True)]

    def chunk_indices(self) -> Iterator[tuple[int, ...]]:
        return itertools.product(*(range(n) for n in self.grid()))

    def zarr_metadata(self) -> bytes:
        """The array's ``zarr.json`` (Zarr v3, codecs bytes and crc32c)."""
        little = {"name": "bytes", "configuration": {"endian": "little"}}
        document = {
            "zarr_format": 3,
            "node_type": "array",
            "shape": self.shape,
            "data_type": self.dtype,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": self.chunk_shape}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "fill_value": 0,
            "codecs": [{"name": "bytes"} if self.dtype in ("uint8", "int8") else little, {"name": "crc32c"}],
            "attributes": {},
        }
        return json.dumps(document, indent=1, sort_keys=True).encode()


def chunk_key(array: str, index: tuple[int, ...]) -> str:
    """The chunk's file inside the bake."""
    return f"{array}/c/" + "/".join(str(i) for i in index)


def encode(values: np.ndarray, spec: ArraySpec) -> tuple[bytes, ChunkRecord]:
    """Bytes of a chunk file and its record; a last chunk is filled up with zeros, as Zarr wants."""
    chunk = np.zeros(spec.chunk_shape, DTYPES[spec.dtype])
    chunk[tuple(slice(0, n) for n in values.shape)] = values
    data = chunk.tobytes()
    crc = google_crc32c.value(data)
    data += crc.to_bytes(CHECKSUM_BYTES, "little")
    return data, ChunkRecord(size=len(data), crc32c=crc, sha256=hashlib.sha256(data).hexdigest())


def open_chunk(root: Path, key: str, spec: ArraySpec, record: ChunkRecord) -> np.ndarray:
    """Memory-map a chunk after checking its size and crc32c; read-only array of ``spec.chunk_shape``.

    Raises DamagedBakeError naming the chunk.
    """
    view = _map_regular(root, key, record.size)
    data = view[:-CHECKSUM_BYTES]
    if _crc32c(data) != record.crc32c or view[-CHECKSUM_BYTES:] != record.crc32c.to_bytes(4, "little"):
        raise DamagedBakeError(root, f"chunk {key} was altered (crc32c differs); bake again or restore it")
    return np.frombuffer(data, DTYPES[spec.dtype]).reshape(spec.chunk_shape)


def _crc32c(data: memoryview) -> int:
    """In blocks, since the library takes nothing but bytes."""
    crc, block = 0, 1 << 20
    for start in range(0, len(data), block):
        crc = google_crc32c.extend(crc, bytes(data[start : start + block]))
    return crc


def check_hash(root: Path, key: str, size: int, sha256: str) -> None:
    """Raises DamagedBakeError unless the file has this size and sha256."""
    if hashlib.sha256(_map_regular(root, key, size)).hexdigest() != sha256:
        raise DamagedBakeError(root, f"chunk {key} was altered (sha256 differs); bake again or restore it")


def _map_regular(root: Path, key: str, size: int) -> memoryview:
    try:
        handle = os.open(root / key, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            status = os.fstat(handle)
            if not stat.S_ISREG(status.st_mode):
                raise DamagedBakeError(root, f"chunk {key} is not a regular file; bake again or restore it")
            if status.st_size != size:
                expected = f"chunk {key} has {status.st_size} bytes, expected {size}"
                raise DamagedBakeError(root, f"{expected}; bake again or restore it")
            return memoryview(mmap.mmap(handle, size, prot=mmap.PROT_READ, **_WITHOUT_HANDLE))
        finally:
            os.close(handle)
    except OSError as error:
        if error.errno in (errno.EMFILE, errno.ENFILE):
            raise OutputError(
                root, "more chunks than files may be open; raise the limit: ulimit -n 65536"
            ) from None
        what = {errno.ENOENT: "is missing", errno.ELOOP: "is a link, not a file"}.get(error.errno or 0)
        what = what or f"cannot be read: {error.strerror}"
        raise DamagedBakeError(root, f"chunk {key} {what}; bake again or restore it") from None
