// What does not change: the mesh, its colours, its textures, fetched once.

export interface Material {
  name: string;
  texture: number | null;
}

interface ArrayPlace {
  url: string;
  type: "f4" | "u4" | "u1";
  shape: number[];
}

interface Index {
  bake: string;
  vertices: number;
  triangles: number;
  arrays: Record<string, ArrayPlace>;
  materials: Material[];
}

export interface Geometry {
  /** Of which bake: `Welcome.bake`. */
  bake: string;
  positions: Float32Array<ArrayBuffer>;
  normals: Float32Array<ArrayBuffer> | null;
  triangles: Uint32Array<ArrayBuffer>;
  materialOf: Uint32Array<ArrayBuffer>;
  albedo: Float32Array<ArrayBuffer>;
  tint: Float32Array<ArrayBuffer>;
  uv: Float32Array<ArrayBuffer> | null;
  /** For each vertex of glass its portal's number from 1; 0 elsewhere. */
  pane: Uint32Array<ArrayBuffer> | null;
  /** (h, w) parts of 255 of the pixels that see the scene, where pixels are the receivers. */
  coverage: Uint8Array<ArrayBuffer> | null;
  materials: Material[];
}

const BYTES = { f4: 4, u4: 4, u1: 1 } as const;

/** Hears bytes so far and bytes in all. */
type Report = (done: number, all: number) => void;

/** The geometry that is asked for while the page still begins; for the first bake that it shows. */
export class EarlyGeometry {
  private report: Report = () => undefined;
  private fetched: Promise<Geometry | null> | null = fetchGeometry((done, all) => this.report(done, all)).catch(() => null);

  /** What was asked for early, once and if it is of this bake; else it is fetched now. Raises as `fetchGeometry`. */
  async of(bake: string, report: Report): Promise<Geometry> {
    this.report = report;
    const early = await this.fetched;
    this.fetched = null;
    return early?.bake === bake ? early : fetchGeometry(report);
  }
}

/** Fetch a bake's geometry. Raises Error with a sentence. */
async function fetchGeometry(report: Report): Promise<Geometry> {
  const index = (await (await fetched("/geometry.json")).json()) as Index;
  const names = ["positions", "normals", "triangles", "material_of", "albedo", "tint", "uv", "pane", "coverage"];
  const places = new Map(names.flatMap((name) => Object.entries(index.arrays).filter(([key]) => key === name)));
  const all = [...places.values()].reduce((sum, place) => sum + byteLength(place), 0);
  let done = 0;
  const arrays = new Map<string, ArrayBuffer>();
  await Promise.all(
    [...places].map(async ([name, place]) => {
      const bytes = await fetchBytes(place.url, byteLength(place), (more) => report((done += more), all));
      arrays.set(name, bytes);
    }),
  );
  const need = (name: string): ArrayBuffer => {
    const bytes = arrays.get(name);
    if (bytes === undefined) throw new Error(`The studio sent no ${name}.`);
    return bytes;
  };
  const floats = (name: string) => new Float32Array(need(name));
  return {
    bake: index.bake,
    positions: floats("positions"),
    normals: arrays.has("normals") ? floats("normals") : null,
    triangles: new Uint32Array(need("triangles")),
    materialOf: new Uint32Array(need("material_of")),
    albedo: floats("albedo"),
    tint: floats("tint"),
    uv: arrays.has("uv") ? floats("uv") : null,
    pane: arrays.has("pane") ? new Uint32Array(need("pane")) : null,
    coverage: arrays.has("coverage") ? new Uint8Array(need("coverage")) : null,
    materials: index.materials,
  };
}

/** The radiance of a map without turn and scale: rgb9e5, lat-long. */
export async function fetchSky(id: string): Promise<Uint32Array<ArrayBuffer>> {
  return new Uint32Array(await (await fetched(`/sky/${encodeURIComponent(id)}`)).arrayBuffer());
}

/** The light as a rig file, or the timeline as one whose lamps fade. Raises Error with a sentence. */
export async function fetchRig(what: "rig" | "timeline" = "rig"): Promise<Blob> {
  const response = await fetch(`/${what}.toml`);
  if (!response.ok) throw new Error((await response.text()).trim());
  return response.blob();
}

/** A picture of the bake's textures, its colours as stored, no larger than `most` a side. */
export async function fetchTexture(k: number, most: number): Promise<ImageBitmap> {
  const options: ImageBitmapOptions = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
  const bitmap = await createImageBitmap(await (await fetched(`/texture/${k}`)).blob(), options);
  const share = most / Math.max(bitmap.width, bitmap.height);
  if (share >= 1) return bitmap;
  const resizeWidth = Math.max(1, Math.floor(bitmap.width * share));
  const resizeHeight = Math.max(1, Math.floor(bitmap.height * share));
  return createImageBitmap(bitmap, { ...options, resizeWidth, resizeHeight, resizeQuality: "high" });
}

export async function fetchPreview(id: string): Promise<ImageBitmap> {
  return createImageBitmap(await (await fetched(`/preview/${encodeURIComponent(id)}`)).blob());
}

function byteLength({ type, shape }: ArrayPlace): number {
  return shape.reduce((product, side) => product * side, BYTES[type]);
}

async function fetched(url: string): Promise<Response> {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`The studio answered ${response.status} when asked for ${url}.`);
  return response;
}

async function fetchBytes(url: string, size: number, more: (bytes: number) => void): Promise<ArrayBuffer> {
  const { body } = await fetched(url);
  const bytes = new Uint8Array(size);
  let filled = 0;
  const reader = body?.getReader();
  for (let part = await reader?.read(); part?.value; part = await reader?.read()) {
    if (filled + part.value.length > size) break;
    bytes.set(part.value, filled);
    filled += part.value.length;
    more(part.value.length);
  }
  if (filled !== size) throw new Error(`The studio sent ${filled} of ${size} bytes of ${url}.`);
  return bytes.buffer;
}
