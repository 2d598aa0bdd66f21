// Looks: the light kept under names, shown again, or seen beside the one that is lit.

import type { Change } from "../messages";
import { MOST_LOOKS } from "../messages";
import type { Look } from "../rig";
import { BEFORE, type Mix, NOW, TRACED, ofLook } from "../sides";
import { button, choice, element, section, slider } from "./elements";

type Way = "wipe" | "fade";

interface Acts {
  ask: (change: Change) => void;
  /** Show two lights; null: what is set alone. */
  show: (mix: Mix | null) => void;
}

export class LooksPanel {
  readonly part: HTMLElement;
  /** What is seen on the right, if two are. */
  private right: string | null = null;
  private left: string = NOW;
  private readonly lefts = element("select", { "aria-label": "Left side" });
  private readonly rights = element("select", { "aria-label": "Right side" });
  private readonly before = button("Before / after", () => this.compare(BEFORE), {
    class: "quiet", title: "Beside how it was before the last step (B)", "aria-pressed": "false",
  });
  private hasTraced = false;
  private readonly list = element("ul", { class: "looks" });
  private readonly name = element("input", { type: "text", maxlength: "60", "aria-label": "Name of the look" });
  private readonly keep = button("Keep", () => this.save(), { class: "quiet", title: "Keep the light as it is" });
  private readonly comparing = element("div", { class: "comparing", role: "group", "aria-label": "Compare" });
  private readonly way: ReturnType<typeof choice<Way>>;
  private readonly share: ReturnType<typeof slider>;
  private chosen: Way = "wipe";
  private place = 0.5;
  private looks: readonly string[] = [];

  constructor(private readonly acts: Acts) {
    this.way = choice<Way>("How to compare", [["wipe", "Side by side"], ["fade", "Cross-fade"]], (way) => {
      this.chosen = way;
      this.mix();
    });
    this.share = slider({
      name: "Right side", least: 0, most: 100, step: 0.5, rest: 50, say: (value) => `${Math.round(value)} %`,
      set: (value) => this.moveTo(this.chosen === "wipe" ? 1 - value / 100 : value / 100),
    });
    const done = button("Done", () => this.stop(), { class: "quiet" });
    this.lefts.addEventListener("change", () => {
      this.left = this.lefts.value;
      this.mix();
    });
    this.rights.addEventListener("change", () => this.compare(this.rights.value));
    const sides = element("div", { class: "sides" }, this.lefts, this.rights);
    this.comparing.append(sides, this.way.row, this.share.row, element("div", { class: "buttons" }, done));
    this.name.addEventListener("keydown", (event) => event.key === "Enter" && this.save());
    this.name.placeholder = "Look 1";
    const naming = element("div", { class: "naming" }, this.name, this.keep);
    this.part = section("Looks", this.list, this.comparing, naming, element("div", { class: "buttons" }, this.before));
    this.comparing.hidden = true;
    this.way.show(this.chosen);
  }

  show({ looks, undo }: Look): void {
    const before = this.looks;
    this.looks = looks;
    this.name.placeholder = this.freeName();
    this.keep.disabled = looks.length >= MOST_LOOKS;
    this.before.disabled = undo === null && this.right !== BEFORE;
    if (looks.length === before.length && looks.every((look, i) => look === before[i])) return;
    if (!this.isThere(this.left)) this.left = NOW;
    if (this.right !== null && !this.isThere(this.right)) this.stop();
    this.showList();
    this.mix();
  }

  /** There is a picture by the path tracer, or none any more. */
  allowTraced(hasTraced: boolean): void {
    this.hasTraced = hasTraced;
    if (!hasTraced && this.right === TRACED) this.stop();
  }

  private isThere(side: string): boolean {
    if (side === TRACED) return this.hasTraced;
    return side === NOW || side === BEFORE || this.looks.some((look) => ofLook(look) === side);
  }

  /** Where the line between the two stands, or how much of the right there is, from 0 to 1. */
  moveTo(place: number): void {
    this.place = Math.min(1, Math.max(0, place));
    this.mix();
  }

  get wipe(): number | null {
    return this.right !== null && this.chosen === "wipe" ? this.place : null;
  }

  /** What is said of both sides. */
  get names(): [string, string] {
    return [this.nameOf(this.left), this.nameOf(this.right ?? NOW)];
  }

  private nameOf(side: string): string {
    const known: Record<string, string> = { [NOW]: "Now", [BEFORE]: "Before", [TRACED]: "Path tracer" };
    return known[side] ?? side.slice(ofLook("").length);
  }

  private save(): void {
    const name = this.name.value.trim() || this.freeName();
    this.name.value = "";
    this.acts.ask({ type: "SaveLook", name });
  }

  private freeName(): string {
    for (let n = 1; ; n++) if (!this.looks.includes(`Look ${n}`)) return `Look ${n}`;
  }

  private showList(): void {
    const rows = this.looks.map((name) => {
      const show = button(name, () => this.acts.ask({ type: "ShowLook", name }), { class: "look-name", title: "Light it so" });
      const compare = button("Compare", () => this.compare(ofLook(name)), {
        class: "quiet", "aria-pressed": String(this.right === ofLook(name)), "aria-label": `Compare with ${name}`,
      });
      const forget = button("×", () => this.acts.ask({ type: "RemoveLook", name }), {
        class: "forget", "aria-label": `Forget ${name}`, title: "Forget",
      });
      return element("li", {}, show, compare, forget);
    });
    this.list.replaceChildren(...rows);
  }

  /** Beside what is seen on the left; asked for again: no more. */
  compare(side: string): void {
    if (this.right === side && document.activeElement !== this.rights) {
      this.stop();
      return;
    }
    this.right = side;
    this.showList();
    this.mix();
  }

  /** Only what is lit, from now on. */
  stop(): void {
    if (this.right === null) return;
    this.right = null;
    this.left = NOW;
    this.showList();
    this.mix();
  }

  private mix(): void {
    const { left, right, place } = this;
    const isWipe = this.chosen === "wipe";
    this.comparing.hidden = right === null;
    this.before.setAttribute("aria-pressed", String(right === BEFORE));
    this.way.show(this.chosen);
    this.share.show(100 * (isWipe ? 1 - place : place));
    const sides = [NOW, BEFORE, ...(this.hasTraced ? [TRACED] : []), ...this.looks.map(ofLook)];
    for (const [made, chosen] of [[this.lefts, left], [this.rights, right ?? BEFORE]] as const) {
      const known = sides.filter((side) => side !== (made === this.lefts ? TRACED : NOW));
      made.replaceChildren(...known.map((side) => element("option", { value: side }, this.nameOf(side))));
      made.value = chosen;
    }
    if (right === null) this.acts.show(null);
    else this.acts.show({ left, right, share: isWipe ? 0 : place, wipe: isWipe ? place : null });
  }
}
