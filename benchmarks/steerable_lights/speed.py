"""How fast pictures are relit from byte planes, beside a dense product and the bare memory of the machine."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numba
import numpy as np

from prelight.bases.steering import SpotBasis
from prelight.checking.machine import read_bandwidth
from prelight.encoding.byte_planes import encoded
from prelight.lighting.places import Place
from prelight.lighting.spot import Spot
from prelight.relighting.plane_kernels import add_planes
from prelight.relighting.steerable import SteerableRelighter
from prelight.relighting.steerable_layer import SteerableLayer

SIZE, COMPONENTS, COPIES, ROUNDS = (512, 512), 20, 8, 9


def _timed(work: Callable[[int], object]) -> float:
    """Seconds of one of ``COPIES`` runs, each on its own memory, so that no cache still has it."""
    started = time.perf_counter()
    for copy in range(COPIES):
        work(copy)
    return (time.perf_counter() - started) / COPIES


def relighting() -> dict:
    """512×512, RGB, 20 components: pictures a second, share of the read bandwidth, and a dense product beside it."""
    rng = np.random.default_rng(1)
    pixels = SIZE[0] * SIZE[1]
    images = rng.standard_normal((COMPONENTS, pixels, 3), np.float32)
    planes = encoded(images)
    basis = SpotBasis(5)
    mixing = rng.standard_normal((COMPONENTS, basis.functions))
    layer = SteerableLayer("key", basis, Place("spot"), SIZE, planes, mixing)
    relighter = SteerableRelighter([layer])
    aims = rng.standard_normal((ROUNDS * COPIES + 1, 3))
    relighter.light([Spot((3.0, 2.0, 1.0), direction=tuple(aims[0]))], negligible=0.0)

    copies = [(planes.bytes.copy(), planes.scales.copy()) for _ in range(COPIES)]
    dense = np.ascontiguousarray(images.transpose(0, 2, 1)).reshape(COMPONENTS, 3, pixels)
    dense_copies = [dense.copy() for _ in range(2)]
    index, picture = np.arange(COMPONENTS, dtype=np.int32), np.zeros((pixels, 3), np.float32)
    weights = rng.standard_normal((3, COMPONENTS)).astype(np.float32)
    shares = np.linspace(0, len(planes.bytes), numba.get_num_threads() + 1).astype(np.int64)
    out = np.empty((3, pixels), np.float32)

    def ours(copy: int) -> None:
        add_planes(*copies[copy], index, weights, picture, shares)

    def product(copy: int) -> None:
        for c in range(3):
            np.matmul(weights[c], dense_copies[copy % 2][:, c], out=out[c])

    whole, kernel, theirs, bandwidth = [], [], [], []
    for n in range(ROUNDS):  # one after the other, so that a busy moment meets all alike
        spots = [[Spot((3.0, 2.0, 1.0), direction=tuple(a))] for a in aims[n * COPIES : (n + 1) * COPIES]]
        whole.append(_timed(lambda copy, spots=spots: relighter.light(spots[copy], negligible=0.0)))
        kernel.append(_timed(ours))
        theirs.append(_timed(product))
        bandwidth.append(read_bandwidth(size=256_000_000, repeats=2))
    read = planes.bytes.nbytes + planes.scales.nbytes
    return {
        "components": COMPONENTS,
        "size": list(SIZE),
        "threads": numba.get_num_threads(),
        "bytes_read": read,
        "pictures_per_second": 1.0 / statistics.median(whole),
        "milliseconds_of_a_picture": 1e3 * statistics.median(whole),
        "milliseconds_of_the_sum_from_memory": 1e3 * statistics.median(kernel),
        "milliseconds_of_a_dense_float32_product": 1e3 * statistics.median(theirs),
        "dense_over_ours": statistics.median(t / k for t, k in zip(theirs, kernel, strict=True)),
        "read_bandwidth": statistics.median(bandwidth),
        "share_of_read_bandwidth": statistics.median(
            read / k / b for k, b in zip(kernel, bandwidth, strict=True)
        ),
    }
