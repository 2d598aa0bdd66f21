"""The JSON schema of a rig file, for editors and programs: generated from the tables that read it.

What a table's own checks say of several keys together stands here once more, as rules of the schema; a test holds both
against each other. Not said by the schema: that a range's first number is the lower one, that times of keys rise, that
a target is not a light's own place, that files are there, and that dates and zones exist.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from .layouts import PICTURE_LAYOUTS
from .rig_file import RigTables, known_tables

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_ANGLES = ("azimuth_deg", "elevation_deg")
_SHAPES = ("power", "width_deg", "polynomial", "ies", "picture")
_NOWHERE = {"properties": {"direction": {"items": {"const": 0}}}, "required": ["direction"]}
_NO_NUL = r"^[^\u0000]*$"
_FILES = ("map", "ies", "picture", "scene")


def rig_schema() -> dict[str, Any]:
    """The schema (JSON Schema 2020-12) of a rig file's tables."""
    schema = _plain(RigTables.model_json_schema())
    tables = schema["$defs"]
    for model in known_tables():
        own = tables.get(model.__name__, schema)
        for name in getattr(model, "unused", ()):
            own["properties"].pop(name, None)
        for name in _FILES:
            if own["properties"].get(name, {}).get("type") == "string":
                own["properties"][name]["pattern"] = _NO_NUL
        rules = _rules(model.__name__, own["properties"])
        if rules:
            own["allOf"] = rules
    for table, name, most in (
        ("PanelTable", "width", 3),
        ("PanelKey", "width", 3),
        ("SunTable", "ground_albedo", 3),
    ):
        _or_one_number(tables[table]["properties"], name, most)
    tables["PathTable"]["properties"]["along"]["enum"] = ["curve", "line"]
    tables["ObjectTable"]["properties"]["along"]["enum"] = ["curve", "line"]
    tables["ObjectTable"]["properties"]["scene"]["minLength"] = 1
    for table in ("MapTable", "BlendTable", "EnvironmentTable"):
        if table in tables:
            tables[table]["properties"]["layout"]["enum"] = list(PICTURE_LAYOUTS)
    place = {"type": "number", "minimum": -1.0, "maximum": 2.0}
    tables["PanelTable"]["properties"]["position"]["items"] = place
    head = {
        "$schema": DIALECT,
        "title": "A rig of Prelight",
        "description": "What lights a bake: docs/rig.md.",
    }
    return head | {name: value for name, value in schema.items() if name not in ("title", "description")}


def _plain(value: Any) -> Any:
    """Without null, which TOML has not, and without the names of classes."""
    if isinstance(value, list):
        return [_plain(part) for part in value]
    if not isinstance(value, Mapping):
        return value
    kept = {key: _plain(part) for key, part in value.items()}
    if "default" in kept and kept["default"] is None:
        del kept["default"]
    options = [part for part in kept.get("anyOf", ()) if part != {"type": "null"}]
    if "anyOf" in kept:
        del kept["anyOf"]
        kept = kept | options[0] if len(options) == 1 else kept | {"anyOf": options}
    if isinstance(kept.get("title"), str) and (
        "type" in kept or "$ref" in kept or "anyOf" in kept or "oneOf" in kept
    ):
        del kept["title"]
    return kept


def _or_one_number(properties: dict[str, Any], name: str, most: int) -> None:
    """A list, or one number for all."""
    several = properties[name]
    inner = several.get("items") or several["prefixItems"][0]
    words = {key: several[key] for key in ("default",) if key in several}
    properties[name] = words | {"anyOf": [inner, {k: v for k, v in several.items() if k != "default"}]}
    properties[name]["anyOf"][1].setdefault("maxItems", most)


# ---- Rules of several keys -------------------------------------------------------------------------------------


def _needs(*names: str) -> dict[str, Any]:
    return {"required": list(names)}


def _none_of(names: Iterable[str]) -> dict[str, Any]:
    return {"not": {"anyOf": [_needs(name) for name in names]}}


def _at_most_one(names: Iterable[str]) -> dict[str, Any]:
    given = list(names)
    pairs = [_needs(a, b) for n, a in enumerate(given) for b in given[n + 1 :]]
    return {"not": {"anyOf": pairs}} if pairs else {}


