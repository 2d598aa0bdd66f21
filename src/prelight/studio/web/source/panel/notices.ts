// What the page says unasked: toasts, the banner of a lost connection, the veil while a bake is opened.

import type { Standing } from "../link";
import { element } from "./elements";

const TOAST_MS = 7000;
const MOST_TOASTS = 3;

export class Notices {
  private readonly toasts = element("div", { class: "toasts", role: "alert" });
  private readonly tip = element("div", { class: "hint" });
  private readonly banner = element("div", { class: "banner" });
  private readonly veil = element("div", { class: "veil" });
  private readonly words = element("p", {});
  private readonly progress = element("progress", { max: "1", "aria-label": "Opening" });

  constructor(host: HTMLElement) {
    this.veil.append(element("div", { class: "mark", "aria-hidden": "true" }), this.words, this.progress);
    this.banner.hidden = true;
    this.tip.hidden = true;
    host.append(this.veil, this.banner, this.tip, this.toasts);
    this.opening("Opening the studio");
  }

  /** Something was refused or failed: a sentence, for a while. */
  toast(words: string): void {
    const toast = element("div", { class: "toast" }, words);
    this.toasts.append(toast);
    while (this.toasts.childElementCount > MOST_TOASTS) this.toasts.firstElementChild?.remove();
    window.setTimeout(() => toast.remove(), TOAST_MS);
  }

  /** What to do now, until it is done or for a while; null: nothing. */
  hint(words: string | null, forMs = 0): void {
    this.tip.hidden = words === null;
    this.tip.textContent = words ?? "";
    if (forMs > 0) window.setTimeout(() => this.tip.textContent === words && this.hint(null), forMs);
  }

  standing(standing: Standing): void {
    this.banner.hidden = standing.is === "open";
    this.banner.classList.toggle("ended", standing.is === "ended");
    if (standing.is === "lost") {
      this.banner.textContent = "The studio does not answer. The light stays as it is; trying again.";
    } else if (standing.is === "ended") {
      this.banner.textContent = standing.reason;
      this.words.textContent = "";
      this.progress.hidden = true;
    }
  }

  opening(words: string, share?: number): void {
    this.veil.hidden = false;
    this.words.textContent = words;
    if (share === undefined) this.progress.removeAttribute("value");
    else this.progress.value = share;
  }

  opened(): void {
    this.veil.hidden = true;
  }
}
