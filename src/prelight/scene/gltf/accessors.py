"""Numbers in the buffers of a glTF file: bounds first, then arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh import UnreadableMesh
from .buffers import Bytes
from .document import Accessor, Document, Sparse, SparseIndices, SparseValues

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_MOST_ZEROS = 1_000_000  # entries that no data stands behind


def check_bounds(document: Document) -> None:
    """Every view inside its buffer, every accessor and what replaces parts of it inside their views."""
    for k, view in enumerate(document.bufferViews):
        if view.buffer >= len(document.buffers):
            raise UnreadableMesh(f"damaged glTF file: there is no buffer {view.buffer}", f"/bufferViews/{k}")
        if view.byteOffset + view.byteLength > document.buffers[view.buffer].byteLength:
            raise UnreadableMesh("damaged glTF file: it ends outside its buffer", f"/bufferViews/{k}")
    for k, accessor in enumerate(document.accessors):
        where, item = f"/accessors/{k}", _item_size(accessor)
        if accessor.bufferView is not None:
            _check_view(document, accessor.bufferView, where)
            stride = document.bufferViews[accessor.bufferView].byteStride or item
            if stride < item:
                reason = f"entries of {item} bytes, the next after {stride}"
                raise UnreadableMesh(f"damaged glTF file: {reason}", where)
            end = accessor.byteOffset + stride * (accessor.count - 1) + item
            _check_end(document, accessor.bufferView, end, where)
        if (sparse := accessor.sparse) is not None:
            if sparse.count > accessor.count:
                reason = f"{sparse.count:,} entries replaced of {accessor.count:,}"
                raise UnreadableMesh(f"damaged glTF file: {reason}", f"{where}/sparse")
            index = np.dtype(_TYPES[sparse.indices.componentType]).itemsize
            for part, size, name in ((sparse.indices, index, "indices"), (sparse.values, item, "values")):
                _check_view(document, part.bufferView, f"{where}/sparse/{name}")
                end = part.byteOffset + sparse.count * size
                _check_end(document, part.bufferView, end, f"{where}/sparse/{name}")


def _item_size(accessor: Accessor) -> int:
    """Bytes of one entry."""
    return np.dtype(_TYPES[accessor.componentType]).itemsize * _WIDTH[accessor.type]


def _check_view(document: Document, view: int, where: str) -> None:
    if view >= len(document.bufferViews):
        raise UnreadableMesh(f"damaged glTF file: there is no bufferView {view}", where)


def _check_end(document: Document, view: int, end: int, where: str) -> None:
    if end > document.bufferViews[view].byteLength:
        raise UnreadableMesh("damaged glTF file: it ends outside its bufferView", where)


@dataclass(frozen=True)
class Numbers:
    """The accessors of a document whose bounds were checked."""

    document: Document
    bytes_: Bytes

    def read(self, index: int, *kinds: str) -> np.ndarray:
        """(count, width): whole numbers for SCALAR, else float64, normalised integers as 0 to 1 or -1 to 1.

        Raises UnreadableMesh for another type than ``kinds`` ("VEC3", ...), or no data.
        """
        accessor, where = self.document.accessors[index], f"/accessors/{index}"
        if accessor.type not in kinds:
            reason = f"it is {accessor.type}, expected {' or '.join(kinds)}"
            raise UnreadableMesh(f"damaged glTF file: {reason}", where)
        array = self._base(accessor, where)
        if accessor.sparse is not None:
            array = self._replaced(accessor.sparse, array, where)
        if accessor.type == "SCALAR":
            return array
        if accessor.normalized and array.dtype.kind in "iu":
            return np.maximum(array / np.float64(np.iinfo(array.dtype).max), -1)
        return array.astype(np.float64)

    def _base(self, accessor: Accessor, where: str) -> np.ndarray:
        """The entries of its bufferView, read where they lie; zeros where it has none."""
        kind, width = np.dtype(_TYPES[accessor.componentType]), _WIDTH[accessor.type]
        if accessor.bufferView is not None:
            view = self.document.bufferViews[accessor.bufferView]
            # NumPy checks the bounds once more.
            return np.ndarray(
                (accessor.count, width),
                kind,
                buffer=self.bytes_.view(accessor.bufferView),
                offset=accessor.byteOffset,
                strides=(view.byteStride or kind.itemsize * width, kind.itemsize),
            )
        if accessor.sparse is None:
            reason = "has no bufferView (compressed or empty data): export without compression"
            raise UnreadableMesh(reason, where)
        if accessor.count > _MOST_ZEROS:
            reason = f"{accessor.count:,} entries with data for {accessor.sparse.count:,}"
            raise UnreadableMesh(f"{reason}: export without sparse accessors", where)
        return np.zeros((accessor.count, width), kind)

    def _replaced(self, sparse: Sparse, array: np.ndarray, where: str) -> np.ndarray:
        """A copy with the entries that ``sparse`` gives."""
        rows = self._packed(sparse.indices, np.dtype(_TYPES[sparse.indices.componentType]), sparse.count)
        if (largest := int(rows.max())) >= len(array):
            reason = f"index {largest:,} into {len(array):,} entries"
            raise UnreadableMesh(f"damaged glTF file: {reason}", f"{where}/sparse/indices")
        array = array.copy()
        width = array.shape[1]
        array[rows] = self._packed(sparse.values, array.dtype, sparse.count * width).reshape(-1, width)
        return array

    def _packed(self, part: SparseIndices | SparseValues, kind: np.dtype, count: int) -> np.ndarray:
        return np.frombuffer(self.bytes_.view(part.bufferView), kind, count, part.byteOffset)
