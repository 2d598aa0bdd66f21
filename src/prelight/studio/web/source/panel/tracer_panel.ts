// The path tracer: a picture of what is seen, made in the background, to hold beside the page's.

import type { Traced } from "../messages";
import { button, element, section } from "./elements";

export class TracerPanel {
  readonly part: HTMLElement;
  private readonly starter: HTMLButtonElement;
  private readonly stopper: HTMLButtonElement;
  private readonly progress = element("progress", { max: "1", value: "0", "aria-label": "Path tracing" });
  private readonly words = element("p", { class: "told", role: "status" });

  constructor(acts: { start: () => void; stop: () => void }) {
    this.starter = button("Trace this view", () => {
      this.tell("Beginning");
      this.running(true);
      acts.start();
    }, { class: "quiet", title: "Mitsuba's path tracer, with the scene's own materials" });
    this.stopper = button("Stop", () => acts.stop(), { class: "quiet" });
    const buttons = element("div", { class: "buttons" }, this.starter, this.stopper);
    this.part = section("Path tracer", this.words, this.progress, buttons);
    this.running(false);
    this.tell("The light that is set, as Mitsuba sees it; the line between the two can be dragged.");
  }

  /** Why there is none; null: there is one. */
  allow(missing: string | null): void {
    this.starter.disabled = missing !== null;
    if (missing !== null) this.tell(missing);
  }

  take({ share, samples, seconds, stopped }: Traced): void {
    this.progress.value = share;
    const sofar = `${samples} samples a pixel in ${seconds.toFixed(1)} s`;
    this.running(stopped === null && share < 1);
    if (stopped !== null && samples === 0) this.tell(stopped);
    else this.tell(stopped === null ? sofar : `${sofar}, ${stopped}`);
  }

  /** The connection was lost, or the bake is another. */
  reset(): void {
    this.running(false);
  }

  private running(isRunning: boolean): void {
    this.progress.hidden = this.stopper.hidden = !isRunning;
    this.starter.hidden = isRunning;
  }

  private tell(words: string): void {
    this.words.textContent = words;
  }
}
