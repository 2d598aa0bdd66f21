"""Every control of the page, and the test that shows that its pixels change as light must.

A control that is not in the table, or whose test has gone, fails here.
"""

from __future__ import annotations

import importlib
import inspect
import re

import numpy as np
import pytest

from .studio_browser import chromium, visiting
from .studio_stand_in import COLUMNS, ROWS, STRAIGHT, StandIn, patches, serving

pytest.importorskip("starlette", reason="the studio's server is not installed")

LAMPS, PANEL = (
    "lamps.a_lamp_is_put_up_dimmed_coloured_switched_and_undone",
    "controls.a_panel_and_the_radius_of_a_lamp",
)
SPOT, DISC = (
    "rest.a_lamps_colour_and_a_spots_beam",
    "controls.a_soft_light_by_its_size_its_softness_and_its_colour",
)
SUN, GLASS = "controls.the_sun_by_day_haze_place_and_clock", "lamps.glass_and_a_world_outside"
LOOKS, SIDES = (
    "lamps.looks_side_by_side_and_cross_faded",
    "shown.two_looks_beside_each_other_and_before_and_after",
)
PAINT, PAINT_TAKEN = (
    "paint.a_dab_lights_the_side_that_faces_it",
    "paint.paint_has_a_colour_and_is_taken_away",
)
LINE, PICTURE = (
    "shown.the_timeline_fades_from_look_to_look",
    "shown.a_picture_and_a_film_are_what_is_on_the_screen",
)
TABLE = {
    "Sky": {
        "daylight: .*": SUN, "(noon|sunset): .*": "lamps.the_hour_moves_the_shadow",
        "Turn( of the sky)?": "live.turning_the_sky_moves_the_shadow",
        "Tint of the sky": "rest.the_strip_the_softness_and_the_tint",
        "Strength|Warmth": "live.scale_and_warmth_change_the_light_by_their_factors",
        "Hour|Day|Haze|Clock: .*|Place [NE] °": SUN,
    },
    "Lights in the sky": {
        "Add a light": "live.a_light_added_throws_a_shadow_of_its_own", "Light 1, .*": DISC,
        "Radius|Warmth|Strength": DISC,
        "Move|Paint|Brush|Edge|Level|Cover|Brush at .*": PAINT,
        "Erase|Clear paint|Kelvin|Colour of the brush": PAINT_TAKEN,
        "Colour of the light": DISC, "Softness": "rest.the_strip_the_softness_and_the_tint",
        "Remove": DISC,
        "Highlight": "placing.a_light_in_the_sky_goes_where_its_highlight_is_clicked",
        "Light|Shadow": "placing.a_lamp_goes_where_its_light_and_its_shadow_are_clicked",
    },
    "Lamps": {
        "Add lamp|Dimmer|Warmth|At full lm|.* is lit": LAMPS,
        "Add spot|Beam|At full cd|Colour of the lamp|Name of the lamp": SPOT,
        "Add panel|Radius|Size, m [wh]|Aim, m [xyz]": PANEL, "Lamp|Spot|Panel": PANEL, "Remove": SPOT,
        "Place, m [xyz]": "lamps.a_lamp_is_moved_by_hand_by_keys_and_by_numbers",
        "Add to key": "shown.steerable_lamps_are_seen_from_their_camera_alone",
        "Highlight": "placing.a_light_in_the_sky_goes_where_its_highlight_is_clicked",
        "Light|Shadow": "placing.a_lamp_goes_where_its_light_and_its_shadow_are_clicked",
    },
    "": {
        ".* at .* m": "lamps.a_lamp_is_moved_by_hand_by_keys_and_by_numbers",
        "Aim of .*": "lamps.a_spot_is_aimed_at_what_is_pointed_at", "Undo: x|Redo: y": LAMPS,
        "Open rig|Save rig|Rig file": "lamps.a_rig_is_saved_and_opened",
        "The scene. .*|straight": "hands.camera_and_keyboard_move_the_eye",
        "Walk": "shown.walking_goes_where_one_looks",
        "Keys|Close": "rest.keys_do_what_the_sheet_says", "Where the other look begins": LOOKS,
    },
    "Glass": {"Window|As built|Tint of the glass|Blind|Frost|Clear|Frosted|Shut": GLASS},
    "Outside": {"World outside|Time|Play": "shown.a_world_is_seen_behind_the_scene_and_moves_with_its_time"},
    "Looks": {
        "A|B|Compare with [AB]|Forget [AB]|Keep|Name of the look|Done|Right side|Cross-fade|Side by side": LOOKS,
        "Before / after|Left side": SIDES,
    },
    "Timeline": {
        "Add key|Film|Live|Play|Time|Remove key .|Key . at s|Look of key .": LINE,
        "Save as rig": "rest.a_timeline_is_saved_as_a_rig_that_fades",
    },
    "Picture": {
        "Auto": "page.auto_exposure_is_that_of_the_pictures", "Record|Save picture": PICTURE,
        "Exposure|Filmic|Linear": "page.shows_what_the_pictures_show", "Sky|Plain": GLASS,
        "Red is|cd/m²|Picture": "rest.luminance_in_false_colour_is_683_times_radiance",
        "lux": "lamps.false_colour_shows_what_a_meter_reads",
    },
    "Path tracer": {"Trace this view|Stop": "shown.the_path_tracers_picture_lies_where_its_camera_saw_it"},
}  # fmt: skip
CONTROLS = """() => [...document.querySelectorAll("button, input, select, a[href], [role=slider], [tabindex='0']")]
  .filter((one) => !one.closest("[aria-hidden=true]"))
  .map((one) => [one.closest("section")?.querySelector("h2")?.textContent ?? "",
    one.getAttribute("aria-label") || one.labels?.[0]?.textContent || one.textContent])"""


