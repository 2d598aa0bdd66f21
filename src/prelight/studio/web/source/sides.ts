// Which two lights are seen: what is set or a look on the left, a look or the path tracer on the right; fetched when wanted.

import type { CameraView, ClientMessage, State } from "./messages";
import type { Lit, Stage } from "./view/stage";

export const NOW = "now";
export const BEFORE = "before";
export const TRACED = "traced";
export const ofLook = (name: string): string => `look ${name}`;

/** `share` of the right one is mixed in, or it is all that is seen right of `wipe`, from 0 to 1. */
export interface Mix {
  left: string;
  right: string | null;
  share: number;
  wipe: number | null;
}

const ALONE: Mix = { left: NOW, right: null, share: 0, wipe: null };

interface TracedPicture {
  words: Uint32Array<ArrayBuffer>;
  view: CameraView;
  width: number;
  height: number;
}

export class Sides {
  private readonly known = new Map<string, Lit>();
  private readonly asked = new Set<string>();
  private traced: TracedPicture | null = null;
  private wanted: Mix = ALONE;
  private compared: unknown = null;

  constructor(
    private readonly stage: Stage,
    private readonly send: (message: ClientMessage) => void,
  ) {}

  /** Show these two; what is not there yet comes later, and until then what was. */
  show(mix: Mix | null): void {
    this.wanted = mix ?? ALONE;
    for (const side of [this.wanted.left, this.wanted.right]) this.need(side);
    this.apply();
  }

  /** Fetch what will be shown soon. */
  need(side: string | null): void {
    if (side === null || side === NOW || side === TRACED || this.known.has(side) || this.asked.has(side)) return;
    this.asked.add(side);
    this.send({ type: "Compare", look: side === BEFORE ? null : side.slice(ofLook("").length) });
  }

  take(look: string | null, light: State, radiance: Uint32Array<ArrayBuffer>): void {
    const side = look === null ? BEFORE : ofLook(look);
    this.asked.delete(side);
    this.known.set(side, { light, radiance });
    this.apply();
  }

  /** Looks may be others now: those that are seen are fetched again. */
  forget(): void {
    this.known.clear();
    this.asked.clear();
    for (const side of [this.wanted.left, this.wanted.right]) this.need(side);
  }

  /** Of one that changes with every step. */
  forgetBefore(): void {
    this.known.delete(BEFORE);
    for (const side of [this.wanted.left, this.wanted.right]) this.need(side);
  }

  setTraced(traced: TracedPicture | null): void {
    this.traced = traced;
    if (this.wanted.right === TRACED) this.compared = null;
    this.apply();
  }

  /** Whether everything that is wanted is seen. */
  get isComplete(): boolean {
    const { left, right } = this.wanted;
    const has = (side: string | null) => side === null || side === NOW || side === TRACED || this.known.has(side);
    return has(left) && has(right);
  }

  private apply(): void {
    const { left, right, share, wipe } = this.wanted;
    const held = left === NOW ? null : this.known.get(left);
    if (held !== undefined) this.stage.hold(held);
    const other = right === TRACED ? this.traced : right === null ? null : this.known.get(right);
    if (other === undefined) return; // soon
    if (other !== this.compared) {
      this.stage.showTraced(right === TRACED ? this.traced : null);
      if (other !== null && "light" in other) this.stage.compare(other.light, other.radiance);
      else this.stage.compare(null, null);
    }
    this.compared = other;
    this.stage.mix(other === null ? ALONE : { share, wipe });
  }
}
