// The page of prelight studio: connects what the studio says to what is seen, and what is touched to the studio.

import "./studio.css";
import { EarlyGeometry } from "./geometry";
import { readFrame } from "./frames";
import { Link, type Standing } from "./link";
import type { ServerMessage, State, Welcome } from "./messages";
import { PROTOCOL_VERSION } from "./messages";
import { Metrics } from "./metrics";
import { download, filmed } from "./recorder";
import { Rig } from "./rig";
import { Shown } from "./shown";
import { BEFORE } from "./sides";
import { summary } from "./welcome";
import { button, element, wrapped } from "./panel/elements";
import { bindKeys } from "./panel/keys";
import { CamerasBar } from "./panel/cameras_bar";
import { GlassPanel } from "./panel/glass_panel";
import { LampsPanel, type Spot } from "./panel/lamps_panel";
import { LightsPanel } from "./panel/lights_panel";
import { Notices } from "./panel/notices";
import { PaceCorner } from "./panel/pace";
import { PicturePanel } from "./panel/picture_panel";
import { PlacingBar } from "./panel/placing_bar";
import { RigBar } from "./panel/rig_bar";
import { SkyPanel } from "./panel/sky_panel";
import { WorldPanel } from "./panel/world_panel";
import { StartPage } from "./start/page";
import { Divider } from "./view/divider";
import { Handles } from "./view/handles";
import { type Effect, type Placement, Placing, anglesOf } from "./view/placing";
import { Stage } from "./view/stage";

const TURN_KEY_DEG = 5;
const MAPS_AFTER_MS = 2000; // from the first light, where its exact answer takes longer

class Page {
  private readonly geometry = new EarlyGeometry(); // and the connection: both are made while the stage is
  private readonly link = Link.opened({
    message: (message) => this.isBegun && this.take(message),
    frame: (data) => this.isBegun && this.takeFrame(data),
    standing: (standing) => this.isBegun && this.takeStanding(standing),
  });
  private readonly metrics = new Metrics();
  private readonly notices = new Notices(found("notices"));
  private readonly stage = new Stage(found("stage"), this.metrics);
  private readonly rig = new Rig((change) => this.link.send(change));
  private readonly placing = new Placing(this.stage, {
    place: (placement) => this.place(placement),
    say: (words) => this.notices.hint(words),
  });
  private readonly placesLamp = { is: false };
  private readonly lights = new LightsPanel(this.rig, this.placingBar(false));
  private readonly sky = new SkyPanel(this.rig, (map) => this.lights.strip.showMap(map));
  private readonly lamps = new LampsPanel(
    this.rig,
    { place: () => this.spotForALamp(), chosen: () => this.showLamps() },
    this.placingBar(true),
  );
  private readonly handles = new Handles(() => this.stage.eye.camera, () => this.stage.surface, {
    select: (id) => this.lamps.select(id),
    move: (id, what, place, dragging) => this.lamps.move(id, what, place, dragging),
    remove: (id) => this.lamps.remove(id),
  });
  private readonly glass = new GlassPanel(this.rig, (through) => this.stage.setPanes(through));
  private readonly divider = new Divider((place) => this.shown.looks.moveTo(place));
  private readonly shown = new Shown({
    rig: this.rig, stage: this.stage, metrics: this.metrics, notices: this.notices,
    send: (message) => this.link.send(message),
    divided: () => this.showDivider(),
  });
  private readonly world = new WorldPanel(this.rig);
  private readonly bar = new RigBar((change) => this.rig.ask(change), (words) => this.notices.toast(words));
  private readonly picture = new PicturePanel(this.stage, found("legend"), {
    save: () => void this.save(),
    record: () => this.record(),
  });
  private readonly cameras = new CamerasBar(found("eyes"), this.stage, () => this.walk());
  private readonly corner = new PaceCorner(found("pace"), this.metrics);
  private welcome: Welcome | null = null;
  private unshown: State | null = null;
  private filming: (() => void) | null = null;
  private isBegun = false; // not where nothing can be drawn

