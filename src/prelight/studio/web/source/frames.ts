// Radiance frames: a header of 32 bytes, then one rgb9e5 for each row.

import {
  FRAME_ASIDE, FRAME_EXACT, FRAME_MAGIC, FRAME_SHINE, FRAME_TRACED, FRAME_VIEW, FRAME_WORLD, HEADER, HEADER_BYTES, WORLD_HEIGHT,
  WORLD_WIDTH,
} from "./messages";

export interface Frame {
  number: number;
  sequence: number;
  milliseconds: number;
  exact: boolean;
  /** Light as it is set; of a look to compare with; what depends on the eye, also of a look; a picture by the path tracer. */
  kind: "light" | "aside" | "view" | "aside view" | "traced";
  /** One rgb9e5 a row, but of a view: what arrived itself, nothing is copied. */
  radiance: Uint32Array<ArrayBuffer>;
  /** Of a view: four half floats a vertex, the first three to be added; null where nothing shines. */
  shine: Uint16Array<ArrayBuffer> | null;
  /** Of a view: what is outside, in rgb9e5, lat-long; null: only the sky. */
  world: Uint32Array<ArrayBuffer> | null;
}

/** The frame in a binary message; null for anything that is not a whole one. */
export function readFrame(data: ArrayBuffer): Frame | null {
  if (data.byteLength < HEADER_BYTES) return null;
  const header = new DataView(data, 0, HEADER_BYTES);
  const count = header.getUint32(HEADER.count, true);
  const isWhole = data.byteLength === HEADER_BYTES + 4 * count;
  if (header.getUint32(HEADER.magic, true) !== FRAME_MAGIC || !isWhole) return null;
  const flags = header.getUint32(HEADER.flags, true);
  const map = flags & FRAME_WORLD ? WORLD_WIDTH * WORLD_HEIGHT : 0;
  return {
    number: header.getUint32(HEADER.frame, true),
    sequence: header.getUint32(HEADER.sequence, true),
    milliseconds: header.getFloat32(HEADER.milliseconds, true),
    exact: (flags & FRAME_EXACT) !== 0,
    kind: kindOf(flags),
    radiance: new Uint32Array(data, HEADER_BYTES, count),
    shine: flags & FRAME_SHINE ? new Uint16Array(data, HEADER_BYTES, 2 * (count - map)) : null,
    world: map > 0 ? new Uint32Array(data, HEADER_BYTES + 4 * (count - map), map) : null,
  };
}

function kindOf(flags: number): Frame["kind"] {
  if (flags & FRAME_VIEW) return flags & FRAME_ASIDE ? "aside view" : "view";
  return flags & FRAME_ASIDE ? "aside" : flags & FRAME_TRACED ? "traced" : "light";
}
