// Page "Front panel": a picture of each device, with working lamps, displays and switches.

import { act, whyDisabled } from "./actions.js";
import { show } from "./api.js";
import { fill, h, setAttribute, svg } from "./dom.js";
import { feed } from "./feed.js";
import { Lamp, SevenSegments, TextDisplay } from "./led.js";
import { withSource } from "./map.js";
import { showError } from "./messages.js";
import { Push, Rotary, Selector, Terminal, Toggle } from "./switch.js";
import { counted, integerOf } from "./values.js";

/** Numbers of the settings in `set_board`. */
const DIP = 1, LEDS = 2, SWITCH = 3, POWER = 4, START = 5, RESET = 6, CYCLE = 7, PROJECT = 8, MODULE_DIP = 9, FRONT = 256;
/** Width of a front panel in units of its drawing. */
const WIDTH = 440;
const POSITIONS = ["run", "stop", "reset"], PROJECTS = ["none", "boot", "sent"], STARTS = ["cold", "warm", "hot", "stop"];

export function panelPage(root) {
  const area = h("div", { class: "columns fronts" });
  fill(root, area);
  const fronts = new Map();
  const draw = ({ boards }) => boards.forEach((board) => fronts.get(board.plc)?.show(board));
  const off = feed.on("boards", draw);
  const start = async () => {
    const [devices, boards] = await Promise.all([show("devices"), show("boards")]);
    for (const device of devices) {
      const board = boards.find((it) => it.plc === device.plc);
      if (board) fronts.set(device.plc, new Front(device, board));
    }
    fill(area, [...fronts.values()].map((front) => front.element));
    draw({ boards });
    feed.want("panel", { events: ["boards"] });
  };
  start().catch(showError);
  return () => {
    off();
    feed.leave("panel");
  };
}

class Front {
  parts = [];

  constructor({ number, plc, title, ports, front }, board) {
    Object.assign(this, { index: number, plc, board, ports, words: front });
    this.build(board);
    const picture = this.picture();
    this.state = h("p", { class: "muted" });
    this.element = h("section", { class: "box front", label: `Front of ${plc}` }, h("header", { class: "boxhead" }, h("h2", null, plc), h("small", null, title)), picture, this.controls(board), h("div", { class: "pad" }, this.state));
  }

  /** Adds a part of the drawing. `read` returns the value of the part from the state of the board. */
  add(part, read, isNewRow) {
    this.parts.push({ part, read, isNewRow });
  }

  set(which, value, words) {
    act("set_board", { plc: this.index, setting: { which, value } }, `${this.plc}: ${words}`);
  }

  build(board) {
    if (board.display !== undefined) this.add(this.hasText() ? new TextDisplay() : new SevenSegments(), (it) => it.display);
    if (board.leds !== undefined) this.leds();
    if (board.switch !== undefined && board.switch !== null) this.add(new Selector("SWITCH", POSITIONS, (at) => this.set(SWITCH, at, `switch=${POSITIONS[at]}`)), (it) => POSITIONS.indexOf(it.switch));
    this.add(new Selector("SUPPLY", ["on", "off"], (at) => this.set(POWER, at, `power=${["on", "off"][at]}`)), (it) => (it.power === "on" ? 0 : 1));
    if (board.dip !== undefined) this.dip((it) => it.dip, (value) => this.set(DIP, value, `dip=${value}`), "DIP");
    for (const [slot, module] of Object.entries(board.modules ?? {})) this.module(slot, module);
    for (const word of this.words) this.word(word);
  }

  hasText() {
    return this.words.some((word) => word.text);
  }

  leds() {
    const bits = (board) => parseInt(board.leds.slice(2), 2);
    for (let bit = 3; bit >= 0; bit -= 1) {
      const set = (isOn) => {
        const value = (bits(this.board) & ~(1 << bit)) | (isOn << bit);
        this.set(LEDS, value, `leds=${value}`);
      };
      this.add(new Terminal(`LED ${bit}`, `LED ${bit}`, set), (board) => Boolean(bits(board) >> bit & 1));
    }
  }

  dip(read, set, name) {
    this.add({ width: 24, height: 50, node: svg("text", { class: "front-name", y: 26 }, "DIP"), show() {} }, null);
    for (let bit = 0; bit < 5; bit += 1) {
      const toggle = new Toggle(String(bit + 1), `${name} ${bit + 1}`, () => set(read(this.board) ^ (1 << bit)));
      this.add(toggle, (board) => Boolean(read(board) >> bit & 1));
    }
  }

  module(slot, module) {
    this.add(title(`${slot} ${module.kind}`), null, true);
    for (const name of Object.keys(module.leds ?? {})) this.add(new Lamp(name), (board) => board.modules[slot].leds[name]);
    const port = this.ports.find((it) => it.port === slot)?.number;
    if (module.dip !== undefined && port !== undefined) this.dip((board) => board.modules[slot].dip, (dip) => this.set(MODULE_DIP, port * 256 + dip, `${slot}.dip=${dip}`), `${slot} DIP`);
  }

  /** Draws a word of the front panel that only this type of device has. The meaning of the word decides how. */
  word({ name, number, switch: isSwitch, values }) {
    const which = FRONT + number;
    const set = isSwitch ? (value) => this.set(which, value, `${name}=${this.named(values, value)}`) : null;
    const choices = values.filter((value) => value.first === value.last);
    if (!(name in this.board)) return;
    if (/^(led_|stat$)/.test(name)) return this.add(new Lamp(name.replace("led_", "").toUpperCase()), (board) => board[name]);
    if (!set) return name === "outputs" ? this.bits(name, null) : undefined;
    if (/^(inputs|open)$/.test(name)) return this.bits(name, set);
    if (name === "switches") return this.twoRotaries(name, set);
    if (name === "s2") return this.add(new Rotary("S2", set), (board) => board[name]);
    if (name !== "program" && choices.length === 2) this.add(new Selector(name.toUpperCase(), choices.map((it) => it.text), (at) => set(choices[at].first)), (board) => choices.findIndex((it) => it.text === board[name]));
  }

