// Small pieces of page. What comes from elsewhere is only ever set as text.

type Attributes = Record<string, string>;

/** An element with attributes and children; strings become text. */
export function element<Name extends keyof HTMLElementTagNameMap>(
  name: Name,
  attributes: Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[Name] {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

export function button(label: string, press: () => void, attributes: Attributes = {}): HTMLButtonElement {
  const made = element("button", { type: "button", ...attributes }, label);
  made.addEventListener("click", press);
  return made;
}

/**
 * To draw on a small canvas, always by the processor. What the graphics processor draws, the browser makes the page
 * wait for now and then, until all pictures of the scene before it are ready too: no message arrives meanwhile.
 */
export function pen(canvas: HTMLCanvasElement): CanvasRenderingContext2D | null {
  return canvas.getContext("2d", { willReadFrequently: true });
}

/** A titled part of the panel, which its title folds away. */
export function section(title: string, ...children: Node[]): HTMLElement {
  const body = element("div", { class: "body" }, ...children);
  const fold = button(title, () => {
    body.hidden = !body.hidden;
    fold.setAttribute("aria-expanded", String(!body.hidden));
  }, { class: "fold", "aria-expanded": "true" });
  return element("section", { "aria-label": title }, element("h2", {}, fold), body);
}

export interface NumberField {
  name: string;
  least: number;
  most: number;
  step: number;
  unit?: string;
  digits?: number;
  set: (value: number) => void;
}

/** A number to type, told when it is finished; arrow keys step it. */
export function numberField(field: NumberField): { row: HTMLElement; show: (value: number) => void } {
  const { name, least, most, step, unit = "", digits = 2 } = field;
  const bounds = { min: String(least), max: String(most), step: String(step), "aria-label": `${name} ${unit}`.trim() };
  const input = element("input", { type: "number", inputmode: "decimal", ...bounds });
  let known = NaN;
  const show = (value: number) => {
    known = value;
    if (!isTyping) input.value = String(rounded(value, digits));
  };
  let isTyping = false; // what is being typed is left alone, whatever arrives
  input.addEventListener("input", () => (isTyping = true));
  input.addEventListener("blur", () => {
    isTyping = false;
    show(known);
  });
  input.addEventListener("change", () => {
    const value = input.valueAsNumber;
    isTyping = false;
    if (Number.isFinite(value)) field.set(Math.min(most, Math.max(least, value)));
    else show(known);
  });
  const words = element("span", { "aria-hidden": "true" }, name);
  const units = element("span", { class: "unit", "aria-hidden": "true" }, unit);
  return { row: element("label", { class: "number" }, words, input, units), show };
}

/** Several numbers in a row, such as a place. */
export function numbers(
  name: string,
  parts: readonly string[],
  range: Omit<NumberField, "name" | "set">,
  set: (values: number[]) => void,
): { row: HTMLElement; show: (values: readonly number[]) => void } {
  let known: number[] = parts.map(() => 0);
  const fields = parts.map((part, i) => {
    const change = (value: number) => set(known.map((old, k) => (k === i ? value : old)));
    const made = numberField({ ...range, name: `${name} ${part}`, set: change });
    const words = made.row.firstElementChild;
    if (words) words.textContent = part;
    return made;
  });
  const rows = element("span", { class: "parts" }, ...fields.map(({ row }) => row));
  const row = element("div", { class: "numbers", role: "group", "aria-label": name }, element("span", {}, name), rows);
  const show = (values: readonly number[]) => {
    known = [...values];
    values.forEach((value, i) => fields[i]?.show(value));
  };
  return { row, show };
}

function rounded(value: number, digits: number): number {
  return Number(value.toFixed(digits));
}

/** A number with about two digits, for amounts that range widely. */
export function amount(value: number): string {
  if (value >= 1e6) return `${(value / 1e6).toPrecision(3)} M`;
  if (value >= 100) return Math.round(value).toLocaleString("en");
  return String(Number(value.toPrecision(2)));
}

export interface Range {
  name: string;
  least: number;
  most: number;
  step: number;
  /** Where a double click returns to. */
  rest: number;
  kind?: string;
  say: (value: number) => string;
  set: (value: number, dragging: boolean) => void;
}

/** A labelled slider; `show` moves it without telling anybody. */
export function slider(range: Range): { row: HTMLElement; show: (value: number) => void } {
  const { least, most, step } = range;
  const said = element("span", { class: "said", "aria-hidden": "true" });
  const bounds = { min: String(least), max: String(most), step: String(step), "aria-label": range.name };
  const input = element("input", { type: "range", class: range.kind ?? "plain", ...bounds });
  const label = element("span", { class: "name", title: "Double click: back to the middle" }, range.name);
  const tell = (value: number) => {
    said.textContent = range.say(value);
    input.setAttribute("aria-valuetext", range.say(value));
    const end = Number(input.max); // which may be another by now
    input.style.setProperty("--share", String((Math.min(Math.max(value, least), end) - least) / (end - least)));
  };
  const set = (dragging: boolean) => {
    tell(input.valueAsNumber);
    range.set(input.valueAsNumber, dragging);
  };
  let held = false; // by a pointer; the steps of keys are many, and the studio knows when they have come to rest
  input.addEventListener("pointerdown", () => (held = true));
  input.addEventListener("input", () => set(true));
  input.addEventListener("change", () => {
    set(!held);
    held = false;
  });
  const show = (value: number) => {
    input.value = String(value);
    tell(value);
  };
  const back = () => {
    show(range.rest);
    range.set(range.rest, false);
  };
  label.addEventListener("dblclick", back);
  input.addEventListener("dblclick", back);
  return { row: element("label", { class: "slider" }, label, said, input), show };
}

/** Buttons of which one is chosen. */
export function choice<Value extends string>(
  name: string,
  options: readonly (readonly [Value, string])[],
  choose: (value: Value) => void,
): { row: HTMLElement; show: (value: Value) => void } {
  const row = element("div", { class: "choice", role: "radiogroup", "aria-label": name });
  chooseByArrows(row);
  const buttons = options.map(([value, label]) => {
    const made = button(label, () => choose(value), { role: "radio" });
    row.append(made);
    return [value, made] as const;
  });
  const show = (chosen: Value) => {
    for (const [value, made] of buttons) made.setAttribute("aria-checked", String(value === chosen));
  };
  return { row, show };
}

/** Arrow keys go to the next radio of a group, and choose it. */
export function chooseByArrows(group: HTMLElement): void {
  const ways: Record<string, number> = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };
  group.addEventListener("keydown", (event) => {
    const way = ways[event.key];
    const radios = [...group.querySelectorAll<HTMLButtonElement>("[role=radio]")];
    const at = radios.indexOf(event.target as HTMLButtonElement);
    if (way === undefined || at < 0) return;
    event.preventDefault();
    const next = radios[(at + way + radios.length) % radios.length];
    next?.focus();
    next?.click();
  });
}

/** Signed stops, with a proper minus. */
export function stops(value: number): string {
  const sign = value > 0.0049 ? "+" : value < -0.0049 ? "−" : "";
  return `${sign}${Math.abs(value).toFixed(1)} EV`;
}

/** Degrees from -180 to 180. */
export function wrapped(degrees: number): number {
  return ((((degrees + 180) % 360) + 360) % 360) - 180;
}

export function degrees(value: number): string {
  return `${value < -0.5 ? "−" : ""}${Math.abs(Math.round(value))}°`;
}
