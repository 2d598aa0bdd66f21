"""Relighting steerable layers: weights of the new aim, place and colour, then one sum over byte planes.

Lights of one layer are added as coefficients first, so that ten spots at one place cost as much as one.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numba
import numpy as np

from ..arrays import Float32, Radiance
from ..encoding.byte_planes import BLOCK
from ..errors import InputError
from ..lighting.panel import Panel
from ..lighting.spot import Spot
from .plane_kernels import sum_planes
from .steerable_layer import SteerableLayer

_LARGEST_COPY = 256_000_000  # bytes
NEGLIGIBLE = 1e-4  # of the picture: planes that together bring less are skipped


@dataclass(frozen=True)
class Refinement:
    """A picture that grows.

    ``radiance`` (pixels, 3) so far; ``planes`` of ``whole`` are in it. ``error``: what is missing is at most this on
    average over the pixels and channels, as an absolute value.
    """

    radiance: Radiance
    planes: int
    whole: int
    error: float


@dataclass(frozen=True)
class SteerableUpdate:
    """What the last change took: planes of all that there are, skipped ones' largest mean error, time and bytes."""

    planes: int
    whole: int
    error: float
    milliseconds: float
    bytes_read: int


@dataclass(frozen=True)
class _Queue:
    """Planes of all layers in the order in which they matter."""

    layer: np.ndarray  # (planes,) which layer
    plane: np.ndarray  # (planes,) which of its planes
    left: np.ndarray  # (planes + 1,) mean absolute value of all from here on, at most


