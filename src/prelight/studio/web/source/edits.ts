// What was changed here and is not yet known to have reached the studio: kept, and laid over whatever the studio says.

import type { Change, Marked } from "./messages";
import { DAYLIGHT, type Look } from "./rig";

const UNSENT = Infinity;

/** What a change is about: the newest one about a thing replaces those before it. Null: it only makes sense in turn. */
export function subject(change: Change): string | null {
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
    case "SetPaint":
      return `paint ${change.stroke.id}`;
    case "RemovePaint":
      return `paint ${change.id}`;
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

/** Two changes about one thing as one: of the environment each says only what it changes. */
export function joined(before: Change | undefined, change: Change): Change {
  return before?.type === "SetEnvironment" && change.type === "SetEnvironment" ? { ...before, ...change } : change;
}

/** Changes that are on their way, by what they are about, until the studio has answered the mark after them. */
export class Edits {
  private readonly known = new Map<string, { change: Change; mark: number }>();
  private mark = 0;
  private answeredMark = 0;

  note(change: Change): void {
    const key = subject(change);
    if (key === null) return;
    const whole = joined(this.known.get(key)?.change, change);
    this.known.delete(key); // the newest last
    this.known.set(key, { change: whole, mark: UNSENT });
  }

  /** All have been sent: the number of the mark that follows them. */
  sent(): number {
    this.mark += 1;
    for (const edit of this.known.values()) if (edit.mark === UNSENT) edit.mark = this.mark;
    return this.mark;
  }

  /** Whether the studio has not answered all yet. */
  get isWaiting(): boolean {
    return this.known.size > 0 || this.answeredMark < this.mark;
  }

  /** The studio has those before a mark. */
  answered({ number }: Marked): void {
    this.answeredMark = number;
    for (const [key, { mark }] of this.known) if (mark <= number) this.known.delete(key);
  }

  over(look: Look): Look {
    return [...this.known.values()].reduce((seen, { change }) => applied(seen, change), look);
  }
}

/** The look after a change, as the studio will say it. */
export function applied(look: Look, change: Change): Look {
  switch (change.type) {
    case "SetEnvironment": {
      const { type: _type, dragging: _dragging, ...values } = change;
      const isOther = values.environment != null && values.environment !== look.environment;
      return { ...look, ...(values as Partial<Look>), stops: isOther ? null : look.stops }; // of another map unknown here
    }
    case "SetSun": {
      const isNew = look.environment !== DAYLIGHT;
      return { ...look, ...(isNew ? { environment: DAYLIGHT, tint: [1, 1, 1], stops: null } : {}), sun: change.sun };
    }
    case "SetDisc": {
      const { type: _type, dragging: _dragging, softness = 0, ...disc } = change;
      return { ...look, discs: put(look.discs, { ...disc, softness }, "id") };
    }
    case "RemoveDisc":
      return { ...look, discs: look.discs.filter(({ id }) => id !== change.id) };
    case "SetPaint":
      return { ...look, paint: put(look.paint, change.stroke, "id") };
    case "RemovePaint":
      return { ...look, paint: look.paint.filter(({ id }) => id !== change.id) };
    case "SetLamp":
      return { ...look, lamps: put(look.lamps, change.lamp, "id") };
    case "RemoveLamp":
      return { ...look, lamps: look.lamps.filter(({ id }) => id !== change.id) };
    case "SetGlass":
      return { ...look, glass: put(look.glass, change.glass, "portal") };
    case "SetWorld":
      return { ...look, world: change.world, seconds: change.seconds ?? 0 };
    case "SetTimeline":
      return { ...look, timeline: change.keys };
    default:
      return look;
  }
}

/** A list with one more, or with another in place of the one of the same name. */
function put<Item, Key extends keyof Item>(list: readonly Item[], item: Item, key: Key): Item[] {
  const isNew = !list.some((other) => other[key] === item[key]);
  return isNew ? [...list, item] : list.map((other) => (other[key] === item[key] ? item : other));
}
