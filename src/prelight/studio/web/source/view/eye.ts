// The eye: the bake's cameras, and orbiting by mouse, touch and keyboard.

import { PerspectiveCamera, Spherical, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { CameraView } from "../messages";
import { Walker } from "./walker";

const FLIGHT_MS = 700;
const NARROWEST = 16 / 10; // below it the field of view is widened, so that the sides of a picture stay in it
const KEY_TURN = Math.PI / 36;
const KEY_ZOOM = 0.88;

/** Of a canvas; strips at its right and its bottom are behind the panel. */
export interface Size {
  width: number;
  height: number;
  right: number;
  bottom: number;
}

interface Pose {
  position: Vector3;
  target: Vector3;
  fov: number;
}

const prefersStillness = matchMedia("(prefers-reduced-motion: reduce)");

export class Eye {
  readonly camera = new PerspectiveCamera(35, 1, 0.01, 100);
  private controls: OrbitControls;
  private pose: Pose = { position: new Vector3(0, 0, 1), target: new Vector3(), fov: 35 };
  private flight: { from: Pose; to: Pose; began: number } | null = null;
  private size: Size = { width: 1, height: 1, right: 0, bottom: 0 };
  private walker: Walker | null = null;
  private sphere = { centre: new Vector3(), radius: 1 };

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly changed: () => void,
  ) {
    this.controls = this.newControls();
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** Where the scene is, for the near and far planes. */
  frame(centre: Vector3, radius: number): void {
    this.sphere = { centre: centre.clone(), radius: Math.max(radius, 1e-6) };
  }

  /** Only the given camera: where the pixels of a picture are the receivers. */
  hold(isHeld: boolean): void {
    this.controls.enabled = !isHeld;
  }

  /** Go to a camera of the bake; at once the first time, or where motion is not wanted. */
  look(view: CameraView, { atOnce = false } = {}): void {
    const walked = this.isWalking;
    this.walk(false);
    const to = {
      position: new Vector3(...view.eye),
      target: new Vector3(...view.target),
      fov: view.vertical_fov_deg,
    };
    const isHeld = !this.controls.enabled;
    this.pose = { ...this.pose, position: this.camera.position.clone(), target: this.controls.target.clone() };
    this.camera.up.set(...view.up).normalize();
    this.controls.dispose();
    this.controls = this.newControls();
    this.controls.enabled = !isHeld;
    if (atOnce || prefersStillness.matches) {
      this.flight = null;
      this.take(to);
    } else {
      this.flight = { from: this.pose, to, began: performance.now() };
    }
    if (walked) this.canvas.dispatchEvent(new Event("walked"));
    this.changed();
  }

  /** The picture's middle is that of what the panel leaves free. */
  resize(size: Size): void {
    this.size = size;
    this.project();
  }

  /** Walk through the scene instead of going around it, or not any more. */
  walk(isWalking: boolean): void {
    if (isWalking === (this.walker !== null) || (isWalking && !this.controls.enabled)) return;
    this.flight = null;
    if (this.walker !== null) {
      this.controls.target.copy(this.walker.end(this.sphere.radius));
      this.pose = { ...this.pose, target: this.controls.target.clone() };
      this.walker = null;
      this.controls.enabled = true;
    } else {
      this.controls.enabled = false;
      this.walker = new Walker(this.canvas, this.camera, { speed: 0.35 * this.sphere.radius, changed: this.changed });
    }
    this.canvas.dispatchEvent(new Event("moved"));
    this.changed();
  }

  get isWalking(): boolean {
    return this.walker !== null;
  }

  /** What is looked at. */
  get target(): Vector3 {
    return this.controls.target;
  }

  /** One step; true while there is movement. */
  step(now: number): boolean {
    let moves = false;
    if (this.flight !== null) {
      const { from, to, began } = this.flight;
      const t = Math.min(1, (now - began) / FLIGHT_MS);
      const s = t * t * (3 - 2 * t);
      const position = from.position.clone().lerp(to.position, s);
      const target = from.target.clone().lerp(to.target, s);
      const distance = from.position.distanceTo(from.target) ** (1 - s) * to.position.distanceTo(to.target) ** s;
      if (t < 1) position.sub(target).setLength(distance).add(target);
      this.take({ position, target, fov: from.fov + (to.fov - from.fov) * s });
      if (t >= 1) this.flight = null;
      moves = true;
    }
    moves = (this.walker === null ? this.controls.update() : this.walker.step(now)) || moves;
    const distance = this.camera.position.distanceTo(this.sphere.centre);
    const least = this.walker === null ? distance / 2000 : this.sphere.radius / 2000;
    this.camera.near = Math.max((distance - 1.05 * this.sphere.radius) * 0.9, least, 1e-6);
    this.camera.far = distance + 1.1 * this.sphere.radius;
    this.project();
    return moves;
  }

  private newControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.target.copy(this.pose.target);
    controls.enableDamping = !prefersStillness.matches;
    controls.dampingFactor = 0.12;
    controls.maxPolarAngle = Math.PI * 0.98;
    controls.zoomSpeed = 0.8;
    controls.addEventListener("change", this.changed);
    controls.addEventListener("start", () => {
      this.flight = null;
      this.canvas.dispatchEvent(new Event("moved"));
    });
    return controls;
  }

  private take(pose: Pose): void {
    this.pose = pose;
    this.camera.position.copy(pose.position);
    this.controls.target.copy(pose.target);
    this.camera.lookAt(pose.target);
  }

  private project(): void {
    const { camera, pose } = this;
    const { width, height, right, bottom } = this.size;
    const free = { width: Math.max(width - right, 1), height: Math.max(height - bottom, 1) };
    const upwards = Math.tan((pose.fov * Math.PI) / 360);
    const widened = Math.max(1, NARROWEST / (free.width / free.height)) * (height / free.height);
    camera.fov = (Math.atan(upwards * widened) * 360) / Math.PI;
    camera.userData["fov"] = pose.fov;
    camera.aspect = width / height;
    camera.setViewOffset(width, height, right / 2, bottom / 2, width, height);
  }

  private key(event: KeyboardEvent): void {
    const moves: Record<string, () => void> = {
      ArrowLeft: () => this.orbit(-KEY_TURN, 0, 1),
      ArrowRight: () => this.orbit(KEY_TURN, 0, 1),
      ArrowUp: () => this.orbit(0, -KEY_TURN, 1),
      ArrowDown: () => this.orbit(0, KEY_TURN, 1),
      "+": () => this.orbit(0, 0, KEY_ZOOM),
      "=": () => this.orbit(0, 0, KEY_ZOOM),
      "-": () => this.orbit(0, 0, 1 / KEY_ZOOM),
    };
    const move = moves[event.key];
    if (move === undefined || event.ctrlKey || event.metaKey || event.altKey || !this.controls.enabled) return;
    event.preventDefault();
    this.flight = null;
    move();
    this.canvas.dispatchEvent(new Event("moved"));
    this.changed();
  }

  private orbit(around: number, down: number, nearer: number): void {
    const { position, up } = this.camera;
    const target = this.controls.target;
    const place = new Spherical().setFromVector3(position.clone().sub(target));
    if (up.y < 0.99) return;
    place.theta += around;
    place.phi = Math.min(Math.max(place.phi + down, 0.02), Math.PI * 0.98);
    place.radius *= nearer;
    position.setFromSpherical(place).add(target);
  }
}
