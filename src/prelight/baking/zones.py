"""Zones: receivers near each other and of one kind, with a cut of the light tree of their own.

Eq. 11 is a mean over receivers, and the paper names what that costs: a few glossy receivers among many
diffuse ones hardly count, and are wrong. In a zone they are among themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Int32, Normals, Positions
from ..encoding.sparse_tiles import GROUP, groups_of
from ..material import Material
from ..transport.ordering import receiver_order

DIFFUSE, VIEWED, DARK = "diffuse", "viewed", "dark"  # one channel; three toward an eye; nothing arrives
_ROUGHNESS_CLASSES = 4


@dataclass(frozen=True)
class Zone:
    """Rows of a layer that share clusters."""

    rows: Int32[np.ndarray, "receivers"]  # of the layer, in storage order
    kind: str  # DIFFUSE, VIEWED or DARK
    channels: int  # 1 or 3

    @property
    def groups(self) -> int:
        """Groups of 32 receivers for each channel, the last one filled up."""
        return groups_of(len(self.rows))

    def stored_rows(self) -> Int32[np.ndarray, "32·groups"]:
        """Rows filled up with −1 to whole groups."""
        filled = np.full(self.groups * GROUP, -1, np.int32)
        filled[: len(self.rows)] = self.rows
        return filled


def sort_of(material: Material) -> int:
    """0 for Lambertian; others by how sharply they reflect: 1 like a mirror, 4 nearly diffuse; metals from 5."""
    if material.is_lambertian:
        return 0
    roughness, metallic = material.roughness, material.metallic
    if material.bsdf is not None:
        found = _numbers_named(material.bsdf, ("roughness", "alpha"))
        roughness = float(np.sqrt(found["alpha"])) if "alpha" in found else found.get("roughness", 0.0)
        metallic = float("conductor" in str(material.bsdf))
    sharpness = min(int(max(roughness, 0.0) * _ROUGHNESS_CLASSES), _ROUGHNESS_CLASSES - 1)
    return 1 + sharpness + _ROUGHNESS_CLASSES * (metallic > 0.5)


def _numbers_named(table, names: tuple[str, ...]) -> dict[str, float]:
    """The least number of each name anywhere in nested tables."""
    found: dict[str, float] = {}
    open_ = [table]
    while open_:
        for name, value in open_.pop().items():
            if hasattr(value, "items"):
                open_.append(value)
            elif name in names and isinstance(value, int | float):
                found[name] = min(abs(float(value)), found.get(name, np.inf))
    return found


def divide(
    positions: Positions,
    normals: Normals,
    sorts: Int32[np.ndarray, "receivers"],
    *,
    zones: int,
) -> list[Int32[np.ndarray, "some"]]:
    """Receivers of each sort in about ``zones`` parts of like size in all, each in storage order.

    A part is halved across its longest side, at the median; sizes are multiples of 32 but for the last of
    a sort. Parts of sort after sort, ascending; the same whatever else is going on.
    """
    parts: list[np.ndarray] = []
    for sort in np.unique(sorts):
        rows = np.flatnonzero(sorts == sort).astype(np.int32)
        share = max(1, min(round(zones * len(rows) / len(sorts)), groups_of(len(rows))))
        parts += _halved(rows, share, positions)
    return [part[receiver_order(positions[part], normals[part])] for part in parts]


def _halved(rows: np.ndarray, parts: int, positions: Positions) -> list[np.ndarray]:
    """``parts`` parts of ``rows``; every one has at least a receiver if there are groups enough."""
    if parts == 1:
        return [rows]
    first = parts // 2
    groups = groups_of(len(rows))
    cut = GROUP * min(max(first, round(groups * first / parts)), groups - (parts - first))
    axis = int(np.ptp(positions[rows], axis=0).argmax())
    along = rows[np.argsort(positions[rows, axis], kind="stable")]
    return _halved(along[:cut], first, positions) + _halved(along[cut:], parts - first, positions)
