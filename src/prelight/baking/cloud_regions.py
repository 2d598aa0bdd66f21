"""A cloud's surfaces in boxes: zones, in which lights and vertices are clustered; regions, which have modes."""

from __future__ import annotations

import numpy as np

from ..arrays import Int32, Positions

MODES_A_REGION = 64  # in the mean
_MODES_A_CELL = 8


def zones_of(positions: Positions, most: int) -> list[Int32[np.ndarray, "some"]]:
    """Vertices in boxes of at most so many, split across their longest side; each ascending."""
    done, todo = [], [np.arange(len(positions), dtype=np.int32)]
    while todo:
        part = todo.pop()
        if len(part) <= most:
            done.append(part)
            continue
        across = positions[part, int(np.ptp(positions[part], axis=0).argmax())]
        order = np.argsort(across, kind="stable")
        half = len(part) // 2
        todo += [np.sort(part[order[half:]]), np.sort(part[order[:half]])]
    return done


def regions_of(positions: Positions, modes: int) -> list[Int32[np.ndarray, "some"]]:
    """Vertices that modes are learnt for together, in the order of the zones: each holds some, or lies in one."""
    count = max(1, modes // MODES_A_REGION)
    return zones_of(positions, -(-len(positions) // count))


def cells_of(positions: Positions, modes: int) -> list[Int32[np.ndarray, "some"]]:
    """Vertices whose mean light modes have to know: boxes within regions, one for every eight modes."""
    return zones_of(positions, -(-len(positions) // max(1, modes // _MODES_A_CELL)))


def modes_there(
    mode_region: Int32[np.ndarray, "modes"], region_of: Int32[np.ndarray, "vertices"], vertices: np.ndarray
) -> slice:
    """Modes of the regions that some vertices of one zone are in: they follow each other."""
    found = np.flatnonzero(np.isin(mode_region, np.unique(region_of[vertices])))
    return slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, 0)
