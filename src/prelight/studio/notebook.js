// The studio in a notebook's output: its own page in a frame, whose requests and socket go through the widget.

function page(frame, model) {
  const view = frame.contentWindow;
  const waiting = new Map();
  let asked = 0;
  let socket = null;

  view.fetch = (path, options = {}) =>
    new Promise((resolve) => {
      asked += 1;
      waiting.set(asked, { resolve, method: options.method ?? "GET" });
      model.send({ get: String(path), number: asked });
    });

  view.WebSocket = class {
    static OPEN = 1;
    readyState = 0;
    constructor() {
      socket?.onclose?.({ code: 1000, reason: "" });
      socket = this;
      model.send({ open: true });
      view.setTimeout(() => {
        this.readyState = 1;
        this.onopen?.();
      });
    }
    send(text) {
      model.send({ say: text });
    }
    close() {
      model.send({ close: true });
    }
  };

  const taken = (message, buffers) => {
    const data = buffers[0];
    const bytes = data && data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength);
    if (message.number !== undefined) {
      const { resolve } = waiting.get(message.number) ?? {};
      waiting.delete(message.number);
      resolve?.(new view.Response(message.status === 200 ? bytes : null, { status: message.status }));
    } else if (message.closed) {
      const old = socket;
      socket = null;
      if (old !== null) {
        old.readyState = 3;
        old.onclose?.({ code: 1002, reason: "The studio of this cell has ended. Run it again." });
      }
    } else if (message.text !== undefined) {
      socket?.onmessage?.({ data: message.text });
    } else if (bytes !== undefined) {
      socket?.onmessage?.({ data: bytes });
    }
  };
  model.on("msg:custom", taken);
  return () => model.off("msg:custom", taken);
}

function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.title = "Prelight";
  frame.style.cssText = `width: 100%; height: ${model.get("height")}px; border: 0; border-radius: 10px;`;
  let ended = () => undefined;
  frame.addEventListener("load", () => {
    if (frame.contentDocument.getElementById("stage") === null) return;
    ended();
    ended = page(frame, model);
    const script = frame.contentDocument.createElement("script");
    script.type = "module";
    script.textContent = model.get("_script");
    frame.contentDocument.head.append(script);
  });
  frame.srcdoc = model.get("_page");
  el.append(frame);
  return () => {
    ended();
    model.send({ close: true });
  };
}

export default { render };
