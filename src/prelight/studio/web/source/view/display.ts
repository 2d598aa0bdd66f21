// Scene-linear radiance to what a screen shows, in GLSL: the curves of images/tonemap.py, with its constants.

import { type DataTexture, Matrix4 } from "three";
import { radianceTexture } from "./textures";

const MIDDLE_GREY = 0.18;
const CONTRAST = 1.375;
const WHITE = 16.0;
const MIXED = 0.16;
const UNMIXED = 0.13;
const HUE_KEPT = 0.35;

/** `none` is for the light meter: linear values as they are. */
export const CURVES = { filmic: 1, linear: 0, none: 2 } as const;
export type Curve = keyof typeof CURVES;

/** What is shown: the picture, or in false colour what a meter would read. */
export const MEANINGS = { picture: 0, luminance: 1, illuminance: 2 } as const;
export type Meaning = keyof typeof MEANINGS;
export const DECADES = 3; // of false colour, below its top
export const LUMENS_PER_WATT = 683;

/** False colours from dark to bright, sRGB. */
export const PALETTE = ["#15123f", "#2b3c99", "#1f7fb3", "#1fa88f", "#79c142", "#f1d13a", "#f08c2e", "#cf2a33"] as const;

function filmicConstants(): { c: number; top: number } {
  const grey = MIDDLE_GREY ** CONTRAST;
  const white = WHITE ** CONTRAST;
  const c = (grey * (1 - MIDDLE_GREY)) / (MIDDLE_GREY - grey / white);
  return { c, top: 1 + c / white };
}

const { c, top } = filmicConstants();
const literal = (x: number): string => x.toExponential(9);

const asVec3 = (hex: string): string =>
  `vec3(${[1, 3, 5].map((at) => (Number.parseInt(hex.slice(at, at + 2), 16) / 255).toFixed(4)).join(", ")})`;

/**
 * `vec3 displayed(vec3 radiance)`: exposure, tone curve, sRGB, or false colour; values in [0, 1].
 * `float otherShare()`: of the look to compare with, at this pixel.
 */
export const DISPLAY_GLSL = `
uniform float gain;
uniform int curve;
uniform highp int meaning;
uniform float falseTop;
uniform float share;
uniform float wipe;
uniform bool hasTraced;              // by the path tracer, in place of another look
uniform sampler2D traced;
uniform mat4 tracedFrom;
const vec3 palette[${PALETTE.length}] = vec3[](${PALETTE.map(asVec3).join(", ")});

float otherShare() {
  return wipe >= 0.0 ? step(wipe, gl_FragCoord.x) : share;
}

/* What a picture, rows from the top, shows of a place (w = 1) or a direction (w = 0) that its camera sees. */
bool pictured(mat4 from, vec4 place, out vec2 at) {
  vec4 clip = from * place;
  at = vec2(0.5 + 0.5 * clip.x / clip.w, 0.5 - 0.5 * clip.y / clip.w);
  return clip.w > 0.0 && all(greaterThanEqual(at, vec2(0.0))) && all(lessThanEqual(at, vec2(1.0)));
}

vec3 besideTraced(vec3 seen, vec4 place) {
  vec2 at;
  if (!hasTraced || meaning == 2 || !pictured(tracedFrom, place, at)) return seen;
  return mix(seen, texture(traced, at).rgb, otherShare());
}

vec3 falseColour(vec3 radiance) {
  float value = ${literal(LUMENS_PER_WATT)} * dot(radiance, vec3(0.2126, 0.7152, 0.0722));
  if (meaning == ${MEANINGS.illuminance}) value *= 3.14159265;
  float t = 1.0 + log(max(value, 1e-30) / falseTop) * ${literal(1 / Math.log(10 ** DECADES))};
  float at = clamp(t, 0.0, 1.0) * ${literal(PALETTE.length - 1)};
  int low = min(int(at), ${PALETTE.length - 2});
  return mix(palette[low], palette[low + 1], at - float(low));
}

vec3 shoulder(vec3 x) {
  x = min(x, ${literal(WHITE)});
  vec3 root = sqrt(sqrt(x));
  x = x * root * sqrt(root);  // to the power 1.375
  return x / ((x + ${literal(c)}) * ${literal(1 / top)});
}

vec3 filmic(vec3 x) {
  x = mix(x, vec3(dot(x, vec3(1.0 / 3.0))), ${literal(MIXED)});
  float brightest = max(max(x.r, x.g), x.b);
  float level = shoulder(vec3(brightest)).r;
  float square = level * level;
  float kept = ${literal(HUE_KEPT)} * (1.0 - square * square);
  vec3 shown = shoulder(x) * (1.0 - kept) + x * (kept * level / max(brightest, 1e-20));
  return (shown - vec3(dot(shown, vec3(${literal(UNMIXED / 3)})))) / ${literal(1 - UNMIXED)};
}

vec3 encoded(vec3 x) {
  x = clamp(x, 0.0, 1.0);
  return mix(1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, 12.92 * x, vec3(lessThanEqual(x, vec3(0.0031308))));
}

vec3 displayed(vec3 radiance) {
  if (curve == ${CURVES.none}) return radiance;
  if (meaning != ${MEANINGS.picture}) return falseColour(radiance);
  vec3 x = clamp(radiance * gain, 0.0, 1e6);
  return encoded(curve == ${CURVES.filmic} ? filmic(x) : x);
}
`;

/** `vec3 unpacked(uint packed)`: the radiance in an rgb9e5; exact. */
export const UNPACK_GLSL = `
vec3 unpacked(uint packed) {
  float unit = uintBitsToFloat(((packed >> 27u) + 103u) << 23u);  // 2^(exponent - 24)
  return unit * vec3(packed & 511u, (packed >> 9u) & 511u, (packed >> 18u) & 511u);
}
`;

export interface Display {
  gain: { value: number };
  curve: { value: number };
  meaning: { value: number };
  falseTop: { value: number };
  share: { value: number };
  wipe: { value: number };
  hasTraced: { value: boolean };
  traced: { value: DataTexture };
  tracedFrom: { value: Matrix4 };
}

/** Uniforms that every material shares. */
export function makeDisplay(): Display {
  return {
    gain: { value: 1 }, curve: { value: CURVES.filmic }, meaning: { value: MEANINGS.picture },
    falseTop: { value: 1000 }, share: { value: 0 }, wipe: { value: -1 }, hasTraced: { value: false },
    traced: { value: radianceTexture(new Uint32Array(1), 1, 1) }, tracedFrom: { value: new Matrix4() },
  };
}
