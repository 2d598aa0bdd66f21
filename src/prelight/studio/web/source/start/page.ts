// The start page: a scene is dropped or chosen, baked while one watches, and opened in the studio.

import "./start.css";
import { button, element } from "../panel/elements";
import type { ProjectView, StartAnswer, Workshop } from "../start_messages";
import { Desk } from "./desk";
import { DropZone } from "./drop";
import { ProjectPart } from "./project";

const TOAST_MS = 9000;
const STAGES = { looking: "…", planning: "…", ready: "not baked", stopped: "stopped", refused: "refused", baked: "baked" } as const;

export class StartPage {
  private readonly desk = new Desk((message) => this.take(message), (words) => this.stand(words));
  private readonly drop = new DropZone({
    arrived: (upload, main) => this.desk.send({ type: "TakeUpload", upload, main }),
    refused: (words) => this.toast(words),
  });
  private readonly project = new ProjectPart((message) => this.desk.send(message));
  private readonly stock = element("div", { class: "stock" });
  private readonly list = element("ul", { class: "projects", "aria-label": "Scenes" });
  private readonly welcome = element("section", { class: "welcome" });
  private readonly back = element("a", { href: "/", class: "back" });
  private readonly banner = element("div", { class: "banner", role: "status" });
  private readonly toasts = element("div", { class: "toasts", role: "alert" });
  private chosen: string | null = location.hash.slice(1) || null;
  private workshop: Workshop | null = null;

  start(): void {
    document.title = "Start · Prelight";
    document.documentElement.classList.add("starting");
    const head = element("header", {}, element("h1", {}, "Prelight"), element("p", {}, "Bake a scene once, then light it live."), this.back);
    this.welcome.append(
      element("h2", {}, "Nothing baked yet"),
      element("p", {}, "Drop a scene, or take one of ours. You see what baking it costs before it begins; you can stop it and go on."),
    );
    const scenes = element("h2", {}, "Scenes of ours");
    const aside = element("aside", {}, this.drop.part, this.list, scenes, this.stock);
    const page = element("div", { id: "start" }, head, aside, element("main", {}, this.welcome, this.project.part));
    this.back.hidden = this.banner.hidden = this.project.part.hidden = true;
    document.body.replaceChildren(page, this.banner, this.toasts);
    window.addEventListener("hashchange", () => this.choose(location.hash.slice(1)));
    Object.defineProperty(window, "__prelight_start", { value: { workshop: () => this.workshop, drop: this.drop } });
    this.desk.open();
  }

  private take(message: StartAnswer): void {
    switch (message.type) {
      case "Workshop":
        this.workshop = message;
        this.show();
        break;
      case "Taken":
        this.choose(message.project);
        break;
      case "Opened":
        location.assign("/");
        break;
      case "Refused":
        this.toast(message.reason);
        break;
    }
  }

  private choose(project: string): void {
    this.chosen = project;
    if (location.hash.slice(1) !== project) history.replaceState(null, "", `#${project}`);
    this.show();
  }

  private show(): void {
    if (this.workshop === null) return;
    const { projects, shown, stock } = this.workshop;
    this.back.hidden = shown === null;
    this.back.textContent = `Back to ${shown ?? "the studio"}`;
    if (this.stock.childElementCount === 0) this.offer(stock.filter(({ scene }) => !scene.endsWith("-small")));
    const chosen = projects.find(({ id }) => id === this.chosen) ?? projects[0];
    this.welcome.hidden = chosen !== undefined;
    this.project.part.hidden = chosen === undefined;
    this.list.replaceChildren(...projects.map((project) => this.row(project, project === chosen)));
    if (chosen !== undefined) this.project.show(chosen);
  }

  private row({ id, name, stage, share, passes }: ProjectView, isChosen: boolean): HTMLElement {
    const said = stage === "baking" ? `${Math.floor(100 * share)} %` : STAGES[stage];
    const row = button("", () => this.choose(id), { class: "row", "aria-pressed": String(isChosen) });
    const picture = element("img", { alt: "", width: "48", height: "27" });
    if (passes > 0) picture.src = `/start/picture/${id}?${passes}`;
    row.append(picture, element("span", { class: "row-name" }, name), element("span", { class: `stage ${stage}` }, said));
    return element("li", {}, row);
  }

  private offer(stock: Workshop["stock"]): void {
    const known = new Set<string>();
    for (const { scene, title } of stock) {
      const name = scene.replace("stock:", "");
      if (known.has(title) || title.startsWith("the scene that shows")) continue;
      known.add(title);
      this.stock.append(button(name, () => this.desk.send({ type: "ChooseStock", scene }), { class: "quiet", title }));
    }
  }

  private stand(words: string): void {
    this.banner.hidden = words === "";
    this.banner.textContent = words;
  }

  private toast(words: string): void {
    const toast = element("div", { class: "toast" }, words);
    this.toasts.append(toast);
    window.setTimeout(() => toast.remove(), TOAST_MS);
  }
}
