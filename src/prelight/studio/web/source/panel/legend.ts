// The legend of false colour: what colour means how much.

import { DECADES, PALETTE, type Meaning } from "../view/display";
import { amount, element } from "./elements";

const WORDS = { picture: "", luminance: "Luminance, cd/m²", illuminance: "Illuminance, lx" } as const;

export class Legend {
  private readonly title = element("p", {});
  private readonly marks = element("ol", {});
  private readonly bar = element("div", { class: "scale", "aria-hidden": "true" });

  constructor(private readonly host: HTMLElement) {
    host.append(this.title, element("div", { class: "legend-body" }, this.bar, this.marks));
    this.bar.style.background = `linear-gradient(to top, ${PALETTE.join(", ")})`;
    host.hidden = true;
  }

  show(meaning: Meaning, top: number): void {
    this.host.hidden = meaning === "picture";
    this.title.textContent = WORDS[meaning];
    const marks: HTMLElement[] = [];
    for (let i = 0; i <= 2 * DECADES; i++) {
      const value = top * 10 ** (-i / 2);
      const isWhole = i % 2 === 0;
      marks.push(element("li", { class: isWhole ? "" : "minor" }, isWhole ? amount(value) : ""));
    }
    this.marks.replaceChildren(...marks);
  }
}
