"""One byte an element, zeros not stored: tiles of 16 clusters × 32 receivers (paper, section 6).

256 consecutive clusters make a *panel*. For each *group* of 32 receivers a panel keeps up to sixteen
tiles, one for each 16 of its clusters, and a word whose bit s says that tile s is there; a tile of
zeros is left out. Inside a tile the 32 receivers of one cluster are contiguous, so that a full relight
keeps its sums in registers and a local one reads only the clusters that changed. Where transfer has three
channels, a panel has the groups of red, then those of green, then those of blue.

As many whole panels as make about four megabytes are a *parcel*, one array on disk.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike

from ..arrays import UInt8, UInt16

GROUP = 32  # receivers of a tile
TILE = 16  # clusters of a tile
PANEL = 256  # clusters of a panel
TILES = PANEL // TILE  # of a group in a panel: the bits of a uint16
_PARCEL_BYTES = 4 << 20  # before zeros are left out


def groups_of(receivers: int) -> int:
    """Groups of 32 receivers, the last one filled up."""
    return -(-receivers // GROUP)


def panels_of_parcel(groups: ArrayLike, channels: ArrayLike) -> np.ndarray:
    """Panels in each parcel of a zone, but for its last one; of many zones at once."""
    return np.maximum(1, _PARCEL_BYTES // (PANEL * GROUP * np.asarray(groups, np.int64) * channels))


@njit(cache=True)
def _group_present(columns, g):
    bits = 0
    for s in range(TILES):
        found = 0
        for k in range(s * TILE, (s + 1) * TILE):
            for i in range(g * GROUP, (g + 1) * GROUP):
                found |= columns[k, i]
        if found:
            bits |= 1 << s
    return bits


@njit(["void(uint8[:,::1], uint16[::1])"], parallel=True, cache=True)
def _mark_tiles(columns, present):
    """For each group of receivers, a bit for each tile that is not all zero."""
    for g in prange(len(present)):
        present[g] = _group_present(columns, g)


@njit(cache=True)
def _copy_group(columns, g, bits, t, tiles):
    for s in range(TILES):
        if (bits >> s) & 1:
            for k in range(TILE):
                for i in range(GROUP):
                    tiles[t, k, i] = columns[s * TILE + k, g * GROUP + i]
            t += 1


@njit(["void(uint8[:,::1], uint16[::1], int64[::1], uint8[:,:,::1])"], parallel=True, cache=True)
def _gather_tiles(columns, present, first, tiles):
    """Copy the tiles that are present, group after group, into ``tiles`` (T, 16 clusters, 32 receivers)."""
    for g in prange(len(present)):
        _copy_group(columns, g, present[g], first[g], tiles)


def first_tiles(present: UInt16[np.ndarray, "... groups"]) -> np.ndarray:
    """Index, inside its panel, of the first tile of each group; int64, same shape."""
    counts = np.bitwise_count(present).astype(np.int64)
    return np.cumsum(counts, axis=-1) - counts


def encode_panel(
    columns: UInt8[np.ndarray, "clusters *channels receivers"],
) -> tuple[UInt8[np.ndarray, "tiles 16 32"], UInt16[np.ndarray, "groups"]]:
    """Tiles and presence bits of up to 256 quantised transfer vectors, receivers in storage order.

    (clusters, receivers), or (clusters, channels, receivers): then the groups of each channel in turn.
    """
    columns = columns if columns.ndim == 3 else columns[:, None]
    clusters, channels, receivers = columns.shape
    padded = np.zeros((PANEL, channels, groups_of(receivers) * GROUP), np.uint8)
    padded[:clusters, :, :receivers] = columns
    padded = padded.reshape(PANEL, -1)
    present = np.empty(padded.shape[1] // GROUP, np.uint16)
    _mark_tiles(padded, present)
    tiles = np.empty((int(np.bitwise_count(present).sum()), TILE, GROUP), np.uint8)
    _gather_tiles(padded, present, first_tiles(present), tiles)
    return tiles, present


def decode_panel(
    tiles: UInt8[np.ndarray, "tiles 16 32"], present: UInt16[np.ndarray, "groups"]
) -> UInt8[np.ndarray, "256 receivers"]:
    """The inverse of ``encode_panel``, plainly: the yardstick for every kernel that reads tiles.

    Of three channels each follows the other's last, filled up, group.
    """
    columns = np.zeros((PANEL, len(present) * GROUP), np.uint8)
    tile = iter(tiles)
    for g, bits in enumerate(present):
        for s in range(TILES):
            if (bits >> s) & 1:
                columns[s * TILE : (s + 1) * TILE, g * GROUP : (g + 1) * GROUP] = next(tile)
    return columns
