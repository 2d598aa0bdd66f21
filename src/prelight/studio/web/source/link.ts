// The connection: greets, hands on what arrives, and comes back when it was lost.

import { type ClientMessage, PROTOCOL_VERSION, type ServerMessage } from "./messages";

const FIRST_WAIT_MS = 400;
const LONGEST_WAIT_MS = 4000;
const PROTOCOL_ERROR = 1002;
const ANOTHER_BAKE = 4001; // 1012 is what a server says that ends

/** How the connection stands; `reason` is a sentence where it ended for good. */
export type Standing = { is: "open" } | { is: "lost"; retryMs: number } | { is: "ended"; reason: string };

export interface Listener {
  message(message: ServerMessage): unknown;
  frame(data: ArrayBuffer): unknown;
  standing(standing: Standing): unknown;
}

/** One socket at a time, to the studio that served this page. */
export class Link {
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT_MS;
  private timer = 0;
  private ended = false;

  private constructor(private readonly listener: Listener) {}

  /** A connection that is being made: its listener hears of it later, never before this returns. */
  static opened(listener: Listener): Link {
    const link = new Link(listener);
    link.open();
    return link;
  }

  private open(): void {
    window.clearTimeout(this.timer);
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.send({ type: "Hello", version: PROTOCOL_VERSION });
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.take(event.data);
    socket.onclose = (event) => void this.closed(socket, event);
    this.socket = socket;
  }

  send(message: ClientMessage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  private take(data: string | ArrayBuffer): void {
    if (typeof data !== "string") {
      this.listener.frame(data);
      return;
    }
    const message = JSON.parse(data) as ServerMessage;
    if (message.type === "Welcome") {
      if (message.version !== PROTOCOL_VERSION) {
        const versions = `the page is of protocol ${PROTOCOL_VERSION}, the studio of ${message.version}`;
        this.end(`This page and the studio do not fit together (${versions}). Reload the page.`);
        return;
      }
      this.wait = FIRST_WAIT_MS;
      this.listener.standing({ is: "open" });
    }
    this.listener.message(message);
  }

  private end(reason: string): void {
    this.ended = true;
    this.socket?.close(1000);
    this.listener.standing({ is: "ended", reason });
  }

  private async closed(socket: WebSocket, event: CloseEvent): Promise<void> {
    if (this.ended || socket !== this.socket) return;
    this.socket = null;
    if (event.code === ANOTHER_BAKE) {
      location.reload();
    } else if (event.code === PROTOCOL_ERROR) {
      this.end(event.reason || "This page and the studio do not fit together. Reload the page.");
    } else if (await isShutOut()) {
      this.end("This page's key no longer opens the studio. Use the address that prelight studio printed.");
    } else {
      this.listener.standing({ is: "lost", retryMs: this.wait });
      this.timer = window.setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
    }
  }
}

/** Whether a studio is there but does not let this page in: a browser does not tell it of a socket. */
async function isShutOut(): Promise<boolean> {
  try {
    const { status } = await fetch("/", { method: "HEAD", cache: "no-store" });
    return status === 401 || status === 403;
  } catch {
    return false;
  }
}
