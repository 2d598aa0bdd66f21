// The sun by place, day and hour: shown where daylight is the sky.

import type { Sun } from "../messages";
import { DAYLIGHT, type Look, type Rig } from "../rig";
import { element, numbers, slider } from "./elements";

const MINUTE = 1 / 60;

export class SunSettings {
  readonly part: HTMLElement;
  private readonly hour: ReturnType<typeof slider>;
  private readonly haze: ReturnType<typeof slider>;
  private readonly place: ReturnType<typeof numbers>;
  private readonly date = element("input", { type: "date", "aria-label": "Day", min: "1901-01-01", max: "2099-12-31" });
  private readonly zone = element("input", {
    type: "text", maxlength: "60", placeholder: "by the sun", "aria-label": "Clock: a zone such as Europe/Zagreb",
    title: "A zone such as Europe/Zagreb; empty: noon is when the sun stands highest (on a yearly mean)",
  });

  constructor(private readonly rig: Rig) {
    this.hour = slider({
      name: "Hour", least: 0, most: 24 - MINUTE, step: MINUTE, rest: 12, say: clock,
      set: (hour, dragging) => this.change({ hour: Math.round(hour / MINUTE) / 60 }, dragging),
    });
    this.haze = slider({
      name: "Haze", least: 1.5, most: 10, step: 0.1, rest: 2.5, say: (value) => value.toFixed(1),
      set: (turbidity, dragging) => this.change({ turbidity }, dragging),
    });
    const range = { least: -180, most: 180, step: 1, unit: "°", digits: 3 };
    this.place = numbers("Place", ["N", "E"], range, ([latitude = 0, longitude = 0]) => {
      this.change({ latitude_deg: Math.max(-90, Math.min(90, latitude)), longitude_deg: longitude }, false);
    });
    this.date.addEventListener("change", () => this.date.value && this.change({ date: this.date.value }, false));
    this.zone.addEventListener("change", () => this.change({ zone: this.zone.value.trim() || null }, false));
    const day = element("label", { class: "field" }, element("span", {}, "Day"), this.date);
    const zone = element("label", { class: "field" }, element("span", {}, "Clock"), this.zone);
    this.part = element("div", { class: "sun", role: "group", "aria-label": "Sun" });
    this.part.append(this.hour.row, day, this.place.row, zone, this.haze.row);
  }

  show({ environment, sun }: Look): void {
    this.part.hidden = environment !== DAYLIGHT;
    this.hour.show(sun.hour);
    this.haze.show(sun.turbidity);
    this.place.show([sun.latitude_deg, sun.longitude_deg]);
    if (this.date.value !== sun.date) this.date.value = sun.date;
    if (document.activeElement !== this.zone) this.zone.value = sun.zone ?? "";
  }

  private change(values: Partial<Sun>, dragging: boolean): void {
    this.rig.setSun({ ...this.rig.look.sun, ...values }, { dragging });
  }
}

function clock(hour: number): string {
  const minutes = Math.round(hour * 60);
  return `${String(Math.floor(minutes / 60)).padStart(2, "0")}:${String(minutes % 60).padStart(2, "0")}`;
}
