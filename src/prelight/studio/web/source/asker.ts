// What depends on the eye is asked for when the eye or the light has changed: one question at a time, always the newest.

import type { ClientMessage } from "./messages";
import type { Place } from "./sides";

export class Asker {
  private asked: string | null = null; // what the last question was about
  private answered = true;
  private wanted: { eye: Place; light: number } | null = null;

  constructor(private readonly send: (message: ClientMessage) => void) {}

  /** This is seen from here now, under the light of this frame; null: nothing depends on the eye. */
  see(wanted: { eye: Place; light: number } | null): void {
    this.wanted = wanted;
    this.next();
  }

  /** An answer has arrived. */
  answer(): void {
    this.answered = true;
    this.next();
  }

  /** The connection is new: whatever was asked will not be answered. */
  reset(): void {
    this.asked = null;
    this.answered = true;
  }

  private next(): void {
    if (this.wanted === null || !this.answered) return;
    const about = JSON.stringify(this.wanted);
    if (about === this.asked) return;
    this.asked = about;
    this.answered = false;
    this.send({ type: "LookFrom", eye: this.wanted.eye });
  }
}
