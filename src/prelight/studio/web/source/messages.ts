// Written by prelight.studio.typescript from protocol.py: change that and write this anew.

export const PROTOCOL_VERSION = 6;
export const MOST_DISCS = 32;
export const MOST_LAMPS = 32;
export const MOST_LOOKS = 32;
export const MOST_DABS = 96;
export const FRAMES_IN_FLIGHT = 2;
export const LARGEST_SCALE = 1000000.0;
export const LARGEST_TINT = 1000.0;
export const LARGEST_RADIANCE = 10000000.0;
export const SMALLEST_RADIUS_DEG = 0.001;
export const LARGEST_RADIUS_DEG = 90.0;
export const FRAME_MAGIC = 827477072;
export const FRAME_EXACT = 1;
export const FRAME_ASIDE = 2;
export const FRAME_VIEW = 4;
export const FRAME_SHINE = 8;
export const FRAME_WORLD = 16;
export const FRAME_TRACED = 32;
export const WORLD_WIDTH = 512;
export const WORLD_HEIGHT = 256;
export const MOST_KEYS = 64;
export const MOST_TRACED = 2000000;
export const HEADER_BYTES = 32;

/** Byte offsets in the header of a radiance frame, little-endian. */
export const HEADER = {magic: 0, frame: 4, sequence: 8, count: 12, milliseconds: 16, flags: 20} as const;

/** An eye to look with; the first of a list is the one to begin with. */
export interface CameraView {
  name: string;
  eye: [number, number, number];
  target: [number, number, number];
  up: [number, number, number];
  vertical_fov_deg: number;
}

/** A map to choose: what a message calls it, and what it is in one line. */
export interface EnvironmentChoice { id: string; title: string; }

/** A disc light as it is. */
export interface DiscLight {
  id: string;
  azimuth_deg: number;
  elevation_deg: number;
  radius_deg: number;
  radiance: [number, number, number];
  softness: number;
}

/** A stroke of paint on the environment: round regions, one after another, mixed with a colour. ``points``: azimuth and elevation of each; all have the same radius, edge, radiance and opacity. */
export interface PaintStroke {
  id: string;
  radius_deg: number;
  radiance: [number, number, number];
  softness: number;
  opacity: number;
  points: [number, number][];
}

/** A light with a place in the scene. ``strength``: lumens of a lamp and a panel, candela along the beam of a spot. ``dim`` is its share that is lit. A spot's ``beam_deg`` is its half intensity's whole width; a lamp has no target. ``layer``: the steerable layer that it belongs to; then a spot's place is the layer's own, and a panel's ``position`` and ``size`` are parts of the layer's panel, its ``strength`` cd/m². */
export interface LampLight {
  id: string;
  name: string;
  kind: "lamp" | "spot" | "panel";
  on: boolean;
  position: [number, number, number];
  target: [number, number, number];
  strength: number;
  dim: number;
  color: [number, number, number];
  radius: number;
  beam_deg: number;
  size: [number, number];
  layer: string | null;
}

/** Where and when it is, for the environment "daylight": hours of the zone's clock, without one mean solar time. */
export interface Sun {
  latitude_deg: number;
  longitude_deg: number;
  date: string;
  hour: number;
  zone: string | null;
  turbidity: number;
}

/** The glass of a portal: ``tint`` is what it lets through, null as built; ``blind`` the share that is covered. ``frost_deg`` is by how much frosted glass turns light. */
export interface PortalGlass {
  portal: string;
  kind: "clear" | "frosted" | "shut";
  tint: [number, number, number] | null;
  frost_deg: number;
  blind: number;
}

/** A portal, and what its glass lets through as built. */
export interface PortalView { name: string; tint: [number, number, number]; }

/** A steerable layer: what lights may stand in it, and where it is. ``kind``: a spot or a sky takes spots, a panel or a box takes panels; ``origin`` is a spot's place. */
export interface SteeredPlace {
  layer: string;
  kind: "spot" | "sky" | "panel" | "box";
  origin: [number, number, number];
}

/** What steerable layers light: pixels of one camera's picture, whose radiance follows that of the vertices. */
export interface SteeredView {
  camera: CameraView;
  width: number;
  height: number;
  places: SteeredPlace[];
}

/** A keyframe of the timeline: a look, and the second at which it is lit; from one to the next it fades. */
export interface LookKey { at: number; look: string; }

