// Keyframes of looks: which two are seen at a time, and how much of the second.

import type { LookKey } from "./messages";

export interface Between {
  left: string;
  right: string;
  share: number;
}

/** Before the first and after the last it rests; null where there are no keys. */
export function between(keys: readonly LookKey[], seconds: number): Between | null {
  const [first] = keys;
  const last = keys.at(-1);
  if (first === undefined || last === undefined) return null;
  if (seconds <= first.at) return { left: first.look, right: first.look, share: 0 };
  for (let i = 1; i < keys.length; i++) {
    const [a, b] = [keys[i - 1] ?? first, keys[i] ?? last];
    if (seconds <= b.at) return { left: a.look, right: b.look, share: (seconds - a.at) / (b.at - a.at) };
  }
  return { left: last.look, right: last.look, share: 0 };
}
