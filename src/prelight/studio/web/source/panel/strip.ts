// The sky as a strip: the whole map unrolled, and the disc lights on it to drag.

import type { DiscLight } from "../messages";
import type { Look } from "../rig";
import { toHex } from "../colour";
import { degrees, element, pen, wrapped } from "./elements";

const WIDTH = 536;
const HEIGHT = 201; // from the zenith to LOWEST
const LOWEST = -45; // degrees; what is lower stands on the edge
const STEP = 2;
const LARGE_STEP = 10;

export interface StripEvents {
  move(disc: DiscLight, dragging: boolean): void;
  select(id: string): void;
  remove(id: string): void;
  add(azimuth: number, elevation: number): void;
}

export class Strip {
  readonly box = element("div", { class: "strip", title: "Double click: a new light there" });
  private readonly canvas = element("canvas", { width: String(WIDTH), height: String(HEIGHT), "aria-hidden": "true" });
  private readonly dots = new Map<string, HTMLButtonElement>();
  private map: ImageBitmap | null = null;
  private look: Look | null = null;

  constructor(private readonly events: StripEvents) {
    this.box.append(this.canvas);
    this.canvas.addEventListener("dblclick", (event) => {
      const { azimuth, elevation } = this.place(event);
      events.add(azimuth, elevation);
    });
  }

  showMap(map: ImageBitmap): void {
    this.map = map;
    this.draw();
  }

  show(look: Look, selected: string | null): void {
    const turned = look.rotation_deg !== this.look?.rotation_deg;
    this.look = look;
    if (turned) this.draw();
    for (const [id, dot] of this.dots) {
      if (look.discs.some((disc) => disc.id === id)) continue;
      dot.remove();
      this.dots.delete(id);
    }
    look.discs.forEach((disc, i) => this.showDot(disc, { number: i + 1, isSelected: disc.id === selected }));
  }

  focus(id: string): void {
    this.dots.get(id)?.focus();
  }

  private draw(): void {
    const context = pen(this.canvas);
    if (context === null || this.map === null) return;
    const turn = wrapped(this.look?.rotation_deg ?? 0);
    const left = (-turn / 360) * WIDTH; // a turn to the left moves the map to the left
    for (const at of [left - WIDTH, left, left + WIDTH]) context.drawImage(this.map, at, 0, WIDTH, WIDTH / 2);
    context.fillStyle = "rgb(255 255 255 / 0.25)";
    context.fillRect(0, WIDTH / 4, WIDTH, 1);
  }

  private showDot(disc: DiscLight, { number, isSelected }: { number: number; isSelected: boolean }): void {
    const dot = this.dots.get(disc.id) ?? this.newDot(disc.id);
    const x = 0.5 + wrapped(disc.azimuth_deg) / 360;
    const y = (90 - Math.max(disc.elevation_deg, LOWEST)) / (90 - LOWEST);
    dot.style.left = `${100 * x}%`;
    dot.style.top = `${100 * y}%`;
    dot.style.setProperty("--light", toHex(disc.radiance));
    dot.classList.toggle("selected", isSelected);
    dot.setAttribute("aria-pressed", String(isSelected));
    const where = `azimuth ${degrees(disc.azimuth_deg)}, elevation ${degrees(disc.elevation_deg)}`;
    dot.setAttribute("aria-label", `Light ${number}, ${where}. Arrow keys move it, Delete removes it.`);
  }

  private newDot(id: string): HTMLButtonElement {
    const dot = element("button", { type: "button", class: "dot" });
    const disc = () => this.look?.discs.find((other) => other.id === id);
    const move = (event: PointerEvent, dragging: boolean) => {
      const now = disc();
      if (now === undefined || !dot.hasPointerCapture(event.pointerId)) return;
      const { azimuth, elevation } = this.place(event);
      this.events.move({ ...now, azimuth_deg: azimuth, elevation_deg: elevation }, dragging);
    };
    dot.addEventListener("pointerdown", (event) => {
      dot.setPointerCapture(event.pointerId);
      this.events.select(id);
    });
    dot.addEventListener("pointermove", (event) => move(event, true));
    dot.addEventListener("pointerup", (event) => {
      move(event, false);
      dot.releasePointerCapture(event.pointerId);
    });
    dot.addEventListener("focus", () => this.events.select(id));
    dot.addEventListener("keydown", (event) => {
      const now = disc();
      if (now !== undefined) this.key(event, now);
    });
    this.dots.set(id, dot);
    this.box.append(dot);
    return dot;
  }

  private key(event: KeyboardEvent, disc: DiscLight): void {
    if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      this.events.remove(disc.id);
      return;
    }
    const ways: Record<string, [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, 1],
      ArrowDown: [0, -1],
    };
    const way = ways[event.key];
    if (way === undefined) return;
    event.preventDefault();
    const step = event.shiftKey ? LARGE_STEP : STEP;
    const elevation_deg = Math.min(90, Math.max(-90, disc.elevation_deg + step * way[1]));
    this.events.move({ ...disc, azimuth_deg: wrapped(disc.azimuth_deg + step * way[0]), elevation_deg }, true);
  }

  private place(event: MouseEvent): { azimuth: number; elevation: number } {
    const box = this.canvas.getBoundingClientRect();
    const x = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    const y = Math.min(1, Math.max(0, (event.clientY - box.top) / box.height));
    return { azimuth: wrapped(360 * (x - 0.5)), elevation: 90 - (90 - LOWEST) * y };
  }
}
