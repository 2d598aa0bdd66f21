"""A command run by a page of the studio: it ends with the studio that began it, and keeps what it has done."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG


def main() -> None:
    """``python -m prelight.cli.child PARENT DEVICE look SCENE …`` or any command of ``prelight``."""
    parent, device, *arguments = sys.argv[1:]
    _end_with(int(parent))
    if device == "cpu":
        from ..scene.variant import on_processor

        on_processor()
    if arguments[:1] == ["look"]:
        from .look import look

        sys.exit(look(arguments[1:]))
    from .main import main as command

    command(arguments)


def _end_with(parent: int) -> None:
    """When the studio dies, stop as at Ctrl-C: a bake stays resumable."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGINT)
    if os.getppid() != parent:  # it is dead already
        sys.exit(130)


if __name__ == "__main__":
    main()
