// Lamps and displays of a front panel, drawn in SVG. The words of a lamp (`green 2 Hz`, `3 x short`) define how it flashes.

import { setAttribute, setText, svg } from "./dom.js";

const COLOURS = { green: "#35d07f", red: "#ff5a4f", yellow: "#ffc53d" };
const isCalm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** Phases of a lamp: `[is lit, milliseconds]`, repeated; a single phase is steady. */
export function phasesOf(words) {
  const text = String(words).toLowerCase();
  const hertz = /([\d.]+)\s*hz/.exec(text);
  if (hertz) return [[true, 500 / Number(hertz[1])], [false, 500 / Number(hertz[1])]];
  const times = /(\d+)\s*(?:x|times|flashes)?\s*(short|long|x|times|flash)/.exec(text) ?? /flash\w*\D*(\d+)/.exec(text);
  if (times) return pulses(Array(Number(times[1])).fill(text.includes("long") ? 600 : 200));
  if (/^(short|long)( (short|long))+$/.test(text)) return pulses(text.split(" ").map((it) => (it === "long" ? 600 : 200)));
  if (text.includes("turn")) return [[true, 250], [false, 250]];
  return [[!/^(off|dark|0|false|none|)$/.test(text), 0]];
}

function pulses(lengths) {
  const all = lengths.flatMap((ms) => [[true, ms], [false, 250]]);
  all[all.length - 1] = [false, 1_200];
  return all;
}

export class Lamp {
  constructor(name, usual = "green") {
    this.usual = usual;
    this.glass = svg("circle", { class: "glass", cx: 14, cy: 14, r: 9 });
    this.second = svg("path", { class: "glass", d: "M14 5a9 9 0 0 1 0 18z", visibility: "hidden" });
    this.words = svg("text", { class: "front-note", x: 30, y: 26 });
    this.label = svg("text", { class: "front-name", x: 30, y: 12 }, name);
    this.node = svg("g", { role: "img" }, svg("circle", { class: "bezel", cx: 14, cy: 14, r: 12 }), this.glass, this.second, this.label, this.words);
    this.name = name;
    this.width = 118;
    this.height = 30;
  }

  show(words) {
    if (words === this.shown) return;
    this.shown = words;
    const colours = Object.keys(COLOURS).filter((colour) => String(words).includes(colour));
    const phases = phasesOf(words);
    this.#light(this.glass, colours[0] ?? this.usual, phases);
    setAttribute(this.second, "visibility", colours[1] ? "visible" : "hidden");
    if (colours[1]) this.#light(this.second, colours[1], phases);
    setText(this.words, String(words));
    setAttribute(this.node, "aria-label", `LED ${this.name}: ${words}`);
  }

  #light(glass, colour, phases) {
    glass.getAnimations().forEach((animation) => animation.cancel());
    const lit = COLOURS[colour], dark = "#26323a";
    if (phases.length === 1) return void (glass.style.fill = phases[0][0] ? lit : dark);
    glass.style.fill = lit;
    if (isCalm()) return;
    const total = phases.reduce((sum, [, ms]) => sum + ms, 0);
    let at = 0;
    const frames = phases.map(([isLit, ms]) => {
      const frame = { fill: isLit ? lit : dark, offset: at / total, easing: "steps(1, end)" };
      at += ms;
      return frame;
    });
    glass.animate([...frames, { ...frames[0], offset: 1 }], { duration: total, iterations: Infinity });
  }
}

/** Segments a to g of each character, the lowest bit first; the same as in the terminal. */
const SEGMENTS = { 0: 0x3f, 1: 0x06, 2: 0x5b, 3: 0x4f, 4: 0x66, 5: 0x6d, 6: 0x7d, 7: 0x07, 8: 0x7f, 9: 0x6f, A: 0x77, b: 0x7c, C: 0x39, c: 0x58, d: 0x5e, E: 0x79, F: 0x71, H: 0x76, h: 0x74, L: 0x38, n: 0x54, o: 0x5c, P: 0x73, r: 0x50, t: 0x78, U: 0x3e, u: 0x1c, "-": 0x40 };
const PATHS = ["M8 4h20l-4 5H12z", "M30 6v22l-5-4V11z", "M30 32v22l-5-5V36z", "M8 56h20l-4-5H12z", "M6 32v22l5-5V36z", "M6 6v22l5-4V11z", "M9 30l4-3h10l4 3-4 3H13z"];

export class SevenSegments {
  width = 62;
  height = 76;

  constructor() {
    this.segments = PATHS.map((d) => svg("path", { class: "segment", d }));
    this.point = svg("circle", { class: "segment", cx: 37, cy: 56, r: 3.5 });
    this.other = svg("text", { class: "segment lit letter", x: 18, y: 44, "text-anchor": "middle" });
    this.node = svg("g", { role: "img" }, svg("rect", { class: "glassplate", width: 52, height: 72, rx: 4 }), svg("g", { transform: "translate(5 6)" }, this.segments, this.point, this.other));
  }

  show(text) {
    const character = text.replace(".", "").trim();
    const bits = SEGMENTS[character] ?? 0;
    this.segments.forEach((segment, at) => setAttribute(segment, "class", bits >> at & 1 ? "segment lit" : "segment"));
    setAttribute(this.point, "class", text.includes(".") ? "segment lit" : "segment");
    setText(this.other, character && !bits ? character : "");
    setAttribute(this.node, "aria-label", `Display: ${text.trim() || "dark"}`);
  }
}

export class TextDisplay {
  width = 250;
  height = 44;

  constructor() {
    this.text = svg("text", { class: "lcd-text", x: 10, y: 26 });
    this.node = svg("g", { role: "img" }, svg("rect", { class: "lcd", width: 240, height: 38, rx: 4 }), this.text);
  }

  show(text) {
    setText(this.text, text);
    setAttribute(this.node, "aria-label", `Display: ${text.trim() || "dark"}`);
  }
}
