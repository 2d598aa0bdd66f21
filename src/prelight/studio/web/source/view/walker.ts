// First person: looking around by dragging, going by W A S D or the arrows, up and down by Q and E; nearer by the wheel.

import { Euler, type PerspectiveCamera, Vector3 } from "three";

const TURN = 0.0032; // radians a pixel
const STEEPEST = 1.5; // radians
const FASTER = 3; // with Shift
const LONGEST_STEP = 0.1; // seconds, of a picture that took long
const WAYS: Readonly<Record<string, readonly [number, number, number]>> = {
  w: [0, 0, -1], s: [0, 0, 1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0],
  ArrowUp: [0, 0, -1], ArrowDown: [0, 0, 1], ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0],
};

export class Walker {
  private readonly held = new Map<string, number>(); // keys, and since when
  private readonly fingers = new Map<number, { x: number; y: number }>();
  private readonly ends = new AbortController();
  private readonly angles: Euler;
  private isFast = false;
  private before = performance.now();

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: PerspectiveCamera,
    private readonly given: { speed: number; changed: () => void },
  ) {
    this.angles = new Euler().setFromQuaternion(camera.quaternion, "YXZ");
    this.angles.z = 0;
    const { signal } = this.ends;
    canvas.addEventListener("pointerdown", (event) => this.press(event), { signal });
    canvas.addEventListener("pointermove", (event) => this.drag(event), { signal });
    for (const name of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(name, (event) => this.fingers.delete(event.pointerId), { signal });
    }
    canvas.addEventListener("wheel", (event) => this.wheel(event), { signal, passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event), { signal, capture: true });
    window.addEventListener("keyup", (event) => this.held.delete(named(event)), { signal });
    window.addEventListener("blur", () => this.held.clear(), { signal });
  }

  /** No more; where it looks, some way ahead. */
  end(far: number): Vector3 {
    this.ends.abort();
    return this.camera.getWorldDirection(new Vector3()).multiplyScalar(0.5 * far).add(this.camera.position);
  }

  /** One picture's step; true while there is movement. */
  step(now: number): boolean {
    const seconds = Math.min(LONGEST_STEP, Math.max(0, now - this.before) / 1000);
    this.before = now;
    this.camera.quaternion.setFromEuler(this.angles);
    if (this.held.size === 0) return false;
    const way = new Vector3();
    for (const key of this.held.keys()) way.add(new Vector3(...(WAYS[key] ?? [0, 0, 0])));
    this.go(way, seconds * this.given.speed * (this.isFast ? FASTER : 1));
    return true;
  }

  /** Level, whichever way it looks; up and down by themselves. */
  private go(way: Vector3, far: number): void {
    const level = new Euler(0, this.angles.y, 0, "YXZ");
    if (way.lengthSq() > 0) this.camera.position.addScaledVector(way.normalize().applyEuler(level), far);
  }

  private press(event: PointerEvent): void {
    this.fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.canvas.setPointerCapture(event.pointerId);
  }

  /** One finger looks around; of two the distance goes ahead and back. */
  private drag(event: PointerEvent): void {
    const last = this.fingers.get(event.pointerId);
    if (last === undefined) return;
    const [x, y] = [event.clientX - last.x, event.clientY - last.y];
    const other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1];
    this.fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (other !== undefined) {
      const apart = (at: { x: number; y: number }) => Math.hypot(at.x - other.x, at.y - other.y);
      const more = apart({ x: event.clientX, y: event.clientY }) - apart(last);
      this.go(new Vector3(0, 0, -Math.sign(more)), (Math.abs(more) / 300) * this.given.speed);
    } else {
      this.angles.y += x * TURN;
      this.angles.x = Math.min(STEEPEST, Math.max(-STEEPEST, this.angles.x + y * TURN));
    }
    this.given.changed();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    this.go(new Vector3(0, 0, Math.sign(event.deltaY)), 0.15 * this.given.speed);
    this.given.changed();
  }

  private key(event: KeyboardEvent): void {
    const key = named(event);
    this.isFast = event.shiftKey;
    if (WAYS[key] === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation(); // letters mean something else to the page
    if (!this.held.has(key)) {
      this.held.set(key, performance.now());
      this.before = performance.now();
    }
    this.given.changed();
  }
}

function named({ key }: KeyboardEvent): string {
  return key.length === 1 ? key.toLowerCase() : key;
}