  start(): void {
    this.metrics.version = PROTOCOL_VERSION;
    const panel = found("panel");
    const { sky, lights, glass, world, lamps, picture } = this;
    const { looks, timeline, tracer } = this.shown;
    panel.append(this.bar.part, ...[sky, lights, world, glass, lamps, looks, timeline, picture, tracer].map(({ part }) => part));
    found("stage").append(this.handles.host, this.divider.host);
    new ResizeObserver(() => this.cover()).observe(panel);
    window.addEventListener("resize", () => this.cover());
    this.rig.follow((look) => {
      this.sky.show(look);
      this.lights.show(look);
      this.glass.show(look);
      this.lamps.show(look);
      this.showLamps();
      this.world.show(look);
      this.shown.looks.show(look);
      this.shown.timeline.show(look);
      this.bar.show(look);
      this.stage.showLook(look);
      this.picture.suit(look.environment, look.stops);
    });
    this.stage.beforeDraw(() => this.showState());
    this.stage.onDraw(() => {
      const azimuth = this.stage.heading();
      this.sky.dome.showHeading(azimuth);
      this.lights.showHeading(azimuth);
      this.handles.place();
      this.shown.see(this.welcome);
      const { shownExact, shownSequence } = this.metrics;
      if (shownExact && shownSequence === this.rig.sequence) this.picture.lit();
      if (shownExact) this.sky.fetchMaps();
    });
    const help = bindKeys([
      { keys: ["[", ","], shown: "[", does: "turn the sky to the left", run: () => this.turn(TURN_KEY_DEG) },
      { keys: ["]", "."], shown: "]", does: "turn the sky to the right", run: () => this.turn(-TURN_KEY_DEG) },
      { keys: ["e"], shown: "e", does: "expose brighter", run: () => this.picture.brighten(0.5) },
      { keys: ["d"], shown: "d", does: "expose darker", run: () => this.picture.brighten(-0.5) },
      { keys: ["a"], shown: "a", does: "expose for what is seen", run: () => this.picture.meter() },
      { keys: ["l"], shown: "l", does: "add a light", run: () => this.lights.addAside() },
      { keys: ["v"], shown: "v", does: "walk through the scene, and back", run: () => this.walk() },
      { keys: ["b"], shown: "b", does: "before and after the last step", run: () => this.shown.looks.compare(BEFORE) },
      { keys: ["t"], shown: "t", does: "play the timeline", run: () => this.shown.timeline.toggle() },
      { keys: ["p"], shown: "p", does: "save a picture", run: () => void this.save() },
      { keys: ["z"], shown: "z", does: "undo", run: () => this.bar.undo() },
      { keys: ["Z", "y"], shown: "Z", does: "redo", run: () => this.bar.redo() },
      { keys: ["h"], shown: "h", does: "hide everything but the scene, and back", run: () => this.hide() },
      { keys: ["?"], shown: "?", does: "this sheet", run: () => help() },
    ]);
    found("pace").append(button("?", () => help(), { class: "help", "aria-label": "Keys", title: "Keys (?)" }));
    this.expose();
    this.isBegun = true;
  }

  private take(message: ServerMessage): void {
    switch (message.type) {
      case "Welcome":
        void this.open(message);
        break;
      case "State":
        this.shown.note(message);
        this.unshown = message;
        this.stage.invalidate();
        break;
      case "Refused":
        this.notices.toast(message.reason);
        break;
      case "Marked":
        this.rig.answered(message);
        break;
      case "Compared":
        this.shown.announce(message);
        break;
      case "Traced":
        this.shown.tracer.take(message);
        break;
      case "Waiting":
        this.corner.wait(message.reason ?? "");
        if (!this.metrics.ready && message.reason !== null) this.notices.opening(message.reason);
        break;
      case "Pace":
        this.corner.take(message);
        break;
    }
  }

  /** What others do, once a picture: they may do more in the meantime. */
  private showState(): void {
    const state = this.unshown;
    this.unshown = null;
    if (state !== null) this.rig.receive(state);
  }

  /** A frame has arrived: keep it for the next picture, and ask for another. */
  private takeFrame(data: ArrayBuffer): void {
    const began = performance.now();
    const frame = readFrame(data);
    if (frame === null) return;
    if (frame.kind !== "light") {
      this.shown.take(frame);
      return;
    }
    this.shown.lit(frame);
    this.stage.take(frame);
    this.link.send({ type: "Seen", frame: frame.number });
    this.metrics.arrived(frame, performance.now() - began);
    if (this.welcome !== null) this.opened();
  }

  private takeStanding(standing: Standing): void {
    this.metrics.standing = standing.is;
    document.documentElement.classList.toggle("lost", standing.is !== "open");
    this.notices.standing(standing);
  }

  private async open(welcome: Welcome): Promise<void> {
    const isSame = this.welcome?.bake === welcome.bake;
    if (!isSame) {
      this.notices.opening(`Opening ${welcome.name}`);
      document.title = `${welcome.name} · Prelight`;
      found("title").replaceChildren(element("h1", {}, welcome.name), element("p", {}, summary(welcome)));
      this.lights.allow(welcome.most_discs);
      this.lamps.allow(welcome.most_lamps);
      this.glass.offer(welcome.portals);
      this.world.offer(welcome.worlds);
      this.shown.open(welcome);
      this.lamps.offer(welcome.takes.includes("lamps"), welcome.steered?.places ?? []);
      const takes = (what: Welcome["takes"][number]) => welcome.takes.includes(what);
      this.sky.part.hidden = this.lights.part.hidden = !takes("environment");
      this.lamps.part.hidden = this.handles.host.hidden = !takes("lamps") && !takes("steered");
      this.picture.indoors = welcome.takes.some((what) => what !== "environment");
      this.picture.allowIlluminance(welcome.pixels === null && welcome.eye === null);
      this.sky.offer(welcome.environments, welcome.state.environment);
      this.cameras.offer(welcome);
    }
    document.documentElement.classList.toggle("picture", welcome.pixels !== null);
    this.welcome = welcome;
    this.unshown = null;
    this.rig.begin(welcome.state);
    this.shown.reset(); // after a lost connection
    if (isSame) return;
    try {
      const geometry = await this.geometry.of(welcome.bake, (done, all) => {
        const megabytes = (bytes: number) => (bytes / 1e6).toFixed(1);
        this.notices.opening(`Opening ${welcome.name}: ${megabytes(done)} of ${megabytes(all)} MB`, done / all);
      });
      this.stage.show(welcome, geometry);
      this.glass.show(this.rig.look);
      this.handles.scale(this.stage.sphere.radius);
      this.cover();
      this.metrics.ready = true;
      this.opened();
    } catch (error) {
      this.notices.toast(error instanceof Error ? error.message : "The scene could not be opened.");
    }
  }