/** A moving world that the windows may look out on, and when it comes to rest, seconds. */
export interface WorldView {
  id: string;
  title: string;
  duration: number;
}

/** What a layer did for the last frame: how ("full", "local", "gain", …), and how long it took. */
export interface LayerPace {
  name: string;
  kind: string;
  how: string;
  ms: number;
}

/** The first message: the version of the protocol that the page was made for. */
export interface Hello { type: "Hello"; version: number; }

/** Change what is given of the environment: which map, its turn, scale and tint. ``dragging``: more will come. */
export interface SetEnvironment {
  type: "SetEnvironment";
  environment?: string | null;
  rotation_deg?: number | null;
  scale?: number | null;
  tint?: [number, number, number] | null;
  dragging?: boolean;
}

/** Change place, day or hour: all of it. The environment becomes "daylight". */
export interface SetSun {
  type: "SetSun";
  sun: Sun;
  dragging?: boolean;
}

/** Light a disc, or change the one of this id: all of it. Directions are the scene's, as in a rig file. */
export interface SetDisc {
  type: "SetDisc";
  id: string;
  azimuth_deg: number;
  elevation_deg: number;
  radius_deg: number;
  radiance: [number, number, number];
  softness?: number;
  dragging?: boolean;
}

/** Put out a disc. */
export interface RemoveDisc { type: "RemoveDisc"; id: string; }

/** Paint a stroke over what is there, or change the one of this id: all of it. Directions are the scene's. */
export interface SetPaint {
  type: "SetPaint";
  stroke: PaintStroke;
  dragging?: boolean;
}

/** Take a stroke of paint away. */
export interface RemovePaint { type: "RemovePaint"; id: string; }

/** Take all paint away. */
export interface ClearPaint { type: "ClearPaint"; }

/** Put up a lamp, or change the one of this id: all of it. */
export interface SetLamp {
  type: "SetLamp";
  lamp: LampLight;
  dragging?: boolean;
}

/** Take down a lamp. */
export interface RemoveLamp { type: "RemoveLamp"; id: string; }

/** Change the glass of a portal, one of ``Welcome.portals``: all of it. */
export interface SetGlass {
  type: "SetGlass";
  glass: PortalGlass;
  dragging?: boolean;
}

/** What is outside the windows: one of ``Welcome.worlds`` as it is at a second of its own time; null: nothing. */
export interface SetWorld {
  type: "SetWorld";
  world: string | null;
  seconds?: number;
  dragging?: boolean;
}

/** The keyframes of looks, all of them, at times that rise. */
export interface SetTimeline { type: "SetTimeline"; keys: LookKey[]; }

/** Take back the last change, whoever made it. */
export interface Undo { type: "Undo"; }

/** Make the change again that was taken back last. */
export interface Redo { type: "Redo"; }

/** Keep the light as it is under a name; one that is known is replaced. */
export interface SaveLook { type: "SaveLook"; name: string; }

/** Light as it was kept under a name. */
export interface ShowLook { type: "ShowLook"; name: string; }

/** Forget what is kept under a name. */
export interface RemoveLook { type: "RemoveLook"; name: string; }

/** Light as a rig file says (TOML, docs/rig.md), as far as a page can show it. */
export interface OpenRig { type: "OpenRig"; text: string; }

/** Answer ``Marked`` when every change before this has been carried out or refused. */
export interface Mark { type: "Mark"; number: number; }

/** Send the light of a look to this page, once, beside the one that is lit: ``Compared``, then a frame. Null: the light before the last step that can be undone. With an eye, what depends on it follows where there is such: one more frame, flagged ``FRAME_ASIDE | FRAME_VIEW``. */
export interface Compare {
  type: "Compare";
  look: string | null;
  eye?: [number, number, number] | null;
}

/** Send what depends on the eye, once, as it is seen from here: a frame flagged ``FRAME_VIEW``. */
export interface LookFrom { type: "LookFrom"; eye: [number, number, number]; }

/** Let the path tracer make the picture of a camera under the light as it is now: ``Traced`` and frames follow. */
export interface Trace {
  type: "Trace";
  eye: [number, number, number];
  target: [number, number, number];
  up: [number, number, number];
  vertical_fov_deg: number;
  width: number;
  height: number;
}

/** No more of it. */
export interface StopTrace { type: "StopTrace"; }

