// The stage: a canvas, what stands on it, and when it is drawn: only when something has changed.

import { LinearSRGBColorSpace, type Mesh, NoToneMapping, Raycaster, Scene, Sphere, Vector2, Vector3, WebGLRenderer } from "three";
import type { Geometry } from "../geometry";
import type { CameraView, Welcome } from "../messages";
import type { Frame } from "../frames";
import type { Metrics } from "../metrics";
import type { Look } from "../rig";
import { newCanvas } from "./context";
import { CURVES, type Curve, MEANINGS, type Meaning, makeDisplay } from "./display";
import { Eye } from "./eye";
import { metered } from "./meter";
import { PixelPicture } from "./pixels";
import { projectionOf } from "./lamp_picture";
import { type SkyLook, makeSky, makeSkyUniforms, showLook, showWorld } from "./sky";
import { SkyMaps } from "./sky_maps";
import { radianceTexture } from "./textures";
import { type Hit, Surface } from "./surface";
import { UnfinishedPicture } from "./unfinished";

const LABEL = "The scene. Arrow keys go around it, plus and minus come nearer and go away.";
const SHARPEST = 2; // device pixels a pixel of the page, at most

/** A light and what it brings: to the rows, and toward the eye (null: the same toward all). */
export interface Lit {
  light: SkyLook;
  radiance: Uint32Array<ArrayBuffer>;
  shine: Uint16Array<ArrayBuffer> | null;
  world: Uint32Array<ArrayBuffer> | null;
}

export class Stage {
  readonly canvas: HTMLCanvasElement;
  readonly eye: Eye;
  private readonly renderer: WebGLRenderer;
  private readonly unfinished: UnfinishedPicture;
  private readonly scene = new Scene();
  private readonly display = makeDisplay();
  private readonly sky = makeSkyUniforms();
  private shown: Surface | PixelPicture | null = null;
  private waiting: Frame | null = null;
  private newest: Frame | null = null;
  private live: Look | null = null;
  private view: Frame | null = null; // what of it depends on the eye
  private held: Lit | null = null; // shown in place of what is lit
  isWanted = false; // another picture than is seen
  private readonly maps = new SkyMaps(this.sky, (environment) => {
    if (environment !== null) this.metrics.sky = environment;
    this.invalidate();
  });
  private covered = { right: 0, bottom: 0 };
  private wipe: number | null = null;
  private prepare: () => void = () => undefined;
  private drawn: () => void = () => undefined;

