// The start page's connection: one socket, which comes back when it was lost.

import { START_VERSION, type StartAnswer, type StartMessage } from "../start_messages";

const FIRST_WAIT_MS = 400;
const LONGEST_WAIT_MS = 4000;
const PROTOCOL_ERROR = 1002;

export class Desk {
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT_MS;

  /** `standing` is told a sentence while nothing can be said to the studio, and nothing once it can. */
  constructor(
    private readonly take: (message: StartAnswer) => void,
    private readonly standing: (words: string) => void,
  ) {}

  open(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/start/socket`);
    socket.onopen = () => this.send({ type: "Hello", version: START_VERSION });
    socket.onmessage = (event: MessageEvent<string>) => {
      this.wait = FIRST_WAIT_MS;
      this.standing("");
      this.take(JSON.parse(event.data) as StartAnswer);
    };
    socket.onclose = (event) => {
      this.socket = null;
      if (event.code === PROTOCOL_ERROR) {
        this.standing(event.reason || "This page and the studio do not fit together. Reload the page.");
        return;
      }
      this.standing("The studio does not answer. What is being baked is kept; trying again.");
      window.setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
    };
    this.socket = socket;
  }

  send(message: StartMessage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
