// Lamps with a place in the scene: a list of them, and all that can be said of the one that is chosen.

import { COOLEST, NEUTRAL, WARMEST } from "../colour";
import { fromHex, hue, kelvinOf, ofKelvin, toHex } from "../colour";
import type { LampLight, SteeredPlace } from "../messages";
import type { Look, Rig } from "../rig";
import { type Placement, distanceOf } from "../view/placing";
import { amount, button, choice, element, numberField, numbers, section, slider } from "./elements";

type Kind = LampLight["kind"];
type Triple = [number, number, number];

const KINDS: readonly (readonly [Kind, string])[] = [["lamp", "Lamp"], ["spot", "Spot"], ["panel", "Panel"]];
const UNITS = { lamp: "lm", spot: "cd", panel: "lm" } as const;
const FARTHEST = 1e5;
const STRONGEST = 1e9;
const LARGEST_LOG = 0; // 1 m
const SMALLEST_LOG = -3; // 1 mm

/** Where a new lamp goes, and what it shines on with how much light: metres and W/sr. */
export interface Spot {
  position: Triple;
  target: Triple;
  intensity: number;
  side: number;
  /** The radiance that is shown as white. */
  white: number;
}

export class LampsPanel {
  readonly part: HTMLElement;
  selected: string | null = null;
  private readonly list = element("ul", { class: "lamps" });
  private readonly settings = element("div", { class: "settings" });
  private readonly tint = element("input", { type: "color", "aria-label": "Colour of the lamp", title: "Colour" });
  private readonly name = element("input", { type: "text", maxlength: "60", "aria-label": "Name of the lamp" });
  private readonly controls;
  private readonly adders: HTMLButtonElement[];
  private readonly free: HTMLElement;
  private readonly layered = element("div", { class: "buttons layered" });
  private most = Infinity;

  constructor(
    private readonly rig: Rig,
    private readonly act: { place: () => Spot; chosen: () => void },
    private readonly placing: HTMLElement,
  ) {
    this.controls = this.makeControls();
    this.tint.addEventListener("input", () => this.paint(fromHex(this.tint.value), true));
    this.tint.addEventListener("change", () => this.paint(fromHex(this.tint.value), false));
    this.name.addEventListener("change", () => {
      const name = this.name.value.trim();
      if (name !== "") this.change((lamp) => ({ ...lamp, name }), false);
      else this.show(this.rig.look);
    });
    const { kind, strength, dim, warmth, radius, beam, size, position, target } = this.controls;
    const coloured = element("div", { class: "with-colour" }, warmth.row, this.tint);
    const remove = button("Remove", () => this.remove(), { class: "quiet" });
    const naming = element("div", { class: "naming" }, this.name, remove);
    this.settings.append(
      naming, kind.row, placing, dim.row, strength.row, coloured, radius.row, beam.row, size.row, position.row, target.row,
    );
    this.adders = KINDS.map(([value, label]) => button(`Add ${label.toLowerCase()}`, () => this.add(value), { class: "quiet" }));
    this.free = element("div", { class: "buttons" }, ...this.adders);
    this.part = section("Lamps", this.list, this.settings, this.free, this.layered);
  }

  /** Where lamps may stand: anywhere, and in steerable layers. */
  offer(isFree: boolean, places: readonly SteeredPlace[]): void {

    this.free.hidden = !isFree;
    this.layered.hidden = places.length === 0;
    const adders = places.map((place) => button(`Add to ${place.layer}`, () => this.addTo(place), { class: "quiet" }));
    this.layered.replaceChildren(...adders);
  }

  /** At most this many lamps. */
  allow(most: number): void {
    this.most = most;
  }

  select(id: string | null): void {
    if (id === this.selected) return;
    this.selected = id;
    this.show(this.rig.look);
    this.act.chosen();
  }

  show({ lamps }: Look): void {
    const lamp = lamps.find(({ id }) => id === this.selected) ?? null; // a late echo may not have it yet
    this.showList(lamps);
    this.settings.hidden = lamp === null;
    for (const made of this.adders) made.disabled = lamps.length >= this.most;
    if (lamp === null) return;
    const { kind, strength, dim, warmth, radius, beam, size, position, target } = this.controls;
    if (document.activeElement !== this.name) this.name.value = lamp.name;
    kind.show(lamp.kind);
    strength.show(lamp.strength);
    const unit = strength.row.querySelector(".unit");
    if (unit !== null) unit.textContent = unitOf(lamp);
    strength.row.querySelector("input")?.setAttribute("aria-label", `At full ${unitOf(lamp)}`);
    dim.show(100 * lamp.dim);
    warmth.show(kelvinOf(lamp.color));
    this.tint.value = toHex(lamp.color);
    radius.show(Math.log10(Math.max(lamp.radius, 10 ** SMALLEST_LOG)));
    beam.show(lamp.beam_deg);
    size.show(lamp.size);
    position.show(lamp.position);
    target.show(lamp.target);
    const isLayered = lamp.layer !== null;
    kind.row.hidden = this.placing.hidden = isLayered;
    radius.row.hidden = lamp.kind === "panel" || isLayered;
    beam.row.hidden = lamp.kind !== "spot";
    size.row.hidden = lamp.kind !== "panel";
    position.row.hidden = isLayered && lamp.kind === "spot";
    target.row.hidden = lamp.kind === "lamp" || (isLayered && lamp.kind === "panel");
    this.name.title = isLayered ? `Of the layer ${lamp.layer ?? ""}; place and size are parts of its panel` : "";
  }

