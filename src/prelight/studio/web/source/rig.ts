// The rig as this page shows it: what the studio said last, and what is being changed here before it answers.

import type { DiscLight, SetEnvironment, State } from "./messages";
import { Outbox, type Change } from "./outbox";

const ANSWERED_MS = 600; // after a change of ours, the studio's echo of older ones is left alone for this long

export type Look = Omit<State, "type" | "sequence" | "author">;
export type EnvironmentChange = Pick<SetEnvironment, "environment" | "rotation_deg" | "scale" | "tint">;

const DARK: Look = { environment: "", rotation_deg: 0, scale: 1, tint: [1, 1, 1], discs: [], stops: null };

/** Holds the look, tells its listeners, and sends what changes here. */
export class Rig {
  look: Look = DARK;
  sequence = -1;
  visitor = -1;
  private readonly listeners: ((look: Look) => void)[] = [];
  private readonly outbox: Outbox;
  private held: State | null = null;
  private quietAt = 0;
  private timer = 0;

  constructor(send: (change: Change) => void) {
    this.outbox = new Outbox(send);
  }

  /** Call now with the look, and whenever it changes. */
  follow(listener: (look: Look) => void): void {
    this.listeners.push(listener);
    listener(this.look);
  }

  /** The studio's word. Echoes of our own drag would pull at the slider: they wait until it rests. */
  receive(state: State): void {
    this.sequence = state.sequence;
    const wait = this.quietAt - performance.now();
    if (wait > 0 && state.author === this.visitor) {
      this.held = state;
      this.releaseIn(wait);
      return;
    }
    this.held = null;
    this.show(state);
  }

  /** A refused change: go back to the studio's word at once. */
  takeBack(state: State | null): void {
    this.quietAt = 0;
    const last = this.held ?? state;
    this.held = null;
    if (last !== null) this.show(last);
  }

  change(values: EnvironmentChange, { dragging = false } = {}): void {
    this.outbox.put({ type: "SetEnvironment", ...values, dragging });
    const isOther = values.environment !== undefined && values.environment !== this.look.environment;
    const stops = isOther ? null : this.look.stops; // of another map they are not known here
    this.changed({ ...this.look, ...(values as Partial<Look>), stops });
  }

  putDisc(disc: DiscLight, { dragging = false } = {}): void {
    this.outbox.put({ type: "SetDisc", ...disc, dragging });
    const isNew = !this.look.discs.some((other) => other.id === disc.id);
    const others = this.look.discs.map((other) => (other.id === disc.id ? disc : other));
    this.changed({ ...this.look, discs: isNew ? [...others, disc] : others });
  }

  removeDisc(id: string): void {
    this.outbox.put({ type: "RemoveDisc", id });
    this.changed({ ...this.look, discs: this.look.discs.filter((disc) => disc.id !== id) });
  }

  private changed(look: Look): void {
    this.quietAt = performance.now() + ANSWERED_MS;
    this.releaseIn(ANSWERED_MS);
    this.tell(look);
  }

  private releaseIn(milliseconds: number): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      if (this.held !== null) this.receive(this.held);
    }, milliseconds + 1);
  }

  private show(state: State): void {
    const { environment, rotation_deg, scale, tint, discs, stops } = state;
    this.tell({ environment, rotation_deg, scale, tint, discs, stops });
  }

  private tell(look: Look): void {
    this.look = look;
    for (const listener of this.listeners) listener(look);
  }
}
