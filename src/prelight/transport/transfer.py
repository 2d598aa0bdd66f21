"""Transfer vectors T_l of a set of receivers, whatever their material: what clustering walks over."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..arrays import Directions, Float32, Float64, Int32, UInt8

Samples = Int32[np.ndarray, "nodes samples"]  # indices into rows, −1 where a node has fewer
SampleDirections = Float32[np.ndarray, "nodes samples 3"]


class Transfer(Protocol):
    """T_l of receivers in storage order, kept as one *row* a light in a form of its own.

    With one channel T is irradiance / π for unit light, without albedo; with three it is radiance toward
    the eye, red, green and blue.
    """

    receivers: int
    channels: int  # 1 or 3
    row_bytes: int  # memory of one light's row

    def trace(self, directions: Directions, *, lanes: int) -> tuple[np.ndarray, Int32[np.ndarray, "lights"]]:
        """A row for each direction, and how many rays it took; at most ``lanes`` rays at a time."""
        ...

    def squared_distances(
        self, rows: np.ndarray, sample: Samples, d: SampleDirections
    ) -> Float64[np.ndarray, "nodes samples"]:
        """‖T_C − T_l‖² of every sample l of every node, T_C their mean, in the worst channel; 0 where unused."""
        ...

    def quantized_means(
        self, rows: np.ndarray, sample: Samples, d: SampleDirections, D_C: Float32[np.ndarray, "nodes 3"]
    ) -> tuple[UInt8[np.ndarray, "nodes channels receivers"], Float32[np.ndarray, "nodes channels"]]:
        """T_C of every node as bytes and a scale for each channel; D_C the nodes' mean directions."""
        ...

    def values(self, rows: np.ndarray, d: Directions) -> Float32[np.ndarray, "lights channels receivers"]:
        """T_l itself, of the lights in directions ``d`` whose rows these are."""
        ...


class DarkTransfer:
    """Receivers that no light reaches, such as pixels that show no surface: T_l = 0, and no rays."""

    row_bytes = 1

    def __init__(self, receivers: int, channels: int) -> None:
        self.receivers, self.channels = receivers, channels

    def trace(self, directions: Directions, *, lanes: int) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((len(directions), 1), np.uint8), np.zeros(len(directions), np.int32)

    def squared_distances(self, rows: np.ndarray, sample: Samples, d: SampleDirections) -> np.ndarray:
        return np.zeros(sample.shape)

    def quantized_means(
        self, rows: np.ndarray, sample: Samples, d: SampleDirections, D_C: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        columns = np.zeros((len(sample), self.channels, self.receivers), np.uint8)
        return columns, np.zeros((len(sample), self.channels), np.float32)

    def values(self, rows: np.ndarray, d: Directions) -> np.ndarray:
        return np.zeros((len(d), self.channels, self.receivers), np.float32)
