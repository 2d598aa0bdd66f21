// What waits to be sent: at most one message of a key for each animation frame, the newest.

import type { Change } from "./messages";

const AT_LATEST_MS = 100; // a page in the background has no animation frames

/** Gathers changes and hands them on together. */
export class Outbox {
  private readonly waiting = new Map<string, Change>();
  private frame = 0;
  private others = 0;
  private timer = 0;

  constructor(private readonly send: (change: Change) => void) {}

  put(change: Change): void {
    const key = subject(change) ?? `other ${this.others++}`;
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

/** What a change is about: of changes that wait, the newest about the same thing is sent. Null: each is sent. */
function subject(change: Change): string | null {
  switch (change.type) {
    case "SetEnvironment":
      return "environment";
    case "SetSun":
      return "sun";
    case "SetWorld":
      return "world";
    case "SetTimeline":
      return "timeline";
    case "SetDisc":
    case "RemoveDisc":
      return `disc ${change.id}`;
    case "SetLamp":
      return `lamp ${change.lamp.id}`;
    case "SetGlass":
      return `glass ${change.glass.portal}`;
    case "RemoveLamp":
      return `lamp ${change.id}`;
    default:
      return null;
  }
}
