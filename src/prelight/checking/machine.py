"""What this machine is, and how fast it traces shadow rays and reads memory."""

from __future__ import annotations

import os
import platform
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numba import njit, prange, types

_PACKAGES = ("prelight", "mitsuba", "drjit", "numba", "numpy", "OpenEXR")


@njit(cache=True)
def _sum_of(values):
    total = 0
    for value in values:
        total += value
    return total


@njit([types.int64(types.Array(types.int64, 1, "C", readonly=True), types.int64)], parallel=True, cache=True)
def _sum(values, threads):
    total = 0
    for t in prange(threads):
        total += _sum_of(values[len(values) * t // threads : len(values) * (t + 1) // threads])
    return total


def machine() -> dict[str, Any]:
    """System, Python, processors, bytes of memory, and the numbers of the packages that figures depend on."""

    def number(name: str) -> str | None:
        try:
            return version(name)
        except PackageNotFoundError:
            return None

    return {
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": f"{platform.python_version()} at {sys.executable}",
        "processors": os.cpu_count(),
        "memory": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "packages": {name: number(name) for name in _PACKAGES},
    }


def llvm() -> dict[str, Any]:
    """The LLVM that tracing would use: its path and its version, None each where there is none."""
    from ..scene.variant import find_llvm

    library = find_llvm()
    return {
        "llvm_path": None if library is None else str(library.path),
        "llvm_version": None if library is None else library.version,
    }


def read_bandwidth(*, size: int = 512_000_000, repeats: int = 5) -> float:
    """Bytes a second that all threads read from memory, the best of some passes over ``size`` bytes."""
    import numba

    values = np.ones(size // 8, np.int64)
    best = np.inf
    for _ in range(repeats):
        started = time.perf_counter()
        _sum(values, numba.get_num_threads())
        best = min(best, time.perf_counter() - started)
    return size / best


def tracing_speed(*, directions: int = 64) -> tuple[float, str]:
    """Vertex-directions a second on the built-in sculpture, and the renderer's variant.

    Raises MissingExtraError if Mitsuba or its LLVM is missing.
    """
    from ..rays.mitsuba import Occluders
    from ..scene.stock.catalogue import stock_scene
    from ..scene.variant import mitsuba
    from ..transport.ordering import receiver_order
    from ..transport.visibility import Visibility

    variant = mitsuba().variant()
    scene = stock_scene("sculpture")
    order = receiver_order(scene.positions, scene.normals)
    occluders = Occluders(scene.positions, scene.triangles)
    visibility = Visibility(occluders, origins=scene.positions[order], normals=scene.normals[order])
    d = np.random.default_rng(0).normal(size=(directions, 3)).astype(np.float32)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    visibility.trace(d)
    started = time.perf_counter()
    visibility.trace(d)
    return directions * len(order) / (time.perf_counter() - started), variant
