// Switches of a front, drawn in SVG, for mouse and keyboard.

import { setAttribute, setText, svg } from "./dom.js";

/** Calls `work` after a click, Enter or Space. `keys` has functions for other keys, such as arrow keys in the direction of the drawing. */
function operable(node, work, keys = {}) {
  node.classList.add("operable");
  setAttribute(node, "tabindex", 0);
  const isUsable = () => node.getAttribute("aria-disabled") !== "true";
  node.addEventListener("click", () => isUsable() && work());
  node.addEventListener("keydown", (event) => {
    const act = event.key === "Enter" || event.key === " " ? work : keys[event.key];
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    if (isUsable()) act();
  });
}

/** A switch with two positions. Calls `set(isOn)`. */
export class Toggle {
  width = 30;
  height = 58;

  constructor(name, label, set) {
    this.lever = svg("rect", { class: "lever", x: 5, y: 25, width: 16, height: 14, rx: 2 });
    this.node = svg("g", { role: "switch", label, "aria-checked": "false" },
      svg("rect", { class: "slot", x: 3, y: 4, width: 20, height: 38, rx: 3 }), this.lever, svg("text", { class: "front-note", x: 13, y: 54, "text-anchor": "middle" }, name));
    const turn = (isOn) => () => isOn !== this.isOn && set(isOn);
    operable(this.node, () => set(!this.isOn), { ArrowUp: turn(true), ArrowDown: turn(false) });
  }

  show(isOn) {
    this.isOn = isOn;
    setAttribute(this.node, "aria-checked", isOn);
    setAttribute(this.lever, "y", isOn ? 7 : 25);
    setAttribute(this.lever, "class", isOn ? "lever on" : "lever");
  }
}

/** A terminal, drawn as a lamp that a click switches on and off. */
export class Terminal {
  height = 40;

  constructor(name, label, set) {
    this.width = name.length > 2 ? 30 : 18;
    this.glass = svg("circle", { class: "terminal", cx: 11, cy: 12, r: 8 });
    this.node = svg("g", { role: set ? "switch" : "img", label }, this.glass, svg("text", { class: "front-note", x: 11, y: 34, "text-anchor": "middle" }, name));
    this.isOperable = Boolean(set);
    this.label = label;
    if (set) operable(this.node, () => set(!this.isOn));
  }

  show(isOn) {
    this.isOn = isOn;
    setAttribute(this.glass, "class", isOn ? "terminal on" : "terminal");
    if (this.isOperable) setAttribute(this.node, "aria-checked", isOn);
    else setAttribute(this.node, "aria-label", `${this.label}: ${isOn ? "on" : "off"}`);
  }
}

/** A switch with several named positions, the first at the top. Calls `set(position)`. */
export class Selector {
  constructor(name, positions, set) {
    this.positions = positions;
    this.height = 18 + positions.length * 20;
    this.width = 112;
    this.lever = svg("rect", { class: "lever on", x: 5, width: 18, height: 16, rx: 3 });
    const texts = positions.map((text, at) => {
      const line = svg("text", { class: "front-note", x: 34, y: 31 + at * 20 }, text.toUpperCase());
      line.addEventListener("click", (event) => {
        event.stopPropagation();
        if (this.node.getAttribute("aria-disabled") !== "true") set(at);
      });
      return line;
    });
    this.texts = texts;
    this.node = svg("g", { role: "slider", label: name, "aria-valuemin": 0, "aria-valuemax": positions.length - 1, "aria-orientation": "vertical" },
      svg("text", { class: "front-name", x: 4, y: 11 }, name), svg("rect", { class: "slot", x: 3, y: 16, width: 22, height: positions.length * 20, rx: 4 }), this.lever, texts);
    const to = (position) => () => {
      const at = Math.max(0, Math.min(position(), positions.length - 1));
      if (at !== this.at) set(at);
    };
    const up = to(() => this.at - 1), down = to(() => this.at + 1);
    const keys = { ArrowUp: up, ArrowLeft: up, ArrowDown: down, ArrowRight: down, Home: to(() => 0), End: to(() => positions.length - 1) };
    operable(this.node, () => set((this.at + 1) % positions.length), keys);
  }

  show(at) {
    this.at = Math.max(0, at);
    setAttribute(this.lever, "y", 18 + this.at * 20);
    this.texts.forEach((text, index) => setAttribute(text, "class", index === this.at ? "front-note chosen" : "front-note"));
    setAttribute(this.node, "aria-valuenow", this.at);
    setAttribute(this.node, "aria-valuetext", this.positions[this.at] ?? "");
  }
}

/** A rotary switch with the positions 0 to 15. Calls `set(position)`. */
export class Rotary {
  width = 74;
  height = 88;

  constructor(name, set) {
    this.hand = svg("path", { class: "hand", d: "M32 32V12M32 12l-4 7M32 12l4 7" });
    const marks = Array.from({ length: 16 }, (_, at) => {
      const angle = (at * Math.PI) / 8;
      return svg("text", { class: "tick", x: 32 + 27 * Math.sin(angle), y: 35 - 27 * Math.cos(angle), "text-anchor": "middle" }, at.toString(16).toUpperCase());
    });
    this.words = svg("text", { class: "front-note", x: 32, y: 80, "text-anchor": "middle" });
    this.name = name;
    this.node = svg("g", { role: "slider", label: name, "aria-valuemin": 0, "aria-valuemax": 15 }, svg("circle", { class: "dial", cx: 32, cy: 32, r: 20 }), marks, this.hand, this.words);
    const turn = (step) => () => set((this.at + step + 16) % 16);
    operable(this.node, turn(1), { ArrowUp: turn(1), ArrowRight: turn(1), ArrowDown: turn(-1), ArrowLeft: turn(-1), Home: () => set(0), End: () => set(15) });
  }

  show(at) {
    this.at = at;
    this.hand.setAttribute("transform", `rotate(${at * 22.5} 32 32)`);
    setText(this.words, `${this.name} = ${at.toString(16).toUpperCase()}`);
    setAttribute(this.node, "aria-valuenow", at);
  }
}

/** A push button. Calls `press()`. */
export class Push {
  width = 84;
  height = 42;

  constructor(name, press) {
    this.node = svg("g", { role: "button", label: name }, svg("rect", { class: "push", x: 2, y: 4, width: 74, height: 30, rx: 6 }), svg("text", { class: "front-name", x: 39, y: 24, "text-anchor": "middle" }, name));
    operable(this.node, press);
  }

  show() {}
}
