// Pictures and films of the canvas, as files.

import { element } from "./panel/elements";

const RATE = 30; // pictures a second
const KINDS = ["video/mp4;codecs=avc1.42E01E", "video/webm;codecs=vp9", "video/webm"];

/** Hand a file to whoever sits there. */
export function download(content: Blob, name: string): void {
  const address = URL.createObjectURL(content);
  element("a", { href: address, download: name }).click();
  window.setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** Film a canvas until the function that is returned is called; null where the browser cannot. */
export function filmed(canvas: HTMLCanvasElement, name: string, done: (megabytes: number) => void): (() => void) | null {
  const kind = "MediaRecorder" in window ? KINDS.find((one) => MediaRecorder.isTypeSupported(one)) : undefined;
  if (kind === undefined) return null;
  const recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: kind, videoBitsPerSecond: 12_000_000 });
  const parts: Blob[] = [];
  recorder.ondataavailable = ({ data }) => parts.push(data);
  recorder.onstop = () => {
    const film = new Blob(parts, { type: kind });
    download(film, `${name}.${kind.includes("mp4") ? "mp4" : "webm"}`);
    done(film.size / 1e6);
  };
  recorder.start(500);
  return () => {
    if (recorder.state !== "inactive") recorder.stop();
  };
}
