// Written by prelight.studio.typescript from start_protocol.py: change that and write this anew.

export const START_VERSION = 1;
export const LARGEST_UPLOAD = 500000000;
export const MOST_FILES = 64;
export const MOST_PASSES = 32;

/** What to bake. ``sky``: from all around, or through the windows' glass; ``lamps``: live, or in a cloud. ``floor``: how many times as wide as the scene; ``subdivide``: the longest edge, metres. */
export interface Wish {
  sky: "none" | "open" | "windows";
  lamps: "none" | "transfer" | "cloud";
  quality: "draft" | "good" | "best";
  device: "auto" | "cpu";
  floor: number | null;
  subdivide: number | null;
}

/** A built-in scene, and what it is. */
export interface StockView { scene: string; title: string; }

/** A layer that is wanted, what it costs as ``--dry-run --json`` says it, and how much of it is done. ``command``: what does the same in a terminal. */
export interface LayerView {
  kind: string;
  title: string;
  command: string;
  rays: number;
  seconds: number;
  bytes: number;
  memory: number;
  share: number;
}

/** A scene on its way. ``reason``: why it was refused or has stopped. ``passes``: of its picture, 0 without one. */
export interface ProjectView {
  id: string;
  name: string;
  source: string;
  stage: "looking" | "planning" | "ready" | "baking" | "stopped" | "baked" | "refused";
  reason: string | null;
  wish: Wish;
  vertices: number;
  triangles: number;
  windows: number;
  devices: string[];
  notes: string[];
  layers: LayerView[];
  share: number;
  seconds_left: number | null;
  rays_per_second: number | null;
  passes: number;
  path: string | null;
}

/** The first message: the version of the protocol that the page was made for. */
export interface Hello { type: "Hello"; version: number; }

/** Begin with a built-in scene. */
export interface ChooseStock { type: "ChooseStock"; scene: string; }

/** Begin with files that were sent: ``main`` is the one to read, which names the others. */
export interface TakeUpload {
  type: "TakeUpload";
  upload: string;
  main: string;
}

/** Choose what to bake of a scene; its cost is estimated. */
export interface SetWish {
  type: "SetWish";
  project: string;
  wish: Wish;
}

/** Begin, or go on where it was stopped. */
export interface Bake { type: "Bake"; project: string; }

/** Stop; what is done is kept. */
export interface Stop { type: "Stop"; project: string; }

/** Show a finished bake in the studio, to everybody. */
export interface OpenBake { type: "OpenBake"; project: string; }

export type StartMessage = Hello | ChooseStock | TakeUpload | SetWish | Bake | Stop | OpenBake;

/** All there is: scenes to choose, those on their way (the newest first), and what the studio shows. */
export interface Workshop {
  type: "Workshop";
  version: number;
  folder: string;
  stock: StockView[];
  projects: ProjectView[];
  shown: string | null;
}

/** The scene that this page has begun with. */
export interface Taken { type: "Taken"; project: string; }

/** The studio shows another bake now: at its page. */
export interface Opened { type: "Opened"; project: string; }

/** A message of the page that was not obeyed, and why, in one line; nothing has changed. */
export interface Refused {
  type: "Refused";
  message: string;
  reason: string;
}

export type StartAnswer = Workshop | Taken | Opened | Refused;
