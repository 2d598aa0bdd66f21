// The stage: a canvas, what stands on it, and when it is drawn: only when something has changed.

import { LinearSRGBColorSpace, type Mesh, NoToneMapping, Scene, Sphere, Vector3, WebGLRenderer } from "three";
import { fetchSky, type Geometry } from "../geometry";
import type { CameraView, Welcome } from "../messages";
import type { Frame } from "../frames";
import type { Metrics } from "../metrics";
import { type Look, skyId } from "../rig";
import { newContext } from "./context";
import { CURVES, type Curve, MEANINGS, type Meaning, makeDisplay } from "./display";
import { Eye } from "./eye";
import { metered } from "./meter";
import { PixelPicture } from "./pixels";
import { type SkyLook, makeSky, makeSkyUniforms, showLook, skyMap } from "./sky";
import { Surface } from "./surface";
import { UnfinishedPicture } from "./unfinished";

const LABEL = "The scene. Arrow keys go around it, plus and minus come nearer and go away.";
const SHARPEST = 2; // device pixels a pixel of the page, at most

export class Stage {
  readonly canvas = document.createElement("canvas");
  readonly eye: Eye;
  private readonly renderer: WebGLRenderer;
  private readonly unfinished: UnfinishedPicture;
  private readonly scene = new Scene();
  private readonly display = makeDisplay();
  private readonly sky = makeSkyUniforms();
  private shown: Surface | PixelPicture | null = null;
  private waiting: Frame | null = null;
  private isWanted = false;
  private readonly skyIds: [string, string] = ["", ""]; // of what is lit, and of the look to compare with
  private readonly arrived: [string, string] = ["", ""];
  private readonly wantedSkies: [string, string] = ["", ""]; // the choices that these are of
  private isFetching = false;
  private covered = { right: 0, bottom: 0 };
  private wipe: number | null = null;
  private prepare: () => void = () => undefined;
  private drawn: () => void = () => undefined;

  constructor(
    private readonly host: HTMLElement,
    private readonly metrics: Metrics,
  ) {
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", LABEL);
    host.append(this.canvas);
    const context = newContext(this.canvas);
    this.renderer = new WebGLRenderer({ canvas: this.canvas, context, alpha: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace; // the shaders encode
    this.renderer.toneMapping = NoToneMapping;
    this.renderer.setClearAlpha(0); // beside a picture of pixels, the page
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
    this.eye.hold(welcome.pixels !== null);
    this.scene.clear();
    const { display, sky } = this;
    if (welcome.pixels !== null) {
      const covered = geometry.coverage ?? new Uint8Array(welcome.receivers).fill(255);
      this.shown = new PixelPicture(welcome.pixels, covered, { display, sky });
    } else {
      this.shown = new Surface(this.renderer, geometry, { display, sky });
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
    this.waiting = frame;
    this.invalidate();
  }

  look(view: CameraView): void {
    this.eye.look(view);
  }

  showLook(look: Look): void {
    showLook(this.sky, look);
    this.needSky(look, 0);
    this.invalidate();
  }

  /** Another light of the scene, to compare with; null: no more. */
  compare(look: SkyLook | null, radiance: Uint32Array<ArrayBuffer> | null): void {
    this.shown?.compare(radiance);
    if (look === null) {
      this.mix({ share: 0, wipe: null });
      return;
    }
    showLook(this.sky, look, 1);
    this.needSky(look, 1);
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
  setPanes(through: readonly (readonly [number, number, number])[]): void {
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
    this.renderer.render(this.scene, this.eye.camera);
    this.unfinished.begin();
    this.metrics.drew();
    this.drawn();
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

  /** Ask for a map that is not there; while one is on its way only the newest of the later ones will be asked for. */
  private needSky(look: SkyLook, side: 0 | 1): void {
    const id = skyId(look);
    if (id === this.skyIds[side]) return;
    this.skyIds[side] = id;
    this.wantedSkies[side] = look.environment;
    if (!this.isFetching) void this.changeSkies();
  }

  private async changeSkies(): Promise<void> {
    this.isFetching = true;
    const known = ["", ""];
    for (let side = this.missing(known); side !== null; side = this.missing(known)) {
      const id = this.skyIds[side] ?? "";
      known[side] = id;
      try {
        const map = skyMap(await fetchSky(id));
        const place = side === 0 ? this.sky.map : this.sky.otherMap;
        place.value.dispose();
        place.value = map;
        this.arrived[side] = id;
        if (side === 0 && id === this.skyIds[0]) this.metrics.sky = this.wantedSkies[0];
        this.invalidate();
      } catch {
        if (id === this.skyIds[side]) this.skyIds[side] = ""; // asked for again with the next change
      }
    }
    this.isFetching = false;
  }

  private missing(tried: readonly string[]): 0 | 1 | null {
    for (const side of [0, 1] as const) {
      const id = this.skyIds[side] ?? "";
      if (id !== "" && id !== this.arrived[side] && id !== tried[side]) return side;
    }
    return null;
  }
}
