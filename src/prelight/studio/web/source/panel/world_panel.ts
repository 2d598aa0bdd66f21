// What is outside the windows: one of the worlds that the studio was started with, and its own time, played or by hand.

import type { WorldView } from "../messages";
import type { Look, Rig } from "../rig";
import { button, element, section, slider } from "./elements";

const NOTHING = "";

export class WorldPanel {
  readonly part: HTMLElement;
  private readonly choice = element("select", { "aria-label": "World outside" });
  private readonly player = button("Play", () => this.toggle(), { class: "quiet" });
  private readonly time: ReturnType<typeof slider>;
  private readonly playing: HTMLElement;
  private readonly input: HTMLInputElement | null;
  private worlds: readonly WorldView[] = [];
  private began: number | null = null;

  constructor(private readonly rig: Rig) {
    this.choice.addEventListener("change", () => {
      this.stop();
      this.rig.setWorld(this.choice.value || null, 0);
    });
    this.time = slider({
      name: "Time", least: 0, most: 1, step: 0.01, rest: 0, say: (value) => `${value.toFixed(1)} s`,
      set: (value, dragging) => {
        this.stop();
        this.rig.setWorld(this.rig.look.world, value, { dragging });
      },
    });
    this.input = this.time.row.querySelector("input");
    this.playing = element("div", { class: "with-button" }, this.time.row, this.player);
    const field = element("label", { class: "field" }, element("span", {}, "World"), this.choice);
    this.part = section("Outside", field, this.playing);
  }

  /** The worlds there are. */
  offer(worlds: readonly WorldView[]): void {
    this.worlds = worlds;
    this.part.hidden = worlds.length === 0;
    const options = worlds.map(({ id, title }) => element("option", { value: id }, title));
    this.choice.replaceChildren(element("option", { value: NOTHING }, "only the sky"), ...options);
    this.show(this.rig.look);
  }

  show({ world, seconds }: Look): void {
    const known = this.worlds.find(({ id }) => id === world);
    this.choice.value = known?.id ?? NOTHING;
    this.playing.hidden = known === undefined || known.duration <= 0;
    if (this.playing.hidden) this.stop();
    if (this.input !== null) this.input.max = String(known?.duration ?? 1);
    this.time.show(seconds);
  }

  toggle(): void {
    if (this.began !== null) {
      this.stop();
      return;
    }
    const { world, seconds } = this.rig.look;
    const duration = this.worlds.find(({ id }) => id === world)?.duration ?? 0;
    if (duration <= 0) return;
    this.began = performance.now() - 1000 * (seconds < duration - 0.01 ? seconds : 0);
    this.player.textContent = "Pause";
    this.tick(duration);
  }

  /** Every picture of the browser asks for the moment that it is; older ones that wait are never lit. */
  private tick(duration: number): void {
    const { began } = this;
    if (began === null) return;
    const seconds = ((performance.now() - began) / 1000) % duration;
    this.rig.setWorld(this.rig.look.world, Number(seconds.toFixed(3)), { dragging: true });
    requestAnimationFrame(() => this.tick(duration));
  }

  private stop(): void {
    if (this.began === null) return;
    this.began = null;
    this.player.textContent = "Play";
  }
}