/** A radiance frame has arrived, and the next may be sent. */
export interface Seen { type: "Seen"; frame: number; }

export type Change = SetEnvironment | SetSun | SetDisc | RemoveDisc | SetPaint | RemovePaint | ClearPaint | SetLamp | RemoveLamp | SetGlass | SetWorld | SetTimeline | Undo | Redo | SaveLook | ShowLook | RemoveLook | OpenRig;

export type ClientMessage = Hello | SetEnvironment | SetSun | SetDisc | RemoveDisc | SetPaint | RemovePaint | ClearPaint | SetLamp | RemoveLamp | SetGlass | SetWorld | SetTimeline | Undo | Redo | SaveLook | ShowLook | RemoveLook | OpenRig | Mark | Compare | LookFrom | Trace | StopTrace | Seen;

/** The answer to ``Hello``: what is shown, what can be chosen, and how the rig stands. ``bake`` tells one bake from another, and is in ``/geometry.json`` too. ``receivers`` are the rows of a radiance frame: the vertices, or where ``pixels`` is (width, height) those of the picture that the first camera sees. ``eye``: the camera that highlights are right for, if one is fixed. ``takes``: what some layer of the bake can be lit by. ``portals``: those whose glass can be set; the array ``pane`` of the geometry has for each vertex of glass its number among them, from 1. ``glossy``: whether surfaces shine toward the eye (``LookFrom``). ``steered``: what steerable layers light, whose pixels follow the vertices in a frame. ``no_tracer``: why no path tracer is there; null: it is. */
export interface Welcome {
  type: "Welcome";
  version: number;
  visitor: number;
  name: string;
  bake: string;
  receivers: number;
  vertices: number;
  triangles: number;
  textures: number;
  resolution: number;
  pixels: [number, number] | null;
  eye: string | null;
  cameras: CameraView[];
  environments: EnvironmentChoice[];
  takes: ("environment" | "lamps" | "glass" | "steered")[];
  portals: PortalView[];
  steered: SteeredView | null;
  worlds: WorldView[];
  glossy: boolean;
  no_tracer: string | null;
  most_discs: number;
  most_lamps: number;
  state: State;
}

/** The rig as all visitors see it, after change number ``sequence``, which visitor ``author`` made. ``stops``: the exposure that suits the map by itself; null until it has been opened. ``undo`` and ``redo``: what these would do, in words; null: nothing. ``looks``: the names of what is kept; ``timeline``: keyframes of them. ``world``: what is outside, as it is at ``seconds``; null: only the sky. ``paint``: strokes, the first one below. */
export interface State {
  type: "State";
  sequence: number;
  author: number | null;
  environment: string;
  rotation_deg: number;
  scale: number;
  tint: [number, number, number];
  sun: Sun;
  discs: DiscLight[];
  lamps: LampLight[];
  glass: PortalGlass[];
  stops: number | null;
  world: string | null;
  seconds: number;
  paint: PaintStroke[];
  looks: string[];
  timeline: LookKey[];
  undo: string | null;
  redo: string | null;
}

/** A message of the page that was not obeyed, and why, in one line; nothing has changed. */
export interface Refused {
  type: "Refused";
  message: string;
  reason: string;
}

/** All that a page asked for before its mark of this number is in the state of this ``sequence``, or was refused. */
export interface Marked {
  type: "Marked";
  number: number;
  sequence: number;
}

/** The light of a look, whose frame (``FRAME_ASIDE``) comes next. */
export interface Compared {
  type: "Compared";
  look: string | null;
  light: State;
}

/** How far the path tracer is: ``share`` of its samples, at 1 it is ready; what stopped it, in a line. A frame flagged ``FRAME_TRACED`` has the picture, row by row from the top. */
export interface Traced {
  type: "Traced";
  share: number;
  samples: number;
  seconds: number;
  stopped: string | null;
}

/** What the studio is busy with before the first picture; null: nothing any more. */
export interface Waiting { type: "Waiting"; reason: string | null; }

/** How fast it goes: the last frame's relighting, its bytes, and frames a second sent to this page of late. */
export interface Pace {
  type: "Pace";
  relight_ms: number;
  pack_ms: number;
  kind: string;
  strong_lights: number;
  bytes: number;
  updates_per_second: number;
  layers: LayerPace[];
}

export type ServerMessage = Welcome | State | Refused | Marked | Compared | Traced | Waiting | Pace;