  named(values, value) {
    return values.find((it) => it.first === value && it.last === value)?.text ?? value;
  }

  bits(name, set) {
    const count = this.words.some((word) => word.name === "s1") ? 16 : 8;
    this.add(title(name.toUpperCase()), null, true);
    for (let bit = 0; bit < count; bit += 1) {
      const one = set && ((isOn) => set(((this.board[name] & ~(1 << bit)) | (isOn << bit)) >>> 0));
      this.add(new Terminal(String(bit), `${name} ${bit}`, one), (board) => Boolean(board[name] >> bit & 1));
    }
  }

  twoRotaries(name, set) {
    this.add(new Rotary("HIGH", (at) => set((at << 4) | (this.board[name] & 15))), (board) => board[name] >> 4);
    this.add(new Rotary("LOW", (at) => set((this.board[name] & 0xf0) | at)), (board) => board[name] & 15);
  }

  picture() {
    let x = 20, y = 18, rowHeight = 0;
    this.add(new Push("RESET", () => this.set(RESET, 0, "reset")), null, false);
    for (const { part, isNewRow } of this.parts) {
      if (x + part.width > WIDTH - 12 || isNewRow) [x, y, rowHeight] = [20, y + rowHeight + 8, 0];
      part.node.setAttribute("transform", `translate(${x} ${y})`);
      x += part.width + 6;
      rowHeight = Math.max(rowHeight, part.height);
    }
    const height = y + rowHeight + 14;
    return svg("svg", { class: "front-picture", viewBox: `0 0 ${WIDTH} ${height}`, role: "group", label: `Front of ${this.plc}` },
      svg("rect", { class: "housing", x: 2, y: 2, width: WIDTH - 4, height: height - 4, rx: 10 }), this.parts.map(({ part }) => part.node));
  }

  /** Adds controls that the housing of the real device does not have. */
  controls(board) {
    const button = (text, work) => h("button", { acts: true, onclick: work }, text);
    const starts = board.start !== undefined && STARTS.map((name, at) => button(name, () => this.set(START, at + 1, `start=${name}`)));
    const projects = board.project !== undefined && PROJECTS.map((name, at) => button(name, () => this.set(PROJECT, at, `project=${name}`)));
    const line = (label, buttons) => buttons && h("div", { class: "line wrap", role: "group", label }, h("span", { class: "muted label" }, label), buttons);
    return h("div", { class: "pad stack" }, line("Program start", starts), line("Project", projects),
      line("Supply", [button("Off and on", () => this.set(CYCLE, 0, "power-cycle"))]), this.wordControls());
  }

  /** Adds an input field for each word with a number or with many named values. */
  wordControls() {
    const drawn = /^(inputs|open|switches|s2)$/;
    const words = this.words.filter(({ name, switch: isSwitch, values }) => isSwitch && !drawn.test(name) && values.filter((value) => value.first === value.last).length !== 2);
    return words.length > 0 && h("div", { class: "wordgrid" }, words.map((word) => this.wordControl(word)));
  }

  wordControl({ name, number, values, meaning: text, provenance }) {
    const meaning = withSource(text, provenance);
    const which = FRONT + number;
    const choices = values.filter((value) => value.first === value.last && value.text !== "none");
    const set = (value) => this.set(which, value, `${name}=${this.named(values, value)}`);
    if (choices.length) return h("div", { class: "line wrap", role: "group", label: name }, h("span", { class: "muted label", title: meaning }, name), choices.map((it) => h("button", { acts: true, title: withSource(it.text, it.provenance), onclick: () => set(it.first) }, it.text)));
    const most = values[0]?.last ?? Infinity;
    const input = h("input", { class: "mono", size: 6, autocomplete: "off", spellcheck: false, acts: true, label: meaning || name, "data-title": meaning, onchange: () => {
      const value = integerOf(input.value);
      if (value >= 0 && value <= most) return set(value);
      showError(new Error(`'${input.value}' is not a value of ${name}: write a number such as 67, 16#43 or 2#1000011${most < Infinity ? `, at most ${most}` : ""}`));
      input.value = this.board[name];
    } });
    this.parts.push({ part: { node: svg("g"), width: 0, height: 0, show: (value) => document.activeElement !== input && (input.value = value) }, read: (board) => board[name] });
    return h("label", { class: "line" }, h("span", { class: "muted label" }, name), input);
  }

  show(board) {
    this.board = board;
    for (const { part, read } of this.parts) if (read) part.show(read(board));
    const why = whyDisabled();
    for (const node of this.element.querySelectorAll(".operable")) setAttribute(node, "aria-disabled", why !== "");
    const texts = [board.program && `program ${board.program}`, board.start && `last start ${board.start}`, board.project && `project ${board.project}`, board.state && `state ${board.state}`, board.address !== undefined && `PROFIBUS address ${board.address}`, counted(board.restarts, "restart")];
    if (board.dip !== undefined) texts.unshift(board.dip === board.dip_latched ? `DIP number ${board.dip}` : `DIP number ${board.dip}, ${board.dip_latched} is active until the next start`);
    this.state.textContent = texts.filter(Boolean).join(", ");
  }
}

function title(text) {
  return { width: WIDTH - 40, height: 14, node: svg("text", { class: "front-name", y: 10 }, text), show() {} };
}
