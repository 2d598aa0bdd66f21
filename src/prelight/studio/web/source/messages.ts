// Written by prelight.studio.typescript from protocol.py: change that and write this anew.

export const PROTOCOL_VERSION = 1;
export const MOST_DISCS = 32;
export const FRAMES_IN_FLIGHT = 2;
export const LARGEST_SCALE = 1000000.0;
export const LARGEST_TINT = 1000.0;
export const LARGEST_RADIANCE = 10000000.0;
export const SMALLEST_RADIUS_DEG = 0.001;
export const LARGEST_RADIUS_DEG = 90.0;
export const FRAME_MAGIC = 827477072;
export const FRAME_EXACT = 1;
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
export interface EnvironmentChoice {
  id: string;
  title: string;
}

/** A disc light as it is. */
export interface DiscLight {
  id: string;
  azimuth_deg: number;
  elevation_deg: number;
  radius_deg: number;
  radiance: [number, number, number];
  softness: number;
}

/** The first message: the version of the protocol that the page was made for. */
export interface Hello {
  type: "Hello";
  version: number;
}

/** Change what is given of the environment: which map, its turn, scale and tint. ``dragging``: more will come. */
export interface SetEnvironment {
  type: "SetEnvironment";
  environment?: string | null;
  rotation_deg?: number | null;
  scale?: number | null;
  tint?: [number, number, number] | null;
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
export interface RemoveDisc {
  type: "RemoveDisc";
  id: string;
}

/** A radiance frame has arrived, and the next may be sent. */
export interface Seen {
  type: "Seen";
  frame: number;
}

export type ClientMessage = Hello | SetEnvironment | SetDisc | RemoveDisc | Seen;

/** The answer to ``Hello``: what is shown, what can be chosen, and how the rig stands. ``receivers`` are the rows of a radiance frame: the vertices, or where ``pixels`` is (width, height) those of the picture that the first camera sees. ``eye``: the camera that highlights are right for, if one is fixed. */
export interface Welcome {
  type: "Welcome";
  version: number;
  visitor: number;
  name: string;
  receivers: number;
  vertices: number;
  triangles: number;
  textures: number;
  resolution: number;
  pixels: [number, number] | null;
  eye: string | null;
  cameras: CameraView[];
  environments: EnvironmentChoice[];
  most_discs: number;
  state: State;
}

/** The rig as all visitors see it, after change number ``sequence``, which visitor ``author`` made. ``stops``: the exposure that suits the map by itself; null until it has been opened. */
export interface State {
  type: "State";
  sequence: number;
  author: number | null;
  environment: string;
  rotation_deg: number;
  scale: number;
  tint: [number, number, number];
  discs: DiscLight[];
  stops: number | null;
}

/** A message of the page that was not obeyed, and why, in one line; nothing has changed. */
export interface Refused {
  type: "Refused";
  message: string;
  reason: string;
}

/** What the studio is busy with before the first picture; null: nothing any more. */
export interface Waiting {
  type: "Waiting";
  reason: string | null;
}

/** How fast it goes: the last frame's relighting, its bytes, and frames a second sent to this page of late. */
export interface Pace {
  type: "Pace";
  relight_ms: number;
  pack_ms: number;
  kind: string;
  strong_lights: number;
  bytes: number;
  updates_per_second: number;
}

export type ServerMessage = Welcome | State | Refused | Waiting | Pace;
