"""The pictures of every panel in docs/pictures/panels, dark beside light: made here, and as the page is.

``PRELIGHT_PICTURES=docs/pictures/panels pytest tests/test_studio_pictures.py`` makes them anew.
"""

from __future__ import annotations

import io
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.studio.environments import Environments, sky_words
from prelight.studio.frames import FRAME_ASIDE

from .studio_browser import Visit, chromium, visiting
from .studio_stand_in import StandIn, framed, packed, serving, unpacked
from .test_studio_table import CONTROLS, everything

pytest.importorskip("starlette", reason="the studio's server is not installed")

DOCS = Path(__file__).resolve().parents[1] / "docs"
MADE = os.environ.get("PRELIGHT_PICTURES")
GAP = 12  # pixels between dark and light
SECTIONS = {
    "sky": "Sky", "lights": "Lights in the sky", "outside": "Outside", "glass": "Glass", "lamps": "Lamps",
    "looks": "Looks", "timeline": "Timeline", "picture": "Picture", "tracer": "Path tracer",
}  # fmt: skip
CUT_OFF = """(part) => [part, ...part.querySelectorAll("*")].filter((one) => {
    const style = getComputedStyle(one), box = one.getBoundingClientRect(), whole = part.getBoundingClientRect();
    if (one.querySelector(".skies") || one.closest(".skies")) return false; // it scrolls
    if (box.width === 0 || style.visibility === "hidden") return false;
    const isText = one.children.length === 0 && style.display !== "inline" && one.tagName !== "INPUT";
    const cut = isText && one.scrollWidth > one.clientWidth + 1;
    return box.right > whole.right + 1 || (cut && style.textOverflow !== "ellipsis");
  }).map((one) => one.outerHTML.slice(0, 120))"""


def furnished() -> StandIn:
    """A page with all panels and real skies, that has been at work."""
    studio, known = everything(), Environments()
    choices = [{"id": choice.id, "title": choice.title} for choice in known.choices]
    pictures = {choice["id"]: known.preview(choice["id"]) for choice in choices if choice["id"] != "daylight"}
    studio.preview = lambda name: pictures.get(name) or pictures["stock:noon"]
    studio.sky = unpacked(sky_words(known.open("stock:noon")))
    rows = studio.radiance(studio.state)
    panes = [{"name": name, "tint": tint} for name, tint in (("Door", [1, 1, 1]), ("Rose", [0.8, 0.2, 0.3]))]
    studio.welcome |= {"portals": panes, "environments": choices}
    studio.state |= {
        "environment": "stock:noon", "looks": ["Evening", "Noon"], "undo": "Spot 1", "redo": None,
        "timeline": [{"at": 0.0, "look": "Noon"}, {"at": 4.0, "look": "Evening"}],
        "lamps": [named(lamp, n, 1200.0 - 300 * n) for n, lamp in enumerate(studio.state["lamps"])],
        "glass": [{"portal": "Rose", "kind": "frosted", "tint": None, "frost_deg": 20, "blind": 0.25}],
    }  # fmt: skip

    def compared(message: dict) -> list:
        light = {"type": "State", **studio.state}
        words = packed(0.5 * rows).astype("<u4")
        return [{"type": "Compared", "look": message["look"], "light": light}, framed(words, FRAME_ASIDE | 1)]

    told = {"type": "Traced", "share": 0.4, "samples": 102, "seconds": 48.0, "stopped": None}
    studio.replies |= {"Compare": compared, "Trace": lambda _: [told]}
    return studio


def named(lamp: dict, n: int, strength: float) -> dict:
    kelvin = ([1.0, 0.8, 0.5], [1.0, 0.95, 0.9], [0.9, 0.95, 1.1])[n]
    return {**lamp, "strength": strength, "color": kelvin, "on": n != 2, "name": f"{lamp['name']} 1"}