  /** Put up a lamp where it is seen, as bright as suits the exposure. */
  add(kind: Kind): void {
    const { lamps } = this.rig.look;
    if (lamps.length >= this.most) return;
    const { position, target, intensity, side } = this.act.place();
    const id = newId();
    const label = KINDS.find(([value]) => value === kind)?.[1] ?? "Lamp";
    const numbered = lamps.filter(({ name }) => name.startsWith(label)).length + 1;
    const all = { lamp: 4 * Math.PI, spot: 1, panel: Math.PI }[kind];
    const strength = Number((683 * all * intensity).toPrecision(2));
    this.selected = id;
    this.rig.putLamp({
      id, name: `${label} ${numbered}`, kind, on: true, position, target, strength, dim: 1, color: [1, 1, 1],
      radius: Number((side / 40).toPrecision(1)), beam_deg: 40, size: [side / 4, side / 4], layer: null,
    });
    this.act.chosen();
    this.part.scrollIntoView({ block: "start" });
  }

  /** A light of a steerable layer: a spot aimed at what is looked at, or half of a panel. */
  private addTo({ layer, kind, origin }: SteeredPlace): void {
    const { lamps } = this.rig.look;
    if (lamps.length >= this.most) return;
    const { target, white } = this.act.place();
    const isSpot = kind === "spot" || kind === "sky";
    const far = Math.hypot(origin[0] - target[0], origin[1] - target[1], origin[2] - target[2]);
    const numbered = lamps.filter((lamp) => lamp.layer === layer).length + 1;
    const strength = kind === "spot" ? 683 * Math.PI * far * far * white : 683 * 10 * white;
    const id = newId();
    this.selected = id;
    this.rig.putLamp({
      id, name: `${layer} ${numbered}`.slice(0, 60), kind: isSpot ? "spot" : "panel", on: true,
      position: isSpot ? [...origin] : [0.5, 0.5, kind === "box" ? 0.5 : 0], target: [...target],
      strength: Number(strength.toPrecision(2)), dim: 1, color: [1, 1, 1], radius: 0, beam_deg: 60, size: [0.6, 0.6], layer,
    });
    this.act.chosen();
  }

  /** Move the chosen lamp to where its light has the effect that was clicked. */
  effect(placement: Placement): void {
    const { point, toward } = placement;
    this.change((lamp) => {
      const from = lamp.kind === "lamp" ? point.toArray() : lamp.target;
      const known = Math.hypot(...lamp.position.map((x, i) => x - (from[i] ?? 0))) || 1;
      const place = point.clone().addScaledVector(toward, distanceOf(placement, known));
      const round = (values: number[]) => values.map((value) => Math.round(value * 1e4) / 1e4) as Triple;
      return { ...lamp, position: round(place.toArray()), target: round(point.toArray()) };
    }, false);
  }

  /** Whether the chosen lamp stands free, so that a click can place it; one is put up where there is none. */
  chooseOne(): boolean {
    const { lamps } = this.rig.look;
    const chosen = lamps.find(({ id }) => id === this.selected) ?? lamps.find(({ layer }) => layer === null);
    if (chosen === undefined) this.add("spot");
    else this.select(chosen.id);
    return chosen === undefined || chosen.layer === null;
  }

  /** Move a lamp, or what it is aimed at. */
  move(id: string, what: "position" | "target", place: Triple, dragging: boolean): void {
    const lamp = this.rig.look.lamps.find((one) => one.id === id);
    if (lamp === undefined) return;
    const rounded = place.map((value) => Math.round(value * 1000) / 1000) as Triple;
    const aimed = { ...lamp, [what]: rounded };
    if (lamp.kind !== "lamp" && same(aimed.position, aimed.target)) return; // it would point nowhere
    this.rig.putLamp(aimed, { dragging });
  }

  remove(id = this.selected): void {
    if (id === null) return;
    if (id === this.selected) this.selected = null;
    this.rig.removeLamp(id);
    this.adders[0]?.focus();
  }

