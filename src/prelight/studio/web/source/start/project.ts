// The scene that is chosen: its picture, what to bake of it, what that costs, and how far it is.

import { button, choice, element } from "../panel/elements";
import type { LayerView, ProjectView, StartMessage, Wish } from "../start_messages";
import { bytes, count, duration, rate } from "./words";

const FLOOR = 3; // times as wide as the scene
const WAITING = { looking: "Reading the scene", planning: "Estimating the cost" } as const;

export class ProjectPart {
  private readonly picture = element("img", { alt: "", width: "480", height: "270" });
  private readonly frame = element("figure", { class: "preview" }, this.picture, element("figcaption", {}));
  private readonly title = element("h2", {});
  private readonly facts = element("p", { class: "facts" });
  private readonly notes = element("ul", { class: "notes" });
  private readonly floor = element("input", { type: "checkbox", "aria-label": "A floor under it" });
  private readonly cost = element("table", { class: "cost" });
  private readonly bar = element("progress", { max: "1", "aria-label": "Baked" });
  private readonly said = element("p", { class: "said", role: "status" });
  private readonly problem = element("p", { class: "problem", role: "alert" });
  private readonly go = button("Bake", () => this.press(), { class: "main" });
  private readonly wishes: HTMLElement;
  private readonly sky = choice<Wish["sky"]>("Sky", [["open", "All around"], ["windows", "Windows"], ["none", "None"]], (sky) => this.ask({ sky }));
  private readonly lamps = choice<Wish["lamps"]>("Lamps", [["none", "None"], ["transfer", "Anywhere"], ["cloud", "In a cloud"]], (lamps) => this.ask({ lamps }));
  private readonly quality = choice<Wish["quality"]>("Quality", [["draft", "Draft"], ["good", "Good"], ["best", "Best"]], (quality) => this.ask({ quality }));
  private readonly device = choice<Wish["device"]>("Device", [["auto", "Graphics card"], ["cpu", "Processor"]], (device) => this.ask({ device }));
  private readonly deviceField: HTMLElement;
  readonly part: HTMLElement;
  private shown: ProjectView | null = null;
  private wish: Wish | null = null;

  constructor(private readonly send: (message: StartMessage) => void) {
    this.floor.addEventListener("change", () => this.ask({ floor: this.floor.checked ? FLOOR : null }));
    const floor = element("label", { class: "check" }, this.floor, "A floor under it");
    this.deviceField = field("Traced on", this.device.row);
    this.wishes = element(
      "fieldset",
      { class: "wishes" },
      field("Sky", this.sky.row),
      field("Lamps", this.lamps.row),
      field("Quality", this.quality.row),
      this.deviceField,
      field("", floor),
    );
    const beside = element("div", {}, this.title, this.facts, this.notes, this.wishes);
    const below = element("div", { class: "going" }, this.problem, this.bar, this.said, this.go);
    this.part = element("section", { class: "project", "aria-label": "The scene" }, this.frame, beside, this.cost, below);
  }

  show(project: ProjectView): void {
    const other = this.shown?.id !== project.id;
    this.shown = project;
    this.wish = project.wish;
    this.title.textContent = project.name;
    const { vertices, triangles, windows } = project;
    const parts = [`${count(vertices)} vertices`, `${count(triangles)} triangles`];
    if (windows > 0) parts.push(`glass in ${windows} ${windows === 1 ? "opening" : "openings"}`);
    this.facts.textContent = vertices > 0 ? parts.join(" · ") : "";
    this.notes.replaceChildren(...project.notes.map((note) => element("li", {}, note)));
    this.showPicture(project, other);
    this.showWishes(project);
    this.showCost(project.layers, project.stage === "baking");
    this.showProgress(project);
  }

  private showPicture({ id, passes, name }: ProjectView, other: boolean): void {
    const url = passes > 0 ? `/start/picture/${id}?${passes}` : "";
    this.frame.classList.toggle("empty", passes === 0);
    if (other || this.picture.dataset["url"] !== url) {
      this.picture.dataset["url"] = url;
      if (url === "") this.picture.removeAttribute("src");
      else this.picture.src = url;
    }
    this.picture.alt = `${name} under a sky at noon`;
    const caption = this.frame.lastElementChild;
    if (caption) caption.textContent = passes > 1 ? `${passes} paths a pixel, under a sky of ours` : "";
  }

