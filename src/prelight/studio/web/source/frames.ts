// Radiance frames: a header of 32 bytes, then one rgb9e5 for each row.

import { FRAME_ASIDE, FRAME_EXACT, FRAME_MAGIC, HEADER, HEADER_BYTES } from "./messages";

export interface Frame {
  number: number;
  sequence: number;
  milliseconds: number;
  exact: boolean;
  /** Of a look to compare with. */
  aside: boolean;
  /** One rgb9e5 a row: a view of what arrived, nothing is copied. */
  radiance: Uint32Array<ArrayBuffer>;
}

/** The frame in a binary message; null for anything that is not a whole one. */
export function readFrame(data: ArrayBuffer): Frame | null {
  if (data.byteLength < HEADER_BYTES) return null;
  const header = new DataView(data, 0, HEADER_BYTES);
  const count = header.getUint32(HEADER.count, true);
  const isWhole = data.byteLength === HEADER_BYTES + 4 * count;
  if (header.getUint32(HEADER.magic, true) !== FRAME_MAGIC || !isWhole) return null;
  return {
    number: header.getUint32(HEADER.frame, true),
    sequence: header.getUint32(HEADER.sequence, true),
    milliseconds: header.getFloat32(HEADER.milliseconds, true),
    exact: (header.getUint32(HEADER.flags, true) & FRAME_EXACT) !== 0,
    aside: (header.getUint32(HEADER.flags, true) & FRAME_ASIDE) !== 0,
    radiance: new Uint32Array(data, HEADER_BYTES, count),
  };
}
