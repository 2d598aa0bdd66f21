"""``prelight``: the commands, and how errors become one line and an exit code."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import NoReturn

import cyclopts

from ..errors import InterruptedBakeError, PrelightError, printable
from ..files import explain
from . import animate, bake, compare, demo, doctor, inspect, layers, relight, rig, solve, studio, verify

EXIT_FAULT, EXIT_INPUT, EXIT_OUTPUT, EXIT_INTERRUPTED = 1, 2, 3, 130

app = cyclopts.App(
    name="prelight",
    version=lambda: version("prelight"),
    help="""Trace a static scene once, then change its light in milliseconds.

A bake keeps how much of each light reaches each place; relighting multiplies. Begin with `prelight demo`, or:
`prelight bake environment MESH.ply --floor 3 -o MESH.prelight`, then
`prelight relight MESH.prelight SKY.hdr -o picture.png`.

Skies and suns come from `bake environment`, rooms by their windows from `bake portals`, lamps anywhere from
`bake transfer` (or `bake cloud`), lamps aimed before one camera from `bake steerable`; `layers add` puts several into
one bake, and one rig lights them all, in relight, animate and studio.

Exit codes: 0 done, 1 a fault of Prelight, 2 bad input, 3 reading or writing failed, 4 a damaged bake,
130 interrupted.""",
    help_format="markdown",
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,  # Ctrl-C is ours to tell from SIGTERM, and to explain
)
app.command(demo.demo)
app.command(bake.app, name="bake")
app.command(relight.relight)
app.command(animate.animate)
app.command(studio.studio)
app.command(solve.solve)
app.command(compare.compare)
app.command(inspect.inspect)
app.command(rig.app, name="rig")
app.command(layers.app, name="layers")
app.command(verify.verify)
app.command(doctor.doctor)
app.register_install_completion_command(add_to_startup=False)


class _Terminated(KeyboardInterrupt):
    """SIGTERM, unwound like Ctrl-C so that a bake stays resumable."""


def _terminate(_signal: int, _frame: FrameType | None) -> NoReturn:
    raise _Terminated


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command and exit with its code."""
    signal.signal(signal.SIGTERM, _terminate)
    _prepare_streams()
    sys.exit(run(sys.argv[1:] if arguments is None else list(arguments)))


def run(arguments: Sequence[str]) -> int:
    """Run a command; its exit code. ``PRELIGHT_DEBUG=1`` lets tracebacks through."""
    if os.environ.get("PRELIGHT_DEBUG") == "1":
        app(arguments, exit_on_error=False, result_action="return_value")
        return 0
    try:
        app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return 0
    except cyclopts.CycloptsError as error:
        chain = " ".join(("prelight", *(error.command_chain or ())))
        return _fail(" ".join(str(error).split()) + f" (see {chain} --help)", EXIT_INPUT)
    except InterruptedBakeError as error:
        code = 143 if isinstance(error.__cause__, _Terminated) else error.exit_code
        return _fail(str(error), code)
    except PrelightError as error:
        return _fail(str(error), error.exit_code)
    except _Terminated:
        return _fail("stopped", 143)
    except KeyboardInterrupt:
        return _fail("interrupted", EXIT_INTERRUPTED)
    except (BrokenPipeError, SystemExit):  # which rich makes of it, while it prints the help
        _abandon_output()  # the reader went away, as `| head` does
        return 0
    except OSError as error:
        _abandon_output()
        return _fail(f"{error.filename or 'standard output'}: {explain(error)}", EXIT_OUTPUT)
    except MemoryError:
        return _fail("out of memory; pass a smaller --memory, --resolution or --size", EXIT_INPUT)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        return _fail(
            f"a fault of Prelight: {what}; run again with PRELIGHT_DEBUG=1 and report it", EXIT_FAULT
        )


def _prepare_streams() -> None:
    """A stream that the caller closed leads nowhere, lest the next file we open take its number; and a name
    or a × that a terminal cannot show is no reason to fail."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115  (for good)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _abandon_output() -> None:
    """What is left in the buffer cannot be written: do not let the interpreter try again as it ends."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str, code: int) -> int:
    with contextlib.suppress(OSError):
        sys.stderr.write(f"prelight: {printable(message)}\n")
    return code
