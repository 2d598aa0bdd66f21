// Handles of lamps over the scene: each a button that is dragged or moved by keys, with arms along the axes, and an aim.

import { type PerspectiveCamera, Plane, Raycaster, Vector2, Vector3, type Object3D } from "three";
import { toHex } from "../colour";
import type { LampLight } from "../messages";
import { button, element } from "../panel/elements";

const ARM = 64; // pixels
const AXES = ["x", "y", "z"] as const;
const NEAR_END = 0.08; // of an arm's length: below it, it points at the eye and cannot be dragged
const STEPS = [1, 2, 5, 10];

type What = "position" | "target";
type Triple = [number, number, number];

interface Acts {
  select: (id: string) => void;
  move: (id: string, what: What, place: Triple, dragging: boolean) => void;
  remove: (id: string) => void;
}

/** Over a canvas whose camera and surface are given by functions. */
export class Handles {
  readonly host = element("div", { class: "handles" });
  private readonly buttons = new Map<string, HTMLButtonElement>();
  private readonly aim = this.newHandle("aim", () => this.selected, "target");
  private readonly arms = AXES.map((axis) => this.newArm(axis));
  private readonly lines = [...AXES, "aim"].map((name) => element("div", { class: `line ${name}` }));
  private lamps: readonly LampLight[] = [];
  private selected: string | null = null;
  private step = 0.05;

  constructor(
    private readonly camera: () => PerspectiveCamera,
    private readonly surface: () => Object3D | null,
    private readonly acts: Acts,
  ) {
    this.host.append(...this.lines, ...this.arms, this.aim);
  }

  /** How large the scene is: keys move by about a hundredth of it. */
  scale(radius: number): void {
    const decade = 10 ** Math.floor(Math.log10(Math.max(radius, 1e-6) / 100));
    this.step = decade * (STEPS.find((step) => step * decade >= radius / 100) ?? 10);
  }

  show(lamps: readonly LampLight[], selected: string | null): void {
    this.lamps = lamps;
    this.selected = selected;
    for (const [id, made] of this.buttons) {
      if (lamps.some((lamp) => lamp.id === id)) continue;
      made.remove();
      this.buttons.delete(id);
    }
    for (const lamp of lamps) {
      const made = this.buttons.get(lamp.id) ?? this.newLamp(lamp.id);
      const where = lamp.position.map((value) => value.toFixed(2)).join(", ");
      made.setAttribute("aria-label", `${lamp.name} at ${where} m`);
      made.title = lamp.name;
      made.style.setProperty("--light", toHex(lamp.color));
      made.classList.toggle("selected", lamp.id === selected);
      made.classList.toggle("off", !lamp.on);
    }
    const chosen = this.chosen();
    this.aim.setAttribute("aria-label", `Aim of ${chosen?.name ?? "the lamp"}`);
    this.place();
  }

  /** Put every handle where its place is seen now. */
  place(): void {
    for (const lamp of this.lamps) this.put(this.buttons.get(lamp.id), hasPlace(lamp) ? this.seen(lamp.position) : null);
    const chosen = this.chosen();
    const middle = chosen && hasPlace(chosen) ? this.seen(chosen.position) : null;
    this.arms.forEach((arm, i) => {
      const tip = chosen?.layer === null && middle ? this.tip(chosen.position, i) : null;
      const isUseful = tip !== null && middle !== null && tip.distanceTo(middle) > NEAR_END * ARM;
      this.put(arm, isUseful ? tip : null);
      this.draw(this.lines[i], middle, isUseful ? tip : null);
    });
    const aimed = chosen !== undefined && chosen.kind !== "lamp" && hasPlace(chosen) ? this.seen(chosen.target) : null;
    this.put(this.aim, aimed);
    this.draw(this.lines[AXES.length], middle, aimed);
  }

  private chosen(): LampLight | undefined {
    return this.lamps.find(({ id }) => id === this.selected);
  }

