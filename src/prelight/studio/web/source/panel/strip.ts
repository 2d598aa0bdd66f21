// The sky as a strip: the whole map unrolled with paint on it, the disc lights to drag, and the brush.

import type { DiscLight } from "../messages";
import type { Look } from "../rig";
import { luminance, toHex, toScreen } from "../colour";
import { painted } from "../paint";
import type { Tool } from "./brush";
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
  begin(azimuth: number, elevation: number): void;
  go(azimuth: number, elevation: number): void;
  end(): void;
}

export class Strip {
  readonly box = element("div", { class: "strip", title: "Double click: a new light there" });
  private readonly canvas = element("canvas", { width: String(WIDTH), height: String(HEIGHT), "aria-hidden": "true" });
  private readonly dots = new Map<string, HTMLButtonElement>();
  private readonly over = element("canvas", { width: String(WIDTH / 2), height: String(WIDTH / 4) });
  private readonly ring = element("button", { type: "button", class: "ring" });
  private brush: { tool: Tool; radius: number } = { tool: "lights", radius: 1 };
  private at = { azimuth: 0, elevation: 30 }; // of the brush
  private covered = ""; // the paint that is on `over`
  private map: ImageBitmap | null = null;
  private look: Look | null = null;

  constructor(private readonly events: StripEvents) {
    this.box.append(this.canvas, this.ring);
    this.listen();
    this.canvas.addEventListener("dblclick", (event) => {
      if (this.brush.tool !== "lights") return;
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
    if (this.cover(look) || turned) this.draw();
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

  /** Which tool is in the hand, and how large it is. */
  take(tool: Tool, radius: number): void {
    this.brush = { tool, radius };
    this.box.classList.toggle("painting", tool !== "lights");
    this.box.title = tool === "lights" ? "Double click: a new light there" : "";
    this.showRing();
  }

  private listen(): void {
    const { canvas, events, ring } = this;
    const follow = (event: PointerEvent) => {
      this.at = this.place(event);
      this.showRing();
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (this.brush.tool === "lights" || event.button !== 0 || !event.isPrimary) return;
      event.preventDefault();
      canvas.setPointerCapture(event.pointerId);
      follow(event);
      events.begin(this.at.azimuth, this.at.elevation);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (this.brush.tool === "lights") return;
      follow(event);
      if (canvas.hasPointerCapture(event.pointerId)) events.go(this.at.azimuth, this.at.elevation);
    });
    canvas.addEventListener("lostpointercapture", () => events.end());
    ring.addEventListener("click", () => {
      events.begin(this.at.azimuth, this.at.elevation);
      events.end();
    });
    ring.addEventListener("keydown", (event) => {
      const to = stepped(event, this.at);
      if (to === null) return;
      this.at = to;
      this.showRing();
    });
    this.showRing();
  }

  private showRing(): void {
    const { azimuth, elevation } = this.at;
    const { tool, radius } = this.brush;
    const size = tool === "erase" ? 2 : radius;
    const wide = Math.min(1, (2 * size) / 360 / Math.max(0.02, Math.cos((elevation * Math.PI) / 180)));
    this.ring.hidden = tool === "lights";
    this.ring.style.left = `${100 * (0.5 + wrapped(azimuth) / 360)}%`;
    this.ring.style.top = `${(100 * (90 - Math.max(elevation, LOWEST))) / (90 - LOWEST)}%`;
    this.ring.style.width = `${100 * wide}%`;
    this.ring.style.height = `${(100 * 2 * size) / (90 - LOWEST)}%`;
    const does = tool === "erase" ? "Enter takes away the stroke there" : "Enter paints a dab";
    const where = `azimuth ${degrees(azimuth)}, elevation ${degrees(elevation)}`;
    this.ring.setAttribute("aria-label", `Brush at ${where}. Arrow keys move it, ${does}.`);
  }

  /** Whether the paint is another now. */
  private cover({ paint, stops, scale, tint }: Look): boolean {
    const level = 2 ** (stops ?? 0) / Math.max(scale * luminance(tint), 1e-6); // the map is drawn at its own strength
    const key = JSON.stringify([paint, level]);
    if (key === this.covered) return false;
    this.covered = key;
    const { width, height } = this.over;
    const seen = painted(paint, width, height);
    const picture = new ImageData(width, height);
    for (let at = 0; at < seen.length; at += 4) {
      const share = seen[at + 3] ?? 0;
      if (share === 0) continue;
      const [red = 0, green = 0, blue = 0] = seen.subarray(at, at + 3);
      const factor = level / share;
      picture.data.set([...toScreen([factor * red, factor * green, factor * blue]), 255 * share], at);
    }
    pen(this.over)?.putImageData(picture, 0, 0);
    return true;
  }

  private draw(): void {
    const context = pen(this.canvas);
    if (context === null || this.map === null) return;
    const turn = wrapped(this.look?.rotation_deg ?? 0);
    const left = (-turn / 360) * WIDTH; // a turn to the left moves the map to the left
    for (const at of [left - WIDTH, left, left + WIDTH]) context.drawImage(this.map, at, 0, WIDTH, WIDTH / 2);
    context.drawImage(this.over, 0, 0, WIDTH, WIDTH / 2);
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
    const to = stepped(event, { azimuth: disc.azimuth_deg, elevation: disc.elevation_deg });
    if (to !== null) this.events.move({ ...disc, azimuth_deg: to.azimuth, elevation_deg: to.elevation }, true);
  }

  private place(event: MouseEvent): Place {
    const box = this.canvas.getBoundingClientRect();
    const x = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    const y = Math.min(1, Math.max(0, (event.clientY - box.top) / box.height));
    return { azimuth: wrapped(360 * (x - 0.5)), elevation: 90 - (90 - LOWEST) * y };
  }
}

interface Place {
  azimuth: number;
  elevation: number;
}

/** Where an arrow key leads from a place; null for other keys. */
function stepped(event: KeyboardEvent, { azimuth, elevation }: Place): Place | null {
  const ways: Record<string, [number, number]> = {
    ArrowLeft: [-1, 0],
    ArrowRight: [1, 0],
    ArrowUp: [0, 1],
    ArrowDown: [0, -1],
  };
  const way = ways[event.key];
  if (way === undefined) return null;
  event.preventDefault();
  const step = event.shiftKey ? LARGE_STEP : STEP;
  return { azimuth: wrapped(azimuth + step * way[0]), elevation: Math.min(90, Math.max(-90, elevation + step * way[1])) };
}
