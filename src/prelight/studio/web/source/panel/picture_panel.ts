// How the picture is shown: exposure, tone curve, what is behind. Of this visitor alone; it changes no light.

import type { Stage } from "../view/stage";
import { type Curve, LUMENS_PER_WATT, type Meaning } from "../view/display";
import { Legend } from "./legend";
import { amount, button, choice, element, section, slider, stops } from "./elements";

type ToneCurve = Exclude<Curve, "none">;

const RANGE = 8; // stops to either side
const INDOORS = -1.2; // stops from what the meter says of a room: it would let windows and lamps burn out

const prefersLight = matchMedia("(prefers-color-scheme: light)");
const BACKDROPS = { light: [0.3, 0.62], dark: [0.012, 0.05] } as const; // linear greys, below and above

export class PicturePanel {
  readonly part: HTMLElement;
  private readonly exposure: ReturnType<typeof slider>;
  private readonly curve: ReturnType<typeof choice<ToneCurve>>;
  private readonly behind: ReturnType<typeof choice<"sky" | "plain">>;
  private readonly meaning: ReturnType<typeof choice<Meaning>>;
  private readonly top: ReturnType<typeof slider>;
  private readonly legend: Legend;
  private readonly filmer: HTMLButtonElement;
  private readonly illuminance: HTMLElement | null;
  private meant: Meaning = "picture";
  private topLog = 3;
  private stops = 0;
  private byHand = false;
  private suited = "";
  private showsSky = true;

  constructor(private readonly stage: Stage, legend: HTMLElement, acts: { save: () => void; record: () => void }) {
    this.legend = new Legend(legend);
    this.meaning = choice<Meaning>(
      "What is shown",
      [["picture", "Picture"], ["luminance", "cd/m²"], ["illuminance", "lux"]],
      (meaning) => this.mean(meaning),
    );
    this.illuminance = this.meaning.row.querySelector("[role=radio]:last-child");
    this.top = slider({
      name: "Red is", least: -1, most: 6, step: 0.1, rest: 3, say: (log) => amount(nice(10 ** log)),
      set: (log) => {
        this.topLog = log;
        this.mean(this.meant);
      },
    });
    this.exposure = slider({
      name: "Exposure", least: -RANGE, most: RANGE, step: 0.1, rest: 0, kind: "centred", say: stops,
      set: (value) => {
        this.byHand = true;
        this.expose(value);
      },
    });
    const auto = button("Auto", () => this.meter(), { class: "quiet", title: "Expose for what is seen now (A)" });
    this.curve = choice("Tone curve", [["filmic", "Filmic"], ["linear", "Linear"]], (curve) => this.setCurve(curve));
    this.behind = choice("Behind the scene", [["sky", "Sky"], ["plain", "Plain"]], (what) => {
      this.showsSky = what === "sky";
      this.setBehind();
    });
    const exposing = element("div", { class: "with-button" }, this.exposure.row, auto);
    const looks = element("div", { class: "choices" }, this.curve.row, this.behind.row);
    const shown = element("div", { class: "choices" }, this.meaning.row);
    const snap = button("Save picture", () => acts.save(), { class: "quiet", title: "What is on the screen, as a PNG (P)" });
    this.filmer = button("Record", () => acts.record(), { class: "quiet", "aria-pressed": "false", title: "Film what is on the screen" });
    const files = element("div", { class: "buttons" }, snap, this.filmer);
    this.part = section("Picture", exposing, looks, shown, this.top.row, files);
    this.exposure.show(0);
    this.setCurve("filmic");
    this.setBehind();
    this.mean("picture");
    prefersLight.addEventListener("change", () => this.setBehind());
  }

  /** Indoors no environment tells how bright it is: what is seen is metered, once there is light. */
  indoors = false;
  private waitsForLight = false;

  /** The exact light of what is set is there. */
  lit(): void {
    if (!this.waitsForLight) return;
    this.waitsForLight = false;
    if (this.byHand) return;
    const metered = this.stage.meter();
    if (metered !== null) this.expose(metered + INDOORS);
  }

  /** Another environment: take the exposure that suits it, when that is known, unless one was set by hand. */
  suit(environment: string, suggested: number | null): void {
    if (environment === this.suited || suggested === null) return;
    this.suited = environment;
    if (this.byHand) return;
    this.waitsForLight = this.indoors;
    if (!this.indoors) this.expose(suggested);
  }

  /** Whether what is on the screen is filmed. */
  recording(isOn: boolean): void {
    this.filmer.textContent = isOn ? "Stop recording" : "Record";
    this.filmer.setAttribute("aria-pressed", String(isOn));
  }

  /** Expose for what is seen. */
  meter(): void {
    const metered = this.stage.meter();
    if (metered === null) return;
    this.byHand = false;
    this.expose(metered);
  }

  brighten(more: number): void {
    this.byHand = true;
    this.expose(Math.min(RANGE, Math.max(-RANGE, this.stops + more)));
  }

  private expose(value: number): void {
    this.stops = value;
    this.exposure.show(value);
    this.stage.expose(value);
  }

  /** Illuminance is of surfaces alone: not where rows are what one eye sees. */
  allowIlluminance(isAllowed: boolean): void {
    if (this.illuminance !== null) this.illuminance.hidden = !isAllowed;
    if (!isAllowed && this.meant === "illuminance") this.mean("picture");
  }

  /** The radiance that is shown as white. */
  get white(): number {
    return 2 ** -this.stops;
  }

  private mean(meaning: Meaning): void {
    if (meaning !== this.meant && this.meant === "picture") {
      const white = LUMENS_PER_WATT * this.white * (meaning === "illuminance" ? Math.PI : 1);
      this.topLog = Math.min(6, Math.max(-1, Math.log10(white) + 0.3));
    }
    this.meant = meaning;
    this.meaning.show(meaning);
    this.top.show(this.topLog);
    this.top.row.hidden = meaning === "picture";
    const top = nice(10 ** this.topLog);
    this.legend.show(meaning, top);
    this.stage.setMeaning(meaning, top);
  }

  private setCurve(curve: ToneCurve): void {
    this.curve.show(curve);
    this.stage.setCurve(curve);
  }

  private setBehind(): void {
    this.behind.show(this.showsSky ? "sky" : "plain");
    this.stage.setBackdrop(this.showsSky, prefersLight.matches ? BACKDROPS.light : BACKDROPS.dark);
  }
}

/** The nearest of 1, 2, 5, 10, …. */
function nice(value: number): number {
  const decade = 10 ** Math.floor(Math.log10(value));
  const steps = [1, 2, 5, 10].map((step) => step * decade);
  return steps.reduce((best, step) => (Math.abs(Math.log(step / value)) < Math.abs(Math.log(best / value)) ? step : best));
}
