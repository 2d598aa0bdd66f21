"""A picture by the path tracer in the background: one at a time, with its progress, ended whenever it is wanted."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Radiance
from ..camera import Camera
from ..errors import InputError, PrelightError
from ..lighting.rig import Rig
from ..storage.bake import Bake
from .environments import Environments, words_of_map
from .frames import FRAME_TRACED, HEADER_BYTES, FrameHeader
from .protocol import MOST_TRACED, State, Trace, Traced

if TYPE_CHECKING:
    from .kinds import Taken

_SAMPLES = 256  # a pixel
_TELL_EVERY = 0.5  # seconds
_PATIENCE = 3.0

Tell = Callable[[int, Traced, bytes | None], None]
Growing = Iterator[tuple[int, Radiance]]  # samples a pixel, and the mean radiance (pixels, 3) so far
Pictures = Callable[
    [Bake, Rig, Camera, tuple[int, int], int], Growing
]  # of a size (width, height), to so many
_MISSING = "Mitsuba, whose path tracer it takes, is not installed: pip install 'prelight[bake]'"


class Tracing:
    """The path tracer of a studio, ``pictures``; None where the renderer is missing.

    ``tell`` is called from its thread: the visitor, how far it is, and a frame.

    Safe to use from several threads.
    """

    def __init__(
        self, bake: Bake, environments: Environments, *, pictures: Pictures | None, tell: Tell
    ) -> None:
        self._bake, self._environments, self._pictures, self._tell = bake, environments, pictures, tell
        self._lock = threading.Lock()
        self._running: tuple[int, threading.Event, threading.Thread] | None = None

    @property
    def missing(self) -> str | None:
        """Why no path tracer is there; None: it is."""
        return None if self._pictures is not None else _MISSING

    def start(self, wanted: Trace, state: State, *, takes: tuple[Taken, ...], visitor: int) -> None:
        """Begin, in place of what runs. Raises InputError without the renderer, and for too many pixels."""
        if self.missing is not None:
            raise InputError("Trace", self.missing)
        if wanted.width * wanted.height > MOST_TRACED:
            raise InputError(
                "Trace", f"{wanted.width}×{wanted.height}, at most {MOST_TRACED:,} pixels are traced"
            )
        if wanted.eye == wanted.target:
            raise InputError("Trace", "eye and target are at one place, expected two")
        camera = Camera(wanted.eye, wanted.target, wanted.up, vertical_fov_deg=wanted.vertical_fov_deg)
        with self._lock:
            before = self._running
            if before is not None:
                before[1].set()
            ends = threading.Event()
            run = _Run(
                visitor, ends, camera, (wanted.width, wanted.height), None if before is None else before[2]
            )
            thread = threading.Thread(
                target=self._trace, args=(run, state, takes), name="path tracing", daemon=True
            )
            self._running = visitor, ends, thread
            thread.start()

    def stop(self, visitor: int) -> None:
        """End what runs for a visitor, soon."""
        with self._lock:
            if self._running is not None and self._running[0] == visitor:
                self._running[1].set()

    def close(self) -> None:
        """End what runs, and wait for it."""
        with self._lock:
            running = self._running
        if running is not None:
            running[1].set()
            running[2].join(_PATIENCE)

    def _trace(self, run: _Run, state: State, takes: tuple[Taken, ...]) -> None:
        if run.before is not None:
            run.before.join()
        began = told = time.monotonic()

        def tell(samples: int, stopped: str | None = None, picture: Radiance | None = None) -> None:
            data = None if picture is None else _frame(picture, state, began)
            passed = round(time.monotonic() - began, 2)
            self._tell(run.visitor, Traced(samples / _SAMPLES, samples, passed, stopped), data)

        try:
            tell(0)
            from .lit_rig import rig_of  # brings the compiler along

            assert self._pictures is not None  # looked at by ``start``
            rig = rig_of(state, self._environments, takes=takes)
            for samples, picture in self._pictures(self._bake, rig, run.camera, run.size, _SAMPLES):
                if run.ends.is_set():
                    tell(samples, "stopped", picture)
                    return
                if samples in (1, _SAMPLES) or time.monotonic() - told > _TELL_EVERY:
                    tell(samples, None, picture)
                    told = time.monotonic()
        except PrelightError as error:
            tell(0, error.reason if isinstance(error, InputError) else str(error))
        except Exception as error:  # the renderer's own, whatever they are
            said = (str(error).splitlines() or [type(error).__name__])[0]
            tell(0, f"the path tracer failed: {said[:200]}")


class _Run:
    """What one picture is of."""

    def __init__(
        self,
        visitor: int,
        ends: threading.Event,
        camera: Camera,
        size: tuple[int, int],
        before: threading.Thread | None,
    ) -> None:
        self.visitor, self.ends, self.camera, self.size, self.before = visitor, ends, camera, size, before


def _frame(picture: Radiance, state: State, began: float) -> bytes:
    words = words_of_map(np.maximum(picture, 0))
    head = bytearray(HEADER_BYTES)
    FrameHeader(0, state.sequence, len(words), (time.monotonic() - began) * 1e3, FRAME_TRACED).write(head)
    return bytes(head) + words.tobytes()
