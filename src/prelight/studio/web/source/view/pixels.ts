// A layer whose receivers are the pixels of one camera: its picture, with the sky where the scene is not.

import {
  BufferAttribute,
  BufferGeometry,
  DataTexture,
  GLSL3,
  LinearFilter,
  Mesh,
  RawShaderMaterial,
  RedFormat,
  UnsignedByteType,
} from "three";
import { DISPLAY_GLSL, type Display } from "./display";
import type { Size } from "./eye";
import { SKY_GLSL, type SkyUniforms } from "./sky";
import { radianceTexture } from "./textures";

const VERTEX = `
precision highp float;
in vec3 position;
out vec2 place;
uniform vec4 frame;     // of the picture on the screen: middle, half of its size
uniform mat4 toWorld;
uniform vec2 slope;     // of the rays through the picture's right and upper edges
out vec3 direction;
void main() {
  place = vec2(0.5 + 0.5 * position.x, 0.5 - 0.5 * position.y);
  direction = mat3(toWorld) * vec3(position.xy * slope, -1.0);
  gl_Position = vec4(frame.xy + position.xy * frame.zw, 0.0, 1.0);
}
`;

const FRAGMENT = `
precision highp float;
${DISPLAY_GLSL}
${SKY_GLSL}
uniform sampler2D picture;
uniform sampler2D otherPicture;
uniform sampler2D coverage;
in vec2 place;
in vec3 direction;
out vec4 pixel;
void main() {
  float covered = texture(coverage, place).r;
  bool metered = curve == 2;
  vec3 behind = metered ? vec3(0.0) : sky(normalize(direction));
  vec3 seen = mix(texture(picture, place).rgb, texture(otherPicture, place).rgb, otherShare());
  vec3 radiance = seen + (1.0 - covered) * behind;
  pixel = vec4(displayed(radiance), metered ? covered : 1.0);
}
`;

/** A picture that fits the screen, whatever its shape. */
export class PixelPicture {
  readonly mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  private readonly texture: DataTexture;
  private readonly other: DataTexture;
  private readonly frame = { value: [0, 0, 1, 1] };

  constructor(
    private readonly shape: readonly [number, number],
    coverage: Uint8Array<ArrayBuffer>,
    { display, sky }: { display: Display; sky: SkyUniforms },
  ) {
    const [width, height] = shape;
    this.texture = radianceTexture(new Uint32Array(width * height), width, height);
    this.other = radianceTexture(new Uint32Array(width * height), width, height);
    const covered = new DataTexture(coverage, width, height, RedFormat, UnsignedByteType);
    covered.magFilter = covered.minFilter = LinearFilter;
    covered.unpackAlignment = 1;
    covered.needsUpdate = true;
    const geometry = new BufferGeometry();
    const corners = new Float32Array([-1, -1, 0, 1, -1, 0, -1, 1, 0, 1, 1, 0]);
    geometry.setAttribute("position", new BufferAttribute(corners, 3));
    geometry.setIndex([0, 1, 2, 2, 1, 3]);
    const slope = { value: [1, 1] };
    const toWorld = { value: null as unknown };
    const pictures = { picture: { value: this.texture }, otherPicture: { value: this.other }, coverage: { value: covered } };
    const uniforms = { ...pictures, frame: this.frame, slope, toWorld };
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms: { ...display, ...sky, ...uniforms },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      depthTest: false,
      depthWrite: false,
    });
    this.mesh = new Mesh(geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.onBeforeRender = (_renderer, _scene, camera) => {
      const upwards = Math.tan(((camera.userData["fov"] as number) * Math.PI) / 360);
      slope.value = [(upwards * width) / height, upwards];
      toWorld.value = camera.matrixWorld;
      material.uniformsNeedUpdate = true;
    };
  }

  upload(radiance: Uint32Array<ArrayBuffer>): void {
    if (radiance.length !== this.shape[0] * this.shape[1]) return;
    (this.texture.image as { data: unknown }).data = radiance;
    this.texture.needsUpdate = true;
  }

  /** Rows of a look to compare with; null: no more. */
  compare(radiance: Uint32Array<ArrayBuffer> | null): void {
    if (radiance?.length !== this.shape[0] * this.shape[1]) return;
    (this.other.image as { data: unknown }).data = radiance;
    this.other.needsUpdate = true;
  }

  dispose(): void {
    this.texture.dispose();
    this.other.dispose();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }

  /** Fit into what the panel leaves free of a canvas: all but strips at the right and the bottom. */
  fit({ width, height, right, bottom }: Size): void {
    const aspect = this.shape[0] / this.shape[1];
    const tall = Math.min(height - bottom, (width - right) / aspect);
    this.frame.value = [-right / width, bottom / height, (tall * aspect) / width, tall / height];
  }
}
