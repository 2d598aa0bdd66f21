// The bake's cameras, and walking.

import type { CameraView, Welcome } from "../messages";
import type { Stage } from "../view/stage";
import { button } from "./elements";

export class CamerasBar {
  private readonly walker: HTMLButtonElement;
  private buttons: HTMLButtonElement[] = [];

  constructor(private readonly host: HTMLElement, private readonly stage: Stage, walk: () => void) {
    this.walker = button("Walk", walk, { title: "First person (V)", "aria-pressed": "false" });
    stage.canvas.addEventListener("moved", () => this.mark(-1));
    for (const name of ["moved", "walked"]) stage.canvas.addEventListener(name, () => this.showWalking());
  }

  offer({ cameras, pixels }: Welcome): void {
    this.buttons = cameras.map((camera, i) => {
      const made = button(camera.name, () => this.choose(camera, i), { title: `Camera ${camera.name}` });
      made.setAttribute("aria-pressed", String(i === 0));
      return made;
    });
    this.host.replaceChildren(...this.buttons, this.walker);
    this.host.hidden = cameras.length === 0 || pixels !== null; // a picture has its own
  }

  private choose(camera: CameraView, i: number): void {
    this.stage.look(camera);
    this.mark(i);
  }

  private mark(chosen: number): void {
    this.buttons.forEach((made, i) => made.setAttribute("aria-pressed", String(i === chosen)));
  }

  private showWalking(): void {
    this.walker.setAttribute("aria-pressed", String(this.stage.eye.isWalking));
  }
}
