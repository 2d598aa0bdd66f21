// Looks: the light kept under names, shown again, or seen beside the one that is lit.

import type { Change } from "../messages";
import { MOST_LOOKS } from "../messages";
import type { Look } from "../rig";
import { button, choice, element, section, slider } from "./elements";

type Way = "wipe" | "fade";

interface Acts {
  ask: (change: Change) => void;
  /** Fetch a look to compare with; null: no more. */
  compare: (look: string | null) => void;
  mix: (mix: { share: number; wipe: number | null }) => void;
}

export class LooksPanel {
  readonly part: HTMLElement;
  /** The look that is compared with. */
  compared: string | null = null;
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
      name: "Other look", least: 0, most: 100, step: 0.5, rest: 50, say: (value) => `${Math.round(value)} %`,
      set: (value) => this.moveTo(this.chosen === "wipe" ? 1 - value / 100 : value / 100),
    });
    const done = button("Done", () => this.stop(), { class: "quiet" });
    this.comparing.append(this.way.row, this.share.row, element("div", { class: "buttons" }, done));
    this.name.addEventListener("keydown", (event) => event.key === "Enter" && this.save());
    this.name.placeholder = "Look 1";
    const naming = element("div", { class: "naming" }, this.name, this.keep);
    this.part = section("Looks", this.list, this.comparing, naming);
    this.comparing.hidden = true;
    this.way.show(this.chosen);
  }

  show({ looks }: Look): void {
    if (this.compared !== null && !looks.includes(this.compared)) this.stop();
    const before = this.looks;
    this.looks = looks;
    this.name.placeholder = this.freeName();
    this.keep.disabled = looks.length >= MOST_LOOKS;
    if (looks.length !== before.length || looks.some((look, i) => look !== before[i])) this.showList();
  }

  /** Where the line between the two stands, or how much of the other there is, from 0 to 1. */
  moveTo(place: number): void {
    this.place = Math.min(1, Math.max(0, place));
    this.mix();
  }

  get wipe(): number | null {
    return this.compared !== null && this.chosen === "wipe" ? this.place : null;
  }

  private save(): void {
    const name = this.name.value.trim() || this.freeName();
    this.name.value = "";
    this.acts.ask({ type: "SaveLook", name });
    if (this.compared === name) this.acts.compare(name);
  }

  private freeName(): string {
    for (let n = 1; ; n++) if (!this.looks.includes(`Look ${n}`)) return `Look ${n}`;
  }

  private showList(): void {
    const rows = this.looks.map((name) => {
      const show = button(name, () => this.acts.ask({ type: "ShowLook", name }), { class: "look-name", title: "Light it so" });
      const compare = button("Compare", () => this.toggle(name), {
        class: "quiet", "aria-pressed": String(this.compared === name), "aria-label": `Compare with ${name}`,
      });
      const forget = button("×", () => this.acts.ask({ type: "RemoveLook", name }), {
        class: "forget", "aria-label": `Forget ${name}`, title: "Forget",
      });
      return element("li", {}, show, compare, forget);
    });
    this.list.replaceChildren(...rows);
  }

  private toggle(name: string): void {
    if (this.compared === name) {
      this.stop();
      return;
    }
    this.compared = name;
    this.acts.compare(name);
    this.showList();
    this.showComparing();
  }

  /** Only what is lit, from now on. */
  stop(): void {
    if (this.compared === null) return;
    this.compared = null;
    this.acts.compare(null);
    this.showList();
    this.showComparing();
  }

  private showComparing(): void {
    this.comparing.hidden = this.compared === null;
    this.mix();
  }

  private mix(): void {
    const isWipe = this.chosen === "wipe";
    this.way.show(this.chosen);
    this.share.show(100 * (isWipe ? 1 - this.place : this.place));
    if (this.compared === null) this.acts.mix({ share: 0, wipe: null });
    else this.acts.mix(isWipe ? { share: 0, wipe: this.place } : { share: this.place, wipe: null });
  }
}