  /** Lift the veil once there is both a scene and light on it. */
  private opened(): void {
    if (this.metrics.ready && this.metrics.updates > 0) {
      this.notices.opened();
      window.setTimeout(() => this.sky.fetchMaps(), MAPS_AFTER_MS);
    } else if (this.metrics.ready) this.notices.opening("Waiting for the first light");
  }

  private showLamps(): void {
    this.handles.show(this.rig.look.lamps, this.lamps.selected);
  }

  /** Above what is looked at, as strong as the exposure wants it there. */
  private spotForALamp(): Spot {
    const { target } = this.stage.eye;
    const side = this.stage.sphere.radius;
    const high = 0.35 * side;
    const round = (value: number) => Number(value.toFixed(2));
    const place: Spot["target"] = [round(target.x), round(target.y), round(target.z)];
    return {
      position: [place[0], round(target.y + high), place[2]],
      target: place,
      intensity: Math.PI * high * high * this.picture.white,
      side,
      white: this.picture.white,
    };
  }

  private placingBar(ofLamp: boolean): HTMLElement {
    const start = (effect: Effect, ended: () => void) => {
      this.placesLamp.is = ofLamp;
      if (!ofLamp || this.lamps.chooseOne()) this.placing.start(effect, ended);
    };
    return new PlacingBar(start, () => this.placing.stop()).row;
  }

  private place(placement: Placement): void {
    if (this.placesLamp.is) this.lamps.effect(placement);
    else this.lights.shineFrom(...anglesOf(placement.toward));
  }

  private walk(): void {
    const { eye, canvas } = this.stage;
    eye.walk(!eye.isWalking);
    if (!eye.isWalking) return;
    this.notices.hint("Walking: drag to look, W A S D to go, V to end", 4000);
    canvas.focus();
  }

  private async save(): Promise<void> {
    const picture = await this.stage.snapshot();
    if (picture !== null) download(picture, `${document.title.split(" · ")[0] ?? "prelight"}.png`);
  }

  private record(): void {
    if (this.filming !== null) {
      this.filming();
      this.filming = null;
    } else {
      this.filming = filmed(this.stage.canvas, "prelight", (megabytes) => this.notices.toast(`A film of ${megabytes.toFixed(1)} MB`));
      if (this.filming === null) this.notices.toast("This browser cannot record films.");
    }
    this.picture.recording(this.filming !== null);
  }

  private showDivider(): void {
    this.divider.show(this.shown.looks.wipe, this.stage.freeWidth, this.shown.looks.names);
  }

  private turn(degrees: number): void {
    this.rig.change({ rotation_deg: wrapped(this.rig.look.rotation_deg + degrees) }, { dragging: true });
  }

  private hide(): void {
    document.documentElement.classList.toggle("bare");
    this.cover();
  }

  /** The picture's middle is that of what the panel leaves free. */
  private cover(): void {
    const panel = found("panel").getBoundingClientRect();
    const isBeside = panel.width < 0.6 * innerWidth;
    if (panel.width === 0) this.stage.cover(0, 0);
    else if (isBeside) this.stage.cover(innerWidth - panel.left, 0);
    else this.stage.cover(0, innerHeight - panel.top);
    this.showDivider();
  }

  /** What tests look at. */
  private expose(): void {
    const { metrics, stage, rig } = this;
    const shown = {
      metrics,
      pixels: () => stage.pixels(),
      eye: () => stage.eye.camera.position.toArray(),
      pick: (x: number, y: number) => stage.pick(x, y)?.point.toArray() ?? null,
      look: () => rig.look,
      settled: () =>
        metrics.ready && !rig.isWaiting && metrics.shownExact && metrics.shownSequence >= rig.sequence &&
        metrics.lastSequence === metrics.shownSequence && metrics.sky === rig.look.environment,
      resting: () => !stage.isWanted,
      change: (values: object, dragging: boolean) => rig.change(values, { dragging }),
    };
    Object.defineProperty(window, "__prelight", { value: shown });
  }
}

function found(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`The page has no ${id}.`);
  return element;
}

try {
  if (location.pathname === "/start") new StartPage().start();
  else new Page().start();
} catch (error) {
  const words = "This browser cannot draw the scene: WebGL 2 is missing or switched off.";
  found("notices").replaceChildren(element("div", { class: "veil" }, element("p", {}, words)));
  throw error;
}