def _direction(*instead: str) -> dict[str, Any]:
    """One direction, said in one way; or one of other keys, and no direction."""
    ways = [{**_needs("direction"), **_none_of((*_ANGLES, *instead)), "allOf": [{"not": _NOWHERE}]}]
    ways += [{**_needs(*_ANGLES), **_none_of(("direction", *instead))}]
    ways += [{**_needs(other), **_none_of(("direction", *_ANGLES))} for other in instead]
    return {"anyOf": ways}


def _no_direction() -> dict[str, Any]:
    return _none_of(("direction", *_ANGLES, "target"))


def _picture_and_spread() -> dict[str, Any]:
    return {"dependentRequired": {"picture": ["spread_deg"], "spread_deg": ["picture"]}}


def _strength(own: str, others: tuple[str, ...]) -> list[dict[str, Any]]:
    """One strength, or an IES file with or without one; colours only where the strength is one number."""
    every = (own, *others)
    return [
        {"anyOf": [_needs(name) for name in every]},
        _at_most_one(name for name in every if name != "ies"),
        _at_most_one(("color", "kelvin")),
        {"if": _needs(own), "then": _none_of(("color", "kelvin"))},
    ]


def _rules(table: str, properties: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What a table's checks say."""
    ranges = ("azimuth_range_deg", "elevation_range_deg")
    aimed_or_not = {"anyOf": [_no_direction(), _direction("target")]}
    match table:
        case "RigTables":
            lights = [_needs(name) for name in ("environment", "sun")]
            lists = ("disc", "paint", "lamp", "spot", "panel")
            lights += [{"required": [n], "properties": {n: {"minItems": 1}}} for n in lists]
            return [_at_most_one(("environment", "sun")), {"anyOf": lights}]
        case "DiscTable":
            return [_direction()]
        case "PaintTable":
            angles = {"anyOf": [_needs(name) for name in ranges]}
            angular = _none_of(("direction", *_ANGLES, "radius_deg", "softness"))
            return [{"if": angles, "then": angular, "else": {"allOf": [_direction(), _needs("radius_deg")]}}]
        case "OutsideTable":
            many = {"required": ["object"], "properties": {"object": {"minItems": 1}}}
            return [{"anyOf": [_needs("scene"), many]}]
        case "SpotTable":
            shape = [_at_most_one(_SHAPES), _picture_and_spread()]
            return [_direction("target"), *shape, {"anyOf": [_needs("intensity"), _needs("ies")]}]
        case "PanelTable":
            beam = ("direction", *_ANGLES, "target", *_SHAPES)
            turned = {"anyOf": [_needs(name) for name in beam if name in properties]}
            shape = {"allOf": [_direction("target"), _at_most_one(_SHAPES), _picture_and_spread()]}
            widths = [
                {"properties": {"width": {"maxItems": 1, "type": "array"}}},
                {"properties": {"width": {"type": "number"}}},
                *({"properties": {k: {"minItems": n, "maxItems": n, "type": "array"} for k in ("width", "position")}}
                  for n in (2, 3)),
            ]  # fmt: skip
            return [{"if": turned, "then": shape}, {"anyOf": widths}]
        case "LampTable":
            return [
                aimed_or_not,
                {"if": {"not": _needs("ies")}, "then": _no_direction()},
                *_strength("intensity", ("power_w", "lumens", "ies")),
            ]
        case "PlacedSpotTable":
            shape = [
                _at_most_one(_SHAPES),
                _picture_and_spread(),
                {"anyOf": [_needs(name) for name in _SHAPES]},
            ]
            return [_direction("target"), *shape, *_strength("intensity", ("ies",))]
        case "PlacedPanelTable":
            return [_direction("target"), *_strength("radiance", ("power_w", "lumens"))]
        case "PortalTable":
            frosted = {"properties": {"glass": {"const": "frosted"}}}
            return [
                *({"if": _needs(name), "then": frosted} for name in ("frost_deg", "rough")),
                _at_most_one(("frost_deg", "rough")),
            ]
        case _:
            return []
