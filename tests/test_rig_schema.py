"""The JSON schema of rigs accepts what the reader accepts, and refuses what it refuses."""

from __future__ import annotations

import copy
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.lighting.rig_file import checked_tables, known_tables
from prelight.lighting.rig_schema import rig_schema

jsonschema = pytest.importorskip("jsonschema")
ROOT = Path(__file__).resolve().parents[1]
_OUT = {"direction": [1.0, 0.5, 0.0], "target": [0.0, 1.0, 0.0], "power": 3.0, "ies": "a.ies", "layer": "key",
        "kelvin": 3000.0, "color": [1.0, 0.5, 0.2], "lumens": 800.0, "intensity": [1.0, 2.0, 3.0], "at": 1.0,
        "radiance": [1.0, 1.0, 1.0], "azimuth_deg": 20.0, "elevation_deg": 10.0, "spread_deg": 40.0, "width_deg": 30.0,
        "frost_deg": 10.0, "rough": 0.5, "glass": "clear", "radius_deg": 3.0, "softness": 0.5, "picture": "gobo.png",
        "elevation_range_deg": [0.0, 30.0], "scene": "stock:town", "misspelt": 1, "position": [0.5, 0.5],
        "size": [1.0, 2.0], "width": 0.5, "polynomial": [0.0, 1.0], "radius": 0.1, "power_w": 20.0}  # fmt: skip
_WRONG: tuple[Any, ...] = (
    True,
    "x",
    -1,
    -1.0,
    1e9,
    [],
    {},
    [1.0],
    [0, 0, 0],
    [1, 2, 3],
    [1, 2, 3, 4],
    "a\x00b",
    0.5,
    2,
)
# What the schema does not say (docs/rig.md): the reader's words for it.
_NOT_SAID = re.compile(r"lower number first|times that rise|not a time|no such zone|zone|colour temperature")
_PLACE = "place"


@pytest.fixture(scope="module")
def validator() -> Any:
    schema = rig_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def _rigs() -> list[dict[str, Any]]:
    """Every rig of the repository: its files, and those in the documentation."""
    texts = [path.read_text() for path in ROOT.glob("docs/**/*.toml")]
    for page in sorted(ROOT.glob("docs/*.md")):
        texts += re.findall(r"```toml\n(.*?)```", page.read_text(), re.S)
    return [tomllib.loads(text) for text in texts]


def _plain(value: Any) -> Any:
    """As JSON has it: TOML's own dates are written out."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_plain(part) for part in value]
    return value.isoformat() if hasattr(value, "isoformat") else value


def _refused(document: dict[str, Any]) -> str | None:
    try:
        checked_tables(document, "rig")
    except InputError as error:
        return str(error)
    return None


def test_every_rig_of_the_repository_is_judged_as_the_reader_does(validator) -> None:
    rigs = _rigs()
    said = [_refused(rig) for rig in rigs]
    assert sum(reason is None for reason in said) >= 10
    for rig, reason in zip(rigs, said, strict=True):
        assert validator.is_valid(_plain(rig)) == (reason is None), (reason, rig)


def _tables(value: Any) -> Iterator[dict[str, Any]]:
    if isinstance(value, dict):
        yield value
        for part in value.values():
            yield from _tables(part)
    elif isinstance(value, list):
        for part in value:
            yield from _tables(part)


def test_a_thousand_changed_rigs_are_judged_as_the_reader_does(validator) -> None:
    rng = np.random.default_rng(7)
    good = [_plain(rig) for rig in _rigs() if _refused(rig) is None]
    refused = 0
    for _ in range(1500):
        rig = copy.deepcopy(good[rng.integers(len(good))])
        tables = list(_tables(rig))
        table = tables[rng.integers(len(tables))]
        keys = sorted(table)
        what = rng.integers(4)
        if what == 0 and keys:
            del table[keys[rng.integers(len(keys))]]
        elif what == 1 and keys:
            table[keys[rng.integers(len(keys))]] = copy.deepcopy(_WRONG[rng.integers(len(_WRONG))])
        else:
            names = sorted(_OUT)
            name = names[rng.integers(len(names))]
            table[name] = copy.deepcopy(_OUT[name])
        reason = _refused(rig)
        if reason is not None and _NOT_SAID.search(reason):
            continue
        refused += reason is not None
        assert validator.is_valid(rig) == (reason is None), (reason, rig)
    assert refused > 500


def test_every_key_of_every_table_is_there() -> None:
    schema = rig_schema()
    for table in known_tables():
        own = schema["$defs"].get(table.__name__, schema)["properties"]
        assert set(own) == set(table.model_fields) - set(getattr(table, "unused", ())), table.__name__


def test_the_published_schema_is_current(prelight) -> None:
    kept = json.loads((ROOT / "docs" / "rig.schema.json").read_text())
    assert kept == rig_schema(), "run: prelight rig schema -o docs/rig.schema.json --force"
    told = prelight("rig", "schema")
    assert (told.code, json.loads(told.out)) == (0, kept)
