// The rig as this page shows it: what the studio said last, and what is being changed here before it answers.

import { Edits, applied } from "./edits";
import type {
  Change, DiscLight, LampLight, LookKey, Mark, Marked, PaintStroke, PortalGlass, SetEnvironment, State, Sun,
} from "./messages";
import { Outbox } from "./outbox";

export type Look = Omit<State, "type" | "sequence" | "author">;
export type EnvironmentChange = Pick<SetEnvironment, "environment" | "rotation_deg" | "scale" | "tint">;

/** The choice that has the sun and the sky of a place and an hour. */
export const DAYLIGHT = "daylight";

const NO_SUN: Sun = { latitude_deg: 0, longitude_deg: 0, date: "2026-06-21", hour: 12, zone: null, turbidity: 2.5 };
const DARK: Look = {
  environment: "", rotation_deg: 0, scale: 1, tint: [1, 1, 1], sun: NO_SUN, discs: [], lamps: [], glass: [],
  stops: null, world: null, seconds: 0, paint: [], looks: [], timeline: [], undo: null, redo: null,
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
  private readonly listeners: ((look: Look) => void)[] = [];
  private readonly outbox: Outbox;
  private edits = new Edits();
  private told: State | null = null;
  private marked: Marked | null = null;

  constructor(send: (message: Change | Mark) => void) {
    this.outbox = new Outbox(send, () => this.edits.sent());
  }

  /** Whether something that was changed here has not come back yet. */
  get isWaiting(): boolean {
    return this.edits.isWaiting;
  }

  /** Call now with the look, and whenever it changes. */
  follow(listener: (look: Look) => void): void {
    this.listeners.push(listener);
    listener(this.look);
  }

  /** A new connection: what was on its way is lost, and the studio's word is all there is. */
  begin(state: State): void {
    this.edits = new Edits();
    this.marked = null;
    this.receive(state);
  }

  /** The studio's word, under what is being changed here and has not reached it yet. */
  receive(state: State): void {
    this.sequence = state.sequence;
    this.told = state;
    if (this.marked !== null && state.sequence >= this.marked.sequence) {
      this.edits.answered(this.marked);
      this.marked = null;
    }
    this.show(state);
  }

  /** The studio has all that was sent before a mark, or refused it: its word counts from that state on. */
  answered(marked: Marked): void {
    this.marked = marked;
    if (this.told !== null && this.sequence >= marked.sequence) this.receive(this.told);
  }

  change(values: EnvironmentChange, { dragging = false } = {}): void {
    this.put({ type: "SetEnvironment", ...values, dragging });
  }

  putDisc(disc: DiscLight, { dragging = false } = {}): void {
    this.put({ type: "SetDisc", ...disc, dragging });
  }

  removeDisc(id: string): void {
    this.put({ type: "RemoveDisc", id });
  }

  putPaint(stroke: PaintStroke, { dragging = false } = {}): void {
    this.put({ type: "SetPaint", stroke, dragging });
  }

  removePaint(id: string): void {
    this.put({ type: "RemovePaint", id });
  }

  setSun(sun: Sun, { dragging = false } = {}): void {
    this.put({ type: "SetSun", sun, dragging });
  }

  putLamp(lamp: LampLight, { dragging = false } = {}): void {
    this.put({ type: "SetLamp", lamp, dragging });
  }

  removeLamp(id: string): void {
    this.put({ type: "RemoveLamp", id });
  }

  putGlass(glass: PortalGlass, { dragging = false } = {}): void {
    this.put({ type: "SetGlass", glass, dragging });
  }

  setWorld(world: string | null, seconds: number, { dragging = false } = {}): void {
    this.put({ type: "SetWorld", world, seconds, dragging });
  }

  setTimeline(keys: LookKey[]): void {
    this.put({ type: "SetTimeline", keys });
  }

  /** What only the studio can carry out: undo, looks, rig files. */
  ask(change: Change): void {
    this.outbox.put(change);
  }

  /** A change that is seen here at once. */
  private put(change: Change): void {
    this.edits.note(change);
    this.outbox.put(change);
    this.tell(applied(this.look, change));
  }

  private show(state: State): void {
    const { type: _type, sequence: _sequence, author: _author, ...look } = state;
    const seen = this.edits.over(look);
    if (JSON.stringify(seen) !== JSON.stringify(this.look)) this.tell(seen); // the echo of a drag changes nothing here
  }

  private tell(look: Look): void {
    this.look = look;
    for (const listener of this.listeners) listener(look);
  }
}
