// The mesh, lit by streamed radiance: rgb9e5 decoded in the vertex shader, HDR to the fragments, texture there.

import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  GLBufferAttribute,
  GLSL3,
  LinearMipmapLinearFilter,
  Mesh,
  RawShaderMaterial,
  RepeatWrapping,
  SRGBColorSpace,
  Sphere,
  Texture,
  Vector3,
  type WebGLRenderer,
} from "three";
import { fetchTexture, type Geometry } from "../geometry";
import { DISPLAY_GLSL, type Display, MEANINGS, UNPACK_GLSL } from "./display";
import { SKY_GLSL, type SkyUniforms } from "./sky";

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
#ifdef COMPARED
in uint other;
out vec3 otherLight;
#endif
uniform highp int meaning;
#ifdef PANES
uniform vec3 panes[${MOST_PANES}];
uniform vec3 eye;
in float pane;
out float isPane;
out vec3 through;
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
#ifdef PANES
${SKY_GLSL}
in float isPane;
in vec3 through;
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
#ifdef COMPARED
  vec3 seen = mix(light, otherLight, otherShare());
#else
  vec3 seen = light;
#endif
#ifdef TEXTURED
  if (meaning != ${MEANINGS.illuminance}) seen *= texture(surface, place).rgb;
#endif
#ifdef PANES
  if (isPane > 0.5) seen = through * sky(normalize(along));
#endif
  pixel = vec4(displayed(seen), 1.0);
}
`;

const ANISOTROPY = 8;

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

  private readonly panes = { value: Array.from({ length: MOST_PANES }, () => new Vector3(1, 1, 1)) };
  private readonly eye = { value: new Vector3() };

  constructor(renderer: WebGLRenderer, geometry: Geometry, { display, sky }: { display: Display; sky: SkyUniforms }) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
    this.count = geometry.positions.length / 3;
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
    const materials = groups.map(({ texture }) => material({ ...display, ...seen }, texture, renderer));
    this.mesh = new Mesh(this.shape, materials);
    this.mesh.onBeforeRender = (_renderer, _scene, camera) => this.eye.value.setFromMatrixPosition(camera.matrixWorld);
    this.mesh.frustumCulled = false;
  }

  /** Show these rows from now on; the array is kept, not copied. */
  upload(radiance: Uint32Array<ArrayBuffer>): void {
    if (radiance.length !== this.count) return;
    this.latest = radiance;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffer);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, radiance);
  }

  /** What each portal's glass lets through, from the first. */
  setPanes(through: readonly (readonly [number, number, number])[]): void {
    through.slice(0, MOST_PANES).forEach((colour, i) => this.panes.value[i]?.set(...colour));
  }

  /** Rows of a look to compare with; null: no more. */
  compare(radiance: Uint32Array<ArrayBuffer> | null): void {
    if (radiance !== null && radiance.length !== this.count) return;
    this.other = radiance;
    this.gl.deleteBuffer(this.otherBuffer);
    this.otherBuffer = null;
    if (radiance !== null) {
      this.otherBuffer = this.rowsBuffer("other");
      this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, radiance);
    } else {
      this.shape.deleteAttribute("other");
    }
    for (const material of this.mesh.material) {
      if (radiance !== null) material.defines["COMPARED"] = 1;
      else delete material.defines["COMPARED"];
      material.needsUpdate = true;
    }
  }

  dispose(): void {
    this.shape.dispose();
    this.gl.deleteBuffer(this.buffer);
    this.gl.deleteBuffer(this.otherBuffer);
    for (const material of this.mesh.material) {
      (material.uniforms["surface"]?.value as Texture | undefined)?.dispose();
      material.dispose();
    }
  }

  /** A buffer of our own, so that an update is one call; made again after a lost context. */
  makeBuffer(): void {
    this.buffer = this.rowsBuffer("radiance");
    if (this.latest !== null) this.upload(this.latest);
    if (this.other !== null) this.compare(this.other);
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
  const uniforms = texture === null ? { ...shared } : { ...shared, surface: { value: picture(texture, renderer) } };
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

/** A texture, white until it has arrived. Row 0 is v = 0. */
function picture(k: number, renderer: WebGLRenderer): Texture {
  const texture = new Texture<HTMLCanvasElement | ImageBitmap>(whitePixel());
  texture.flipY = false;
  texture.colorSpace = SRGBColorSpace;
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.anisotropy = Math.min(ANISOTROPY, renderer.capabilities.getMaxAnisotropy());
  texture.needsUpdate = true;
  void fetchTexture(k, renderer.capabilities.maxTextureSize).then((bitmap) => {
    texture.dispose();
    texture.image = bitmap;
    texture.needsUpdate = true;
    renderer.domElement.dispatchEvent(new Event("textured"));
  });
  return texture;
}

function whitePixel(): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 1;
  const context = canvas.getContext("2d");
  if (context) {
    context.fillStyle = "#fff";
    context.fillRect(0, 0, 1, 1);
  }
  return canvas;
}
