// The rig as this page shows it: what the studio said last, and what is being changed here before it answers.

import type { Change, DiscLight, LampLight, LookKey, PortalGlass, SetEnvironment, State, Sun } from "./messages";
import { Outbox } from "./outbox";

const ANSWERED_MS = 600; // after a change of ours, the studio's echo of older ones is left alone for this long

export type Look = Omit<State, "type" | "sequence" | "author">;
export type EnvironmentChange = Pick<SetEnvironment, "environment" | "rotation_deg" | "scale" | "tint">;

/** The choice that has the sun and the sky of a place and an hour. */
export const DAYLIGHT = "daylight";

const NO_SUN: Sun = { latitude_deg: 0, longitude_deg: 0, date: "2026-06-21", hour: 12, zone: null, turbidity: 2.5 };
const DARK: Look = {
  environment: "", rotation_deg: 0, scale: 1, tint: [1, 1, 1], sun: NO_SUN, discs: [], lamps: [], glass: [],
  stops: null, world: null, seconds: 0, looks: [], timeline: [], undo: null, redo: null,
};

/** What the studio calls the sky of a look: of daylight, that of its hour. */
export function skyId({ environment, sun }: Pick<Look, "environment" | "sun">): string {
  if (environment !== DAYLIGHT) return environment;
  const { latitude_deg, longitude_deg, date, hour, turbidity, zone } = sun;
  const short = (value: number) => String(Number(value.toPrecision(6)));
  const numbers = `${short(latitude_deg)},${short(longitude_deg)},${date},${short(hour)},${short(turbidity)}`;
  return `${DAYLIGHT}:${numbers},${zone ?? ""}`;
}

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

  setSun(sun: Sun, { dragging = false } = {}): void {
    this.outbox.put({ type: "SetSun", sun, dragging });
    const isNew = this.look.environment !== DAYLIGHT;
    const first = isNew ? { environment: DAYLIGHT, tint: [1, 1, 1] as [number, number, number], stops: null } : {};
    this.changed({ ...this.look, ...first, sun });
  }

  putLamp(lamp: LampLight, { dragging = false } = {}): void {
    this.outbox.put({ type: "SetLamp", lamp, dragging });
    const isNew = !this.look.lamps.some(({ id }) => id === lamp.id);
    const others = this.look.lamps.map((other) => (other.id === lamp.id ? lamp : other));
    this.changed({ ...this.look, lamps: isNew ? [...others, lamp] : others });
  }

  removeLamp(id: string): void {
    this.outbox.put({ type: "RemoveLamp", id });
    this.changed({ ...this.look, lamps: this.look.lamps.filter((lamp) => lamp.id !== id) });
  }

  putGlass(glass: PortalGlass, { dragging = false } = {}): void {
    this.outbox.put({ type: "SetGlass", glass, dragging });
    const others = this.look.glass.filter(({ portal }) => portal !== glass.portal);
    this.changed({ ...this.look, glass: [...others, glass] });
  }

  setWorld(world: string | null, seconds: number, { dragging = false } = {}): void {
    this.outbox.put({ type: "SetWorld", world, seconds, dragging });
    this.changed({ ...this.look, world, seconds });
  }

  setTimeline(keys: LookKey[]): void {
    this.outbox.put({ type: "SetTimeline", keys });
    this.changed({ ...this.look, timeline: keys });
  }

  /** What only the studio can carry out: undo, looks, rig files. Its answer is shown at once. */
  ask(change: Change): void {
    this.outbox.put(change);
    this.quietAt = 0;
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
    const { type: _type, sequence: _sequence, author: _author, ...look } = state;
    this.tell(look);
  }

  private tell(look: Look): void {
    this.look = look;
    for (const listener of this.listeners) listener(look);
  }
}
