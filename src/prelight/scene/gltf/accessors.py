"""Numbers in the binary chunk of a GLB file: bounds first, then arrays."""

from __future__ import annotations

import numpy as np

from ..mesh import UnreadableMesh
from .document import Accessor, Document

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def check_bounds(document: Document, binary: memoryview) -> None:
    """Every buffer inside the chunk, every view inside its buffer, every accessor inside its view."""
    for k, buffer in enumerate(document.buffers):
        where = f"/buffers/{k}"
        if buffer.uri is not None:
            raise UnreadableMesh("points to data outside its binary chunk: export as one GLB", where)
        if k == 0 and buffer.byteLength > len(binary):
            raise UnreadableMesh(
                f"damaged GLB file: the buffer has {buffer.byteLength:,} bytes, its chunk {len(binary):,}",
                where,
            )
    for k, view in enumerate(document.bufferViews):
        if view.buffer != 0 or not document.buffers:
            raise UnreadableMesh(f"damaged GLB file: buffer {view.buffer} has no data", f"/bufferViews/{k}")
        if view.byteOffset + view.byteLength > document.buffers[view.buffer].byteLength:
            raise UnreadableMesh("damaged GLB file: it ends outside its buffer", f"/bufferViews/{k}")
    for k, accessor in enumerate(document.accessors):
        if accessor.bufferView is None:
            continue
        if accessor.bufferView >= len(document.bufferViews):
            reason = f"damaged GLB file: there is no bufferView {accessor.bufferView}"
            raise UnreadableMesh(reason, f"/accessors/{k}")
        item, stride = _sizes(document, accessor)
        if accessor.byteOffset + stride * (accessor.count - 1) + item > (
            document.bufferViews[accessor.bufferView].byteLength
        ):
            raise UnreadableMesh("damaged GLB file: it ends outside its bufferView", f"/accessors/{k}")


def _sizes(document: Document, accessor: Accessor) -> tuple[int, int]:
    """Bytes of one entry, and from one entry to the next."""
    item = np.dtype(_TYPES[accessor.componentType]).itemsize * _WIDTH[accessor.type]
    stride = document.bufferViews[accessor.bufferView or 0].byteStride
    return item, stride or item


def read_accessor(
    document: Document, binary: memoryview, index: int, *, kinds: tuple[str, ...]
) -> np.ndarray:
    """(count, width): whole numbers for SCALAR, otherwise float64, normalised integers as 0 to 1 or -1 to 1.

    `check_bounds` must have passed. Raises UnreadableMesh for another type than ``kinds``.
    """
    accessor, where = document.accessors[index], f"/accessors/{index}"
    if accessor.type not in kinds:
        raise UnreadableMesh(f"damaged GLB file: it is {accessor.type}, expected {' or '.join(kinds)}", where)
    if accessor.sparse is not None:
        raise UnreadableMesh("sparse accessors are not read: export without them", where)
    if accessor.bufferView is None:
        raise UnreadableMesh(
            "has no bufferView (compressed or empty data): export without compression", where
        )
    kind, width = np.dtype(_TYPES[accessor.componentType]), _WIDTH[accessor.type]
    view = document.bufferViews[accessor.bufferView]
    _, stride = _sizes(document, accessor)
    # NumPy checks the bounds once more.
    array = np.ndarray(
        (accessor.count, width),
        kind,
        buffer=binary,
        offset=view.byteOffset + accessor.byteOffset,
        strides=(stride, kind.itemsize),
    )
    if accessor.type == "SCALAR":
        return array
    if accessor.normalized and kind.kind in "iu":
        return np.maximum(array / np.float64(np.iinfo(kind.type).max), -1)
    return array.astype(np.float64)
