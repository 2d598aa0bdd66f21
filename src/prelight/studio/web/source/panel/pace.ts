// The corner: how long relighting takes, how many updates arrive, and more when it is opened.

import type { Pace } from "../messages";
import type { Metrics } from "../metrics";
import { element } from "./elements";

const EVERY_MS = 250;

export class PaceCorner {
  private readonly headline = element("summary", { title: "How long it takes to relight" });
  private readonly rows = element("dl", {});
  private pace: Pace | null = null;
  private waiting = "";

  constructor(host: HTMLElement, private readonly metrics: Metrics) {
    const details = element("details", { class: "pace" }, this.headline, this.rows);
    host.append(details);
    details.addEventListener("toggle", () => this.draw());
    window.setInterval(() => this.draw(), EVERY_MS);
    this.draw();
  }

  take(pace: Pace): void {
    const isNews = pace.relight_ms > 0 || this.pace === null; // the same light again takes no time
    this.pace = isNews ? pace : { ...pace, relight_ms: this.pace?.relight_ms ?? 0 };
  }

  /** What the studio is busy with; empty: nothing. */
  wait(reason: string): void {
    this.waiting = reason;
    this.draw();
  }

  private draw(): void {
    const { metrics, pace } = this;
    const perSecond = metrics.updatesPerSecond();
    const relight = `${(pace?.relight_ms ?? metrics.relightMs).toFixed(1)} ms`;
    const state = perSecond > 0 ? `${perSecond} updates/s` : metrics.exact ? "exact" : "at rest";
    const words = this.waiting || (metrics.updates === 0 ? "no light yet" : `${relight} · ${state}`);
    if (this.headline.textContent !== words) this.headline.textContent = words;
    this.headline.classList.toggle("busy", perSecond > 0 || this.waiting !== "");
    if (!(this.rows.parentElement as HTMLDetailsElement).open) return;
    const rows: [string, string][] = [
      ["Relighting", pace ? `${pace.relight_ms.toFixed(2)} ms, ${pace.kind}` : relight],
      ["Lights traced", String(pace?.strong_lights ?? 0)],
      ["Packing", `${(pace?.pack_ms ?? 0).toFixed(2)} ms`],
      ["A frame", `${((pace?.bytes ?? 0) / 1e6).toFixed(2)} MB`],
      ["Updates", `${perSecond} a second, ${metrics.updates.toLocaleString("en")} in all`],
      ["Script", `${metrics.medianScriptMs().toFixed(2)} ms an update`],
      ["Pictures", `${metrics.picturesPerSecond()} a second`],
    ];
    for (const { name, kind, how, ms } of pace?.layers ?? []) {
      rows.push([kind === "" ? name : `Layer ${name}`, `${ms.toFixed(2)} ms, ${how}`]);
    }
    this.rows.replaceChildren(...rows.flatMap(([term, value]) => [element("dt", {}, term), element("dd", {}, value)]));
  }
}
