// What the page measures of itself: shown in the corner, and read by tests as `window.__prelight`.

import type { Frame } from "./frames";

const REMEMBERED = 240; // updates
const WINDOW_MS = 1000;

/** Milliseconds of script an update: taking the message, and the upload of those that are drawn. */
export class Metrics {
  version = 0;
  ready = false;
  standing = "connecting";
  updates = 0;
  drawn = 0;
  uploads = 0;
  exact = false;
  lastFrame = -1;
  lastSequence = -1;
  shownSequence = -1;
  shownExact = false;
  relightMs = 0;
  sides = false; // whether all that is compared has come
  traced = false; // whether the path tracer has sent a picture
  views = 0; // of what depends on the eye
  asideViews = 0; // the same of looks that are compared
  lamps = false; // whether what steerable lamps bring is seen
  sky = ""; // of which environment the map behind the scene is
  readonly scriptMs: number[] = [];
  readonly uploadMs: number[] = [];
  readonly arrivals: number[] = []; // milliseconds of this page
  private readonly pictures: number[] = [];

  arrived(frame: Frame, milliseconds: number): void {
    this.updates += 1;
    this.lastFrame = frame.number;
    this.lastSequence = frame.sequence;
    this.exact = frame.exact;
    this.relightMs = frame.milliseconds;
    remember(this.scriptMs, milliseconds);
    remember(this.arrivals, performance.now());
  }

  uploaded(frame: Frame, milliseconds: number): void {
    this.uploads += 1;
    this.shownSequence = frame.sequence;
    this.shownExact = frame.exact;
    remember(this.uploadMs, milliseconds);
  }

  drew(): void {
    this.drawn += 1;
    remember(this.pictures, performance.now());
  }

  /** Updates that arrived in the last second. */
  updatesPerSecond(): number {
    return lately(this.arrivals);
  }

  picturesPerSecond(): number {
    return lately(this.pictures);
  }

  /** The median script time of an update, upload included. */
  medianScriptMs(): number {
    return median(this.scriptMs) + median(this.uploadMs);
  }
}

function remember(list: number[], value: number): void {
  list.push(value);
  if (list.length > REMEMBERED) list.shift();
}

function lately(times: readonly number[]): number {
  const since = performance.now() - WINDOW_MS;
  return times.reduce((count, time) => (time >= since ? count + 1 : count), 0);
}

function median(values: readonly number[]): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[sorted.length >> 1] ?? 0;
}
