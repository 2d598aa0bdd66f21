// The environment: which map, its turn, its strength, its colour.

import { COOLEST, NEUTRAL, type Rgb, WARMEST } from "../colour";
import { fromHex, hue, kelvinOf, luminance, ofKelvin, times, toHex } from "../colour";
import { fetchPreview } from "../geometry";
import type { EnvironmentChoice } from "../messages";
import type { Look, Rig } from "../rig";
import { DAYLIGHT, skyId } from "../rig";
import { Dome } from "./dome";
import { button, chooseByArrows, degrees, element, pen, section, slider, stops, wrapped } from "./elements";
import { SunSettings } from "./sun_settings";

const BRIGHTEST = 6; // stops
const DIMMEST = -6;

export class SkyPanel {
  readonly part: HTMLElement;
  readonly dome: Dome;
  private readonly choices = element("div", { class: "skies", role: "radiogroup", "aria-label": "Environment" });
  private readonly name = element("div", { class: "sky-name" });
  private readonly turn: ReturnType<typeof slider>;
  private readonly strength: ReturnType<typeof slider>;
  private readonly warmth: ReturnType<typeof slider>;
  private readonly tint = element("input", { type: "color", "aria-label": "Tint of the sky", title: "Tint" });
  private readonly thumbnails = new Map<string, { choice: EnvironmentChoice; button: HTMLButtonElement }>();
  private readonly maps = new Map<string, Promise<ImageBitmap>>();
  private mayFetch: () => void = () => undefined;
  private readonly isLit = new Promise<void>((lit) => (this.mayFetch = lit));
  private queue: Promise<unknown> = this.isLit;
  private readonly sun: SunSettings;
  private readonly warmthRow: HTMLElement;
  private shownMap = "";
  private drawnMap = "";
  private fetching = "";

  constructor(
    private readonly rig: Rig,
    private readonly showMap: (map: ImageBitmap) => void,
  ) {
    chooseByArrows(this.choices);
    const change = (degrees: number, dragging: boolean) => rig.change({ rotation_deg: degrees }, { dragging });
    this.dome = new Dome(change);
    this.turn = slider({
      name: "Turn", least: -180, most: 180, step: 0.5, rest: 0, kind: "centred", say: degrees, set: change,
    });
    this.strength = slider({
      name: "Strength", least: DIMMEST, most: BRIGHTEST, step: 0.1, rest: 0, kind: "centred", say: stops,
      set: (value, dragging) => rig.change({ scale: 2 ** value / level(rig.look.tint) }, { dragging }),
    });
    this.warmth = slider({
      name: "Warmth", least: WARMEST, most: COOLEST, step: 50, rest: NEUTRAL, kind: "kelvin",
      say: (kelvin) => `${Math.round(kelvin)} K`,
      set: (kelvin, dragging) => this.paint(ofKelvin(kelvin), dragging),
    });
    this.tint.addEventListener("input", () => this.paint(fromHex(this.tint.value), true));
    this.tint.addEventListener("change", () => this.paint(fromHex(this.tint.value), false));
    const beside = element("div", { class: "beside" }, this.name, this.turn.row, this.strength.row);
    this.sun = new SunSettings(rig);
    this.warmthRow = element("div", { class: "with-colour" }, this.warmth.row, this.tint);
    const turning = element("div", { class: "turning" }, this.dome.canvas, beside);
    this.part = section("Sky", this.choices, turning, this.sun.part, this.warmthRow);
  }

  /** The scene is lit: its small pictures, which the studio paints, take nothing from that any more. */
  fetchMaps(): void {
    this.mayFetch();
  }

  /** The maps to choose from, one of which is lit; each with its picture. */
  offer(choices: readonly EnvironmentChoice[], lit: string): void {
    this.choices.replaceChildren();
    this.thumbnails.clear();
    if (choices.some(({ id }) => id === lit) && lit !== DAYLIGHT) void this.map(lit).catch(() => undefined); // the first
    for (const choice of choices) {
      const name = shortName(choice.id);
      const made = button("", () => this.rig.change({ environment: choice.id }), {
        role: "radio", class: "thumbnail", title: choice.title, "aria-label": `${name}: ${choice.title}`,
      });
      const picture = element("canvas", { width: "96", height: "64", "aria-hidden": "true" });
      made.append(picture, element("span", {}, name));
      void this.map(choice.id).then((map) => {
        const { width, height } = map; // the middle of the map, from a little below the horizon up
        pen(picture)?.drawImage(map, width / 4, height * 0.08, width / 2, height * 0.66, 0, 0, 96, 64);
      }, () => undefined);
      this.thumbnails.set(choice.id, { choice, button: made });
      this.choices.append(made);
    }
    this.show(this.rig.look);
  }

  show(look: Look): void {
    for (const [id, { button: made }] of this.thumbnails) {
      made.setAttribute("aria-checked", String(id === look.environment));
    }
    this.name.textContent = this.thumbnails.get(look.environment)?.choice.title ?? look.environment;
    this.turn.show(wrapped(look.rotation_deg));
    this.strength.show(Math.log2(Math.max(look.scale * level(look.tint), 2 ** DIMMEST)));
    this.warmth.show(kelvinOf(look.tint));
    this.tint.value = toHex(look.tint);
    this.dome.show(look);
    this.sun.show(look);
    this.warmthRow.hidden = look.environment === DAYLIGHT; // it has the colour of its hour
    if (!this.thumbnails.has(look.environment)) return;
    this.shownMap = skyId(look);
    void this.showMaps();
  }

  /** The small pictures of the sky; of hours that pass while one is fetched only the last is asked for. */
  private async showMaps(): Promise<void> {
    if (this.fetching !== "") return;
    while (this.drawnMap !== this.shownMap) {
      const shown = (this.drawnMap = this.fetching = this.shownMap);
      const isHour = shown.startsWith(`${DAYLIGHT}:`);
      try {
        const map = await (isHour ? this.isLit.then(() => fetchPreview(shown)) : this.map(shown));
        this.dome.showMap(map);
        this.showMap(map);
      } catch {
        // the next change asks again
      }
    }
    this.fetching = "";
  }

  private paint(colour: Rgb, dragging: boolean): void {
    this.rig.change({ tint: times(hue(colour), level(this.rig.look.tint)) }, { dragging });
  }

  private map(id: string): Promise<ImageBitmap> {
    const known = this.maps.get(id);
    if (known !== undefined) return known;
    const asked = this.queue.then(() => fetchPreview(id)); // one after the other
    this.queue = asked.catch(() => this.maps.delete(id));
    this.maps.set(id, asked);
    return asked;
  }
}

/** What a tint does to brightness; a black one counts as none. */
function level(tint: Readonly<Rgb>): number {
  return luminance(tint) || 1;
}

/** A file's or a stock environment's name without what all have. */
function shortName(id: string): string {
  return id.replace(/^stock:/, "").replace(/\.(hdr|exr|pic)$/i, "");
}
