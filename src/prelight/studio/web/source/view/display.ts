// Scene-linear radiance to what a screen shows, in GLSL: the curves of images/tonemap.py, with its constants.

const MIDDLE_GREY = 0.18;
const CONTRAST = 1.375;
const WHITE = 16.0;
const MIXED = 0.16;
const UNMIXED = 0.13;
const HUE_KEPT = 0.35;

/** `none` is for the light meter: linear values as they are. */
export const CURVES = { filmic: 1, linear: 0, none: 2 } as const;
export type Curve = keyof typeof CURVES;

function filmicConstants(): { c: number; top: number } {
  const grey = MIDDLE_GREY ** CONTRAST;
  const white = WHITE ** CONTRAST;
  const c = (grey * (1 - MIDDLE_GREY)) / (MIDDLE_GREY - grey / white);
  return { c, top: 1 + c / white };
}

const { c, top } = filmicConstants();
const literal = (x: number): string => x.toExponential(9);

/** `vec3 displayed(vec3 radiance)`: exposure, tone curve, sRGB; values in [0, 1]. */
export const DISPLAY_GLSL = `
uniform float gain;
uniform int curve;

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
}

/** Uniforms that every material shares. */
export function makeDisplay(): Display {
  return { gain: { value: 1 }, curve: { value: CURVES.filmic } };
}
