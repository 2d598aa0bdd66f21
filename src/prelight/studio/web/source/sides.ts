// Which two lights are seen: what is set or a look on the left, a look or the path tracer on the right; fetched when wanted.

import type { Frame } from "./frames";
import type { CameraView, ClientMessage, State } from "./messages";
import type { Lit, Stage } from "./view/stage";

export type Place = [number, number, number];

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

const REST_MS = 250; // of an eye, before looks are asked for as it sees them
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
  private readonly askedFrom = new Map<string, string>(); // where the eye was at the newest question about a side
  private traced: TracedPicture | null = null;
  private wanted: Mix = ALONE;
  private compared: unknown = null;
  private eye: Place | null = null; // from where they are seen; null: they look the same from everywhere
  private rest = 0;

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
    if (side === null || side === NOW || side === TRACED || this.asked.has(side)) return;
    const isMoving = this.rest !== 0; // when it rests, all are looked at again
    if (this.known.has(side) && (isMoving || this.askedFrom.get(side) === String(this.eye))) return;
    this.ask(side);
  }

  private ask(side: string): void {
    this.asked.add(side);
    this.askedFrom.set(side, String(this.eye));
    this.send({ type: "Compare", look: side === BEFORE ? null : side.slice(ofLook("").length), eye: this.eye });
  }

  /** They are seen from here; null: it makes no difference. When the eye rests they are fetched as it sees them. */
  see(eye: Place | null): void {
    if (String(eye) === String(this.eye)) return;
    this.eye = eye;
    window.clearTimeout(this.rest);
    this.rest = window.setTimeout(() => this.lookAgain(), REST_MS);
  }

  private lookAgain(): void {
    this.rest = 0;
    for (const side of new Set([...this.known.keys(), ...this.asked])) {
      const isWanted = side === this.wanted.left || side === this.wanted.right;
      if (isWanted || this.asked.has(side)) this.ask(side); // what is on its way is as another eye saw it
      else this.known.delete(side);
    }
  }

  take(look: string | null, light: State, radiance: Uint32Array<ArrayBuffer>): void {
    const side = look === null ? BEFORE : ofLook(look);
    this.asked.delete(side);
    const { shine = null, world = null } = this.known.get(side) ?? {};
    this.known.set(side, { light, radiance, shine, world });
    this.apply();
  }

  /** What a look that has come adds toward the eye. */
  takeView(look: string | null, { shine, world }: Frame): void {
    const side = look === null ? BEFORE : ofLook(look);
    const known = this.known.get(side);
    if (known === undefined) return;
    this.known.set(side, { ...known, shine, world });
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
      this.stage.compare(other !== null && "light" in other ? other : null);
    }
    this.compared = other;
    this.stage.mix(other === null ? ALONE : { share, wipe });
  }
}
