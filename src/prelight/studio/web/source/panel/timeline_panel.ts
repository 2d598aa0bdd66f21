// The timeline: keyframes of looks, scrubbed, played, filmed, and saved as a rig whose lamps fade.

import type { LookKey } from "../messages";
import { MOST_KEYS } from "../messages";
import type { Look, Rig } from "../rig";
import { button, element, numberField, section, slider } from "./elements";

const APART = 2; // seconds, of a new key after the last
const LONGEST = 3600;

interface Acts {
  /** Show the light of a moment; null: what is set. */
  seek: (seconds: number | null) => void;
  /** Film what is played, until `stop` is called. */
  film: () => (() => void) | null;
  save: () => void;
}

export class TimelinePanel {
  readonly part: HTMLElement;
  private readonly list = element("ol", { class: "keys" });
  private readonly time: ReturnType<typeof slider>;
  private readonly input: HTMLInputElement | null;
  private readonly player = button("Play", () => this.toggle(), { class: "quiet", title: "Play (T)" });
  private readonly live = button("Live", () => this.leave(), { class: "quiet", title: "Back to the light that is set" });
  private readonly adder = button("Add key", () => this.add(), { class: "quiet", title: "A look at a time of its own" });
  private readonly buttons: HTMLElement;
  private readonly moving: HTMLElement;
  private keys: readonly LookKey[] = [];
  private looks: readonly string[] = [];
  private drawn = "";
  private began: number | null = null;
  private at = 0;
  private filmed: (() => void) | null = null;

  constructor(private readonly rig: Rig, private readonly acts: Acts) {
    this.time = slider({
      name: "Time", least: 0, most: 1, step: 0.01, rest: 0, say: (value) => `${value.toFixed(1)} s`,
      set: (value) => {
        this.pause();
        this.seek(value);
      },
    });
    this.input = this.time.row.querySelector("input");
    this.moving = element("div", { class: "with-button" }, this.time.row, this.player, this.live);
    const film = button("Film", () => this.film(), { class: "quiet", title: "A film of it as it is seen here" });
    const save = button("Save as rig", () => acts.save(), { class: "quiet", title: "A rig whose lamps fade, for prelight animate" });
    this.buttons = element("div", { class: "buttons" }, this.adder, film, save);
    this.part = section("Timeline", this.list, this.moving, this.buttons);
    this.live.hidden = true;
  }

  show({ timeline, looks }: Look): void {
    this.part.hidden = looks.length === 0;
    const isOther = JSON.stringify(timeline) !== JSON.stringify(this.keys);
    [this.keys, this.looks] = [timeline, looks];
    const drawn = JSON.stringify([timeline, looks]);
    if (drawn !== this.drawn && !this.list.contains(document.activeElement)) {
      this.drawn = drawn;
      this.list.replaceChildren(...timeline.map((key, i) => this.row(key, i)));
    }
    this.moving.hidden = timeline.length < 2 && this.live.hidden;
    for (const made of [...this.buttons.children].slice(1)) (made as HTMLElement).hidden = timeline.length < 2;
    this.adder.disabled = timeline.length >= MOST_KEYS;
    if (this.input !== null) this.input.max = String(this.duration || 1);
    this.time.show(Math.min(this.at, this.duration));
    if (isOther && !this.live.hidden && this.began === null) this.seek(Math.min(this.at, this.duration));
  }

  get duration(): number {
    return this.keys.at(-1)?.at ?? 0;
  }

  /** Play from where it stands, or from the beginning; or pause. */
  toggle(): void {
    if (this.began !== null) {
      this.pause();
      return;
    }
    if (this.keys.length < 2) return;
    this.began = performance.now() - 1000 * (this.at < this.duration - 0.01 ? this.at : 0);
    this.player.textContent = "Pause";
    this.tick();
  }

  /** Back to the light that is set. */
  leave(): void {
    this.pause();
    if (this.live.hidden) return;
    this.live.hidden = true;
    this.acts.seek(null);
  }

  private pause(): void {
    this.began = null;
    this.player.textContent = "Play";
    this.filmed?.();
    this.filmed = null;
  }

  private seek(seconds: number): void {
    this.at = seconds;
    this.live.hidden = false;
    this.time.show(seconds);
    this.acts.seek(seconds);
  }

  private tick(): void {
    if (this.began === null) return;
    const seconds = Math.min((performance.now() - this.began) / 1000, this.duration);
    this.seek(seconds);
    if (seconds >= this.duration) this.pause();
    else requestAnimationFrame(() => this.tick());
  }

  private film(): void {
    this.pause();
    this.seek(0);
    this.filmed = this.acts.film();
    if (this.filmed !== null) this.toggle();
  }

  private add(): void {
    const look = this.looks.find((name) => !this.keys.some((key) => key.look === name)) ?? this.looks[0];
    if (look === undefined) return;
    const last = this.keys.at(-1);
    this.change([...this.keys, { at: last === undefined ? 0 : Math.min(last.at + APART, LONGEST), look }]);
  }

  private change(keys: readonly LookKey[]): void {
    const sorted = [...keys].sort((a, b) => a.at - b.at);
    this.rig.setTimeline(sorted.filter((key, i) => i === 0 || key.at > (sorted[i - 1]?.at ?? -1)));
  }

  private row(key: LookKey, i: number): HTMLElement {
    const others = this.keys.filter((_, k) => k !== i);
    const at = numberField({
      name: `Key ${i + 1} at`, least: 0, most: LONGEST, step: 0.5, unit: "s", digits: 2,
      set: (seconds) => {
        (document.activeElement as HTMLElement | null)?.blur();
        this.change([...others, { ...key, at: seconds }]);
      },
    });
    at.show(key.at);
    const words = at.row.firstElementChild;
    if (words) words.textContent = "";
    const options = this.looks.map((name) => element("option", { value: name }, name));
    const look = element("select", { "aria-label": `Look of key ${i + 1}` }, ...options);
    look.value = key.look;
    look.addEventListener("change", () => {
      look.blur();
      this.change([...others, { ...key, look: look.value }]);
    });
    const forget = button("×", () => {
      forget.blur();
      this.change(others);
    }, { class: "forget", "aria-label": `Remove key ${i + 1}`, title: "Remove" });
    return element("li", {}, at.row, look, forget);
  }
}
