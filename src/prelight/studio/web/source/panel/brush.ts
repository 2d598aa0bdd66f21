// The brush for the strip of the sky: its settings, the stroke that is being painted, and what erases.

import { COOLEST, NEUTRAL, type Rgb, WARMEST } from "../colour";
import { fromHex, luminance, ofKelvin, times, toHex } from "../colour";
import { MOST_DABS, type PaintStroke } from "../messages";
import { apart, covers } from "../paint";
import type { Look, Rig } from "../rig";
import { button, choice, element, slider, stops } from "./elements";

const SIZE_DEG = 12;
const SMALLEST_DEG = 2;
const LARGEST_DEG = 60;
const EDGE = 0.5;
const BRIGHTNESS = 2; // stops above white in this sky
const BRIGHTEST = 8;
const DIMMEST = -8;
const SPACING = 0.75; // of the radius, from one dab to the next

export type Tool = "lights" | "paint" | "erase";

export class Brush {
  readonly tools;
  readonly settings = element("div", { class: "settings" });
  tool: Tool = "lights";
  radius = SIZE_DEG;
  private edge = EDGE;
  private brightness = BRIGHTNESS;
  private cover = 1;
  private colour: Rgb = [1, 1, 1];
  private stroke: PaintStroke | null = null;
  private isFull = false;
  private readonly picker = element("input", { type: "color", "aria-label": "Colour of the brush", title: "Colour" });
  private readonly used = element("span", { class: "said", role: "status" });
  private readonly clear = button("Clear paint", () => this.rig.ask({ type: "ClearPaint" }), { class: "quiet" });
  private readonly sliders = element("div");

  /** `changed` hears of another tool or another size. */
  constructor(private readonly rig: Rig, private readonly changed: () => void) {
    this.tools = choice<Tool>("Hand on the sky", [["lights", "Move"], ["paint", "Paint"], ["erase", "Erase"]], (tool) => {
      this.tool = tool;
      this.changed();
    });
    this.fill();
    this.settings.append(this.sliders, element("div", { class: "buttons" }, this.clear, this.used));
  }

  show(look: Look): void {
    const dabs = count(look);
    this.tools.show(this.tool);
    this.settings.hidden = this.tool === "lights";
    this.sliders.hidden = this.tool !== "paint";
    this.clear.disabled = dabs === 0;
    this.used.textContent = this.isFull && dabs >= MOST_DABS ? `All ${MOST_DABS} dabs are used: erase some` : `${dabs} of ${MOST_DABS} dabs`;
  }

  /** The tool is set down on the sky. */
  begin(azimuth: number, elevation: number): void {
    const { look } = this.rig;
    if (this.tool === "erase") {
      const stroke = [...look.paint].reverse().find((one) => covers(one, azimuth, elevation));
      if (stroke !== undefined) this.rig.removePaint(stroke.id);
      return;
    }
    this.isFull = count(look) >= MOST_DABS;
    if (this.isFull) {
      this.show(look);
      return;
    }
    const white = (2 ** -(look.stops ?? 0)) * (look.scale * luminance(look.tint) || 1);
    this.stroke = {
      id: `p${crypto.getRandomValues(new Uint32Array(1))[0]?.toString(16)}`,
      radius_deg: this.radius,
      radiance: times(this.colour, white * 2 ** this.brightness),
      softness: this.edge,
      opacity: this.cover,
      points: [[azimuth, elevation]],
    };
    this.rig.putPaint(this.stroke, { dragging: true });
  }

  /** It goes on to there. */
  go(azimuth: number, elevation: number): void {
    const last = this.stroke?.points.at(-1);
    if (this.stroke === null || last === undefined) return;
    if (apart(last, [azimuth, elevation]) < 1 - Math.cos((SPACING * this.radius * Math.PI) / 180)) return;
    this.isFull = count(this.rig.look) >= MOST_DABS;
    if (!this.isFull) this.stroke = { ...this.stroke, points: [...this.stroke.points, [azimuth, elevation]] };
    this.rig.putPaint(this.stroke, { dragging: true });
  }

  /** It is lifted. */
  end(): void {
    if (this.stroke !== null) this.rig.putPaint(this.stroke);
    this.stroke = null;
  }

  private fill(): void {
    const size = slider({
      name: "Brush", least: Math.log2(SMALLEST_DEG), most: Math.log2(LARGEST_DEG), step: 0.02, rest: Math.log2(SIZE_DEG),
      say: (value) => `${(2 ** value).toPrecision(2)}°`,
      set: (value) => {
        this.radius = 2 ** value;
        this.changed();
      },
    });
    const edge = slider({
      name: "Edge", least: 0, most: 1, step: 0.01, rest: EDGE, say: (value) => value.toFixed(2),
      set: (value) => (this.edge = value),
    });
    const brightness = slider({
      name: "Level", least: DIMMEST, most: BRIGHTEST, step: 0.1, rest: BRIGHTNESS, kind: "centred", say: stops,
      set: (value) => (this.brightness = value),
    });
    const cover = slider({
      name: "Cover", least: 0.02, most: 1, step: 0.01, rest: 1, say: (value) => `${Math.round(100 * value)} %`,
      set: (value) => (this.cover = value),
    });
    const kelvin = slider({
      name: "Kelvin", least: WARMEST, most: COOLEST, step: 50, rest: NEUTRAL, kind: "kelvin",
      say: (value) => `${Math.round(value)} K`,
      set: (value) => {
        this.colour = ofKelvin(value);
        this.picker.value = toHex(this.colour);
      },
    });
    this.picker.value = toHex(this.colour);
    this.picker.addEventListener("input", () => (this.colour = fromHex(this.picker.value)));
    size.show(Math.log2(SIZE_DEG));
    edge.show(EDGE);
    brightness.show(BRIGHTNESS);
    cover.show(1);
    kelvin.show(NEUTRAL);
    const coloured = element("div", { class: "with-colour" }, kelvin.row, this.picker);
    this.sliders.append(size.row, edge.row, brightness.row, cover.row, coloured);
  }
}

function count({ paint }: Look): number {
  return paint.reduce((sum, { points }) => sum + points.length, 0);
}
