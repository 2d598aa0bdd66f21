"""All threads or one: for kernels that take so little that waiting for other threads may cost more."""

from __future__ import annotations

import statistics
import time
from collections import deque
from collections.abc import Callable

import numba

_ALONE_BELOW = 2_000_000  # bytes, some 0.15 ms of one thread: hardly more than there is to gain
_REMEMBERED = 5  # calls
_TRY_THE_OTHER, _SELDOM = 16, 1024  # calls between trials: at first, and where the other keeps losing


class Pace:
    """A kernel, called with as many threads as were faster of late; what it does must not depend on them.

    Where others keep the processors busy, waiting for a second thread costs a time slice (8 ms seen) and the
    work itself a fraction of a millisecond.
    """

    def __init__(self, kernel: Callable[..., object]) -> None:
        self._kernel = kernel
        self._took = {together: deque[float](maxlen=_REMEMBERED) for together in (False, True)}  # s a byte
        self._together = False
        self._until_trial = self._between_trials = 1

    def __call__(self, size: int, *arguments: object) -> None:
        """Run it; it reads and writes about ``size`` bytes."""
        threads = numba.get_num_threads()
        if size < _ALONE_BELOW or threads == 1:
            self._run(1, threads, arguments)
            return
        self._until_trial -= 1
        is_trial = self._until_trial <= 0
        together = self._together != is_trial
        began = time.perf_counter()
        self._run(threads if together else 1, threads, arguments)
        self._took[together].append((time.perf_counter() - began) / size)
        if is_trial:
            self._judge()

    def _run(self, some: int, threads: int, arguments: tuple) -> None:
        if some == threads:
            self._kernel(*arguments)
            return
        numba.set_num_threads(some)
        try:
            self._kernel(*arguments)
        finally:
            numba.set_num_threads(threads)

    def _judge(self) -> None:
        """After a trial: change over if the other is faster, else try it less often."""
        alone, together = (statistics.median(took) if took else 0.0 for took in self._took.values())
        before, self._together = self._together, together < alone
        is_known = all(self._took.values())
        changed = before != self._together or not is_known
        self._between_trials = _TRY_THE_OTHER if changed else min(2 * self._between_trials, _SELDOM)
        self._until_trial = self._between_trials if is_known else 2
