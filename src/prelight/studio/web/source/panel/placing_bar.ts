// Three buttons that place the chosen light by its effect: highlight, light, shadow.

import type { Effect } from "../view/placing";
import { button, element } from "./elements";

const EFFECTS: readonly (readonly [Effect, string, string])[] = [
  ["highlight", "Highlight", "Click where it shall be mirrored toward you"],
  ["light", "Light", "Click what it shall fall on"],
  ["shadow", "Shadow", "Click where its shadow shall fall, then what casts it"],
];

export class PlacingBar {
  readonly row = element("div", { class: "placing-bar", role: "group", "aria-label": "Place by clicking" });
  private readonly buttons: HTMLButtonElement[];

  constructor(start: (effect: Effect, ended: () => void) => void, stop: () => void) {
    this.buttons = EFFECTS.map(([effect, words, title]) => {
      const made = button(words, () => {
        const isOn = made.getAttribute("aria-pressed") === "true";
        stop();
        if (isOn) return;
        start(effect, () => made.setAttribute("aria-pressed", "false"));
        made.setAttribute("aria-pressed", "true");
      }, { "aria-pressed": "false", title });
      return made;
    });
    this.row.append(element("span", {}, "Click a"), ...this.buttons);
  }
}
