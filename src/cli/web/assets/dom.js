// Functions that create elements. No markup is in strings, and every text from the emulator is set by textContent.

const SHORT = { label: "aria-label", acts: "data-acts" };

/** Creates an element. `props` are properties, `on…` listeners, `class`, `role`, `label`, `aria-…`, `data-…`; `acts`: see `guard`. */
export function h(tag, props, ...children) {
  return build(document.createElement(tag), tag === "button" ? { type: "button", ...props } : props, children);
}

export function svg(tag, props, ...children) {
  return build(document.createElementNS("http://www.w3.org/2000/svg", tag), props, children);
}

function build(element, props, children) {
  const isSvg = element instanceof SVGElement;
  for (const [name, value] of Object.entries(props ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (!isSvg && name === "class") element.className = value;
    else if (name in SHORT) element.setAttribute(SHORT[name], value);
    else if (!isSvg && name in element && !name.includes("-") && name !== "list" && name !== "role") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  append(element, children);
  return element;
}

function append(element, children) {
  for (const child of children) {
    if (Array.isArray(child)) append(element, child);
    else if (child !== undefined && child !== null && child !== false) element.append(child);
  }
}

/** Sets a text if it differs from the present one. An equal text would cost the browser a layout. */
export function setText(element, text) {
  if (element.firstChild?.nodeType === Node.TEXT_NODE && !element.firstChild.nextSibling) {
    if (element.firstChild.data !== text) element.firstChild.data = text;
  } else if (element.textContent !== text) element.textContent = text;
}

/** Sets an attribute if its value differs from the present one. */
export function setAttribute(element, name, value) {
  if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
}

export function fill(element, ...children) {
  element.replaceChildren();
  append(element, children);
  return element;
}

/** Returns a function that calls `work` once, `ms` milliseconds after its last call. */
export function later(ms, work) {
  let timer;
  return (...args) => {
    clearTimeout(timer);
    timer = setTimeout(() => work(...args), ms);
  };
}

/** Returns a function that calls `work` at most once per frame of the browser. */
export function perFrame(work) {
  let isDue = false;
  return () => {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      work();
    });
  };
}

/** Pause after a run of `oneAtATime`, in durations of the run with its drawing: three quarters of the time are left for other work. */
const REST = 3;

/** Waits until the browser has drawn the present content. A hidden page waits until it is shown. */
const drawn = () => new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));

/**
 * Returns a function that runs `work`, never twice at the same time. Calls during a run cause one further run after a pause: `ms`
 * milliseconds, or longer if the run and the drawing of its result took long.
 */
export function oneAtATime(ms, work) {
  let isBusy = false;
  let isLate = false;
  return async function run() {
    if (isBusy) return void (isLate = true);
    isBusy = true;
    const start = performance.now();
    await work();
    await drawn();
    await new Promise((resolve) => setTimeout(resolve, Math.max(ms, REST * (performance.now() - start))));
    isBusy = false;
    if (!isLate) return;
    isLate = false;
    run();
  };
}

let ids = 0;
/** A new identifier for `for`, `aria-labelledby` and others. */
export const newId = () => `id${++ids}`;

export function field(label, input, note) {
  input.id ||= newId();
  return h("div", { class: "field" }, h("label", { htmlFor: input.id }, label), input, note && h("small", null, note));
}

/** Creates a drop-down list of texts, or of `[value, text]` pairs. */
export function choice(options, value, props) {
  const make = (option) => {
    const [key, text] = Array.isArray(option) ? option : [option, option];
    return h("option", { value: key, selected: key === value }, text);
  };
  return h("select", props, options.map(make));
}

/** Creates the cells of a table row. The second cell has a monospaced font. */
export const td = (...children) => h("td", null, ...children);
export const tdMono = (...children) => h("td", { class: "mono" }, ...children);
