// What shines toward the eye, as an attribute of the mesh: four half floats a vertex, the first three to be added.

import { type BufferAttribute, type BufferGeometry, GLBufferAttribute } from "three";

const BYTES = 8; // a vertex

interface Place {
  attribute: string;
  count: number;
  /** The shaders have it, or have it no more. */
  define: (isSet: boolean) => void;
}

export class ShineRows {
  private buffer: WebGLBuffer | null = null;
  private rows: Uint16Array<ArrayBuffer> | null = null;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    private readonly shape: BufferGeometry,
    private readonly place: Place,
  ) {}

  /** From now on; null: nothing. */
  show(rows: Uint16Array<ArrayBuffer> | null): void {
    const { gl, shape, place } = this;
    if (rows === this.rows || (rows !== null && rows.length !== 4 * place.count)) return;
    const isOther = (rows === null) !== (this.rows === null);
    this.rows = rows;
    if (isOther && rows !== null) {
      this.buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
      gl.bufferData(gl.ARRAY_BUFFER, BYTES * place.count, gl.STREAM_DRAW);
      const halves = new GLBufferAttribute(this.buffer, gl.HALF_FLOAT, 4, 2, place.count);
      shape.setAttribute(place.attribute, halves as unknown as BufferAttribute);
    } else if (isOther) {
      this.dispose();
      shape.deleteAttribute(place.attribute);
    }
    if (rows !== null) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, rows);
    }
    if (isOther) place.define(rows !== null);
  }

  /** After a lost context. */
  makeBuffer(): void {
    const { rows } = this;
    this.buffer = this.rows = null;
    if (rows !== null) this.show(rows);
  }

  dispose(): void {
    this.gl.deleteBuffer(this.buffer);
    this.buffer = null;
  }
}
