// The canvas's drawing context, by a graphics card or by the processor.

const BY_PROCESSOR = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/**
 * WebGL 2, with smoothed edges where there is a graphics card: a processor that draws needs three times as long for
 * them, which everything else on the machine would feel. Raises Error where there is none.
 */
export function newContext(canvas: HTMLCanvasElement): WebGL2RenderingContext {
  const antialias = !BY_PROCESSOR.test(artist());
  const context = canvas.getContext("webgl2", { antialias, alpha: true, powerPreference: "high-performance" });
  if (context === null) throw new Error("There is no WebGL 2.");
  return context;
}

/** Who draws here, as the browser says; empty where it does not. It can only be asked of a context. */
function artist(): string {
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name: unknown = names ? gl?.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return String(name ?? "");
}
