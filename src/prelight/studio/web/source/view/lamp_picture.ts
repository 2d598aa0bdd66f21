// What steerable lamps bring: pixels of one camera's picture, laid over the surfaces that this camera sees.

import type { DataTexture, Vector3 } from "three";
import { Matrix4, PerspectiveCamera } from "three";
import type { CameraView, SteeredView } from "../messages";
import { radianceTexture } from "./textures";

/** `vec3 fromLamps(vec4 place, float otherShare)`; after `displayed`'s functions. */
export const LAMPS_GLSL = `
uniform bool hasLamps;
uniform sampler2D lampPicture;
uniform sampler2D otherLampPicture;
uniform mat4 lampsFrom;
vec3 fromLamps(vec4 place, float t) {
  vec2 at;
  if (!hasLamps || !pictured(lampsFrom, place, at)) return vec3(0.0);
  return mix(texture(lampPicture, at).rgb, texture(otherLampPicture, at).rgb, t);
}
`;

/** From places of the scene to a camera's picture of a size. */
export function projectionOf(view: CameraView, width: number, height: number): Matrix4 {
  const camera = new PerspectiveCamera(view.vertical_fov_deg, width / height, 0.01, 1000);
  camera.up.set(...view.up);
  camera.position.set(...view.eye);
  camera.lookAt(...view.target);
  camera.updateMatrixWorld();
  camera.updateProjectionMatrix();
  return new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
}

export type LampPicture = ReturnType<typeof makeLampPicture>;

export function makeLampPicture(steered: SteeredView | null) {
  const [width, height] = steered === null ? [0, 0] : [steered.width, steered.height];
  const empty = () => radianceTexture(new Uint32Array(Math.max(1, width * height)), Math.max(1, width), Math.max(1, height));
  const pictures: [DataTexture, DataTexture] = [empty(), empty()];
  const uniforms = {
    hasLamps: { value: false },
    lampPicture: { value: pictures[0] },
    otherLampPicture: { value: pictures[1] },
    lampsFrom: { value: steered === null ? new Matrix4() : projectionOf(steered.camera, width, height) },
  };
  return {
    uniforms,
    /** How many words of a frame are theirs. */
    pixels: width * height,
    /** Only who stands where their camera stands sees them. */
    look(eye: Vector3, size: number): boolean {
      if (steered === null) return false;
      const [x, y, z] = steered.camera.eye;
      return (uniforms.hasLamps.value = Math.hypot(eye.x - x, eye.y - y, eye.z - z) < 1e-3 * size);
    },
    show(words: Uint32Array<ArrayBuffer>, side: 0 | 1): void {
      if (words.length === 0) return;
      (pictures[side].image as { data: unknown }).data = words;
      pictures[side].needsUpdate = true;
    },
    dispose(): void {
      for (const picture of pictures) picture.dispose();
    },
  };
}
