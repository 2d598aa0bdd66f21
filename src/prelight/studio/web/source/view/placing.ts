// Light placed by its effect: a click says where a highlight, a shadow or the light itself shall fall.

import { Vector3 } from "three";
import type { Stage } from "./stage";

export type Effect = "highlight" | "shadow" | "light";

/** Where a light has to come from: a place that it acts on, the direction toward it, and how far it can go that way. */
export interface Placement {
  point: Vector3;
  toward: Vector3;
  /** Farther away it would be behind something. */
  free: number;
  /** Nearer it would not be behind what casts the shadow. */
  least: number;
}

const MARGIN = 0.9; // of the way to what is in it

/**
 * A highlight is where the eye sees a mirror's image of the light: along the reflected ray. Light falls straightest from
 * along the normal. A shadow needs two clicks: where it falls, then what casts it; the light is behind that.
 */
export class Placing {
  private effect: Effect | null = null;
  private fallen: Vector3 | null = null;
  private readonly ends: (() => void)[] = [];

  constructor(
    private readonly stage: Stage,
    private readonly acts: { place: (placement: Placement) => void; say: (words: string | null) => void },
  ) {
    const { canvas } = stage;
    let down: { x: number; y: number } | null = null;
    canvas.addEventListener("pointerdown", (event) => {
      down = event.button === 0 ? { x: event.clientX, y: event.clientY } : null;
    });
    canvas.addEventListener("pointerup", (event) => {
      const isClick = down !== null && Math.hypot(event.clientX - down.x, event.clientY - down.y) < 5;
      if (isClick && this.effect !== null) this.click(event.clientX, event.clientY);
      down = null;
    });
    canvas.addEventListener("keydown", (event) => {
      if (this.effect === null || event.key !== "Enter") return;
      event.preventDefault(); // by keys: the middle of what is seen
      const { left, top, height } = canvas.getBoundingClientRect();
      this.click(left + stage.freeWidth / 2, top + height / 2);
    });
    window.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.stop();
    });
  }

  /** Wait for clicks; `ended` is called when it is over. */
  start(effect: Effect, ended: () => void): void {
    this.stop();
    this.effect = effect;
    this.fallen = null;
    this.ends.push(ended);
    this.stage.canvas.classList.add("placing");
    this.stage.canvas.focus();
    this.acts.say({
      highlight: "Click where the highlight shall be",
      light: "Click what the light shall fall on",
      shadow: "Click where the shadow shall fall",
    }[effect]);
  }

  stop(): void {
    if (this.effect === null) return;
    this.effect = this.fallen = null;
    this.stage.canvas.classList.remove("placing");
    this.acts.say(null);
    for (const end of this.ends.splice(0)) end();
  }

  private click(x: number, y: number): void {
    const hit = this.stage.pick(x, y);
    if (hit === null) {
      this.acts.say("There is no surface; click one, or Esc");
      return;
    }
    const { point, normal } = hit;
    if (this.effect === "shadow") {
      this.shade(point);
      return;
    }
    const away = point.clone().sub(this.stage.eye.camera.position).normalize();
    const toward = this.effect === "light" ? normal : away.reflect(normal);
    this.acts.place({ point, toward, free: MARGIN * (this.stage.reach(point, toward)?.distance ?? Infinity), least: 0 });
  }

  private shade(point: Vector3): void {
    if (this.fallen === null) {
      this.fallen = point;
      this.acts.say("Now click what shall cast it");
      return;
    }
    const toward = point.clone().sub(this.fallen);
    const far = toward.length();
    if (far < 1e-4 * this.stage.sphere.radius) {
      this.acts.say("That is the same place; click what shall cast the shadow");
      return;
    }
    toward.normalize();
    const fallen = this.fallen;
    this.fallen = null;
    this.acts.say("Click where the shadow shall fall");
    this.acts.place({ point: fallen, toward, ...this.behind(point, toward, far) });
  }

  /** Behind what casts it: past the far side of that body, up to the next thing or as far as one likes. */
  private behind(caster: Vector3, toward: Vector3, far: number): { free: number; least: number } {
    const first = this.stage.reach(caster, toward);
    if (first === null) return { free: Infinity, least: 1.1 * far };
    if (first.front) return { free: far + MARGIN * first.distance, least: far + 0.05 * first.distance }; // it is thin
    const out = far + first.distance;
    const next = this.stage.reach(first.point, toward);
    if (next === null) return { free: Infinity, least: 1.05 * out };
    return { free: out + MARGIN * next.distance, least: out + 0.05 * next.distance };
  }
}

/** How far a lamp goes: as far as it is from what it acts on now, as far as there is room. */
export function distanceOf({ free, least }: Placement, known: number): number {
  return Math.min(Math.max(known, least), free);
}

/** Azimuth and elevation of a direction, degrees: the scene's, as of discs. */
export function anglesOf(toward: Vector3): [number, number] {
  const azimuth = (Math.atan2(toward.x, -toward.z) * 180) / Math.PI;
  return [azimuth, (Math.asin(Math.min(1, Math.max(-1, toward.y))) * 180) / Math.PI];
}
