"""Commands of ``prelight`` run beside the studio: what they find, how far they are, and how they are stopped.

A process of its own for each: what a hostile scene does to one, and the memory of a long bake, end with it; and a bake
that is stopped or killed is the one of the command line, journal and all.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import InputError, printable

_LINE = 1 << 20  # bytes of a line of their answers
_PATIENCE = 20.0  # seconds after being asked to stop
FAULT = 1  # the exit code of a fault of ours


class Child:
    """A command that runs.

    Parameters
    ----------
    command
        What comes before the arguments: an interpreter and a module, given this process's number and a device.
    device
        "auto" or "cpu".
    arguments
        Of ``prelight``.
    """

    def __init__(self, command: Sequence[str], device: str, arguments: Sequence[str]) -> None:
        self._line = (*command, str(os.getpid()), device, *arguments)
        self._process: asyncio.subprocess.Process | None = None
        self.said = ""  # its last words on standard error

    async def start(self) -> None:
        """Begin."""
        self._process = await asyncio.create_subprocess_exec(
            *self._line,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
            env={**os.environ, "PRELIGHT_PROGRESS": "json"}, start_new_session=True, limit=_LINE,
        )  # fmt: skip

    @property
    def process(self) -> asyncio.subprocess.Process:
        """It, once started."""
        assert self._process is not None
        return self._process

    @property
    def runs(self) -> bool:
        """Whether it has been started and has not ended."""
        return self._process is not None and self._process.returncode is None

    async def result(self, progress: Callable[[float], None] | None = None) -> dict[str, Any]:
        """What it prints as one JSON object. Raises InputError with its own line if it fails."""
        await self.start()
        try:
            listening = asyncio.create_task(self.listen(progress))
            text = await self.process.stdout.read() if self.process.stdout else b""
            await listening
            code = await self.process.wait()
        except BaseException:
            await self.stop()
            raise
        if code != 0:
            raise InputError("bake", self.said or f"ended with {code}")
        try:
            return json.loads(text)
        except ValueError:
            raise InputError("bake", "said nothing that can be read") from None

    async def listen(self, progress: Callable[[float], None] | None = None) -> None:
        """Hear what it says on standard error, to the end: its progress, and its last words."""
        errors = self.process.stderr
        assert errors is not None
        while True:
            try:
                line = await errors.readline()
            except ValueError:  # longer than any of ours
                continue
            if not line:
                return
            text = line.decode("utf-8", "replace").strip()
            share = _share(text)
            if share is None:
                self.said = printable(text.removeprefix("prelight: "))
            elif progress is not None:
                progress(share)

    async def answer(self) -> dict[str, Any] | None:
        """The next line that it prints, as JSON; None at its end."""
        assert self.process.stdout is not None
        with contextlib.suppress(ValueError):
            line = await self.process.stdout.readline()
            return json.loads(line) if line else None
        return None

    def ask(self, text: str) -> None:
        """Send it a line."""
        if self.runs and self.process.stdin is not None:
            with contextlib.suppress(ConnectionError, RuntimeError):
                self.process.stdin.write(text.encode() + b"\n")

    async def stop(self) -> None:
        """Stop it as Ctrl-C does: it keeps what is done; one that does not listen is killed."""
        if not self.runs:
            return
        for sign, patience in ((signal.SIGINT, _PATIENCE), (signal.SIGKILL, 5.0)):
            with contextlib.suppress(ProcessLookupError):
                self.process.send_signal(sign)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self.process.wait(), patience)
                return


def _share(text: str) -> float | None:
    """What a line of progress says."""
    if not text.startswith("{"):
        return None
    try:
        share = json.loads(text).get("progress")
    except ValueError:
        return None
    return min(max(float(share), 0.0), 1.0) if isinstance(share, int | float) else None
