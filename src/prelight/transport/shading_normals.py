"""What a shading normal that is not the triangle's own does to light that is traced from the lamp."""

from __future__ import annotations

from typing import Any


def for_smoothed(si: Any, wo: Any, direction: Any) -> Any:
    """What light going this way is to be multiplied with where the normal is not the triangle's (Veach, 1997)."""
    import drjit as dr

    above = si.wi.z * dr.dot(direction, si.n)
    below = wo.z * dr.dot(si.to_world(si.wi), si.n)
    return dr.select(below != 0, dr.abs(above / below), 0)
