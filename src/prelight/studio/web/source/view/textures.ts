// Textures: radiance in rgb9e5, and those of the surfaces.

import {
  DataTexture,
  DataUtils,
  HalfFloatType,
  LinearFilter,
  LinearMipmapLinearFilter,
  RGBAFormat,
  RGBFormat,
  RepeatWrapping,
  SRGBColorSpace,
  Texture,
  UnsignedInt5999Type,
  type WebGLRenderer,
} from "three";
import { fetchTexture } from "../geometry";

const ANISOTROPY = 8;

export function radianceTexture(data: Uint32Array<ArrayBuffer>, width: number, height: number): DataTexture {
  const texture = new DataTexture(data, width, height, RGBFormat, UnsignedInt5999Type);
  texture.internalFormat = "RGB9_E5";
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.wrapS = RepeatWrapping;
  texture.needsUpdate = true;
  return texture;
}

/** Four half floats a pixel, nothing to begin with. */
export function coverTexture(width: number, height: number): DataTexture {
  const texture = new DataTexture(new Uint16Array(4 * width * height), width, height, RGBAFormat, HalfFloatType);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.wrapS = RepeatWrapping;
  texture.needsUpdate = true;
  return texture;
}

export function toHalves(values: Float32Array): Uint16Array {
  return Uint16Array.from(values, (value) => (value === 0 ? 0 : DataUtils.toHalfFloat(Math.min(value, 65504))));
}

/** A texture, white until it has arrived. Row 0 is v = 0. */
export function surfaceTexture(k: number, renderer: WebGLRenderer): Texture {
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
