// What waits to be sent: at most one message of a key for each animation frame, the newest.

import { joined, subject } from "./edits";
import type { Change, Mark } from "./messages";

const AT_LATEST_MS = 100; // a page in the background has no animation frames

/** Gathers changes and hands them on together, with a mark after them, whose number `mark` gives. */
export class Outbox {
  private readonly waiting = new Map<string, Change>();
  private frame = 0;
  private timer = 0;

  constructor(
    private readonly send: (message: Change | Mark) => void,
    private readonly mark: () => number,
  ) {}

  put(change: Change): void {
    const key = subject(change);
    if (key === null) {
      this.flush(change); // after what it is about
      return;
    }
    this.waiting.set(key, joined(this.waiting.get(key), change));
    if (this.frame !== 0) return;
    this.frame = requestAnimationFrame(() => this.flush());
    this.timer = window.setTimeout(() => this.flush(), AT_LATEST_MS);
  }

  private flush(last?: Change): void {
    cancelAnimationFrame(this.frame);
    window.clearTimeout(this.timer);
    this.frame = 0;
    const changes = [...this.waiting.values()];
    this.waiting.clear();
    if (last !== undefined) changes.push(last);
    changes.forEach(this.send);
    this.send({ type: "Mark", number: this.mark() });
  }
}
