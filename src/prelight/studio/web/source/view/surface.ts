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
  type WebGLRenderer,
} from "three";
import { fetchTexture, type Geometry } from "../geometry";
import { DISPLAY_GLSL, type Display, UNPACK_GLSL } from "./display";

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
${UNPACK_GLSL}
void main() {
#ifdef TEXTURED
  place = uv;
  light = unpacked(radiance) * tint;
#else
  light = unpacked(radiance) * albedo;
#endif
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(position, 1.0));
}
`;

const FRAGMENT = `
precision highp float;
${DISPLAY_GLSL}
in vec3 light;
#ifdef TEXTURED
uniform sampler2D surface;
in vec2 place;
#endif
out vec4 pixel;
void main() {
#ifdef TEXTURED
  pixel = vec4(displayed(light * texture(surface, place).rgb), 1.0);
#else
  pixel = vec4(displayed(light), 1.0);
#endif
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

  constructor(renderer: WebGLRenderer, geometry: Geometry, display: Display) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
    this.count = geometry.positions.length / 3;
    const { order, groups } = byTexture(geometry);
    this.shape.setAttribute("position", new BufferAttribute(geometry.positions, 3));
    this.shape.setAttribute("albedo", new BufferAttribute(geometry.albedo, 3));
    if (geometry.uv !== null) {
      this.shape.setAttribute("tint", new BufferAttribute(geometry.tint, 3));
      this.shape.setAttribute("uv", new BufferAttribute(geometry.uv, 2));
    }
    this.shape.setIndex(new BufferAttribute(order, 1));
    groups.forEach(({ start, count }, i) => this.shape.addGroup(start, count, i));
    this.makeBuffer();
    const used = order.length > 0;
    this.shape.computeBoundingSphere();
    this.sphere = used && this.shape.boundingSphere ? this.shape.boundingSphere : new Sphere();
    const materials = groups.map(({ texture }) => material(display, texture, renderer));
    this.mesh = new Mesh(this.shape, materials);
    this.mesh.frustumCulled = false;
  }

  /** Show these rows from now on; the array is kept, not copied. */
  upload(radiance: Uint32Array<ArrayBuffer>): void {
    if (radiance.length !== this.count) return;
    this.latest = radiance;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffer);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, radiance);
  }

  dispose(): void {
    this.shape.dispose();
    this.gl.deleteBuffer(this.buffer);
    for (const material of this.mesh.material) {
      (material.uniforms["surface"]?.value as Texture | undefined)?.dispose();
      material.dispose();
    }
  }

  /** A buffer of our own, so that an update is one call; made again after a lost context. */
  makeBuffer(): void {
    const { gl, count } = this;
    this.buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, 4 * count, gl.STREAM_DRAW);
    const rows = new GLBufferAttribute(this.buffer, gl.UNSIGNED_INT, 1, 4, count);
    this.shape.setAttribute("radiance", rows as unknown as BufferAttribute); // three takes both; its types do not say
    if (this.latest !== null) this.upload(this.latest);
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

function material(display: Display, texture: number | null, renderer: WebGLRenderer): RawShaderMaterial {
  const uniforms = texture === null ? { ...display } : { ...display, surface: { value: picture(texture, renderer) } };
  return new RawShaderMaterial({
    glslVersion: GLSL3,
    defines: texture === null ? {} : { TEXTURED: 1 },
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
