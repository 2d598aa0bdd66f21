// What is said of a bake when it is opened.

import type { Welcome } from "./messages";

export function summary({ receivers, pixels, eye }: Welcome): string {
  if (pixels !== null) return `${pixels[0]} × ${pixels[1]} pixels`;
  const rows = `${receivers.toLocaleString("en")} vertices`;
  return eye === null ? rows : `${rows} · highlights as camera ${eye} sees them`;
}
