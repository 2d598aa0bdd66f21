// Colours of light: kelvin, luminance, and the colours that a browser's picker speaks.

export type Rgb = [number, number, number];

export const WARMEST = 2000;
export const COOLEST = 12000;
export const NEUTRAL = 6500;

/** Relative luminance of linear Rec.709. */
export function luminance([red, green, blue]: Readonly<Rgb>): number {
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

export function times([red, green, blue]: Readonly<Rgb>, factor: number): Rgb {
  return [red * factor, green * factor, blue * factor];
}

/** The colour at luminance one; grey for black. */
export function hue(colour: Readonly<Rgb>): Rgb {
  const level = luminance(colour);
  return level > 0 ? times(colour, 1 / level) : [1, 1, 1];
}

/** A black body's colour at luminance one, with 6500 K as white. */
export function ofKelvin(kelvin: number): Rgb {
  const neutral = planckian(NEUTRAL);
  const colour = planckian(kelvin).map((value, i) => Math.max(value, 0) / (neutral[i] ?? 1)) as Rgb;
  return hue(colour);
}

/** The kelvin whose colour is nearest. */
export function kelvinOf(colour: Readonly<Rgb>): number {
  const wanted = warmth(colour);
  let [low, high] = [WARMEST, COOLEST];
  while (high - low > 5) {
    const middle = (low + high) / 2;
    if (warmth(ofKelvin(middle)) > wanted) low = middle;
    else high = middle;
  }
  return Math.round((low + high) / 20) * 10;
}

function warmth([red, , blue]: Readonly<Rgb>): number {
  return Math.log2((red + 1e-6) / (blue + 1e-6));
}

/** Linear Rec.709 of a black body: the cubic approximation of Kim et al. (2002) to the Planckian locus. */
function planckian(kelvin: number): Rgb {
  const t = 1000 / kelvin;
  const x =
    kelvin < 4000
      ? ((-0.2661239 * t - 0.234358) * t + 0.8776956) * t + 0.17991
      : ((-3.0258469 * t + 2.1070379) * t + 0.2226347) * t + 0.24039;
  const y =
    kelvin < 2222
      ? ((-1.1063814 * x - 1.3481102) * x + 2.18555832) * x - 0.20219683
      : kelvin < 4000
        ? ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867
        : ((3.081758 * x - 5.8733867) * x + 3.75112997) * x - 0.37001483;
  const [bigX, bigZ] = [x / y, (1 - x - y) / y];
  return [
    3.2404542 * bigX - 1.5371385 - 0.4985314 * bigZ,
    -0.969266 * bigX + 1.8760108 + 0.041556 * bigZ,
    0.0556434 * bigX - 0.2040259 + 1.0572252 * bigZ,
  ];
}

/** A colour for `<input type="color">`: the brightest channel at full. */
export function toHex(colour: Readonly<Rgb>): string {
  const most = Math.max(...colour, 1e-9);
  const bytes = colour.map((value) => Math.round(255 * encode(value / most)));
  return `#${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

/** Bytes of a colour on the screen; one that is too bright keeps its hue. */
export function toScreen(colour: Readonly<Rgb>): Rgb {
  const most = Math.max(...colour, 1);
  return colour.map((value) => Math.round(255 * encode(value / most))) as Rgb;
}

/** The hue, at luminance one, of a colour from a picker. */
export function fromHex(hex: string): Rgb {
  const bytes = [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16) || 0);
  return hue(bytes.map((byte) => decode(byte / 255)) as Rgb);
}

function encode(x: number): number {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}

function decode(y: number): number {
  return y <= 0.04045 ? y / 12.92 : ((y + 0.055) / 1.055) ** 2.4;
}
