// How the picture is shown: exposure, tone curve, what is behind. Of this visitor alone; it changes no light.

import type { Stage } from "../view/stage";
import type { Curve } from "../view/display";
import { button, choice, element, section, slider, stops } from "./elements";

type ToneCurve = Exclude<Curve, "none">;

const RANGE = 8; // stops to either side

const prefersLight = matchMedia("(prefers-color-scheme: light)");
const BACKDROPS = { light: [0.3, 0.62], dark: [0.012, 0.05] } as const; // linear greys, below and above

export class PicturePanel {
  readonly part: HTMLElement;
  private readonly exposure: ReturnType<typeof slider>;
  private readonly curve: ReturnType<typeof choice<ToneCurve>>;
  private readonly behind: ReturnType<typeof choice<"sky" | "plain">>;
  private stops = 0;
  private byHand = false;
  private suited = "";
  private showsSky = true;

  constructor(private readonly stage: Stage) {
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
    this.part = section("Picture", exposing, element("div", { class: "choices" }, this.curve.row, this.behind.row));
    this.exposure.show(0);
    this.setCurve("filmic");
    this.setBehind();
    prefersLight.addEventListener("change", () => this.setBehind());
  }

  /** Another environment: take the exposure that suits it, when that is known, unless one was set by hand. */
  suit(environment: string, suggested: number | null): void {
    if (environment === this.suited || suggested === null) return;
    this.suited = environment;
    if (!this.byHand) this.expose(suggested);
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

  private setCurve(curve: ToneCurve): void {
    this.curve.show(curve);
    this.stage.setCurve(curve);
  }

  private setBehind(): void {
    this.behind.show(this.showsSky ? "sky" : "plain");
    this.stage.setBackdrop(this.showsSky, prefersLight.matches ? BACKDROPS.light : BACKDROPS.dark);
  }
}