def everything() -> StandIn:
    """A page that has all panels, and something in each."""
    wide, high = 20, 12
    rows = 4 * ROWS * COLUMNS + wide * high
    studio = patches(np.full((ROWS * COLUMNS, 3), 0.4))
    studio.radiance = lambda _: np.full((rows, 3), 0.4)
    studio.environments = ["stock:noon", "stock:sunset", "daylight"]
    studio.cameras = [STRAIGHT]
    places = [{"layer": "key", "kind": "spot", "origin": [0, 1, 2]}]
    studio.welcome = {
        "takes": ["environment", "lamps", "glass", "steered"],
        "portals": [{"name": "Window", "tint": [1, 1, 1]}],
        "worlds": [{"id": "town.toml", "title": "town", "duration": 10.0}], "no_tracer": None,
        "receivers": rows,
        "steered": {"camera": STRAIGHT, "width": wide, "height": high, "places": places},
    }  # fmt: skip
    studio.state |= {
        "environment": "daylight", "looks": ["A", "B"], "world": "town.toml", "undo": "x", "redo": "y",
        "timeline": [{"at": 0.0, "look": "A"}, {"at": 2.0, "look": "B"}],
        "discs": [
            {"id": "d", "azimuth_deg": 0, "elevation_deg": 30, "radius_deg": 5, "radiance": [1, 1, 1], "softness": 0.5}
        ],
        "lamps": [lamp("Lamp"), lamp("Spot"), lamp("Panel")],
        "glass": [{"portal": "Window", "kind": "frosted", "tint": [1, 0.5, 0.5], "frost_deg": 10, "blind": 0.2}],
    }  # fmt: skip
    return studio


def lamp(name: str) -> dict:
    return {
        "id": name, "name": name, "kind": name.lower(), "on": True, "position": [0, 1, 1],
        "target": [0, 0, 0],
        "strength": 500.0, "dim": 1.0, "color": [1, 1, 1], "radius": 0.05, "beam_deg": 40.0,
        "size": [0.5, 0.5],
        "layer": None,
    }  # fmt: skip


def test_every_control_has_its_test() -> None:
    found: set[tuple[str, str]] = set()
    with (
        chromium() as browser,
        serving(everything()) as studio,
        visiting(browser, studio.url, width=900) as visit,
    ):
        visit.settled()
        for name in ("Lamp", "Spot", "Panel"):
            row = visit.page.get_by_role("region", name="Lamps").get_by_role("button", name=name, exact=True)
            row.dispatch_event("click")
            visit.rested()
            found |= {(section, name.strip()) for section, name in visit.page.evaluate(CONTROLS)}
    folds = {(section, section) for section in TABLE}
    known = {place: entry_of(*place) for place in found - folds}
    assert [place for place, test in known.items() if test is None] == []
    assert len(known) > 100
    used = {test for test in known.values() if test}
    assert used == {test for rows in TABLE.values() for test in rows.values()}, "of controls that have gone"
    for test in used:
        module, name = test.split(".")
        wanted = getattr(importlib.import_module(f"{__package__}.test_studio_{module}"), f"test_{name}", None)
        assert wanted is not None, test
        assert re.search(r"pixels|linear|seen|scene_alone|shown|mean\(", inspect.getsource(wanted)), test


def entry_of(section: str, name: str) -> str | None:
    """The entry of a control."""
    rows = TABLE.get(section, {})
    return next((test for names, test in rows.items() if re.fullmatch(names, name, re.DOTALL)), None)