def shots(visit: Visit) -> Iterator[tuple[str, Image.Image]]:
    """All panels by their names; nothing in them is cut off."""
    page = visit.page
    regions = {name: page.get_by_role("region", name=title, exact=True) for name, title in SECTIONS.items()}
    parts = regions | {"rig": page.get_by_role("toolbar", name="Rig"), "cameras": page.locator("#eyes")}
    regions["lamps"].get_by_role("button", name="Spot 1", exact=True).click()
    regions["lights"].get_by_role("button", name="Light 1").focus()
    regions["glass"].get_by_role("button", name="Rose").click()
    regions["looks"].get_by_role("button", name="Compare with Noon").click()
    regions["tracer"].get_by_role("button", name="Trace this view").click()
    regions["picture"].get_by_role("radio", name="lux").click()
    page.get_by_text("102 samples a pixel").wait_for()
    visit.until("__prelight.metrics.sides")
    page.evaluate("() => document.activeElement.blur()")
    visit.rested()
    for name, part in (parts | {"legend": page.locator("#legend")}).items():
        assert part.evaluate(CUT_OFF) == [], name
        yield name, shot(part)
    regions["lights"].get_by_role("radio", name="Paint", exact=True).click()
    regions["lights"].get_by_role("slider", name="Kelvin").fill("3000")
    ring = regions["lights"].get_by_role("button", name="Brush at")
    for _ in range(6):
        ring.press("Enter")
        ring.press("Shift+ArrowRight")
    page.evaluate("() => document.activeElement.blur()")
    visit.rested()
    assert regions["lights"].evaluate(CUT_OFF) == []
    yield "paint", shot(regions["lights"])
    regions["lights"].get_by_role("button", name="Clear paint").click()
    visit.page.evaluate("() => __prelight.change({environment: 'daylight'}, false)")
    page.get_by_role("slider", name="Hour").wait_for()
    visit.rested()
    yield "sun", shot(parts["sky"])
    page.get_by_role("button", name="Keys", exact=True).click()
    yield "keys", shot(page.get_by_role("dialog", name="Keys"))


def shot(part) -> Image.Image:
    return Image.open(io.BytesIO(part.screenshot())).convert("RGB")


def test_every_panel_has_its_picture_dark_and_light() -> None:
    found: dict[str, list[Image.Image]] = {}
    with chromium() as browser, serving(furnished()) as studio:
        for scheme in ("dark",) if MADE is None else ("dark", "light"):
            studio.state["environment"] = "stock:noon"
            with visiting(browser, studio.url, width=800, height=640, scheme=scheme) as visit:
                visit.settled()
                titles = set(
                    visit.page.evaluate(
                        "() => [...document.querySelectorAll('section[aria-label]')].map((one) => one.ariaLabel)"
                    )
                )
                assert titles == set(SECTIONS.values()), "a panel without a picture"
                for name, picture in shots(visit):
                    found.setdefault(name, []).append(picture)
                controls = sorted({f"{section}: {name}" for section, name in visit.page.evaluate(CONTROLS)})
                assert not visit.complaints
    for name, pictures in found.items():
        values = [np.asarray(picture, float) for picture in pictures]
        assert min(value.std() for value in values) > 8, f"{name} is empty"
        assert values[0].mean() < values[-1].mean() - 20 or len(values) == 1, name
    folder = DOCS / "pictures" / "panels" if MADE is None else Path(MADE)
    if MADE is not None:
        keep(found, controls, folder)
    assert {path.stem for path in folder.glob("*.png")} == set(found)
    said = (folder / "controls.json").read_text()
    assert json.loads(said) == controls, (
        "controls have changed since: make the pictures anew, and look at them"
    )
    shown = re.findall(r"pictures/panels/(\w+)\.png", (DOCS / "studio.md").read_text())
    assert sorted(shown) == sorted(found)


def keep(found: dict[str, list[Image.Image]], controls: list[str], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, (dark, light) in found.items():
        both = Image.new("RGBA", (dark.width + GAP + light.width, max(dark.height, light.height)))
        both.paste(dark, (0, 0))
        both.paste(light, (dark.width + GAP, 0))
        both.quantize(256, method=Image.Quantize.FASTOCTREE).save(folder / f"{name}.png", optimize=True)
    (folder / "controls.json").write_text(json.dumps(controls, indent=1, ensure_ascii=False) + "\n")
