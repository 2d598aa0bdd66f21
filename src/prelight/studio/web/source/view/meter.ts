// A light meter: the exposure that shows a picture well, as images/tonemap.py finds it.

import { FloatType, LinearFilter, RGBAFormat, WebGLRenderTarget, type WebGLRenderer } from "three";

const WIDTH = 160;
const HEIGHT = 90;
const MIDDLE_GREY = 0.18;
const BRIGHTER = 1.3;

/** Stops for what `draw` renders (linear, alpha 1 where the scene is); null where nothing is lit. */
export function metered(renderer: WebGLRenderer, draw: () => void): number | null {
  const options = { type: FloatType, format: RGBAFormat, minFilter: LinearFilter, magFilter: LinearFilter };
  const target = new WebGLRenderTarget(WIDTH, HEIGHT, options);
  const pixels = new Float32Array(4 * WIDTH * HEIGHT);
  renderer.setRenderTarget(target);
  draw();
  renderer.readRenderTargetPixels(target, 0, 0, WIDTH, HEIGHT, pixels);
  renderer.setRenderTarget(null);
  target.dispose();
  return exposureFor(pixels);
}

/** The mean log luminance of the middle half of the lit pixels, brought to middle grey and raised a little. */
function exposureFor(pixels: Float32Array): number | null {
  const lit: number[] = [];
  for (let i = 0; i < pixels.length; i += 4) {
    const [red = 0, green = 0, blue = 0, alpha = 0] = pixels.subarray(i, i + 4);
    const luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    if (alpha > 0.5 && luminance > 1e-30 && luminance < Infinity) lit.push(luminance);
  }
  if (lit.length === 0) return null;
  lit.sort((a, b) => a - b);
  const middle = lit.slice(Math.floor(lit.length / 4), Math.ceil((3 * lit.length) / 4));
  const mean = middle.reduce((sum, luminance) => sum + Math.log2(luminance), 0) / middle.length;
  return Math.log2(MIDDLE_GREY) - mean + BRIGHTER;
}
