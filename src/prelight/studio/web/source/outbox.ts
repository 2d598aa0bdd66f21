// What waits to be sent: at most one message of a key for each animation frame, the newest.

import type { RemoveDisc, SetDisc, SetEnvironment } from "./messages";

export type Change = SetEnvironment | SetDisc | RemoveDisc;

const AT_LATEST_MS = 100; // a page in the background has no animation frames

/** Gathers changes and hands them on together. */
export class Outbox {
  private readonly waiting = new Map<string, Change>();
  private frame = 0;
  private timer = 0;

  constructor(private readonly send: (change: Change) => void) {}

  put(change: Change): void {
    const key = change.type === "SetEnvironment" ? "environment" : `disc ${change.id}`;
    const before = this.waiting.get(key);
    const isMore = before?.type === "SetEnvironment" && change.type === "SetEnvironment";
    this.waiting.set(key, isMore ? { ...before, ...change } : change);
    if (this.frame !== 0) return;
    this.frame = requestAnimationFrame(() => this.flush());
    this.timer = window.setTimeout(() => this.flush(), AT_LATEST_MS);
  }

  private flush(): void {
    cancelAnimationFrame(this.frame);
    window.clearTimeout(this.timer);
    this.frame = 0;
    const changes = [...this.waiting.values()];
    this.waiting.clear();
    changes.forEach(this.send);
  }
}
