// The canvas and its drawing context, by a graphics card or by the processor.

const BY_PROCESSOR = /swiftshader|llvmpipe|softpipe|software|basic render/i;

interface Drawn {
  canvas: HTMLCanvasElement;
  context: WebGL2RenderingContext;
}

/**
 * WebGL 2, with smoothed edges where there is a graphics card: a processor that draws needs three times as long for
 * them, which everything else on the machine would feel. Who draws can only be asked of a context, and making one takes
 * the processor some tenths of a second: so its own is asked. Raises Error where there is none.
 */
export function newCanvas(): Drawn {
  const plain = drawn(false);
  if (BY_PROCESSOR.test(artist(plain.context))) return plain;
  plain.context.getExtension("WEBGL_lose_context")?.loseContext();
  return drawn(true);
}

function drawn(antialias: boolean): Drawn {
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("webgl2", { antialias, alpha: true, powerPreference: "high-performance" });
  if (context === null) throw new Error("There is no WebGL 2.");
  return { canvas, context };
}

/** Who draws here, as the browser says; empty where it does not. */
function artist(gl: WebGL2RenderingContext): string {
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name: unknown = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  return String(name ?? "");
}
