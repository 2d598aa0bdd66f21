// The strip of the sky with its brush, and disc lights: add them, drag them on the strip, dim, size, soften, colour and remove them.

import { COOLEST, NEUTRAL, type Rgb, WARMEST } from "../colour";
import { fromHex, hue, kelvinOf, luminance, ofKelvin, times, toHex } from "../colour";
import type { DiscLight } from "../messages";
import type { Look, Rig } from "../rig";
import { Brush } from "./brush";
import { button, element, section, slider, stops, wrapped } from "./elements";
import { Strip } from "./strip";

const NEW_RADIUS_DEG = 8;
const NEW_SOFTNESS = 0.5;
const NEW_ELEVATION = 38;
const ASIDE_DEG = -125; // of where the eye looks: over its left shoulder
const BRIGHTEST = 6;
const DIMMEST = -6;
const SMALLEST_DEG = 0.25;
const LARGEST_DEG = 45;

export class LightsPanel {
  readonly part: HTMLElement;
  readonly strip: Strip;
  private readonly brush: Brush;
  private readonly add = button("Add a light", () => this.addAside(), { class: "quiet", title: "Add a light (L)" });
  private readonly settings = element("div", { class: "settings" });
  private readonly tint = element("input", { type: "color", "aria-label": "Colour of the light", title: "Colour" });
  private readonly sliders;
  private readonly remover: HTMLButtonElement;
  private selected: string | null = null;
  private heading = 0;
  private most = Infinity;

  constructor(private readonly rig: Rig, placing: HTMLElement) {
    this.brush = new Brush(rig, () => {
      this.strip.take(this.brush.tool, this.brush.radius);
      this.show(rig.look);
    });
    this.strip = new Strip({
      move: (disc, dragging) => rig.putDisc(disc, { dragging }),
      select: (id) => this.select(id),
      remove: (id) => this.remove(id),
      add: (azimuth, elevation) => this.addAt(azimuth, elevation),
      begin: (azimuth, elevation) => this.brush.begin(azimuth, elevation),
      go: (azimuth, elevation) => this.brush.go(azimuth, elevation),
      end: () => this.brush.end(),
    });
    this.sliders = this.makeSliders();
    this.tint.addEventListener("input", () => this.paint(fromHex(this.tint.value), true));
    this.tint.addEventListener("change", () => this.paint(fromHex(this.tint.value), false));
    const remove = button("Remove", () => this.selected !== null && this.remove(this.selected), { class: "quiet" });
    const { strength, size, softness, warmth } = this.sliders;
    const coloured = element("div", { class: "with-colour" }, warmth.row, this.tint);
    this.settings.append(placing, strength.row, size.row, softness.row, coloured);
    const buttons = element("div", { class: "buttons" }, this.add, remove);
    this.part = section("Lights in the sky", this.strip.box, this.brush.tools.row, this.brush.settings, this.settings, buttons);
    this.remover = remove;
  }

  /** At most this many lights. */
  allow(most: number): void {
    this.most = most;
  }

  showHeading(azimuth: number): void {
    this.heading = azimuth;
  }

  show(look: Look): void {
    const disc = look.discs.find(({ id }) => id === this.selected) ?? null;
    this.strip.show(look, this.selected);
    this.brush.show(look);
    this.settings.hidden = this.remover.hidden = disc === null || this.brush.tool !== "lights";
    this.add.disabled = look.discs.length >= this.most;
    if (disc === null) return;
    this.sliders.strength.show(Math.log2(Math.max(power(disc), 2 ** DIMMEST)));
    this.sliders.size.show(Math.log2(disc.radius_deg));
    this.sliders.softness.show(disc.softness);
    this.sliders.warmth.show(kelvinOf(disc.radiance));
    this.tint.value = toHex(disc.radiance);
  }

  /** A new light beside where the eye looks. */
  addAside(): void {
    this.addAt(wrapped(this.heading + ASIDE_DEG), NEW_ELEVATION);
  }

  /** Move the chosen light, or a new one, to where it comes from this direction. */
  shineFrom(azimuth_deg: number, elevation_deg: number): void {
    const disc = this.rig.look.discs.find(({ id }) => id === this.selected);
    if (disc === undefined) this.addAt(azimuth_deg, elevation_deg);
    else this.rig.putDisc({ ...disc, azimuth_deg: wrapped(azimuth_deg), elevation_deg });
  }

  private addAt(azimuth_deg: number, elevation_deg: number): void {
    if (this.rig.look.discs.length >= this.most) return;
    const id = `d${crypto.getRandomValues(new Uint32Array(1))[0]?.toString(16)}`;
    const shape = { id, azimuth_deg, elevation_deg, radius_deg: NEW_RADIUS_DEG, softness: NEW_SOFTNESS };
    this.selected = id;
    this.rig.putDisc(lit(shape, 1, [1, 1, 1]));
    this.strip.focus(id);
  }

  private remove(id: string): void {
    if (id === this.selected) this.selected = null;
    this.rig.removeDisc(id);
    this.add.focus();
  }

  private select(id: string): void {
    if (id === this.selected) return;
    this.selected = id;
    this.show(this.rig.look);
  }

  private change(values: (disc: DiscLight) => DiscLight, dragging: boolean): void {
    const disc = this.rig.look.discs.find(({ id }) => id === this.selected);
    if (disc !== undefined) this.rig.putDisc(values(disc), { dragging });
  }

  private paint(colour: Rgb, dragging: boolean): void {
    this.change((disc) => lit(disc, power(disc), colour), dragging);
  }

  private makeSliders() {
    return {
      strength: slider({
        name: "Strength", least: DIMMEST, most: BRIGHTEST, step: 0.1, rest: 0, kind: "centred", say: stops,
        set: (value, dragging) => this.change((disc) => lit(disc, 2 ** value, disc.radiance), dragging),
      }),
      size: slider({
        name: "Radius", least: Math.log2(SMALLEST_DEG), most: Math.log2(LARGEST_DEG), step: 0.02,
        rest: Math.log2(NEW_RADIUS_DEG), say: (value) => `${(2 ** value).toPrecision(2)}°`,
        set: (value, dragging) => {
          this.change((disc) => lit({ ...disc, radius_deg: 2 ** value }, power(disc), disc.radiance), dragging);
        },
      }),
      softness: slider({
        name: "Softness", least: 0, most: 1, step: 0.01, rest: NEW_SOFTNESS, say: (value) => value.toFixed(2),
        set: (value, dragging) => this.change((disc) => ({ ...disc, softness: value }), dragging),
      }),
      warmth: slider({
        name: "Warmth", least: WARMEST, most: COOLEST, step: 50, rest: NEUTRAL, kind: "kelvin",
        say: (kelvin) => `${Math.round(kelvin)} K`,
        set: (kelvin, dragging) => this.paint(ofKelvin(kelvin), dragging),
      }),
    };
  }
}

/** What a white surface that faces it reflects: radiance · solid angle / π. It stays when the size changes. */
function power({ radiance, radius_deg }: Pick<DiscLight, "radiance" | "radius_deg">): number {
  return luminance(radiance) * solidAngleOverPi(radius_deg);
}

function lit(shape: Omit<DiscLight, "radiance">, strength: number, colour: Readonly<Rgb>): DiscLight {
  return { ...shape, radiance: times(hue(colour), strength / solidAngleOverPi(shape.radius_deg)) };
}

function solidAngleOverPi(radius: number): number {
  return 4 * Math.sin((radius * Math.PI) / 360) ** 2;
}
