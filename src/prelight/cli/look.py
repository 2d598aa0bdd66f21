"""What the start page of the studio asks of a scene before it is baked: what is in it, and a picture that sharpens."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from ..errors import PrelightError, printable

WIDTH, HEIGHT = 480, 270


def look(arguments: Sequence[str]) -> int:
    """``SCENE PICTURE.png``: facts as a line of JSON, then more paths a pixel for each number that comes in.

    Ends when nothing comes in any more; the exit code.
    """
    parser = argparse.ArgumentParser(prog="look")
    parser.add_argument("scene")
    parser.add_argument("picture", type=Path)
    parser.add_argument("--floor", type=float)
    parser.add_argument("--subdivide", type=float)
    given = parser.parse_args(arguments)
    try:
        _look(given)
    except PrelightError as error:
        sys.stderr.write(f"prelight: {printable(error)}\n")
        return error.exit_code
    except KeyboardInterrupt:
        return 130
    return 0


def _look(given: argparse.Namespace) -> None:
    from ..checking.sharpening import SharpeningPicture, facts
    from ..scene.loading import load_scene

    scene = load_scene(given.scene, floor=given.floor, subdivide=given.subdivide)
    _say(facts(scene))
    picture = SharpeningPicture(scene, width=WIDTH, height=HEIGHT)
    for line in sys.stdin:
        wanted = int(line)
        while picture.passes < wanted:
            picture.more()
        picture.save(given.picture)
        _say({"passes": picture.passes})


def _say(values: dict) -> None:
    sys.stdout.write(json.dumps(values) + "\n")
    sys.stdout.flush()
