// Paint on the sky as a picture: what covers the map, and how much of it.

import type { PaintStroke } from "./messages";

const DEEPEST = 1.5; // as in lighting/regions.py: no soft edge reaches further than 120 degrees
const DEGREE = Math.PI / 180;

/** 1 - cos of the angles where a round region begins to fade, and where it ends. */
export function depths({ radius_deg, softness }: { radius_deg: number; softness: number }): [number, number] {
  const middle = 2 * Math.sin((radius_deg * DEGREE) / 2) ** 2;
  const soft = softness * Math.min(middle, DEEPEST - middle);
  return [middle - soft, middle + soft];
}

/** Premultiplied radiance and cover (4 a pixel) of strokes on a latitude-longitude map, the top row first. */
export function painted(strokes: readonly PaintStroke[], width: number, height: number): Float32Array<ArrayBuffer> {
  const out = new Float32Array(4 * width * height);
  for (const stroke of strokes) for (const point of stroke.points) dab(out, { stroke, point, width, height });
  return out;
}

interface Dab {
  stroke: PaintStroke;
  point: readonly [number, number];
  width: number;
  height: number;
}

function dab(out: Float32Array, { stroke, point: [azimuth, elevation], width, height }: Dab): void {
  const [begins, ends] = depths(stroke);
  const reach = Math.acos(1 - ends) / DEGREE;
  const rowOf = (degrees: number) => ((90 - degrees) / 180) * height;
  const [red, green, blue] = stroke.radiance;
  const [sine, cosine] = [Math.sin(elevation * DEGREE), Math.cos(elevation * DEGREE)];
  const last = Math.min(height, Math.ceil(rowOf(elevation - reach)));
  for (let y = Math.max(0, Math.floor(rowOf(elevation + reach))); y < last; y++) {
    const e = (90 - (180 * (y + 0.5)) / height) * DEGREE;
    const [high, far] = [sine * Math.sin(e), cosine * Math.cos(e)];
    for (let x = 0; x < width; x++) {
      const w = 1 - high - far * Math.cos(((360 * (x + 0.5)) / width - 180 - azimuth) * DEGREE);
      if (w >= ends) continue;
      const t = ends > begins ? Math.max(0, (w - begins) / (ends - begins)) : 0;
      const m = stroke.opacity * (1 - t * t * (3 - 2 * t));
      const at = 4 * (y * width + x);
      [red, green, blue, 1].forEach((value, i) => (out[at + i] = (1 - m) * (out[at + i] ?? 0) + m * value));
    }
  }
}

/** Whether a stroke covers a direction. */
export function covers(stroke: PaintStroke, azimuth: number, elevation: number): boolean {
  const middle = 1 - Math.cos(stroke.radius_deg * DEGREE);
  return stroke.points.some(([a, e]) => apart([a, e], [azimuth, elevation]) <= middle);
}

/** 1 - cos of the angle between two directions. */
export function apart([a, e]: readonly [number, number], [b, f]: readonly [number, number]): number {
  const level = Math.cos(e * DEGREE) * Math.cos(f * DEGREE) * Math.cos((a - b) * DEGREE);
  return 1 - Math.sin(e * DEGREE) * Math.sin(f * DEGREE) - level;
}
