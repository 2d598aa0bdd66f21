// What is behind the scene: the environment's map as turned, scaled and tinted, the disc lights in front of it.

import {
  type DataTexture,
  BufferAttribute,
  BufferGeometry,
  GLSL3,
  Mesh,
  RawShaderMaterial,
  Vector3,
  Vector4,
} from "three";
import type { PaintStroke } from "../messages";
import { MOST_DISCS, WORLD_HEIGHT, WORLD_WIDTH } from "../messages";
import { depths, painted } from "../paint";
import type { Look } from "../rig";
import { coverTexture, radianceTexture, toHalves } from "./textures";
import { DISPLAY_GLSL, type Display } from "./display";

const MAP_WIDTH = 512;
const MAP_HEIGHT = 256;
const PAINT_WIDTH = 256;
const PAINT_HEIGHT = 128; // of one look

/** `vec3 sky(vec3 direction)`, unit; see docs/conventions.md for the map and for a disc's edge. */
export const SKY_GLSL = `
uniform sampler2D map;
uniform sampler2D otherMap;          // of the look to compare with: the second of everything below
uniform vec3 skyGain[2];
uniform float skyTurn[2];
uniform sampler2D paint;             // premultiplied radiance and cover, as the scene is turned: of both, one below the other
uniform int isPainted[2];
uniform vec3 backdrop[2];
uniform bool showsSky;
uniform bool hasWorld;               // what is outside as the eye sees it, in place of the map and the discs
uniform bool hasOtherWorld;
uniform sampler2D world;
uniform sampler2D otherWorld;
uniform int discCount[2];
uniform vec4 discs[${2 * MOST_DISCS}];   // direction; depth where the edge begins
uniform vec4 glows[${2 * MOST_DISCS}];   // radiance; depth where it ends

vec2 mapPlace(vec3 d, float turn) {
  float c = cos(turn), s = sin(turn);
  vec3 m = vec3(c * d.x - s * d.z, d.y, s * d.x + c * d.z);
  return vec2(0.5 + atan(m.x, -m.z) * 0.15915494309, acos(clamp(m.y, -1.0, 1.0)) * 0.31830988618);
}

vec3 discsAlong(vec3 d, int first, int count) {
  vec3 radiance = vec3(0.0);
  for (int i = first; i < first + count; i++) {
    vec3 off = d - discs[i].xyz;
    float w = 0.5 * dot(off, off);  // 1 - cos, precise near the middle
    float y = clamp((w - discs[i].w) / max(glows[i].w - discs[i].w, 1e-9), 0.0, 1.0);
    radiance += glows[i].rgb * (1.0 - y * y * (3.0 - 2.0 * y));
  }
  return radiance;
}

vec3 skyBehind(vec3 d, vec3 radiance, int side) {
  if (isPainted[side] == 0) return radiance;
  vec2 at = mapPlace(d, 0.0);
  float edge = 0.5 / ${PAINT_HEIGHT}.0;
  vec4 over = texture(paint, vec2(at.x, 0.5 * (clamp(at.y, edge, 1.0 - edge) + float(side))));
  return radiance * (1.0 - over.a) + over.rgb;
}

vec3 sky(vec3 d) {
  if (meaning == 2) return vec3(0.0);  // illuminance is of surfaces
  if (!showsSky) return meaning != 0 ? vec3(0.0) : mix(backdrop[0], backdrop[1], smoothstep(-0.25, 0.6, d.y)) / gain;
  vec3 radiance = hasWorld
    ? texture(world, mapPlace(d, 0.0)).rgb
    : skyBehind(d, skyGain[0] * texture(map, mapPlace(d, skyTurn[0])).rgb, 0) + discsAlong(d, 0, discCount[0]);
  float t = hasTraced ? 0.0 : otherShare();
  if (t > 0.0) {
    vec3 other = hasOtherWorld
      ? texture(otherWorld, mapPlace(d, 0.0)).rgb
      : skyBehind(d, skyGain[1] * texture(otherMap, mapPlace(d, skyTurn[1])).rgb, 1) + discsAlong(d, ${MOST_DISCS}, discCount[1]);
    radiance = mix(radiance, other, t);
  }
  return radiance;
}
`;

const VERTEX = `
precision highp float;
uniform mat4 projectionMatrix;
uniform mat4 toWorld;
uniform mat4 fromScreen;
in vec3 position;
out vec3 direction;
void main() {
  vec4 along = fromScreen * vec4(position.xy, 1.0, 1.0);
  direction = mat3(toWorld) * (along.xyz / along.w);
  gl_Position = vec4(position.xy, 1.0, 1.0);
}
`;

const FRAGMENT = `
precision highp float;
${DISPLAY_GLSL}
${SKY_GLSL}
in vec3 direction;
out vec4 pixel;
void main() {
  bool metered = curve == 2;  // the meter looks at the scene alone
  vec3 along = normalize(direction);
  pixel = vec4(displayed(besideTraced(sky(along), vec4(along, 0.0))), metered ? 0.0 : 1.0);
}
`;

/** What of a look is seen behind the scene. */
export type SkyLook = Pick<Look, "tint" | "scale" | "rotation_deg" | "discs" | "paint" | "environment" | "sun">;
export type SkyUniforms = ReturnType<typeof makeSkyUniforms>;

