"""How much of what modes bring in a zone can be believed.

A lamp's light far from it, around corners, is little; there modes, each spread over the whole scene, nearly cancel, and
what does not is the part of the lamp that no mode has. How much that is, the faintest modes tell: what they bring is
like what those beyond them would have. So modes count in a zone as a signal counts in noise (Wiener 1949).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Float64
from .stored_cloud import CloudLayer

_FAINT = 4  # one of so many modes tells of those beyond
_NOISE = 2.0  # times what the faint ones bring: what may be missing


class ModesInZones:
    """Products of the modes in every zone, from the components that are kept of them."""

    def __init__(self, layer: CloudLayer) -> None:
        K, zones = layer.extras, len(layer.zone_rows)
        self._products = np.zeros((zones, K, K), np.float32)
        starts = np.append(0, layer.first_extra[:-1] + K)
        assert layer.areas is not None
        for place in layer.places:
            zone = int(np.searchsorted(starts, place[2], side="right")) - 1
            first, rows, _, width, n = place[:5]
            basis = layer.bases[place[5] : place[5] + (n + 1) * width].reshape(n + 1, width)[:, -K:]
            areas = layer.areas[layer.order[first : first + rows]]
            products = np.zeros((n + 1, n + 1), np.float32)
            for channel in place[4:].reshape(-1, 4):
                codes = layer.codes[channel[2] : channel[2] + n * rows].reshape(n, rows)
                z = np.concatenate(
                    [np.ones((1, rows), np.float32), codes * layer.scales[channel[3] : channel[3] + n, None]]
                )
                products += (z * areas) @ z.T
            self._products[zone] += basis.T @ products @ basis
        faint = max(1, K // _FAINT)
        self._faint = np.ascontiguousarray(np.diagonal(self._products, axis1=1, axis2=2)[:, K - faint :])

    def believed(self, left: Float64[np.ndarray, "modes"]) -> Float32[np.ndarray, "zones modes"]:
        """So much of each mode, zone by zone, of what no lights bring."""
        c = left.astype(np.float32)
        squares = np.einsum("zk,k->z", self._products @ c, c)
        noise = _NOISE * (self._faint @ np.square(c[len(c) - self._faint.shape[1] :]))
        share = np.divide(squares - noise, squares, out=np.zeros_like(squares), where=squares > noise)
        return share[:, None] * c
