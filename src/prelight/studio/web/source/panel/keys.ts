// Keyboard shortcuts of the whole page, and the sheet that lists them.

import { button, element } from "./elements";

export interface Shortcut {
  keys: string[];
  shown: string;
  does: string;
  run: () => void;
}

const OTHERS: [string, string][] = [
  ["Drag", "go around the scene"],
  ["Right drag", "move aside"],
  ["Wheel", "nearer, farther"],
  ["Arrows  + −", "the same, with the scene in focus"],
  ["Arrows", "turn the sky, move a light, with it in focus"],
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
    const isTyping = event.target instanceof HTMLInputElement && event.target.type !== "range";
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping || sheet.open) return;
    const shortcut = shortcuts.find(({ keys }) => keys.includes(event.key));
    if (shortcut === undefined) return;
    event.preventDefault();
    shortcut.run();
  });
  return () => sheet.showModal();
}