export function makeSkyUniforms() {
  return {
    map: { value: emptyMap() },
    otherMap: { value: emptyMap() },
    skyGain: { value: [new Vector3(), new Vector3()] },
    skyTurn: { value: [0, 0] },
    paint: { value: coverTexture(PAINT_WIDTH, 2 * PAINT_HEIGHT) },
    paintShown: { value: ["", ""] }, // not of the shader: which strokes are in the texture
    isPainted: { value: [0, 0] },
    backdrop: { value: [new Vector3(), new Vector3()] },
    showsSky: { value: true },
    hasWorld: { value: false },
    hasOtherWorld: { value: false },
    world: { value: emptyMap() },
    otherWorld: { value: emptyMap() },
    discCount: { value: [0, 0] },
    discs: { value: Array.from({ length: 2 * MOST_DISCS }, () => new Vector4()) },
    glows: { value: Array.from({ length: 2 * MOST_DISCS }, () => new Vector4()) },
  };
}

/** A triangle over the whole screen, drawn before everything else. */
export function makeSky(uniforms: SkyUniforms, display: Display): Mesh<BufferGeometry, RawShaderMaterial> {
  const geometry = new BufferGeometry();
  const corners = new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]);
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  const material = new RawShaderMaterial({
    glslVersion: GLSL3,
    uniforms: { ...display, ...uniforms, toWorld: { value: null }, fromScreen: { value: null } },
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    depthTest: false,
    depthWrite: false,
  });
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.renderOrder = -1;
  mesh.onBeforeRender = (_renderer, _scene, camera) => {
    const { toWorld, fromScreen } = material.uniforms;
    if (toWorld) toWorld.value = camera.matrixWorld;
    if (fromScreen) fromScreen.value = camera.projectionMatrixInverse;
    material.uniformsNeedUpdate = true;
  };
  return mesh;
}

/** A map of radiance in rgb9e5, lat-long, from the top; the filter of the hardware interpolates it. */
export function skyMap(data: Uint32Array<ArrayBuffer>): DataTexture {
  if (data.length !== MAP_WIDTH * MAP_HEIGHT) throw new Error(`a sky of ${data.length} pixels`);
  return radianceTexture(data, MAP_WIDTH, MAP_HEIGHT);
}

function emptyMap(): DataTexture {
  return radianceTexture(new Uint32Array(1), 1, 1);
}

/** What is outside, as the eye sees it now; null: only the sky. `side` as of `showLook`. */
export function showWorld(uniforms: SkyUniforms, data: Uint32Array<ArrayBuffer> | null, side: 0 | 1 = 0): void {
  (side === 0 ? uniforms.hasWorld : uniforms.hasOtherWorld).value = data !== null;
  if (data === null) return;
  const place = side === 0 ? uniforms.world : uniforms.otherWorld;
  if (place.value.image.width !== WORLD_WIDTH) {
    place.value.dispose();
    place.value = radianceTexture(data, WORLD_WIDTH, WORLD_HEIGHT);
  }
  (place.value.image as { data: unknown }).data = data;
  place.value.needsUpdate = true;
}

/** Set the sky's uniforms to a look; `side` 1: the one to compare with. */
export function showLook(uniforms: SkyUniforms, look: SkyLook, side: 0 | 1 = 0): void {
  const [red, green, blue] = look.tint;
  uniforms.skyGain.value[side]?.set(red, green, blue).multiplyScalar(look.scale);
  uniforms.skyTurn.value[side] = (look.rotation_deg * Math.PI) / 180;
  showPaint(uniforms, look.paint, side);
  uniforms.discCount.value[side] = Math.min(look.discs.length, MOST_DISCS);
  look.discs.slice(0, MOST_DISCS).forEach((disc, i) => {
    const [begins, ends] = depths(disc);
    const { x, y, z } = pointing(disc.azimuth_deg, disc.elevation_deg);
    uniforms.discs.value[side * MOST_DISCS + i]?.set(x, y, z, begins);
    uniforms.glows.value[side * MOST_DISCS + i]?.set(...disc.radiance, ends);
  });
}

function showPaint(uniforms: SkyUniforms, strokes: readonly PaintStroke[], side: 0 | 1): void {
  uniforms.isPainted.value[side] = strokes.length > 0 ? 1 : 0;
  const shown = JSON.stringify(strokes);
  if (strokes.length === 0 || shown === uniforms.paintShown.value[side]) return;
  uniforms.paintShown.value[side] = shown;
  const texture = uniforms.paint.value;
  const half = 4 * PAINT_WIDTH * PAINT_HEIGHT;
  (texture.image.data as Uint16Array).set(toHalves(painted(strokes, PAINT_WIDTH, PAINT_HEIGHT)), side * half);
  texture.needsUpdate = true;
}

/** The unit direction of an azimuth, from -Z towards +X, and an elevation, in degrees. */
export function pointing(azimuth: number, elevation: number): Vector3 {
  const a = (azimuth * Math.PI) / 180;
  const e = (elevation * Math.PI) / 180;
  return new Vector3(Math.sin(a) * Math.cos(e), Math.sin(e), -Math.cos(a) * Math.cos(e));
}
