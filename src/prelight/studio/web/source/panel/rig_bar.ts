// What is done with the rig as a whole: undo, redo, open it from a file, save it to one.

import { fetchRig } from "../geometry";
import type { Change } from "../messages";
import type { Look } from "../rig";
import { download } from "../recorder";
import { button, element } from "./elements";

const LARGEST_FILE = 60_000; // as the protocol has it

export class RigBar {
  readonly part = element("div", { class: "bar", role: "toolbar", "aria-label": "Rig" });
  private readonly undoer = button("↶", () => this.undo(), { class: "icon" });
  private readonly redoer = button("↷", () => this.redo(), { class: "icon" });
  private readonly file = element("input", { type: "file", accept: ".toml,application/toml", "aria-label": "Rig file" });

  constructor(
    private readonly ask: (change: Change) => void,
    private readonly toast: (words: string) => void,
  ) {
    this.file.hidden = true;
    this.file.addEventListener("change", () => void this.open());
    const open = button("Open rig", () => this.file.click(), { class: "quiet", title: "Light as a rig file says (.toml)" });
    const save = button("Save rig", () => void this.save(), { class: "quiet", title: "This light as a file for prelight relight" });
    this.part.append(this.undoer, this.redoer, element("span", { class: "gap" }), open, save, this.file);
    const start = document.documentElement.dataset["start"]; // where the studio has a start page
    if (start !== undefined) {
      const words = { class: "quiet", href: start, title: "Bake another scene, or open another bake" };
      this.part.querySelector(".gap")?.after(element("a", words, "New"));
    }
  }

  show({ undo, redo }: Look): void {
    for (const [made, verb, words] of [[this.undoer, "Undo", undo], [this.redoer, "Redo", redo]] as const) {
      made.disabled = words === null;
      const said = words === null ? verb : `${verb}: ${words}`;
      made.title = said;
      made.setAttribute("aria-label", said);
    }
  }

  undo(): void {
    if (!this.undoer.disabled) this.ask({ type: "Undo" });
  }

  redo(): void {
    if (!this.redoer.disabled) this.ask({ type: "Redo" });
  }

  private async open(): Promise<void> {
    const [file] = this.file.files ?? [];
    this.file.value = "";
    if (file === undefined) return;
    if (file.size > LARGEST_FILE) this.toast(`${file.name} is too large for a rig: ${file.size} bytes`);
    else this.ask({ type: "OpenRig", text: await file.text() });
  }

  private async save(): Promise<void> {
    try {
      download(await fetchRig(), "rig.toml");
    } catch (error) {
      this.toast(error instanceof Error ? error.message : "The rig could not be saved.");
    }
  }
}
