// The line between two looks that are seen side by side.

import { element } from "../panel/elements";

const STEP = 0.02;

export class Divider {
  readonly host = element("div", { class: "divider" });
  private readonly grip = element("div", { class: "grip", role: "slider", tabindex: "0", "aria-label": "Where the other look begins" });
  private readonly left = element("span", { class: "left" }, "Now");
  private readonly right = element("span", { class: "right" });
  private place = 0.5;
  private free = 1;
  private held = false;

  constructor(private readonly move: (place: number) => void) {
    this.grip.setAttribute("aria-valuemin", "0");
    this.grip.setAttribute("aria-valuemax", "100");
    this.host.append(element("div", { class: "cut" }), this.left, this.right, this.grip);
    this.host.hidden = true;
    this.grip.addEventListener("pointerdown", (event) => {
      this.held = true;
      this.grip.setPointerCapture(event.pointerId);
    });
    this.grip.addEventListener("pointermove", (event) => this.held && this.move(event.clientX / this.free));
    for (const end of ["pointerup", "pointercancel"] as const) this.grip.addEventListener(end, () => (this.held = false));
    this.grip.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -STEP, ArrowRight: STEP }[event.key];
      if (way === undefined) return;
      event.preventDefault();
      this.move(this.place + way);
    });
  }

  /** At a place from 0 to 1 of the free part of the stage, `free` pixels wide; null: hidden. */
  show(place: number | null, free: number, [left, right]: readonly [string, string]): void {
    this.host.hidden = place === null;
    if (place === null) return;
    [this.place, this.free] = [place, free];
    this.left.textContent = left;
    this.right.textContent = right;
    this.host.style.transform = `translateX(${(place * free).toFixed(1)}px)`;
    this.grip.setAttribute("aria-valuenow", (100 * place).toFixed(0));
  }
}
