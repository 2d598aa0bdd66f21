"""The studio in a notebook: two lines show a bake and light it from Python.

    view = View("room.prelight"); view
    view.lamp("key", position=(0.5, 2.0, 0.3), lumens=800, kelvin=3000)

The same page as ``prelight studio``, in the cell's output; everything goes through the notebook's own connection, so
that it works wherever the notebook does, and nothing is fetched. Needs ``pip install 'prelight[notebook]'``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any

from .errors import InputError, MissingExtraError
from .lighting.colour_temperature import of_kelvin
from .storage.bake import Bake
from .studio.embedded import Embedded
from .studio.environments import Environments
from .studio.kept import state_file
from .studio.protocol import PROTOCOL_VERSION, Hello, Message, OpenRig, RemoveLamp, SetEnvironment, SetLamp
from .studio.protocol_values import LampLight
from .studio.server import PAGE, Served
from .studio.wire import encode

try:
    import anywidget
    import traitlets
except ImportError:
    raise MissingExtraError("this needs anywidget: pip install 'prelight[notebook]'") from None

_PYTHON = 0  # the number of the socket that Python's own changes go through
_HEIGHTS = (200, 4000)  # pixels


class View(anywidget.AnyWidget):
    """A bake under a light that can be set, by hand in the cell's output or from Python.

    Parameters
    ----------
    bake
        NAME.prelight, or a `Bake`.
    skies
        Environment maps or rigs to choose from, as ``prelight studio`` takes them.
    height
        Of the output, pixels.

    Raises
    ------
    InputError
        No layer of the bake can be shown, or a sky is not there.
    DamagedBakeError
        The bake is not whole.
    """

    _esm = Path(__file__).parent / "studio" / "notebook.js"
    _page = traitlets.Unicode().tag(sync=True)
    _script = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int(640, min=_HEIGHTS[0], max=_HEIGHTS[1]).tag(sync=True)

    def __init__(self, bake: str | Path | Bake, *skies: str, height: int = 640) -> None:
        from .studio.kinds import vertex_kinds

        opened = bake if isinstance(bake, Bake) else Bake.open(Path(bake))
        vertex_kinds(opened)
        self.notes: list[str] = []
        served = Served(opened, Environments(skies), state_file(opened.path), self.notes.append)
        self._studio = Embedded(served)
        self._numbers, self._socket = count(1), -1  # none yet
        script = (PAGE / "studio.js").read_text(encoding="utf-8")
        super().__init__(_page=page_document(), _script=script, height=height)
        self.on_msg(self._asked)
        self._studio.open(_PYTHON, self._heard)
        self._change(Hello(PROTOCOL_VERSION))

    # ---- Setting the light -------------------------------------------------------------------------------

    def lamp(  # noqa: PLR0913  (a lamp, number by number)
        self,
        name: str,
        *,
        position: Sequence[float],
        lumens: float = 800.0,
        kelvin: float = 4000.0,
        radius: float = 0.05,
        target: Sequence[float] | None = None,
        candela: float | None = None,
        beam_deg: float = 40.0,
    ) -> None:
        """Put up a lamp, or change the one of this name; with a ``target`` it is a spot of so many candela.

        ``position`` and ``target`` are metres in the scene. Raises InputError for what no lamp can be.
        """
        red, green, blue = of_kelvin(kelvin)
        spot = target is not None
        strength = candela if spot and candela is not None else lumens
        lamp = LampLight(
            id=_id(name), name=name, kind="spot" if spot else "lamp", on=True, position=_place(position),
            target=_place(target if target is not None else (0.0, 0.0, 0.0)), strength=float(strength), dim=1.0,
            color=(red, green, blue), radius=float(radius), beam_deg=float(beam_deg), size=(1.0, 1.0),
        )  # fmt: skip
        self._change(_checked(SetLamp(lamp)))

    def remove_lamp(self, name: str) -> None:
        """Take down a lamp."""
        self._change(_checked(RemoveLamp(_id(name))))

    def sky(
        self, name: str | None = None, *, rotate_deg: float | None = None, scale: float | None = None
    ) -> None:
        """Change the sky: ``stock:sunset`` or one of ``skies``, its turn, its factor; what is not given stays."""
        self._change(_checked(SetEnvironment(name, rotate_deg, scale)))

    def open_rig(self, text: str) -> None:
        """Light as a rig file's text says, as far as the page can show it."""
        self._change(_checked(OpenRig(text)))

    def close(self) -> None:
        """End the studio of this view; its light is kept beside the bake."""
        self._studio.close()
        super().close()

    # ---- Between the page and the studio -----------------------------------------------------------------

    def _change(self, message: Message) -> None:
        if self._studio.error is not None:
            raise self._studio.error
        self._studio.tell(_PYTHON, encode(message))

    def _heard(self, said: str | bytes | None) -> None:
        """Of what the studio tells Python, frames are left to the page."""
        if isinstance(said, str) and '"type": "Refused"' in said[:40]:
            self.notes.append(said)

    def _asked(self, _view: Any, content: Any, _buffers: Any) -> None:
        """A message of the page: it may come from a notebook that somebody else wrote."""
        if not isinstance(content, dict):
            return
        if isinstance(path := content.get("get"), str) and isinstance(number := content.get("number"), int):
            self._studio.get(
                path, lambda status, data: self.send({"number": number, "status": status}, [data])
            )
        elif content.get("open"):
            self._studio.tell(self._socket, None)
            self._socket = next(self._numbers)
            self._studio.open(self._socket, self._said)
        elif isinstance(text := content.get("say"), str):
            self._studio.tell(self._socket, text)
        elif content.get("close"):
            self._studio.tell(self._socket, None)

    def _said(self, said: str | bytes | None) -> None:
        if said is None:
            self.send({"closed": True})
        elif isinstance(said, str):
            self.send({"text": said})
        else:
            self.send({"frame": True}, [said])


def page_document() -> str:
    """The page without its script: whose style is inside."""
    text = (PAGE / "index.html").read_text(encoding="utf-8")
    style = (PAGE / "studio.css").read_text(encoding="utf-8")
    text = re.sub(r"<script[^>]*></script>|<link[^>]*>", "", text)
    return text.replace("</head>", f"<style>{style}</style></head>")


def _id(name: str) -> str:
    """What messages call a lamp of this name."""
    return "py-" + format(sum((i + 1) * ord(c) for i, c in enumerate(name)) % 16**8, "x")


def _place(values: Sequence[float]) -> tuple[float, float, float]:
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError):
        raise InputError(
            "position", f"{str(values)[:60]!r}, expected three numbers: x, y, z in metres"
        ) from None
    return x, y, z


def _checked(message: Any) -> Message:
    """As the studio would: raises InputError."""
    from .studio.wire import decode

    return decode(encode(message))