class SteerableRelighter:
    """Lights with places, aims and shapes, and the picture that follows.

    What follows depends on the lights alone, not on those before.

    Parameters
    ----------
    layers
        At least one; all of one picture's size, with different names.

    Raises
    ------
    InputError
        Otherwise.
    """

    def __init__(self, layers: Sequence[SteerableLayer]) -> None:
        if not layers:
            raise InputError("layers", "none given; this bake has no steerable layer")
        if len({layer.size for layer in layers}) > 1:
            raise InputError("layers", "are pictures of different sizes; relight them one by one")
        self.layers = {layer.name: layer for layer in layers}
        if len(self.layers) < len(layers):
            raise InputError("layers", "two have the same name")
        blocks = layers[0].planes.bytes.shape[0]
        threads = numba.get_num_threads()
        self._shares = np.linspace(0, blocks, threads + 1).astype(np.int64)
        self._weights = {
            name: np.zeros((3, layer.components), np.float32) for name, layer in self.layers.items()
        }
        self._radiance = np.zeros((layers[0].planes.pixels, 3), np.float32)
        self._together = _Together.of(layers) if len(layers) > 1 else None
        self._known: dict[tuple[str, Spot | Panel], np.ndarray] = {}
        self.last = SteerableUpdate(0, self._whole, 0.0, 0.0, 0)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the picture."""
        return next(iter(self.layers.values())).size

    @property
    def radiance(self) -> Radiance:
        """Linear radiance (pixels, 3), row by row from the top; a copy."""
        return self._radiance.copy()

    @property
    def _whole(self) -> int:
        return sum(layer.planes.planes for layer in self.layers.values())

    def layer_of(self, light: Spot | Panel) -> SteerableLayer:
        """The layer that a light names, or the only one. Raises InputError if it is not there or not clear."""
        if light.layer is None and len(self.layers) == 1:
            return next(iter(self.layers.values()))
        if light.layer not in self.layers:
            given = (
                "no layer is named" if light.layer is None else f"{light.layer[:60]!r} is not in this bake"
            )
            raise InputError("layer", f"{given}; it has {', '.join(self.layers)[:120]}")
        return self.layers[light.layer]

    def notes(self, lights: Sequence[Spot | Panel]) -> list[str]:
        """Where what is asked for is only approximated, one line each."""
        found = []
        for n, light in enumerate(lights):
            layer = self.layer_of(light)
            found += [
                f"light {n + 1}, layer {layer.name}: {note}" for note in light.notes(layer.basis, layer.place)
            ]
        return found

    def light(self, lights: Sequence[Spot | Panel], *, negligible: float = NEGLIGIBLE) -> SteerableUpdate:
        """Light the scene with these and nothing else; ``negligible`` 0 takes every plane.

        Raises InputError for a light that no layer has.
        """
        began = time.perf_counter()
        self._set(lights)
        queue = self._queue()
        taken = self._needed(queue, negligible)
        read = self._begin(queue, taken, self._radiance)
        milliseconds = 1e3 * (time.perf_counter() - began)
        self.last = SteerableUpdate(taken, self._whole, float(queue.left[taken]), milliseconds, read)
        return self.last

    def refine(
        self, lights: Sequence[Spot | Panel], *, step: int = 4, error: float = 0.0
    ) -> Iterator[Refinement]:
        """Pictures of these lights that grow by ``step`` planes, those first that matter most (weight × salience).

        Stops where what is missing is at most ``error``, as a mean absolute value. Each picture is a copy; the last
        becomes ``radiance``.
        """
        if step < 1:
            raise InputError("step", f"{step}, expected at least 1")
        self._set(lights)
        queue = self._queue()
        picture = np.empty_like(self._radiance)
        whole = int(np.argmax(queue.left <= error)) if error > 0.0 else len(queue.plane)
        done = min(step, whole)
        self._begin(queue, done, picture)
        while True:
            yield Refinement(picture.copy(), done, self._whole, float(queue.left[done]))
            if done >= whole:
                break
            following = min(done + step, whole)
            self._add(queue, slice(done, following), picture, begun=True)
            done = following
        self._radiance = picture

    def _set(self, lights: Sequence[Spot | Panel]) -> None:
        sums = {name: np.zeros((layer.basis.functions, 3)) for name, layer in self.layers.items()}
        known: dict[tuple[str, Spot | Panel], np.ndarray] = {}
        for light in lights:
            layer = self.layer_of(light)
            own = (layer.name, light)
            if (coefficients := self._known.get(own)) is None:  # as most lights are while one is dragged
                coefficients = light.coefficients(layer.basis, layer.place)
            known[own] = coefficients
            sums[layer.name] += coefficients
        self._known = known
        for name, layer in self.layers.items():
            self._weights[name] = layer.weights(sums[name])

    def _queue(self) -> _Queue:
        importance, layers, planes = [], [], []
        for n, (name, layer) in enumerate(self.layers.items()):
            weight = np.abs(self._weights[name].T[layer.planes.image_of].astype(np.float64))
            importance.append((weight * layer.planes.salience).mean(axis=1))
            layers.append(np.full(layer.planes.planes, n))
            planes.append(np.arange(layer.planes.planes))
        every = np.concatenate(importance)
        order = np.argsort(-every, kind="stable")
        left = np.append(np.cumsum(every[order][::-1])[::-1], 0.0)
        return _Queue(np.concatenate(layers)[order], np.concatenate(planes)[order].astype(np.int32), left)

    @staticmethod
    def _needed(queue: _Queue, negligible: float) -> int:
        """How many planes, so that those left out bring at most that share."""
        if queue.left[0] == 0.0:
            return 0
        return int(np.argmax(queue.left <= negligible * queue.left[0]))

    def _begin(self, queue: _Queue, planes: int, picture: Float32[np.ndarray, "pixels 3"]) -> int:
        """Write a picture of the queue's first planes and the pixels kept apart; the bytes that were read."""
        read = self._add(queue, slice(0, planes), picture, begun=False)
        for name, layer in self.layers.items():
            layer.planes.add_bright(self._weights[name], picture)
        return read

    def _add(
        self, queue: _Queue, part: slice, picture: Float32[np.ndarray, "pixels 3"], *, begun: bool
    ) -> int:
        """Add planes of the queue to a picture, which is nothing yet unless ``begun``; the bytes that were read."""
        read = 0
        for data, scales, index, weights in self._chosen(queue, part):
            sum_planes(data, scales, index, weights, picture, self._shares, begun)
            begun = True
            read += len(index) * len(data) * 3 * (BLOCK + 4)
        if not begun:
            picture[:] = 0.0
        return read

    def _chosen(
        self, queue: _Queue, part: slice
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Bytes, scales, which planes of them and their weights, of each sum that there is to be."""
        layer, plane = queue.layer[part], queue.plane[part]
        if self._together is not None and len(plane):
            yield self._together.chosen(layer, plane, self._weights)
        elif self._together is None:
            for n, (name, one) in enumerate(self.layers.items()):
                index = np.sort(plane[layer == n])
                if len(index):
                    weights = self._weights[name][:, one.planes.image_of[index]]
                    yield one.planes.bytes, one.planes.scales, index, np.ascontiguousarray(weights)


@dataclass(frozen=True, eq=False)
class _Together:
    """Planes of several layers side by side, so that many lamps are one sum: each alone would wait for all threads."""

    bytes: np.ndarray
    scales: np.ndarray
    image_of: np.ndarray  # (planes,) among the components of all layers
    firsts: np.ndarray  # (layers,) plane at which each begins

    @classmethod
    def of(cls, layers: Sequence[SteerableLayer]) -> _Together | None:
        """A copy of all; None where it were large."""
        if sum(layer.planes.bytes.nbytes for layer in layers) > _LARGEST_COPY:
            return None
        begins = np.cumsum([0, *(layer.components for layer in layers)])
        return cls(
            np.concatenate([layer.planes.bytes for layer in layers], axis=2),
            np.concatenate([layer.planes.scales for layer in layers], axis=2),
            np.concatenate([layer.planes.image_of + b for layer, b in zip(layers, begins, strict=False)]),
            np.cumsum([0, *(layer.planes.planes for layer in layers)])[:-1],
        )

    def chosen(
        self, layer: np.ndarray, plane: np.ndarray, weights: dict[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Bytes, scales, which planes of them and their weights (3, planes), of some planes of each layer."""
        index = np.sort(self.firsts[layer] + plane).astype(np.int32)
        every = np.concatenate(list(weights.values()), axis=1)
        return self.bytes, self.scales, index, np.ascontiguousarray(every[:, self.image_of[index]])
