// The glass of portals, each by its name: clear, frosted or shut, its tint, a blind before it.

import { fromHex, toHex } from "../colour";
import type { PortalGlass, PortalView } from "../messages";
import type { Look, Rig } from "../rig";
import { button, choice, element, section, slider } from "./elements";

type Kind = PortalGlass["kind"];
type Triple = [number, number, number];

const KINDS: readonly (readonly [Kind, string])[] = [["clear", "Clear"], ["frosted", "Frosted"], ["shut", "Shut"]];
const WORDS = { clear: "", frosted: "frosted", shut: "shut" } as const;
const USUAL_FROST_DEG = 15;
const MOST_FROST_DEG = 60;

export class GlassPanel {
  readonly part: HTMLElement;
  private readonly list = element("ul", { class: "lamps portals" });
  private readonly settings = element("div", { class: "settings" });
  private readonly tint = element("input", { type: "color", "aria-label": "Tint of the glass", title: "Tint" });
  private readonly own = button("As built", () => this.change({ tint: null }, false), { class: "quiet" });
  private readonly kind: ReturnType<typeof choice<Kind>>;
  private readonly frost: ReturnType<typeof slider>;
  private readonly blind: ReturnType<typeof slider>;
  private readonly tinting: HTMLElement;
  private portals: readonly PortalView[] = [];
  private selected: string | null = null;

  constructor(
    private readonly rig: Rig,
    private readonly see: (through: [number, number, number, number][]) => void,
  ) {
    this.kind = choice("Glass", KINDS, (kind) => this.change({ kind }, false));
    this.frost = slider({
      name: "Frost", least: 0, most: MOST_FROST_DEG, step: 1, rest: USUAL_FROST_DEG, say: (value) => `${Math.round(value)}°`,
      set: (frost_deg, dragging) => this.change({ frost_deg }, dragging),
    });
    this.blind = slider({
      name: "Blind", least: 0, most: 100, step: 1, rest: 0, say: (value) => `${Math.round(value)} %`,
      set: (value, dragging) => this.change({ blind: value / 100 }, dragging),
    });
    this.tint.addEventListener("input", () => this.change({ tint: paler(this.tint.value) }, true));
    this.tint.addEventListener("change", () => this.change({ tint: paler(this.tint.value) }, false));
    this.tinting = element("div", { class: "field" }, element("span", {}, "Tint"));
    this.tinting.append(element("div", { class: "with-colour" }, this.tint, this.own));
    this.settings.append(this.kind.row, this.blind.row, this.frost.row, this.tinting);
    this.part = section("Glass", this.list, this.settings);
  }

  /** The portals of the bake, by name. */
  offer(portals: readonly PortalView[]): void {
    this.portals = portals;
    this.selected = portals[0]?.name ?? null;
    this.part.hidden = portals.length === 0;
    const rows = portals.map(({ name }) => {
      const made = button(name, () => this.select(name), { class: "lamp-name" });
      return element("li", {}, element("span", { class: "pane", "aria-hidden": "true" }), made, element("span", { class: "said" }));
    });
    this.list.replaceChildren(...rows);
    this.show(this.rig.look);
  }

  show(look: Look): void {
    if (this.portals.length > 0) this.see(this.portals.map((portal) => through(portal, this.glass(portal.name, look))));
    [...this.list.children].forEach((row, i) => {
      const portal = this.portals[i];
      if (portal === undefined) return;
      const glass = this.glass(portal.name, look);
      const [pane, name, said] = row.children as unknown as [HTMLElement, HTMLElement, HTMLElement];
      row.classList.toggle("selected", glass.portal === this.selected);
      name.setAttribute("aria-pressed", String(glass.portal === this.selected));
      pane.className = `pane ${glass.kind}`;
      pane.style.setProperty("--light", colourOf(glass.tint ?? portal.tint));
      const blind = glass.blind > 0 && glass.kind !== "shut" ? `blind ${Math.round(100 * glass.blind)} %` : "";
      said.textContent = [WORDS[glass.kind], blind].filter((word) => word !== "").join(", ");
    });
    this.settings.hidden = this.selected === null;
    if (this.selected === null) return;
    const glass = this.glass(this.selected, look);
    this.kind.show(glass.kind);
    this.frost.show(glass.frost_deg);
    this.blind.show(100 * glass.blind);
    const built = this.portals.find(({ name }) => name === this.selected)?.tint;
    this.tint.value = colourOf(glass.tint ?? built ?? [1, 1, 1]);
    this.own.disabled = glass.tint === null;
    this.frost.row.hidden = glass.kind !== "frosted";
    this.blind.row.hidden = this.tinting.hidden = glass.kind === "shut";
  }

  private select(name: string): void {
    this.selected = name;
    this.show(this.rig.look);
  }

  private glass(portal: string, { glass }: Look): PortalGlass {
    const known = glass.find((one) => one.portal === portal);
    return known ?? { portal, kind: "clear", tint: null, frost_deg: USUAL_FROST_DEG, blind: 0 };
  }

  private change(values: Partial<PortalGlass>, dragging: boolean): void {
    if (this.selected === null) return;
    this.rig.putGlass({ ...this.glass(this.selected, this.rig.look), ...values }, { dragging });
  }
}

/** What glass of a picked colour lets through: its brightest channel as the picker has it. */
function paler(hex: string): Triple {
  const most = Math.max(...[1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16) || 0)) / 255;
  const level = most <= 0.04045 ? most / 12.92 : ((most + 0.055) / 1.055) ** 2.4;
  const colour = fromHex(hex);
  const scale = level / Math.max(...colour, 1e-9);
  return colour.map((part) => Math.min(1, part * scale)) as Triple;
}

function colourOf(tint: Readonly<Triple>): string {
  const most = Math.max(...tint);
  if (most <= 0) return "#000000";
  const level = most <= 0.0031308 ? 12.92 * most : 1.055 * most ** (1 / 2.4) - 0.055;
  const bytes = [1, 3, 5].map((at) => Math.round(Number.parseInt(toHex(tint).slice(at, at + 2), 16) * level));
  return `#${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

/** What is seen through it: its colour, less what a blind covers; nothing where it is shut. Last: 1 where frosted. */
function through(portal: PortalView, glass: PortalGlass): [number, number, number, number] {
  const open = glass.kind === "shut" ? 0 : 1 - glass.blind;
  const [red, green, blue] = (glass.tint ?? portal.tint).map((part) => part * open) as Triple;
  return [red, green, blue, glass.kind === "frosted" ? 1 : 0];
}