  constructor(
    private readonly host: HTMLElement,
    private readonly metrics: Metrics,
  ) {
    const { canvas, context } = newCanvas();
    this.canvas = canvas;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", LABEL);
    host.append(this.canvas);
    this.renderer = new WebGLRenderer({ canvas: this.canvas, context, alpha: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace; // the shaders encode
    this.renderer.toneMapping = NoToneMapping;
    this.renderer.setClearAlpha(0); // beside a picture of pixels, the page
    this.renderer.setScissor(0, 0, 1, 1);
    this.unfinished = new UnfinishedPicture(context);
    this.eye = new Eye(this.canvas, () => this.invalidate());
    new ResizeObserver(() => this.resize()).observe(host);
    this.canvas.addEventListener("textured", () => this.invalidate());
    this.canvas.addEventListener("webglcontextrestored", () => {
      if (this.shown instanceof Surface) this.shown.makeBuffer();
      this.invalidate();
    });
  }

  /** Put a bake on the stage, in place of what is there. */
  show(welcome: Welcome, geometry: Geometry): void {
    this.shown?.dispose();
    this.view = null;
    this.eye.hold(welcome.pixels !== null);
    this.scene.clear();
    const { display, sky } = this;
    if (welcome.pixels !== null) {
      const covered = geometry.coverage ?? new Uint8Array(welcome.receivers).fill(255);
      this.shown = new PixelPicture(welcome.pixels, covered, { display, sky });
    } else {
      this.shown = new Surface(this.renderer, geometry, { display, sky, steered: welcome.steered });
      this.eye.frame(this.shown.sphere.center, this.shown.sphere.radius);
      this.scene.add(makeSky(sky, display));
    }
    this.scene.add(this.shown.mesh);
    const [first] = welcome.cameras;
    if (first !== undefined) this.eye.look(first, { atOnce: true });
    this.resize();
  }

  /** A frame of radiance: shown with the next picture; a newer one replaces it. */
  take(frame: Frame): void {
    this.newest = frame;
    if (this.held !== null) return;
    this.waiting = frame;
    this.invalidate();
  }

  /** Show a light in place of the one that is lit, until null is given. */
  hold(lit: Lit | null): void {
    if (lit === this.held) return;
    const isNew = lit?.radiance !== this.held?.radiance;
    this.held = lit;
    if (lit === null) {
      this.waiting = this.newest;
      if (this.live !== null) this.showLook(this.live);
    } else {
      this.waiting = null;
      if (isNew) this.shown?.upload(lit.radiance);
      showLook(this.sky, lit.light);
      this.maps.need(lit.light, 0);
    }
    this.shine(lit ?? this.view);
  }

  /** What depends on the eye, of what is lit. */
  showView(view: Frame): void {
    this.view = view;
    if (this.held === null) this.shine(view);
  }

  private shine(view: Pick<Frame, "shine" | "world"> | null): void {
    if (this.shown instanceof Surface) this.shown.shine.show(view?.shine ?? null);
    showWorld(this.sky, view?.world ?? null);
    this.invalidate();
  }

  /** A picture that the path tracer made of a camera's view, to compare with; null: none. */
  showTraced(traced: { words: Uint32Array<ArrayBuffer>; view: CameraView; width: number; height: number } | null): void {
    this.display.hasTraced.value = traced !== null;
    if (traced !== null) {
      const { words, view, width, height } = traced;
      this.display.traced.value.dispose();
      this.display.traced.value = radianceTexture(words, width, height);
      this.display.tracedFrom.value.copy(projectionOf(view, width, height));
    }
    this.invalidate();
  }

  /** The camera as it is now, of what the panel leaves free, and how many pixels that is. */
  get viewed(): { view: CameraView; width: number; height: number } {
    const { camera, target } = this.eye;
    const free = { width: this.freeWidth, height: this.host.clientHeight - this.covered.bottom };
    const upwards = Math.tan((camera.fov * Math.PI) / 360) * (free.height / this.host.clientHeight);
    const at = (p: Vector3): [number, number, number] => [p.x, p.y, p.z];
    const ahead = camera.position.clone().add(camera.getWorldDirection(new Vector3()).multiplyScalar(target.distanceTo(camera.position) || 1));
    const view: CameraView = {
      name: "here", eye: at(camera.position), target: at(ahead), up: at(camera.up),
      vertical_fov_deg: (Math.atan(upwards) * 360) / Math.PI,
    };
    return { view, ...free };
  }

  /** Where the surfaces are met under a place of the page, in pixels; null where there are none. */
  pick(x: number, y: number): Hit | null {
    if (!(this.shown instanceof Surface)) return null;
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const rays = new Raycaster();
    rays.setFromCamera(new Vector2(((x - left) / width) * 2 - 1, 1 - ((y - top) / height) * 2), this.eye.camera);
    return this.shown.hit(rays);
  }

  /** What a ray meets that begins on a surface. */
  reach(from: Vector3, along: Vector3): Hit | null {
    if (!(this.shown instanceof Surface)) return null;
    return this.shown.hit(new Raycaster(from, along, 1e-4 * this.sphere.radius));
  }

  /** What is on the screen, as a PNG. */
  snapshot(): Promise<Blob | null> {
    this.prepare();
    this.eye.step(performance.now());
    this.draw();
    return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
  }

  look(view: CameraView): void {
    this.eye.look(view);
  }

  showLook(look: Look): void {
    this.live = look;
    if (this.held !== null) return;
    showLook(this.sky, look);
    this.maps.need(look, 0);
    this.invalidate();
  }

  /** Another light of the scene, to compare with; null: no more. */
  compare(lit: Lit | null): void {
    this.shown?.compare(lit?.radiance ?? null);
    if (this.shown instanceof Surface) this.shown.otherShine.show(lit?.shine ?? null);
    showWorld(this.sky, lit?.world ?? null, 1);
    if (lit === null) {
      this.mix({ share: 0, wipe: null });
      return;
    }
    showLook(this.sky, lit.light, 1);
    this.maps.need(lit.light, 1);
    this.invalidate();
  }

  /** How much of the other light is seen: a share of it, or all of it right of a place from 0 to 1 of the free part. */
  mix({ share, wipe }: { share: number; wipe: number | null }): void {
    this.display.share.value = share;
    this.wipe = wipe;
    this.placeWipe();
    this.invalidate();
  }

  /** What each portal's glass lets through, in the order of the studio's list. */
  setPanes(through: readonly (readonly [number, number, number, number])[]): void {
    if (this.shown instanceof Surface) this.shown.setPanes(through);
    this.invalidate();
  }

  /** The picture, or false colour; `top` is the largest value, in cd/m² or lx. */
  setMeaning(meaning: Meaning, top: number): void {
    this.display.meaning.value = MEANINGS[meaning];
    this.display.falseTop.value = top;
    this.invalidate();
  }

  expose(stops: number): void {
    this.display.gain.value = 2 ** stops;
    this.invalidate();
  }

  setCurve(curve: Curve): void {
    this.display.curve.value = CURVES[curve];
    this.invalidate();
  }

  /** The sky behind the scene, or a plain backdrop from one linear grey below to another above. */
  setBackdrop(showsSky: boolean, [low, high]: readonly [number, number]): void {
    this.sky.showsSky.value = showsSky;
    const { value: greys } = this.sky.backdrop;
    [low, high].forEach((grey, i) => greys[i]?.setScalar(grey));
    this.invalidate();
  }

  /** How many pixels at the right and the bottom the panel covers. */
  cover(right: number, bottom: number): void {
    this.covered = { right, bottom };
    this.resize();
  }

  /** What the scene's surfaces are, for rays; null where there are only pixels. */
  get surface(): Mesh | null {
    return this.shown instanceof Surface ? this.shown.mesh : null;
  }

  /** Its middle and its size. */
  get sphere(): Sphere {
    return this.shown instanceof Surface ? this.shown.sphere : new Sphere(new Vector3(), 1);
  }

  /** The width of what the panel leaves free, in pixels of the page. */
  get freeWidth(): number {
    return this.host.clientWidth - this.covered.right;
  }

  /** The exposure, in stops, that the light meter would choose; null in the dark. */
  meter(): number | null {
    const { curve } = this.display;
    const { meaning } = this.display;
    const before = curve.value;
    const meant = meaning.value;
    curve.value = CURVES.none;
    meaning.value = MEANINGS.picture;
    this.uploadWaiting();
    const stops = metered(this.renderer, () => this.renderer.render(this.scene, this.eye.camera));
    curve.value = before;
    meaning.value = meant;
    return stops;
  }

  /** Call this before every picture. */
  beforeDraw(prepare: () => void): void {
    this.prepare = prepare;
  }

  /** Call this after every picture. */
  onDraw(drawn: () => void): void {
    this.drawn = drawn;
  }

  /** Where the eye looks, in degrees from -Z towards +X. */
  heading(): number {
    const ahead = this.eye.camera.getWorldDirection(new Vector3());
    return (Math.atan2(ahead.x, -ahead.z) * 180) / Math.PI;
  }

  /** The canvas's pixels now, RGBA, from the bottom: for tests. */
  pixels(): { width: number; height: number; data: Uint8Array } {
    this.prepare();
    this.eye.step(performance.now());
    this.draw();
    const gl = this.renderer.getContext();
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    const data = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    return { width, height, data };
  }

  /** Draw with the next animation frame, or the first after the picture before is ready. */
  invalidate(): void {
    if (this.isWanted) return;
    this.isWanted = true;
    this.request();
  }

  private request(): void {
    requestAnimationFrame((now) => {
      const wait = this.unfinished.wait();
      if (wait > 0) {
        window.setTimeout(() => this.request(), wait);
        return;
      }
      this.prepare();
      this.isWanted = false;
      const moves = this.eye.step(now);
      this.draw();
      if (moves) this.invalidate();
    });
  }

  private draw(): void {
    this.uploadWaiting();
    if (this.shown instanceof Surface) this.metrics.lamps = this.shown.lamps.look(this.eye.camera.position, this.sphere.radius);
    this.renderer.setScissorTest(this.isUnlit); // until there is light one pixel is drawn, to have the shaders compiled
    this.renderer.render(this.scene, this.eye.camera);
    this.unfinished.begin();
    this.metrics.drew();
    this.drawn();
  }

  private get isUnlit(): boolean {
    return this.newest === null && this.held === null;
  }

  private uploadWaiting(): void {
    const frame = this.waiting;
    if (frame === null || this.shown === null) return;
    const began = performance.now();
    this.shown.upload(frame.radiance);
    this.waiting = null;
    this.metrics.uploaded(frame, performance.now() - began);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, SHARPEST));
    this.renderer.setSize(width, height, false);
    const size = { width, height, ...this.covered };
    if (this.shown instanceof PixelPicture) this.shown.fit(size);
    this.eye.resize(size);
    this.placeWipe();
    this.invalidate();
  }

  private placeWipe(): void {
    const free = (this.host.clientWidth - this.covered.right) * this.renderer.getPixelRatio();
    this.display.wipe.value = this.wipe === null ? -1 : this.wipe * free;
  }
}