  // ---- Where things are seen --------------------------------------------------------------------------------

  /** Pixels of a place; null behind the eye. */
  private seen(place: Readonly<Triple> | Vector3): Vector2 | null {
    const camera = this.camera();
    const point = place instanceof Vector3 ? place.clone() : new Vector3(...place);
    if (point.clone().applyMatrix4(camera.matrixWorldInverse).z > -camera.near / 2) return null;
    point.project(camera);
    const { clientWidth, clientHeight } = this.host;
    return new Vector2(((point.x + 1) / 2) * clientWidth, ((1 - point.y) / 2) * clientHeight);
  }

  /** Where an arm ends: as long on the screen whatever the distance, but for its foreshortening. */
  private tip(position: Readonly<Triple>, axis: number): Vector2 | null {
    const camera = this.camera();
    const origin = new Vector3(...position);
    const far = origin.clone().applyMatrix4(camera.matrixWorldInverse).z;
    const tall = 2 * -far * Math.tan((camera.fov * Math.PI) / 360);
    return this.seen(origin.add(direction(axis).multiplyScalar((ARM * tall) / Math.max(this.host.clientHeight, 1))));
  }

  private put(made: HTMLElement | undefined, at: Vector2 | null): void {
    if (made === undefined) return;
    made.hidden = at === null;
    if (at !== null) made.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px)`;
  }

  private draw(line: HTMLElement | undefined, from: Vector2 | null, to: Vector2 | null): void {
    if (line === undefined) return;
    line.hidden = from === null || to === null;
    if (from === null || to === null) return;
    const along = to.clone().sub(from);
    line.style.width = `${along.length().toFixed(1)}px`;
    line.style.transform = `translate(${from.x.toFixed(1)}px, ${from.y.toFixed(1)}px) rotate(${along.angle()}rad)`;
  }

  // ---- Hands ------------------------------------------------------------------------------------------------

  private newLamp(id: string): HTMLButtonElement {
    const made = this.newHandle("lamp", () => id, "position");
    this.buttons.set(id, made);
    this.host.append(made);
    return made;
  }

  /** A button that is dragged: a lamp across the view, an aim over the surfaces. */
  private newHandle(kind: string, which: () => string | null, what: What): HTMLButtonElement {
    const made = button("", () => this.acts.select(which() ?? ""), { class: `handle ${kind}` });
    made.addEventListener("keydown", (event) => this.key(event, which(), what));
    this.drags(made, (lamp) => {
      const from = new Vector3(...lamp[what]);
      const across = new Plane().setFromNormalAndCoplanarPoint(this.camera().getWorldDirection(new Vector3()), from);
      return (rays) => {
        const hit = what === "target" ? this.hit(rays) : null;
        return hit ?? rays.ray.intersectPlane(across, new Vector3());
      };
    }, which, what);
    return made;
  }

  private newArm(axis: (typeof AXES)[number]): HTMLButtonElement {
    const made = button("", () => undefined, { class: `handle arm ${axis}`, tabindex: "-1", "aria-hidden": "true" });
    const along = direction(AXES.indexOf(axis));
    this.drags(made, (lamp) => {
      const origin = new Vector3(...lamp.position);
      let first: number | null = null;
      return (rays) => {
        const t = nearest(origin, along, rays);
        if (t === null) return null;
        first ??= t;
        return origin.clone().addScaledVector(along, t - first);
      };
    }, () => this.selected, "position");
    return made;
  }

  /** Follow a pointer: `grasp` is told the lamp and makes the function from a ray to a place. */
  private drags(
    made: HTMLElement,
    grasp: (lamp: LampLight) => (rays: Raycaster) => Vector3 | null,
    which: () => string | null,
    what: What,
  ): void {
    let held: { id: string; place: (rays: Raycaster) => Vector3 | null; moved: boolean } | null = null;
    const move = (event: PointerEvent, dragging: boolean) => {
      if (held === null) return;
      const { id, place } = held;
      const to = place(this.rays(event));
      if (dragging && event.movementX === 0 && event.movementY === 0 && !held.moved) return;
      if (!dragging) held = null;
      if (to !== null) this.acts.move(id, what, to.toArray() as Triple, dragging);
    };
    made.addEventListener("pointerdown", (event) => {
      const id = which();
      const lamp = this.lamps.find((one) => one.id === id);
      if (lamp === undefined || event.button !== 0) return;
      this.acts.select(lamp.id);
      if (what === "position" && lamp.layer !== null) return; // it stands where its layer is
      made.setPointerCapture(event.pointerId);
      held = { id: lamp.id, place: grasp(lamp), moved: false };
      held.place(this.rays(event)); // where an arm is held
    });
    made.addEventListener("pointermove", (event) => {
      if (held === null) return;
      held.moved = true;
      move(event, true);
    });
    made.addEventListener("pointerup", (event) => (held?.moved ? move(event, false) : (held = null)));
    made.addEventListener("pointercancel", () => (held = null));
  }

  private rays(event: PointerEvent): Raycaster {
    const { left, top, width, height } = this.host.getBoundingClientRect();
    const place = new Vector2(((event.clientX - left) / width) * 2 - 1, 1 - ((event.clientY - top) / height) * 2);
    const rays = new Raycaster();
    rays.setFromCamera(place, this.camera());
    return rays;
  }

  private hit(rays: Raycaster): Vector3 | null {
    const surface = this.surface();
    return surface === null ? null : (rays.intersectObject(surface, false)[0]?.point ?? null);
  }

  /** Arrows move over the floor as seen, page keys up and down; with Shift five times as far. */
  private key(event: KeyboardEvent, id: string | null, what: What): void {
    const lamp = this.lamps.find((one) => one.id === id);
    if (lamp === undefined || (what === "position" && lamp.layer !== null && event.key !== "Delete")) return;
    if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      this.acts.remove(lamp.id);
      return;
    }
    const right = snapped(new Vector3(1, 0, 0).transformDirection(this.camera().matrixWorld));
    const ahead = new Vector3(0, 1, 0).cross(right);
    const ways: Record<string, Vector3> = {
      ArrowRight: right, ArrowLeft: right.clone().negate(), ArrowUp: ahead, ArrowDown: ahead.clone().negate(),
      PageUp: new Vector3(0, 1, 0), PageDown: new Vector3(0, -1, 0),
    };
    const way = ways[event.key];
    if (way === undefined) return;
    event.preventDefault();
    this.acts.select(lamp.id);
    const to = new Vector3(...lamp[what]).addScaledVector(way, this.step * (event.shiftKey ? 5 : 1));
    this.acts.move(lamp.id, what, to.toArray() as Triple, true);
  }
}

/** Whether it has a place in the scene: a light on a panel of a steerable layer has one on that panel. */
function hasPlace(lamp: LampLight): boolean {
  return lamp.layer === null || lamp.kind === "spot";
}

function direction(axis: number): Vector3 {
  return new Vector3().setComponent(axis, 1);
}

/** The level axis of the scene that is nearest. */
function snapped(along: Vector3): Vector3 {
  const isX = Math.abs(along.x) >= Math.abs(along.z);
  return isX ? new Vector3(Math.sign(along.x) || 1, 0, 0) : new Vector3(0, 0, Math.sign(along.z) || 1);
}

/** How far along a line it is nearest to a ray; null where they are parallel. */
function nearest(origin: Vector3, along: Vector3, { ray }: Raycaster): number | null {
  const b = along.dot(ray.direction);
  const below = 1 - b * b;
  if (below < 1e-4) return null;
  const between = ray.origin.clone().sub(origin);
  return (between.dot(along) - b * between.dot(ray.direction)) / below;
}
