"""How fast pictures are relit from byte planes, beside a dense product and a pass that only reads the same bytes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numba
import numpy as np
from numba import njit, prange

from prelight.bases.steering import SpotBasis
from prelight.checking.machine import read_bandwidth
from prelight.encoding.byte_planes import encoded
from prelight.encoding.principal_components import LOSS_DB, Components, to_bytes
from prelight.lighting.places import Place
from prelight.lighting.spot import Spot
from prelight.relighting.plane_kernels import sum_planes
from prelight.relighting.steerable import SteerableRelighter
from prelight.relighting.steerable_layer import SteerableLayer
from prelight.relighting.vector_code import prefetch

SIZE, COMPONENTS, COPIES, ROUNDS = (512, 512), 20, 8, 160
REST = (
    0.2  # seconds after a product by BLAS, whose threads wait busily and would be measured with what follows
)
_AHEAD = 10_000  # bytes


@njit(cache=True)
def _read(values, begin, end):
    """A sum that a processor makes as fast as memory brings it: eight at a time, asked for well ahead."""
    total = 0
    at = values.ctypes.data
    for line in range(begin, end):
        prefetch(at + 64 * line + _AHEAD)
        for k in range(8):
            total += values[8 * line + k]
    return total


@njit(parallel=True, cache=True)
def _read_all(values, threads):
    total, lines = 0, len(values) // 8
    for t in prange(threads):
        total += _read(values, lines * t // threads, lines * (t + 1) // threads)
    return total


@njit(cache=True)
def _plain(values, begin, end):
    total = 0
    for value in values[begin:end]:
        total += value
    return total


@njit(parallel=True, cache=True)
def _plain_all(values, threads):
    total, n = 0, len(values)
    for t in prange(threads):
        total += _plain(values, n * t // threads, n * (t + 1) // threads)
    return total


def _interleaved(
    work: dict[str, Callable[[int], object]], rounds: int, *, rest: float = 0.0, at_once: int = 1
) -> dict[str, dict]:
    """Milliseconds of each, in turn, so that a busy moment meets all alike: median and tenths.

    ``at_once``: so many of each, after a rest of seconds; of several the first, which wakes threads, does not count.

    Of one thread the processor's time, which a busy machine hardly disturbs.
    """
    clock = time.thread_time if numba.get_num_threads() == 1 else time.perf_counter
    taken: dict[str, list[float]] = {name: [] for name in work}
    for one in work.values():
        one(0)
    for n in range(rounds):
        for name, one in work.items():
            for again in range(at_once):
                started = clock()
                one(n * at_once + again)
                if again or at_once == 1:
                    taken[name].append(1e3 * (clock() - started))
            time.sleep(rest)
    return {
        name: {
            "median": statistics.median(each), "tenth": float(np.percentile(each, 10)),
            "nine_tenths": float(np.percentile(each, 90)),
        }
        for name, each in taken.items()
    }  # fmt: skip


def relighting() -> dict:
    """512×512, RGB, 20 components: pictures a second, share of the read bandwidth, and a dense product beside it."""
    rng = np.random.default_rng(1)
    pixels = SIZE[0] * SIZE[1]
    images = rng.standard_normal((COMPONENTS, pixels, 3), np.float32)
    planes = encoded(images)
    basis = SpotBasis(5)
    layer = SteerableLayer(
        "key", basis, Place("spot"), SIZE, planes, rng.standard_normal((COMPONENTS, basis.functions))
    )
    relighter = SteerableRelighter([layer])
    spots = [[Spot((3.0, 2.0, 1.0), direction=tuple(a))] for a in rng.standard_normal((COPIES * ROUNDS, 3))]

    copies = [(planes.bytes.copy(), planes.scales.copy()) for _ in range(COPIES)]  # no cache has them all
    flat = [data.reshape(-1).view(np.int64) for data, _ in copies]
    dense = np.ascontiguousarray(images.transpose(0, 2, 1)).reshape(COMPONENTS, 3, pixels)
    dense_copies = [dense.copy() for _ in range(2)]
    index, picture = np.arange(COMPONENTS, dtype=np.int32), np.zeros((pixels, 3), np.float32)
    weights = rng.standard_normal((3, COMPONENTS)).astype(np.float32)
    threads = numba.get_num_threads()
    shares = np.linspace(0, len(planes.bytes), threads + 1).astype(np.int64)
    out = np.empty((3, pixels), np.float32)

    def ours(n: int) -> None:
        sum_planes(*copies[n % COPIES], index, weights, picture, shares, False)

    def product(n: int) -> None:
        for c in range(3):
            np.matmul(weights[c], dense_copies[n % 2][:, c], out=out[c])

    work = {
        "light": lambda n: relighter.light(spots[n], negligible=0.0),
        "sum": ours,
        "read": lambda n: _read_all(flat[(n + 3) % COPIES], threads),
        "read_plainly": lambda n: _plain_all(flat[(n + 5) % COPIES], threads),
    }
    alone = _interleaved(work, ROUNDS)
    beside = _interleaved({"sum": ours, "dense": product}, 12, rest=REST, at_once=12)
    read, bare = planes.bytes.nbytes + planes.scales.nbytes, planes.bytes.nbytes
    large = read_bandwidth(size=256_000_000, repeats=5)
    at_median = {name: each["median"] for name, each in alone.items()}
    return {
        "components": COMPONENTS, "size": list(SIZE), "threads": threads, "bytes_read": read,
        "pictures_per_second": 1e3 / at_median["light"], "milliseconds": alone,
        "milliseconds_beside_a_dense_product": beside,
        "dense_over_ours": beside["dense"]["median"] / beside["sum"]["median"],
        "share_of_read_bandwidth": read / at_median["sum"] * at_median["read"] / bare,
        "share_of_plain_reading": read / at_median["sum"] * at_median["read_plainly"] / bare,
        "whole_picture_of_read_bandwidth": read / at_median["light"] * at_median["read"] / bare,
        "gigabytes_a_second": {
            "sum": 1e-6 * read / at_median["sum"], "read": 1e-6 * bare / at_median["read"],
            "read_plainly": 1e-6 * bare / at_median["read_plainly"], "read_of_a_large_array": 1e-9 * large,
        },
        "loss_of_bytes_dB": _loss(),
    }  # fmt: skip


def _loss() -> float:
    """What bytes cost: the loss of the signal-to-noise ratio of pictures under the basis lights, 20 of 36 kept.

    Of pictures whose components fall off by a fifth each.
    """
    rng = np.random.default_rng(2)
    lights, kept, pixels = 36, COMPONENTS, 1 << 14
    V, _ = np.linalg.qr(rng.standard_normal((lights, lights)))
    U, _ = np.linalg.qr(rng.standard_normal((3 * pixels, lights)))
    s = 1000 * 0.8 ** np.arange(lights)
    M = (U * s) @ V.T
    images = np.ascontiguousarray((U * s)[:, :kept].T.reshape(kept, pixels, 3), np.float32)
    planes = to_bytes(Components(V[:, :kept].T, V[:, :kept].T, s), images)
    decoded = planes.decoded(kept).reshape(kept, -1).T.astype(np.float64)
    without = np.square((U * s)[:, :kept] @ V[:, :kept].T - M).mean()
    found = float(10 * np.log10(np.square(decoded @ V[:, :kept].T - M).mean() / without))
    if found > LOSS_DB:
        raise SystemExit(f"bytes cost {found:.2f} dB, at most {LOSS_DB} was wanted")
    return found
