"""Unit directions in two numbers of 16 bits: the sphere unfolded over an octahedron, 0.002° at worst near enough."""

from __future__ import annotations

import numpy as np

from ..arrays import Float64, UInt16

_STEPS = 65535


def encoded_directions(directions: np.ndarray) -> UInt16[np.ndarray, "directions 2"]:
    """Unit directions (n, 3), rounded to the nearest code."""
    d = np.asarray(directions, np.float64)
    flat = d[:, :2] / np.abs(d).sum(axis=1, keepdims=True)
    below = d[:, 2] < 0
    flat[below] = (1 - np.abs(flat[below][:, ::-1])) * np.where(flat[below] >= 0, 1.0, -1.0)
    return np.rint((np.clip(flat, -1, 1) + 1) * (_STEPS / 2)).astype(np.uint16)


def decoded_directions(codes: UInt16[np.ndarray, "directions 2"]) -> Float64[np.ndarray, "directions 3"]:
    """Unit directions (n, 3); any two numbers are one."""
    flat = codes * (2 / _STEPS) - 1
    z = 1 - np.abs(flat).sum(axis=1)
    below = z < 0
    flat[below] = (1 - np.abs(flat[below][:, ::-1])) * np.where(flat[below] >= 0, 1.0, -1.0)
    d = np.column_stack([flat, z])
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def encoded_places(coordinates: np.ndarray, marked: np.ndarray) -> UInt16[np.ndarray, "n 2"]:
    """Coordinates 0 to 1 on a panel, in steps of 1/32767, twice; the first is odd where it is ``marked`` (n,)."""
    found = 2 * np.rint(np.clip(coordinates, 0.0, 1.0) * 32767.0).astype(np.uint16)
    found[:, 0] += marked.astype(np.uint16)
    return found


def decoded_places(
    places: UInt16[np.ndarray, "n 2"],
) -> tuple[Float64[np.ndarray, "n 2"], np.ndarray]:
    """The other way, and which are marked, (n,) bool."""
    return (places >> 1) / 32767.0, (places[:, 0] & 1).astype(bool)
