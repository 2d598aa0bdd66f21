// The picture that is still being drawn, and the rest that is left after one that took long.

const LONGEST_MS = 5000; // a driver that never says so shall not stop the page
const SLOW_MS = 50; // such a picture is drawn by the processor
const LONGEST_REST_MS = 150;
const LOOK_AGAIN_MS = 8;

/**
 * Where drawing is slow, a picture begun before the last is ready would make the browser hold up the whole page, and
 * pictures without a pause between them leave the connection no processor. So there is one at a time, nobody waits
 * for it, and after a slow one there is a rest.
 */
export class UnfinishedPicture {
  private fence: WebGLSync | null = null;
  private began = 0;
  private restsUntil = 0;

  constructor(private readonly gl: WebGL2RenderingContext) {}

  /** All commands of a picture have been given. */
  begin(): void {
    this.gl.deleteSync(this.fence);
    this.fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush(); // or the fence is never sent
    this.began = performance.now();
  }

  /** Milliseconds after which to ask again whether the next may begin; 0: it may. Never waits itself. */
  wait(): number {
    const now = performance.now();
    if (this.fence !== null) {
      const status = this.gl.getSyncParameter(this.fence, this.gl.SYNC_STATUS) as number | null; // null: lost context
      const took = now - this.began;
      if (status === this.gl.UNSIGNALED && took < LONGEST_MS) return LOOK_AGAIN_MS;
      this.gl.deleteSync(this.fence);
      this.fence = null;
      this.restsUntil = took > SLOW_MS ? now + Math.min(took / 2, LONGEST_REST_MS) : now;
    }
    return Math.max(0, this.restsUntil - now);
  }
}
