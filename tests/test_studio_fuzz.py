"""S6: 20,000 mutated messages are messages, or refused by name; nothing else ever happens."""

from __future__ import annotations

import json
from typing import get_args

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.studio.protocol import ClientMessage
from prelight.studio.start_protocol import StartMessage
from prelight.studio.wire import decode, encode

_SEEDS = (
    '{"type": "Hello", "version": 3}', '{"type": "SetEnvironment", "rotation_deg": 30.5, "tint": [1, 0.5, 2]}',
    '{"type": "SetDisc", "id": "a", "azimuth_deg": 10, "elevation_deg": 5, "radius_deg": 2, "radiance": [1, 2, 3]}',
    '{"type": "SaveLook", "name": "evening"}', '{"type": "OpenRig", "text": "[environment]"}', '{"type": "Undo"}',
    '{"type": "SetWish", "project": "a", "wish": {"sky": "open", "quality": "draft", "floor": 3.0}}',
    '{"type": "TakeUpload", "upload": "0123456789abcdef", "main": "a.glb"}', '{"type": "Bake", "project": "a"}',
)  # fmt: skip
_PIECES = ('"', "{", "}", "[", "]", ",", ":", "null", "true", "1e999", "-1", "NaN", "9" * 400, "\\u0000", "[" * 300,
           "\\ud800", "../", "<script>", '"type"', "0.0")  # fmt: skip


@pytest.mark.parametrize("kinds", [ClientMessage, StartMessage])
def test_mutated_messages_are_refused_by_name_or_are_messages(kinds) -> None:
    rng, said, taken = np.random.default_rng(6), [], 0
    known = {kind.__name__ for kind in get_args(kinds)}
    for _ in range(10_000):
        text = _SEEDS[rng.integers(len(_SEEDS))]
        for _ in range(rng.integers(1, 4)):
            at, width = rng.integers(len(text) + 1), rng.integers(4)
            text = text[:at] + _PIECES[rng.integers(len(_PIECES))] * int(rng.integers(2)) + text[at + width :]
        try:
            message = decode(text, kinds)
        except InputError as error:
            said.append(str(error))
            continue
        taken += 1
        assert type(message).__name__ in known
        assert decode(encode(message), kinds) == message
        json.loads(encode(message))
    assert len(said) > 5000
    assert all("\n" not in line and len(line) <= 300 for line in said)
    assert taken > 100
