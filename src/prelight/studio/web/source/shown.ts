// What is seen beside the light that is set: looks, the timeline, the path tracer's picture, what depends on the eye.

import { Asker } from "./asker";
import type { Frame } from "./frames";
import { fetchRig } from "./geometry";
import type { CameraView, ClientMessage, Compared, State, Welcome } from "./messages";
import type { Metrics } from "./metrics";
import { LooksPanel } from "./panel/looks_panel";
import type { Notices } from "./panel/notices";
import { TimelinePanel } from "./panel/timeline_panel";
import { TracerPanel } from "./panel/tracer_panel";
import { download, filmed } from "./recorder";
import type { Rig } from "./rig";
import { type Place, Sides, TRACED, ofLook } from "./sides";
import { between } from "./timeline";
import type { Stage } from "./view/stage";

const WIDEST_TRACED = 720; // pixels

interface Parts {
  rig: Rig;
  stage: Stage;
  metrics: Metrics;
  notices: Notices;
  send: (message: ClientMessage) => void;
  /** The line between two lights has moved, or is gone. */
  divided: () => void;
}

export class Shown {
  readonly looks: LooksPanel;
  readonly timeline: TimelinePanel;
  readonly tracer: TracerPanel;
  private readonly sides: Sides;
  private readonly asker: Asker;
  private other: Compared | null = null;
  private light = -1; // the number of the newest frame
  private tracing: { view: CameraView; width: number; height: number } | null = null;
  private lookWords = "";
  private isSeeking = false;

  constructor(private readonly parts: Parts) {
    const { rig, stage, notices, send } = parts;
    this.sides = new Sides(stage, send);
    this.asker = new Asker(send);
    this.timeline = new TimelinePanel(rig, {
      seek: (seconds) => this.seek(seconds),
      film: () => filmed(stage.canvas, "timeline", (megabytes) => notices.toast(`A film of ${megabytes.toFixed(1)} MB`)),
      save: () => void fetchRig("timeline").then((file) => download(file, "timeline.toml"), (error: Error) => notices.toast(error.message)),
    });
    this.looks = new LooksPanel({
      ask: (change) => rig.ask(change),
      show: (mix) => {
        if (!this.isSeeking) this.timeline.leave();
        this.sides.show(mix);
        parts.metrics.sides = this.sides.isComplete;
        parts.divided();
      },
    });
    this.tracer = new TracerPanel({ start: () => this.trace(), stop: () => send({ type: "StopTrace" }) });
  }

  /** Another bake. */
  open(welcome: Welcome): void {
    this.looks.stop();
    this.tracer.allow(welcome.no_tracer);
    this.dropTraced();
  }

  /** The connection is new: what was asked for is asked again. */
  reset(): void {
    this.asker.reset();
    this.tracer.reset();
    this.sides.forget();
  }

  /** A frame of the light that is set. */
  lit(frame: Frame): void {
    this.light = frame.number;
  }

  /** Whose light the next frame of a look is. */
  announce(compared: Compared): void {
    this.other = compared;
  }

  /** Any other frame. */
  take(frame: Frame): void {
    const { stage, metrics } = this.parts;
    if (frame.kind === "view") {
      stage.showView(frame);
      metrics.views += 1;
      this.asker.answer();
    } else if (frame.kind === "aside" && this.other !== null) {
      this.sides.take(this.other.look, this.other.light, frame.radiance);
      metrics.sides = this.sides.isComplete;
    } else if (frame.kind === "aside view" && this.other !== null) {
      this.sides.takeView(this.other.look, frame);
      metrics.asideViews += 1;
    } else if (frame.kind === "traced" && this.tracing !== null) {
      const isFirst = !metrics.traced;
      metrics.traced = true;
      this.sides.setTraced({ words: frame.radiance, ...this.tracing });
      this.looks.allowTraced(true);
      if (isFirst) this.looks.compare(TRACED);
    }
  }

  /** What depends on the eye is asked for, as it is seen in this picture. */
  see(welcome: Welcome | null): void {
    const { rig, stage } = this.parts;
    if (welcome === null) return;
    const { x, y, z } = stage.eye.camera.position;
    const eye = [x, y, z].map((value) => Number(value.toPrecision(6))) as Place;
    this.sides.see(welcome.glossy || welcome.worlds.length > 0 ? eye : null);
    if (welcome.glossy || rig.look.world !== null) this.asker.see({ eye, light: this.light });
  }

  /** Looks that were kept, or taken back, are fetched again where they are seen. */
  note({ undo, redo, looks }: State): void {
    const said = JSON.stringify([undo, redo, looks]);
    if (said === this.lookWords) return;
    this.lookWords = said;
    const isOfLooks = [undo, redo].some((words) => words?.startsWith("keeping") || words?.startsWith("forgetting"));
    if (isOfLooks) this.sides.forget();
    else this.sides.forgetBefore();
  }

  /** The light of a moment of the timeline; null: what is set. */
  private seek(seconds: number | null): void {
    const keys = this.parts.rig.look.timeline;
    const now = seconds === null ? null : between(keys, seconds);
    this.isSeeking = true;
    if (now !== null) this.looks.stop();
    this.isSeeking = false;
    for (const { look } of now === null ? [] : keys) this.sides.need(ofLook(look));
    this.sides.show(now === null ? null : { left: ofLook(now.left), right: ofLook(now.right), share: now.share, wipe: null });
    this.parts.metrics.sides = this.sides.isComplete;
    this.parts.divided();
  }

  private trace(): void {
    const { view, width, height } = this.parts.stage.viewed;
    const scale = Math.min(1, WIDEST_TRACED / width);
    this.dropTraced();
    this.tracing = { view, width: Math.round(width * scale), height: Math.round(height * scale) };
    const { eye, target, up, vertical_fov_deg } = view;
    this.parts.send({ type: "Trace", eye, target, up, vertical_fov_deg, width: this.tracing.width, height: this.tracing.height });
  }

  private dropTraced(): void {
    this.tracing = null;
    this.parts.metrics.traced = false;
    this.looks.allowTraced(false);
    this.sides.setTraced(null);
  }
}
