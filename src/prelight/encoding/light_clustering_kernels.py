"""Merging lights two groups at a time, the most alike first, while every pair of both stays below a bound."""

from __future__ import annotations

import heapq

import numpy as np
from numba import njit, prange, types

_f4_3 = types.Array(types.float32, 3, "C", readonly=True)
_i4_2 = types.Array(types.int32, 2, "C", readonly=True)


@njit([types.void(_f4_3, _i4_2, types.float32[::1])], parallel=True, cache=True, nogil=True)
def largest_differences(answers, pairs, out):
    """out (pairs,): the largest difference of two lights' answers (lights, receivers, numbers) at any receiver, the
    root of the squares over its numbers."""
    for p in prange(len(pairs)):
        j, k = pairs[p, 0], pairs[p, 1]
        largest = np.float32(0)
        for i in range(answers.shape[1]):
            square = np.float32(0)
            for n in range(answers.shape[2]):
                difference = answers[j, i, n] - answers[k, i, n]
                square += difference * difference
            largest = max(largest, square)
        out[p] = np.sqrt(largest)


@njit([types.int64(types.float32[:, ::1], types.int32[::1])], cache=True, nogil=True)
def merge_below_one(distance, group_of):
    """Merge lights whose ``distance`` (L, L; symmetric) is below 1; how many groups are left.

    The distance of two groups is the largest between a light of one and a light of the other: two groups whose
    distance is below 1 have every pair below 1. ``distance`` is overwritten; ``group_of`` (L,) becomes the first light
    of each one's group. Of pairs equally far those of the first lights merge first.
    """
    count = len(distance)
    age = np.zeros(
        count, np.int64
    )  # how often a group has grown; what the queue says of younger ones is stale
    alive = np.ones(count, np.bool_)
    queue = [(np.float32(0), np.int64(0), np.int64(0), np.int64(0), np.int64(0))]
    queue.pop()
    for j in range(count):
        group_of[j] = j
        for k in range(j + 1, count):
            if distance[j, k] < 1:
                queue.append((distance[j, k], np.int64(j), np.int64(k), np.int64(0), np.int64(0)))
    heapq.heapify(queue)
    groups = count
    while len(queue) > 0:
        _, j, k, age_j, age_k = heapq.heappop(queue)
        if not alive[j] or not alive[k] or age[j] != age_j or age[k] != age_k:
            continue
        alive[k] = False
        age[j] += 1
        groups -= 1
        for i in range(count):
            if group_of[i] == k:
                group_of[i] = j
            if alive[i] and i != j:
                both = max(distance[i, j], distance[i, k])
                distance[i, j] = distance[j, i] = both
                if both < 1:
                    a, b = min(i, j), max(i, j)
                    heapq.heappush(queue, (both, np.int64(a), np.int64(b), age[a], age[b]))
    return groups
