// The mesh, lit by streamed radiance: rgb9e5 decoded in the vertex shader, HDR to the fragments, texture there.

import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  GLBufferAttribute,
  GLSL3,
  Mesh,
  RawShaderMaterial,
  Sphere,
  type Texture,
  Vector3,
  Vector4,
  type Raycaster,
  type WebGLRenderer,
} from "three";
import type { Geometry } from "../geometry";
import { makeLampPicture, LAMPS_GLSL, type LampPicture } from "./lamp_picture";
import type { SteeredView } from "../messages";
import { DISPLAY_GLSL, type Display, MEANINGS, UNPACK_GLSL } from "./display";
import { SKY_GLSL, type SkyUniforms } from "./sky";
import { ShineRows } from "./shine_rows";
import { surfaceTexture } from "./textures";

const MOST_PANES = 128;

const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec3 albedo;
#ifdef TEXTURED
in vec3 tint;
in vec2 uv;
out vec2 place;
#endif
in uint radiance;
out vec3 light;
#ifdef SHINES
in vec4 shine;
out vec3 shining;
#endif
#ifdef OTHER_SHINES
in vec4 otherShine;
out vec3 otherShining;
#endif
out vec3 place3;
#ifdef COMPARED
in uint other;
out vec3 otherLight;
#endif
uniform highp int meaning;
#ifdef PANES
uniform vec4 panes[${MOST_PANES}];   // what they let through; 1 where they are frosted
uniform vec3 eye;
in float pane;
out float isPane;
out vec4 through;
out vec3 along;
#endif
${UNPACK_GLSL}
void main() {
#ifdef TEXTURED
  place = uv;
  vec3 colour = tint;
#else
  vec3 colour = albedo;
#endif
  if (meaning == ${MEANINGS.illuminance}) colour = vec3(1.0);
  light = unpacked(radiance) * colour;
#ifdef COMPARED
  otherLight = unpacked(other) * colour;
#endif
#ifdef SHINES
  shining = shine.rgb;
#endif
#ifdef OTHER_SHINES
  otherShining = otherShine.rgb;
#endif
  place3 = position;
#ifdef PANES
  isPane = min(pane, 1.0);
  through = panes[min(int(max(pane, 1.0) + 0.5), ${MOST_PANES}) - 1];
  along = position - eye;
#endif
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(position, 1.0));
}
`;

const FRAGMENT = `
precision highp float;
${DISPLAY_GLSL}
${LAMPS_GLSL}
#ifdef SHINES
in vec3 shining;
#endif
#ifdef OTHER_SHINES
in vec3 otherShining;
#endif
in vec3 place3;
#ifdef PANES
${SKY_GLSL}
in float isPane;
in vec4 through;
in vec3 along;
#endif
in vec3 light;
#ifdef TEXTURED
uniform sampler2D surface;
in vec2 place;
#endif
#ifdef COMPARED
in vec3 otherLight;
#endif
out vec4 pixel;
void main() {
  bool measured = meaning == ${MEANINGS.illuminance};
  float t = hasTraced ? 0.0 : otherShare();
#ifdef COMPARED
  vec3 seen = mix(light, otherLight, t);
#else
  vec3 seen = light;
#endif
#ifdef TEXTURED
  if (!measured) seen *= texture(surface, place).rgb;
#endif
  vec3 shone = vec3(0.0);
#ifdef SHINES
  shone = (1.0 - t) * shining;
#endif
#ifdef OTHER_SHINES
  shone += t * otherShining;
#endif
#ifdef PANES
  if (isPane > 0.5) {
#if defined(SHINES) || defined(OTHER_SHINES)
    seen = through.a > 0.5 ? vec3(0.0) : through.rgb * sky(normalize(along));
#else
    seen = through.rgb * sky(normalize(along));
#endif
    if (through.a <= 0.5) shone = vec3(0.0);
  }
#endif
  if (!measured) seen = max(seen + shone, 0.0);
  if (!measured) seen += fromLamps(vec4(place3, 1.0), t);
  pixel = vec4(displayed(besideTraced(seen, vec4(place3, 1.0))), 1.0);
}
`;

/** Where a ray meets a surface; `front`: from the side that its normal is on. */
export interface Hit {
  point: Vector3;
  normal: Vector3;
  distance: number;
  front: boolean;
}

/** Draws vertices whose radiance changes. */
export class Surface {
  readonly mesh: Mesh<BufferGeometry, RawShaderMaterial[]>;
  readonly sphere: Sphere;
  private readonly shape = new BufferGeometry();
  private readonly gl: WebGL2RenderingContext;
  private readonly count: number;
  private buffer: WebGLBuffer | null = null;
  private latest: Uint32Array<ArrayBuffer> | null = null;
  private other: Uint32Array<ArrayBuffer> | null = null;
  private otherBuffer: WebGLBuffer | null = null;
  /** What shines toward the eye, of what is lit and of the look to compare with. */
  readonly shine: ShineRows;
  readonly otherShine: ShineRows;
  private readonly normals: Float32Array<ArrayBuffer> | null;
  /** What steerable lamps add, seen from their camera. */
  readonly lamps: LampPicture;

  private readonly panes = { value: Array.from({ length: MOST_PANES }, () => new Vector4(1, 1, 1, 0)) };
  private readonly eye = { value: new Vector3() };

  constructor(
    renderer: WebGLRenderer,
    geometry: Geometry,
    { display, sky, steered }: { display: Display; sky: SkyUniforms; steered: SteeredView | null },
  ) {
    this.lamps = makeLampPicture(steered);
    this.normals = geometry.normals;
    this.gl = renderer.getContext() as WebGL2RenderingContext;
    this.count = geometry.positions.length / 3;
    const rowsOf = (attribute: string, name: string) =>
      new ShineRows(this.gl, this.shape, { attribute, count: this.count, define: (isSet) => this.define(name, isSet) });
    this.shine = rowsOf("shine", "SHINES");
    this.otherShine = rowsOf("otherShine", "OTHER_SHINES");
    const { order, groups } = byTexture(geometry);
    this.shape.setAttribute("position", new BufferAttribute(geometry.positions, 3));
    this.shape.setAttribute("albedo", new BufferAttribute(geometry.albedo, 3));
    if (geometry.uv !== null) {
      this.shape.setAttribute("tint", new BufferAttribute(geometry.tint, 3));
      this.shape.setAttribute("uv", new BufferAttribute(geometry.uv, 2));
    }
    if (geometry.pane !== null) {
      this.shape.setAttribute("pane", new BufferAttribute(Float32Array.from(geometry.pane), 1));
    }
    this.shape.setIndex(new BufferAttribute(order, 1));
    groups.forEach(({ start, count }, i) => this.shape.addGroup(start, count, i));
    this.makeBuffer();
    const used = order.length > 0;
    this.shape.computeBoundingSphere();
    this.sphere = used && this.shape.boundingSphere ? this.shape.boundingSphere : new Sphere();
    const seen = geometry.pane === null ? {} : { ...sky, panes: this.panes, eye: this.eye };
    const materials = groups.map(({ texture }) => material({ ...display, ...seen, ...this.lamps.uniforms }, texture, renderer));
    this.mesh = new Mesh(this.shape, materials);
    this.mesh.onBeforeRender = (_renderer, _scene, camera) => this.eye.value.setFromMatrixPosition(camera.matrixWorld);
    this.mesh.frustumCulled = false;
  }

  /** Show these rows from now on; the array is kept, not copied. */
  upload(radiance: Uint32Array<ArrayBuffer>): void {
    if (radiance.length !== this.count + this.lamps.pixels) return;
    this.latest = radiance;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffer);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, radiance, 0, this.count);
    this.lamps.show(radiance.subarray(this.count), 0);
  }

  /** Where a ray meets the scene first, and the normal there, toward where the ray comes from. */
  hit(rays: Raycaster): Hit | null {
    const [first] = rays.intersectObject(this.mesh, false);
    if (first === undefined || !first.face) return null;
    const normal = this.normalAt(first.face, first.barycoord ?? null) ?? first.face.normal.clone();
    const front = normal.dot(rays.ray.direction) <= 0;
    if (!front) normal.negate();
    return { point: first.point, normal: normal.normalize(), distance: first.distance, front };
  }

  private normalAt({ a, b, c }: { a: number; b: number; c: number }, weights: Vector3 | null): Vector3 | null {
    const { normals } = this;
    if (normals === null || weights === null) return null;
    const sum = new Vector3();
    for (const [vertex, weight] of [[a, weights.x], [b, weights.y], [c, weights.z]] as const) {
      sum.addScaledVector(new Vector3().fromArray(normals, 3 * vertex), weight);
    }
    return sum.lengthSq() > 1e-6 ? sum : null;
  }

  /** What each portal's glass lets through, from the first; the fourth is 1 where it is frosted. */
  setPanes(through: readonly (readonly [number, number, number, number])[]): void {
    through.slice(0, MOST_PANES).forEach((colour, i) => this.panes.value[i]?.set(...colour));
  }

  /** Rows of a look to compare with; null: no more. */
  compare(radiance: Uint32Array<ArrayBuffer> | null): void {
    if (radiance !== null && radiance.length !== this.count + this.lamps.pixels) return;
    const isOther = (radiance === null) !== (this.other === null);
    this.other = radiance;
    if (radiance !== null) {
      this.otherBuffer ??= this.rowsBuffer("other");
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.otherBuffer);
      this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, radiance, 0, this.count);
      this.lamps.show(radiance.subarray(this.count), 1);
    } else {
      this.gl.deleteBuffer(this.otherBuffer);
      this.otherBuffer = null;
      this.shape.deleteAttribute("other");
    }
    if (isOther) this.define("COMPARED", radiance !== null);
  }

  private define(name: string, isSet: boolean): void {
    for (const material of this.mesh.material) {
      if (isSet) material.defines[name] = 1;
      else delete material.defines[name];
      material.needsUpdate = true;
    }
  }

  dispose(): void {
    this.shape.dispose();
    this.gl.deleteBuffer(this.buffer);
    this.gl.deleteBuffer(this.otherBuffer);
    this.shine.dispose();
    this.otherShine.dispose();
    this.lamps.dispose();
    for (const material of this.mesh.material) {
      (material.uniforms["surface"]?.value as Texture | undefined)?.dispose();
      material.dispose();
    }
  }

  /** A buffer of our own, so that an update is one call; made again after a lost context. */
  makeBuffer(): void {
    this.buffer = this.rowsBuffer("radiance");
    if (this.latest !== null) this.upload(this.latest);
    const { other } = this;
    this.otherBuffer = null;
    if (other !== null) this.compare(other);
    this.shine.makeBuffer();
    this.otherShine.makeBuffer();
  }

  /** A buffer for a word a row, bound, as an attribute of the shape. */
  private rowsBuffer(name: string): WebGLBuffer | null {
    const { gl, count } = this;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, 4 * count, gl.STREAM_DRAW);
    const rows = new GLBufferAttribute(buffer, gl.UNSIGNED_INT, 1, 4, count);
    this.shape.setAttribute(name, rows as unknown as BufferAttribute); // three takes both; its types do not say
    return buffer;
  }
}

interface Group {
  texture: number | null;
  start: number;
  count: number;
}

/** The triangles' indices, sorted by texture, and where each texture's begin. */
function byTexture(geometry: Geometry): { order: Uint32Array<ArrayBuffer>; groups: Group[] } {
  const { triangles, materialOf, materials, uv } = geometry;
  const slots = new Map<number | null, number>([[null, 0]]);
  const slotOf = materials.map(({ texture }) => {
    const known = uv === null ? null : texture;
    if (!slots.has(known)) slots.set(known, slots.size);
    return slots.get(known) ?? 0;
  });
  if (slots.size === 1) return { order: triangles, groups: [{ texture: null, start: 0, count: triangles.length }] };
  const slot = Uint32Array.from(materialOf, (m) => slotOf[m] ?? 0);
  const counts = new Uint32Array(slots.size);
  for (const s of slot) counts[s] = (counts[s] ?? 0) + 3;
  const next = new Uint32Array(slots.size);
  for (let s = 1; s < next.length; s++) next[s] = (next[s - 1] ?? 0) + (counts[s - 1] ?? 0);
  const groups = [...slots].map(([texture, s]) => ({ texture, start: next[s] ?? 0, count: counts[s] ?? 0 }));
  const order = new Uint32Array(triangles.length);
  slot.forEach((s, f) => {
    const to = next[s] ?? 0;
    order.set(triangles.subarray(3 * f, 3 * f + 3), to);
    next[s] = to + 3;
  });
  return { order, groups: groups.filter(({ count }) => count > 0) };
}

type Uniforms = Record<string, { value: unknown }>;

function material(shared: Uniforms, texture: number | null, renderer: WebGLRenderer): RawShaderMaterial {
  const uniforms = texture === null ? { ...shared } : { ...shared, surface: { value: surfaceTexture(texture, renderer) } };
  const panes = "panes" in shared ? { PANES: 1 } : {};
  return new RawShaderMaterial({
    glslVersion: GLSL3,
    defines: texture === null ? { ...panes } : { ...panes, TEXTURED: 1 },
    uniforms,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    side: DoubleSide,
  });
}
