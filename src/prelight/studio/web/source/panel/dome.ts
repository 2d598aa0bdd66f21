// The sky as a disc to turn, seen from above: the zenith in the middle, ahead (-Z) at the top.

import type { Look } from "../rig";
import { degrees, element, pen, wrapped } from "./elements";

const SIDE = 264; // pixels of the drawing, twice those of the page
const STEP = 2;
const LARGE_STEP = 15;

export class Dome {
  readonly canvas = element("canvas", { class: "dome", width: String(SIDE), height: String(SIDE) });
  private readonly disc = document.createElement("canvas");
  private look: Look | null = null;
  private heading = 0;
  private from: { angle: number; turn: number } | null = null;

  constructor(private readonly turn: (degrees: number, dragging: boolean) => void) {
    this.disc.width = this.disc.height = SIDE;
    const { canvas } = this;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "slider");
    canvas.setAttribute("aria-label", "Turn of the sky");
    canvas.setAttribute("aria-valuemin", "-180");
    canvas.setAttribute("aria-valuemax", "180");
    canvas.addEventListener("pointerdown", (event) => this.grasp(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event, true));
    canvas.addEventListener("pointerup", (event) => this.drag(event, false));
    canvas.addEventListener("pointercancel", () => (this.from = null));
    canvas.addEventListener("dblclick", () => this.turn(0, false));
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  show(look: Look): void {
    this.look = look;
    const turn = wrapped(look.rotation_deg);
    this.canvas.setAttribute("aria-valuenow", turn.toFixed(0));
    this.canvas.setAttribute("aria-valuetext", degrees(turn));
    this.draw();
  }

  /** Where the eye looks: degrees from ahead to the right. */
  showHeading(azimuth: number): void {
    if (Math.abs(azimuth - this.heading) < 0.25) return;
    this.heading = azimuth;
    this.draw();
  }

  /** The map's upper half, wrapped around the zenith. */
  showMap(map: ImageBitmap): void {
    const flat = document.createElement("canvas");
    [flat.width, flat.height] = [map.width, map.height];
    const reader = pen(flat);
    const writer = pen(this.disc);
    if (!reader || !writer) return;
    reader.drawImage(map, 0, 0);
    const source = new Uint32Array(reader.getImageData(0, 0, flat.width, flat.height).data.buffer);
    const drawn = writer.createImageData(SIDE, SIDE);
    const target = new Uint32Array(drawn.data.buffer);
    for (let row = 0; row < SIDE; row++) {
      for (let column = 0; column < SIDE; column++) {
        const [x, y] = [(2 * column + 1) / SIDE - 1, (2 * row + 1) / SIDE - 1];
        const radius = Math.hypot(x, y);
        if (radius > 1) continue;
        const u = 0.5 + Math.atan2(x, -y) / (2 * Math.PI);
        const from = Math.floor(radius * 0.5 * flat.height) * flat.width + Math.floor(u * flat.width) % flat.width;
        target[row * SIDE + column] = source[from] ?? 0;
      }
    }
    writer.putImageData(drawn, 0, 0);
    this.draw();
  }

  private draw(): void {
    const context = pen(this.canvas);
    if (context === null || this.look === null) return;
    const middle = SIDE / 2;
    context.clearRect(0, 0, SIDE, SIDE);
    context.save();
    context.beginPath();
    context.arc(middle, middle, middle - 1, 0, 2 * Math.PI);
    context.clip();
    context.translate(middle, middle);
    context.rotate((-this.look.rotation_deg * Math.PI) / 180); // counter-clockwise seen from above
    context.drawImage(this.disc, -middle, -middle);
    context.restore();
    this.drawEye(context, middle);
    for (const { azimuth_deg, elevation_deg, radiance } of this.look.discs) {
      if (elevation_deg < 0) continue;
      const angle = (azimuth_deg * Math.PI) / 180;
      const radius = (1 - elevation_deg / 90) * (middle - 8);
      const most = Math.max(...radiance, 1e-9);
      const bytes = radiance.map((value) => Math.round(255 * (value / most) ** (1 / 2.2)));
      context.beginPath();
      context.arc(middle + radius * Math.sin(angle), middle - radius * Math.cos(angle), 7, 0, 2 * Math.PI);
      context.fillStyle = `rgb(${bytes.join(" ")})`;
      context.fill();
      context.strokeStyle = "rgb(0 0 0 / 0.55)";
      context.lineWidth = 2;
      context.stroke();
    }
  }

  /** A small wedge: where the eye looks. */
  private drawEye(context: CanvasRenderingContext2D, middle: number): void {
    const ahead = (this.heading * Math.PI) / 180 - Math.PI / 2;
    context.beginPath();
    context.moveTo(middle, middle);
    context.arc(middle, middle, 46, ahead - 0.33, ahead + 0.33);
    context.closePath();
    context.fillStyle = "rgb(255 255 255 / 0.28)";
    context.fill();
    context.beginPath();
    context.arc(middle, middle, 6, 0, 2 * Math.PI);
    context.fillStyle = "rgb(255 255 255 / 0.92)";
    context.fill();
    context.strokeStyle = "rgb(0 0 0 / 0.4)";
    context.lineWidth = 2;
    context.stroke();
  }

  private angle(event: PointerEvent): number {
    const box = this.canvas.getBoundingClientRect();
    const x = event.clientX - box.left - box.width / 2;
    const y = event.clientY - box.top - box.height / 2;
    return (Math.atan2(x, -y) * 180) / Math.PI; // clockwise from the top
  }

  private grasp(event: PointerEvent): void {
    this.canvas.setPointerCapture(event.pointerId);
    this.from = { angle: this.angle(event), turn: this.look?.rotation_deg ?? 0 };
  }

  private drag(event: PointerEvent, dragging: boolean): void {
    if (this.from === null) return;
    const { angle, turn } = this.from;
    const now = wrapped(turn - wrapped(this.angle(event) - angle));
    if (!dragging) this.from = null;
    this.turn(now, dragging);
  }

  private key(event: KeyboardEvent): void {
    const ways: Record<string, number> = { ArrowLeft: 1, ArrowUp: 1, ArrowRight: -1, ArrowDown: -1 };
    const way = ways[event.key];
    if (way === undefined && event.key !== "Home") return;
    event.preventDefault();
    const step = event.shiftKey ? LARGE_STEP : STEP;
    this.turn(way === undefined ? 0 : wrapped((this.look?.rotation_deg ?? 0) + way * step), true);
  }
}
