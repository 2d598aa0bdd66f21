// Keyboard shortcuts of the whole page, and the sheet that lists them.

import { button, element } from "./elements";

export interface Shortcut {
  keys: string[];
  shown: string;
  does: string;
  run: () => void;
}

const OTHERS: [string, string][] = [
  ["Walking", "drag to look, W A S D or arrows to go, Q E down and up"],
  ["Drag", "go around the scene"],
  ["Right drag", "move aside"],
  ["Wheel", "nearer, farther"],
  ["Arrows  + −", "the same, with the scene in focus"],
  ["Arrows", "turn the sky, move a light or a lamp, with it in focus"],
  ["Page ↑ ↓", "raise, lower a lamp; Shift: farther"],
];

/** Listen for the shortcuts; returns what opens the sheet. */
export function bindKeys(shortcuts: readonly Shortcut[]): () => void {
  const list = element("dl", {});
  const rows = [...OTHERS, ...shortcuts.map(({ shown, does }) => [shown, does] as const)];
  for (const [shown, does] of rows) list.append(element("dt", {}, shown), element("dd", {}, does));
  const sheet = element("dialog", { class: "sheet", "aria-label": "Keys" });
  sheet.append(element("h2", {}, "Keys"), list, button("Close", () => sheet.close(), { class: "quiet" }));
  sheet.addEventListener("click", (event) => event.target === sheet && sheet.close());
  document.body.append(sheet);
  window.addEventListener("keydown", (event) => {
    const isTyping = (event.target instanceof HTMLInputElement && event.target.type !== "range") || event.target instanceof HTMLSelectElement;
    const isUndo = (event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z";
    if (((event.ctrlKey || event.metaKey) && !isUndo) || event.altKey || isTyping || sheet.open) return;
    const key = isUndo ? (event.shiftKey ? "Z" : "z") : event.key;
    const shortcut = shortcuts.find(({ keys }) => keys.includes(key));
    if (shortcut === undefined) return;
    event.preventDefault();
    shortcut.run();
  });
  return () => sheet.showModal();
}