  private showList(lamps: readonly LampLight[]): void {
    const rows = [...this.list.children] as HTMLElement[];
    while (rows.length > lamps.length) rows.pop()?.remove();
    lamps.forEach((lamp, i) => {
      const row = rows[i] ?? this.newRow();
      row.dataset["id"] = lamp.id;
      row.classList.toggle("selected", lamp.id === this.selected);
      const [toggle, name, said] = row.children as unknown as [HTMLElement, HTMLElement, HTMLElement];
      toggle.setAttribute("aria-checked", String(lamp.on));
      toggle.setAttribute("aria-label", `${lamp.name} is lit`);
      toggle.style.setProperty("--light", toHex(lamp.color));
      name.textContent = lamp.name;
      name.setAttribute("aria-pressed", String(lamp.id === this.selected));
      said.textContent = lamp.on ? `${amount(lamp.strength * lamp.dim)} ${unitOf(lamp)}` : "off";
    });
  }

  private newRow(): HTMLElement {
    const row = element("li", {});
    const lamp = () => this.rig.look.lamps.find(({ id }) => id === row.dataset["id"]);
    const toggle = button("", () => {
      const found = lamp();
      if (found !== undefined) this.rig.putLamp({ ...found, on: !found.on });
    }, { class: "switch", role: "switch" });
    const name = button("", () => {
      const id = row.dataset["id"] ?? null;
      this.select(id === this.selected ? null : id);
    }, { class: "lamp-name" });
    row.append(toggle, name, element("span", { class: "said" }));
    this.list.append(row);
    return row;
  }

  private change(values: (lamp: LampLight) => LampLight, dragging: boolean): void {
    const lamp = this.rig.look.lamps.find(({ id }) => id === this.selected);
    if (lamp !== undefined) this.rig.putLamp(values(lamp), { dragging });
  }

  private paint(colour: Readonly<Triple>, dragging: boolean): void {
    this.change((lamp) => ({ ...lamp, color: hue(colour) }), dragging);
  }

  private makeControls() {
    const metres = { least: -FARTHEST, most: FARTHEST, step: 0.1, unit: "", digits: 3 };
    return {
      kind: choice("Kind of lamp", KINDS, (kind) => this.change((lamp) => converted(lamp, kind), false)),
      strength: numberField({
        name: "At full", least: 0, most: STRONGEST, step: 50, unit: "lm", digits: 1,
        set: (strength) => this.change((lamp) => ({ ...lamp, strength }), false),
      }),
      dim: slider({
        name: "Dimmer", least: 0, most: 100, step: 1, rest: 100, say: (value) => `${Math.round(value)} %`,
        set: (value, dragging) => this.change((lamp) => ({ ...lamp, dim: value / 100 }), dragging),
      }),
      warmth: slider({
        name: "Warmth", least: WARMEST, most: COOLEST, step: 50, rest: NEUTRAL, kind: "kelvin",
        say: (kelvin) => `${Math.round(kelvin)} K`,
        set: (kelvin, dragging) => this.paint(ofKelvin(kelvin), dragging),
      }),
      radius: slider({
        name: "Radius", least: SMALLEST_LOG, most: LARGEST_LOG, step: 0.02, rest: -1.3, say: (log) => length(10 ** log),
        set: (log, dragging) => this.change((lamp) => ({ ...lamp, radius: 10 ** log }), dragging),
      }),
      beam: slider({
        name: "Beam", least: 5, most: 120, step: 1, rest: 40, say: (value) => `${Math.round(value)}°`,
        set: (value, dragging) => this.change((lamp) => ({ ...lamp, beam_deg: value }), dragging),
      }),
      size: numbers("Size, m", ["w", "h"], { ...metres, least: 0.01, most: 1000 }, ([w = 1, h = 1]) =>
        this.change((lamp) => ({ ...lamp, size: [w, h] }), false),
      ),
      position: numbers("Place, m", ["x", "y", "z"], metres, (place) => this.place("position", place)),
      target: numbers("Aim, m", ["x", "y", "z"], metres, (place) => this.place("target", place)),
    };
  }

  private place(what: "position" | "target", place: number[]): void {
    if (this.selected !== null) this.move(this.selected, what, place as Triple, false);
  }
}

/** In order of time. */
function newId(): string {
  return `l${Date.now().toString(36)}${crypto.getRandomValues(new Uint16Array(1))[0]?.toString(16)}`;
}

function unitOf(lamp: LampLight): string {
  return lamp.layer !== null && lamp.kind === "panel" ? "cd/m²" : UNITS[lamp.kind];
}

/** The same light in another shape: as strong, seen from where it is aimed. */
function converted(lamp: LampLight, kind: Kind): LampLight {
  const spread = { lamp: 4 * Math.PI, spot: 1, panel: Math.PI };
  return { ...lamp, kind, strength: Number(((lamp.strength * spread[kind]) / spread[lamp.kind]).toPrecision(3)) };
}

function same(one: Readonly<Triple>, other: Readonly<Triple>): boolean {
  return Math.hypot(one[0] - other[0], one[1] - other[1], one[2] - other[2]) < 1e-3;
}

function length(metres: number): string {
  return metres < 0.995 ? `${Number((100 * metres).toPrecision(2))} cm` : `${metres.toPrecision(2)} m`;
}
