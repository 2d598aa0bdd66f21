"""The messages of the studio: one definition for two languages, and nothing else gets through."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import get_args

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.studio import protocol, rig_state, typescript
from prelight.studio.frames import FrameHeader
from prelight.studio.protocol import (
    LARGEST_MESSAGE,
    ClientMessage,
    Compare,
    Hello,
    LookFrom,
    OpenRig,
    Redo,
    RemoveDisc,
    RemoveLamp,
    RemoveLook,
    SaveLook,
    Seen,
    SetDisc,
    SetEnvironment,
    SetGlass,
    SetLamp,
    SetSun,
    SetTimeline,
    SetWorld,
    ShowLook,
    StopTrace,
    Trace,
    Undo,
)
from prelight.studio.protocol_values import LampLight, LookKey, PortalGlass, Sun
from prelight.studio.wire import decode, encode

MESSAGES = [
    Hello(1),
    SetEnvironment("stock:noon", -30.5, 2.0, (1.0, 0.5, 0.25), dragging=True),
    SetEnvironment(scale=0.0),
    SetDisc("a-1", 12.0, -3.5, 4.0, (1.0, 2.0, 3.0), 0.5),
    RemoveDisc("a-1"),
    Seen(2**32 - 1),
    SetSun(Sun(-43.5, 170.0, "2026-12-21", 23.75, "Pacific/Auckland", 3.0), dragging=True),
    SetLamp(LampLight("l", "Lampe «Ä»", "spot", False, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), 80.0, 0.5, (1.0, 1.0, 1.0),
                      0.0, 40.0, (0.5, 0.5))),
    RemoveLamp("l"),
    SetGlass(PortalGlass("rose", "frosted", None, 20.0, 0.5)),
    Undo(), Redo(), SaveLook("One"), ShowLook("One"), RemoveLook("One"), Compare("One"), Compare(None),
    OpenRig("[environment]"),
    Compare("Look", (0.5, 1.0, -2.0)),
    SetWorld("drive.toml", 2.5, dragging=True), SetWorld(None), SetTimeline((LookKey(0.0, "One"), LookKey(2.5, "Two"))),
    LookFrom((0.0, 1.5, -2.0)), Trace((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 35.0, 640, 360), StopTrace(),
]  # fmt: skip


NO_NUMBERS = ["NaN", "Infinity", "-Infinity", "1e39", "-1e39", "1e400", '"1"', "true", "null", "[1]", "{}", "[]",
              "1" + "0" * 400, "1" * 5000]  # fmt: skip
DISC = {
    "id": "a",
    "azimuth_deg": 1,
    "elevation_deg": 2,
    "radius_deg": 3,
    "radiance": [1, 2, 3],
    "softness": 0,
}
OUT_OF_RANGE = {
    "azimuth_deg": ["-361", "361"],
    "elevation_deg": ["-90.01", "91"],
    "radius_deg": ["0", "-1", "90.1", "1e-9"],
    "softness": ["-1e-300", "1.01"],
    "radiance": [
        "1",
        "[1, 2]",
        "[1, 2, 3, 4]",
        "[1, 2, -1]",
        "[1, 2, 1e8]",
        '"123"',
        '{"0": 1, "1": 2, "2": 3}',
    ],
    "id": ['""', '"../a"', '"a b"', '"<b>"', '"é"', '"' + "a" * 17 + '"', '"a\\u0000"', '"a\\n"', "1"],
}


LAMP = {
    "id": "a", "name": "n", "kind": "lamp", "on": True, "position": [0, 1, 2], "target": [0, 0, 0], "strength": 1.0,
    "dim": 1.0, "color": [1, 1, 1], "radius": 0.1, "beam_deg": 40.0, "size": [1, 1],
}  # fmt: skip
SUN = {"latitude_deg": 1, "longitude_deg": 2, "date": "2026-06-21", "hour": 3, "zone": None, "turbidity": 2.5}


def words_of(plain: dict, field: str, value: str) -> str:
    """The members of a JSON object, one of them as it is written."""
    return ", ".join(f'"{k}": {value if k == field else json.dumps(v)}' for k, v in plain.items())


def bad_messages() -> list[str]:
    """Some three hundred that no page of ours sends."""
    found = []

    def disc(field: str, value: str) -> str:
        words = ", ".join(f'"{k}": {value if k == field else json.dumps(v)}' for k, v in DISC.items())
        return f'{{"type":"SetDisc", {words}}}'

    for field in DISC:
        found += [disc(field, n) for n in (*OUT_OF_RANGE[field], *NO_NUMBERS) if field != "id" or n != '"1"']
        if field != "softness":
            found.append(json.dumps({"type": "SetDisc", **{k: v for k, v in DISC.items() if k != field}}))
    for n in NO_NUMBERS:
        found += [disc("radiance", f"[1, {n}, 3]")]
        found += [
            f'{{"type":"SetEnvironment","tint":[{n},1,1]}}',
            f'{{"type":"SetEnvironment","tint":[1,1,{n}]}}',
        ]
        if n != "null":  # the same as not given
            found += [
                f'{{"type":"SetEnvironment","{f}":{n}}}'
                for f in ("scale", "rotation_deg", "environment")
                if '"' not in n or f != "environment"
            ]
    found += ['{"type":"SetEnvironment","scale":-1e-300}', '{"type":"SetEnvironment","tint":[-1,1,1]}']
    for n in (*NO_NUMBERS[:8], "1.5", "4294967296", "null"):
        found += [f'{{"type":"Seen","frame":{n}}}', f'{{"type":"Hello","version":{n}}}']
    for n in OUT_OF_RANGE["id"]:
        found.append(f'{{"type":"RemoveDisc","id":{n}}}')
    for n in ("1", "true", '""', "[]", "{}", '"' + "a" * 301 + '"'):
        found.append(f'{{"type":"SetEnvironment","environment":{n}}}')
    for n in ("1", '"yes"', "null", "[]"):
        found.append(f'{{"type":"SetEnvironment","dragging":{n}}}')
    for kind in ("Welcome", "State", "_Message", "__class__", "setdisc", "SetEnvironment ", "eval"):
        found += [json.dumps({"type": kind}), json.dumps({"type": [kind]}), json.dumps({"kind": kind})]
    for field, value in (
        ("kind", '"disco"'), ("name", '""'), ("name", '"a\\u0000"'), ("position", "[1, 2]"),
        ("position", "[1, 2, 1e9]"),
        ("dim", "1.1"), ("beam_deg", "0"), ("radius", "-1"), ("size", "[0, 1]"), ("strength", "1e300"), ("on", "1"),
        ("color", "[1, 1, NaN]"), ("id", '"../a"'), ("extra", "1"),
    ):  # fmt: skip
        found.append(f'{{"type":"SetLamp","lamp":{{{words_of(LAMP | {field: None}, field, value)}}}}}')
    for field, value in (
        ("hour", "24"),
        ("date", '"21.6.2026"'),
        ("latitude_deg", "91"),
        ("zone", '"a b"'),
        ("turbidity", "0"),
    ):
        found.append(f'{{"type":"SetSun","sun":{{{words_of(SUN | {field: None}, field, value)}}}}}')
    for text in ('"glass":{}', '"glass":{"portal":"a","kind":"open","tint":null,"frost_deg":1,"blind":0}',
                 '"glass":{"portal":"a","kind":"clear","tint":[2,1,1],"frost_deg":1,"blind":0}'):  # fmt: skip
        found.append(f'{{"type":"SetGlass",{text}}}')
    found += [
        '{"type":"SaveLook","name":""}',
        '{"type":"SaveLook","name":"' + "a" * 61 + '"}',
        '{"type":"Undo","x":1}',
    ]
    found += ['{"type":"OpenRig","text":1}', '{"type":"Compare"}', '{"type":"ShowLook","name":"a\\nb"}']
    found += ["", " ", "null", "[]", "1", '"SetDisc"', "{", "}", '{"type":', "\x00", "\ufffd", "[" * 8000]
    found += ['{"a":' * 3000, '{"type":"SetEnvironment","extra":1}', '{"type":"RemoveDisc","id":"a","id2":1}']
    found += ['{"type":"SetEnvironment","scale":1e}', "a" * 66000]
    found += [json.dumps({"type": "SetEnvironment", "x" * 9000: 1})]
    return found


BAD = bad_messages()


def test_typescript_is_current() -> None:
    """`python -m prelight.studio.typescript` writes it anew."""
    assert typescript.TARGET.read_text(encoding="utf-8") == typescript.messages_module()


def test_typescript_has_every_field_of_every_message() -> None:
    written = typescript.messages_module()
    for kind in (*get_args(protocol.ClientMessage), *get_args(protocol.ServerMessage)):
        block = written.split(f"export interface {kind.__name__} {{")[1].split("}")[0]
        names = [one.split(":")[0].strip(" ?\n") for one in block.split(";") if one.strip()]
        assert names == ["type", *(field.name for field in fields(kind))]
    assert "  tint?: [number, number, number] | null;" in written
    assert "  discs: DiscLight[];" in written


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: type(m).__name__)
def test_messages_survive_the_way(message: ClientMessage) -> None:
    assert decode(encode(message)) == message


def test_three_hundred_bad_messages_are_refused_by_name() -> None:
    """R3: one line that names message and field, whatever they are."""
    assert len(BAD) >= 250
    for text in BAD:
        with pytest.raises(InputError) as refused:
            decode(text)
        line = str(refused.value)
        assert line.isprintable(), text[:80]
        assert len(line) <= 300
        if text.startswith('{"type":"Set') and "NaN" not in text and "Infinity" not in text:
            assert line.startswith(("Set", "message")), line


def test_a_message_that_is_too_long_is_not_even_read() -> None:
    """Also where nothing before has looked at its length, as in a notebook."""
    text = encode(OpenRig("x"))
    padded = text + " " * (LARGEST_MESSAGE - len(text))
    assert decode(padded) == OpenRig("x")
    with pytest.raises(InputError, match="65,537 characters"):
        decode(padded + " ")


def test_ten_thousand_discs_are_never_alight() -> None:
    state = rig_state.initial("stock:noon")
    for k in range(protocol.MOST_DISCS):
        state = rig_state.changed(state, SetDisc(f"d{k}", 1.0, 2.0, 3.0, (1.0, 1.0, 1.0)), author=1)
    for k in range(10_000):
        with pytest.raises(InputError, match="at most 32"):
            rig_state.changed(state, SetDisc(f"e{k}", 1.0, 2.0, 3.0, (1.0, 1.0, 1.0)), author=1)
    moved = rig_state.changed(state, SetDisc("d3", 9.0, 2.0, 3.0, (1.0, 1.0, 1.0)), author=1)
    assert len(moved.discs) == protocol.MOST_DISCS


def test_a_frame_says_what_it_is() -> None:
    data = bytearray(32 + 8)
    header = FrameHeader(7, 9, 2, 1.5, 1)
    header.write(data)
    assert data[:4] == b"PLR1"
    assert np.frombuffer(data, "<u4", 8)[[1, 2, 3, 5]].tolist() == [7, 9, 2, 1]
    assert FrameHeader.read(data) == header
    for broken in (data[:-1], data + b"\0", b"PLR2" + data[4:], b""):
        with pytest.raises(InputError):
            FrameHeader.read(bytes(broken))