  private showWishes({ wish, stage, windows, devices, vertices }: ProjectView): void {
    this.wishes.toggleAttribute("disabled", stage === "baking");
    this.wishes.hidden = this.go.hidden = stage === "refused" && vertices === 0;
    this.sky.show(wish.sky);
    this.lamps.show(wish.lamps);
    this.quality.show(wish.quality);
    this.device.show(wish.device);
    this.deviceField.hidden = devices.length < 2;
    this.floor.checked = wish.floor !== null;
    const through = this.sky.row.children[1];
    if (through instanceof HTMLButtonElement) through.disabled = windows === 0 && wish.sky !== "windows";
  }

  private showCost(layers: LayerView[], isBaking: boolean): void {
    this.cost.hidden = layers.every(({ seconds }) => seconds === 0);
    const head = ["Layer", "Rays", "Time", "On disk", "Memory"].map((name) => element("th", { scope: "col" }, name));
    const rows = layers.map((layer) => {
      const { title, rays, seconds, bytes: size, memory, share, command } = layer;
      const done = share >= 1 ? "done" : isBaking && share > 0 ? `${Math.floor(100 * share)} %` : duration(seconds);
      const cells = [count(rays), done, bytes(size), bytes(memory)].map((text) => element("td", {}, text));
      return element("tr", {}, element("th", { scope: "row", title: command }, title), ...cells);
    });
    const all = (of: (layer: LayerView) => number) => layers.reduce((sum, layer) => sum + of(layer), 0);
    if (layers.length > 1) {
      const most = Math.max(...layers.map(({ memory }) => memory));
      const sums = [count(all((l) => l.rays)), duration(all((l) => l.seconds)), bytes(all((l) => l.bytes)), bytes(most)];
      rows.push(element("tr", { class: "sum" }, element("th", { scope: "row" }, "Together"), ...sums.map((text) => element("td", {}, text))));
    }
    this.cost.replaceChildren(element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...rows));
  }

  private showProgress(project: ProjectView): void {
    const { stage, reason, share, seconds_left: left, rays_per_second: speed } = project;
    const isBaking = stage === "baking";
    this.problem.textContent = stage === "refused" || stage === "stopped" ? reason : "";
    this.problem.classList.toggle("mild", stage === "stopped");
    this.bar.hidden = !(isBaking || stage === "stopped" || stage === "looking" || stage === "planning");
    if (isBaking || stage === "stopped") this.bar.value = share;
    else this.bar.removeAttribute("value");
    const told = [`${Math.floor(100 * share)} %`];
    if (speed !== null) told.push(rate(speed));
    if (left !== null) told.push(`${duration(left)} left`);
    const waiting = stage === "looking" || stage === "planning" ? WAITING[stage] : "";
    this.said.textContent = isBaking ? told.join(" · ") : stage === "baked" ? `Baked: ${project.path ?? ""}` : waiting;
    const names = { baking: "Stop", stopped: "Go on", baked: "Open in the studio" } as Record<string, string>;
    this.go.textContent = names[stage] ?? "Bake";
    this.go.disabled = !["ready", "baking", "stopped", "baked"].includes(stage);
    this.go.classList.toggle("calm", isBaking);
  }

  private press(): void {
    const project = this.shown?.id;
    if (project === undefined) return;
    const stage = this.shown?.stage;
    this.send({ type: stage === "baking" ? "Stop" : stage === "baked" ? "OpenBake" : "Bake", project });
  }

  private ask(changed: Partial<Wish>): void {
    if (this.shown === null || this.wish === null) return;
    this.wish = { ...this.wish, ...changed };
    if (this.wish.sky === "windows") this.wish.floor = null;
    this.send({ type: "SetWish", project: this.shown.id, wish: this.wish });
  }
}

function field(name: string, row: HTMLElement): HTMLElement {
  return element("div", { class: "field" }, element("span", { "aria-hidden": "true" }, name), row);
}
