"""One page that is connected: what waits to be sent to it, what it may send.

Nothing queues: of messages with the same redundancy key, and of frames, the newest replaces any unsent one, and
at most two frames are on their way until the page says that it has seen one. So a slow reader costs one frame of
memory, and gets the newest light.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable

from .frames import FRAME_TRACED, FRAME_VIEW, FrameHeader
from .protocol import FRAMES_IN_FLIGHT, Compared, Message, Pace, Seen
from .session import Aside, Frame
from .wire import encode

MOST_MESSAGES = 200  # a second, in the long run
_BURST = 400
_MOST_UNKEYED = 16  # texts that wait; a page that provokes more refusals misses some
_PACE_EVERY = 0.25  # seconds


class Allowance:
    """How many messages one may still send: so many a second, and a burst."""

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst, self._left, self._at = rate, burst, burst, time.monotonic()

    def take(self) -> bool:
        """Whether one more is allowed now."""
        now = time.monotonic()
        self._left = min(self._left + (now - self._at) * self._rate, self._burst)
        self._at = now
        self._left -= 1
        return self._left >= 0


class Visitor:
    """A page. Lives on the event loop."""

    def __init__(self, number: int) -> None:
        self.number = number
        self._texts: dict[object, str] = {}
        self._unkeyed = 0
        self._frame: Frame | None = None
        self._asides: dict[str | None, Aside] = {}
        self._views: dict[int, bytes] = {}
        self._in_flight: deque[int] = deque()
        self._sent_at: deque[float] = deque(maxlen=240)
        self._paced_at = 0.0
        self._news = asyncio.Event()
        self._commands = Allowance(MOST_MESSAGES, _BURST)
        self._acknowledgements = Allowance(10 * MOST_MESSAGES, 10 * _BURST)

    @property
    def has_room(self) -> bool:
        """Whether a frame could be sent at once."""
        return len(self._in_flight) < FRAMES_IN_FLIGHT and self._frame is None

    def may_send(self, *, is_seen: bool) -> bool:
        """Whether it keeps to its rate, with one more message."""
        return (self._acknowledgements if is_seen else self._commands).take()

    def tell(self, message: Message, *, text: str | None = None) -> None:
        """Send a message, instead of one of the same key that still waits; ``text``: its JSON, where that is known."""
        key: object = message.redundancy_key
        if key is None:
            if sum(isinstance(k, int) for k in self._texts) >= _MOST_UNKEYED:
                return
            self._unkeyed += 1
            key = self._unkeyed
        self._texts.pop(key, None)  # and take its place at the end
        self._texts[key] = encode(message) if text is None else text
        self._news.set()

    def show(self, frame: Frame) -> None:
        """Send a frame, instead of one that still waits."""
        self._frame = frame
        self._news.set()

    def show_aside(self, aside: Aside) -> None:
        """Send the light of a look, instead of an older one that still waits."""
        self._asides[aside.look] = aside
        self._news.set()

    def show_view(self, data: bytes) -> None:
        """Send what depends on the eye, or a picture by the path tracer, instead of one that still waits."""
        self._views[FrameHeader.read(data).flags & (FRAME_VIEW | FRAME_TRACED)] = data
        self._news.set()

    def seen(self, message: Seen) -> None:
        """A frame has arrived, and those before it."""
        if message.frame in self._in_flight:
            while self._in_flight.popleft() != message.frame:
                pass
            self._news.set()

    async def send_all(
        self,
        text: Callable[[str], Awaitable[None]],
        data: Callable[[bytes], Awaitable[None]],
        *,
        has_room: Callable[[], None],
    ) -> None:
        """Send what there is, for ever; ``has_room`` is called when a frame could be taken."""
        while True:
            await self._news.wait()
            self._news.clear()
            while self._texts:
                await text(self._texts.pop(next(iter(self._texts))))
            while self._asides:
                aside = self._asides.pop(next(iter(self._asides)))
                await text(encode(Compared(aside.look, aside.light)))
                await data(aside.data)
                if aside.view is not None:
                    await data(aside.view)
            while self._views:
                await data(self._views.pop(next(iter(self._views))))
            if self._frame is not None and len(self._in_flight) < FRAMES_IN_FLIGHT:
                frame, self._frame = self._frame, None
                self._in_flight.append(frame.number)
                await data(frame.data)
                self._note_pace(frame)
            if self.has_room:
                has_room()

    def _note_pace(self, frame: Frame) -> None:
        now = time.monotonic()
        self._sent_at.append(now)
        if now - self._paced_at < _PACE_EVERY and not frame.exact:
            return
        self._paced_at = now
        lately = sum(now - at < 1.0 for at in self._sent_at)
        self.tell(
            Pace(
                relight_ms=round(frame.relight_ms, 3),
                pack_ms=round(frame.pack_ms, 3),
                kind=frame.kind,
                strong_lights=frame.strong_lights,
                bytes=len(frame.data),
                updates_per_second=float(lately),
                layers=frame.layers,
            )
        )
