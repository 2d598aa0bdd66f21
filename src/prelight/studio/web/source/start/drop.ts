// Where a scene is dropped: its files are sent one by one, then the studio is told which one to read.

import { element } from "../panel/elements";
import { LARGEST_UPLOAD, MOST_FILES } from "../start_messages";

const SCENES = [".glb", ".gltf", ".obj", ".ply"];
const BESIDE = [".bin", ".mtl", ".png", ".jpg", ".jpeg"];

export interface Drop {
  /** All files have arrived. */
  arrived(upload: string, main: string): void;
  refused(words: string): void;
}

export class DropZone {
  private readonly input = element("input", { type: "file", multiple: "", accept: [...SCENES, ...BESIDE].join(",") });
  private readonly bar = element("progress", { max: "1", "aria-label": "Sending" });
  private readonly words = element("span", { class: "drop-words" }, "Drop a scene here, or choose a file");
  readonly part = element(
    "label",
    { class: "drop" },
    element("span", { class: "mark", "aria-hidden": "true" }),
    this.words,
    element("span", { class: "drop-kinds" }, "GLB, glTF, OBJ or PLY, with the files that belong to it"),
    this.bar,
    this.input,
  );

  constructor(private readonly told: Drop) {
    this.bar.hidden = true;
    this.input.addEventListener("change", () => void this.send([...(this.input.files ?? [])]));
    window.addEventListener("dragover", (event) => {
      event.preventDefault();
      this.part.classList.add("over");
    });
    window.addEventListener("dragleave", (event) => {
      if (event.relatedTarget === null) this.part.classList.remove("over");
    });
    window.addEventListener("drop", (event) => {
      event.preventDefault();
      this.part.classList.remove("over");
      void this.send([...(event.dataTransfer?.files ?? [])]);
    });
  }

  /** Send files, whatever they are: the studio says what it does not take. */
  async send(files: File[]): Promise<void> {
    if (files.length === 0 || !this.bar.hidden) return;
    const main = mainFile(files);
    const size = files.reduce((sum, file) => sum + file.size, 0);
    if (main === null) {
      this.told.refused(`${files[0]?.name ?? "That"} is no scene that is read here: ${SCENES.join(", ")}.`);
    } else if (files.length > MOST_FILES || size > LARGEST_UPLOAD) {
      this.told.refused(`At most ${MOST_FILES} files and ${LARGEST_UPLOAD / 1e6} MB; bake larger scenes at the command line.`);
    } else {
      await this.sendAll(files, main.name, size);
    }
    this.input.value = "";
  }

  private async sendAll(files: File[], main: string, size: number): Promise<void> {
    const upload = [...crypto.getRandomValues(new Uint8Array(8))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    this.bar.hidden = false;
    let before = 0;
    try {
      for (const file of files) {
        this.words.textContent = `Sending ${file.name}`;
        await sendFile(upload, file, (done) => (this.bar.value = (before + done) / Math.max(size, 1)));
        before += file.size;
      }
      this.told.arrived(upload, main);
    } catch (error) {
      this.told.refused(error instanceof Error ? error.message : "The files did not arrive.");
    }
    this.bar.hidden = true;
    this.words.textContent = "Drop a scene here, or choose a file";
  }
}

/** What is read of several files: the first that is a scene by itself. */
function mainFile(files: File[]): File | null {
  const named = (suffix: string) => files.find((file) => file.name.toLowerCase().endsWith(suffix));
  return SCENES.map(named).find((file) => file !== undefined) ?? (files.length === 1 ? files[0] ?? null : null);
}

function sendFile(upload: string, file: File, progress: (bytes: number) => void): Promise<void> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest(); // which tells how much has been sent
    request.open("POST", `/start/file/${upload}`);
    request.setRequestHeader("X-Name", encodeURIComponent(file.name));
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.upload.onprogress = (event) => progress(event.loaded);
    request.onerror = () => reject(new Error(`${file.name} did not arrive; is the studio running?`));
    request.onload = () => {
      if (request.status === 200) resolve();
      else reject(new Error(reason(request.responseText) ?? `${file.name} was refused (${request.status}).`));
    };
    request.send(file);
  });
}

function reason(text: string): string | null {
  try {
    return (JSON.parse(text) as { reason?: string }).reason ?? null;
  } catch {
    return null;
  }
}
