// Page "CANopen": the nodes with their states, network management, and object dictionaries read by SDO.

import { guard } from "./actions.js";
import { show } from "./api.js";
import { choice, field, fill, h, td, tdMono } from "./dom.js";
import { feed } from "./feed.js";
import { withSource } from "./map.js";
import { showError } from "./messages.js";
import { table } from "./plant.js";
import { NMT, SdoClient, sendFrame } from "./sdo.js";
import { parseValue, seconds } from "./values.js";

/** Objects that many nodes have. Type `s` is a text, `u` a number. */
const USUAL = [
  [0x1000, 0, "Device type", "u"], [0x1001, 0, "Error register", "u"], [0x1003, 0, "Number of errors", "u"], [0x1008, 0, "Device name", "s"], [0x1009, 0, "Hardware version", "s"], [0x100a, 0, "Software version", "s"],
  [0x100c, 0, "Guard time in ms", "u"], [0x100d, 0, "Life time factor", "u"], [0x1014, 0, "Identifier of emergency messages", "u"], [0x1016, 1, "Consumer heartbeat time", "u"], [0x1017, 0, "Producer heartbeat time in ms", "u"],
  [0x1018, 1, "Vendor", "u"], [0x1018, 2, "Product", "u"], [0x1018, 3, "Revision", "u"], [0x1400, 1, "Identifier of receive PDO 1", "u"], [0x1600, 0, "Objects in receive PDO 1", "u"], [0x1800, 1, "Identifier of transmit PDO 1", "u"], [0x1800, 2, "Type of transmit PDO 1", "u"], [0x1a00, 0, "Objects in transmit PDO 1", "u"],
  [0x2000, 0, "Manufacturer object 2000", "u"], [0x6000, 1, "Digital inputs 1 to 8", "u"], [0x6200, 1, "Digital outputs 1 to 8", "u"], [0x6401, 1, "Analog input 1", "u"], [0x6411, 1, "Analog output 1", "u"],
];
const STATES = { 0: "pre-operational", 4: "stopped", 5: "operational", 127: "pre-operational" };
/** Number of past journal records that are searched for nodes. */
const PAST = 4_096;

export function canopenPage(root, rest, context) {
  const page = new CanopenPage(root, context);
  return page.buses.length ? feed.followJournal("canopen", PAST, (records) => page.take(records)) : null;
}

class CanopenPage {
  nodes = new Map();
  objects = new Map();
  dictionaries = new Map();
  chosen = null;

  constructor(root, context) {
    this.root = root;
    this.buses = context.status.buses.map((bus, index) => ({ ...bus, index })).filter((bus) => bus.kind === "can");
    if (!this.buses.length) return void fill(root, h("p", { class: "empty" }, "The plant has no CAN bus, so no CANopen node."));
    this.list = h("section", { class: "box scroll", tabIndex: 0, label: "Nodes" });
    this.dictionary = h("section", { class: "box scroll", tabIndex: 0, label: "Object dictionary" });
    fill(root, this.list, this.dictionary);
    this.draw();
  }

  take(records) {
    let isNew = false;
    for (const record of records) {
      if (record.kind === "node_state" && typeof record.node === "number") isNew = this.#note(record.node, record.time_us, record.to, record.plc) || isNew;
      if (record.kind !== "can_frame" || record.extended) continue;
      const node = record.id & 0x7f, what = record.id & 0x780;
      if (!node || ![0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700].includes(what)) continue;
      const state = what === 0x700 && !record.remote ? STATES[parseInt(record.data, 16) & 0x7f] : undefined;
      isNew = this.#note(node, record.time_us, state, undefined, record.bus) || isNew;
    }
    if (isNew) this.draw();
  }

  /** Returns the objects of a node: those of its device if the plant contains the device, otherwise the objects that many nodes have. */
  async #objectsOf(number) {
    const plc = this.nodes.get(number)?.plc;
    const usual = USUAL.map(([index, sub, name, type]) => ({ index, sub, name, type }));
    if (!plc) return usual;
    this.dictionaries.set(plc, this.dictionaries.get(plc) ?? show("objects", { plc }).catch(() => []));
    const own = await this.dictionaries.get(plc);
    return own.length ? own : usual;
  }

  #note(number, timeUs, state, plc, bus) {
    const known = this.nodes.get(number) ?? { number, bus: this.buses[0].bus };
    const next = { ...known, timeUs, state: state ?? known.state, plc: plc ?? known.plc, bus: bus ?? known.bus };
    this.nodes.set(number, next);
    return known.state !== next.state || known.plc !== next.plc || known.timeUs === undefined;
  }

  draw() {
    const nodes = [...this.nodes.values()].sort((one, other) => one.number - other.number);
    this.chosen ??= nodes[0]?.number ?? null;
    const pick = (node) => h("button", { class: "link", "aria-pressed": node.number === this.chosen, onclick: () => { this.chosen = node.number; this.draw(); } }, `Node ${node.number}`);
    const row = (node) => h("tr", { "aria-selected": node.number === this.chosen }, h("th", { scope: "row" }, pick(node)), td(node.plc ?? ""), td(node.bus), td(node.state ?? "unknown"), tdMono(seconds(node.timeUs)), td(this.#commands(node)));
    fill(this.list, h("header", { class: "boxhead" }, h("h2", null, "Nodes"), h("small", null, "seen in the traffic")),
      nodes.length ? table(["Node", "PLC", "Bus", "State", "Last heard", "Network management"], nodes.map(row), "Nodes") : h("p", { class: "empty" }, "No node has been heard yet. Advance the clock; a node sends its boot-up message after power-on."));
    this.drawDictionary();
    guard(this.root);
  }

  #busOf(number) {
    return this.buses.find((bus) => bus.bus === this.nodes.get(number)?.bus) ?? this.buses[0];
  }

  #commands(node) {
    const button = ([name, code]) => h("button", { acts: true, label: `${name}, node ${node.number}`, onclick: () => sendFrame(this.#busOf(node.number).index, 0, [code, node.number], `network management: ${name}, node ${node.number}`) }, name);
    return h("div", { class: "line" }, Object.entries(NMT).map(button));
  }

  async drawDictionary() {
    this.dictionary.hidden = this.chosen === null;
    if (this.chosen === null) return;
    const node = this.chosen;
    const known = await this.#objectsOf(node);
    if (node !== this.chosen) return;
    const more = [...this.objects.values()].filter((it) => it.node === this.chosen && !known.some((one) => one.index === it.index && one.sub === it.sub));
    const rows = [...known, ...more].map((object) => this.#row(object));
    const all = h("button", { acts: true, onclick: () => this.readAll(known) }, "Read all");
    fill(this.dictionary, h("header", { class: "boxhead" }, h("h2", { class: "grow" }, `Object dictionary of node ${this.chosen}`), all),
      h("p", { class: "pad muted" }, "Reading and writing sends SDO frames on the bus, and advances a stepped clock until the node answers."),
      this.#form(), table(["Object", "Name", "Value", "Access", "Default", "Page", ""], rows, "Objects"));
    guard(this.dictionary);
  }

  #row({ index, sub, name, type, access, default: usual, page, provenance, default_provenance: usualFrom }) {
    const known = this.objects.get(`${this.chosen} ${index} ${sub}`);
    const read = h("button", { acts: true, label: `Read ${nameOf(index, sub)}`, onclick: () => this.read(index, sub).then(() => this.draw()) }, "Read");
    return h("tr", { class: known?.error ? "muted" : "" }, tdMono(nameOf(index, sub)), td(withSource(name ?? "", provenance)), tdMono(known ? (known.error ?? textOf(known.bytes, type)) : ""), td(access ?? ""),
      tdMono(usual && withSource(usual, usualFrom)), td(page ?? ""), td(read));
  }

  #form() {
    const object = h("input", { class: "mono", value: "1017.0", required: true, pattern: "[0-9A-Fa-f]{4}(\\.[0-9]+)?" });
    const value = h("input", { class: "mono", placeholder: "16#64" });
    const size = choice([["1", "1 byte"], ["2", "2 bytes"], ["4", "4 bytes"]], "2", null);
    const place = () => {
      const [index, sub = "0"] = object.value.split(".");
      return [parseInt(index, 16), Number(sub)];
    };
    const form = h("form", { class: "line wrap pad" }, field("Object (hexadecimal index.subindex)", object), field("Value to write", value), field("Size", size),
      h("button", { type: "submit", acts: true }, "Read"), h("button", { acts: true, onclick: () => object.reportValidity() && this.write(...place(), value.value, size.value) }, "Write"));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.read(...place()).then(() => this.draw());
    });
    return form;
  }

  async read(index, sub) {
    const node = this.chosen;
    const bus = this.#busOf(node);
    const entry = { node, index, sub };
    try {
      entry.bytes = await new SdoClient(bus.index, bus.bus, node).read(index, sub);
    } catch (error) {
      entry.error = error.message;
    }
    this.objects.set(`${node} ${index} ${sub}`, entry);
    return entry;
  }

  async readAll(objects) {
    for (const { index, sub } of objects) {
      const { error } = await this.read(index, sub);
      this.draw();
      if (error?.includes("does not answer")) return;
    }
  }

  async write(index, sub, text, size) {
    try {
      const value = parseValue(text, TYPES[size][text.trim().startsWith("-") ? 1 : 0]);
      const bytes = Array.from({ length: size }, (_, at) => Math.floor(value / 256 ** at) % 256);
      const bus = this.#busOf(this.chosen);
      await new SdoClient(bus.index, bus.bus, this.chosen).write(index, sub, bytes);
      await this.read(index, sub);
      this.draw();
    } catch (error) {
      showError(error);
    }
  }
}

/** Types for each size in bytes that can be written: without a sign, and with a sign. */
const TYPES = { 1: ["BYTE", "SINT"], 2: ["WORD", "INT"], 4: ["DWORD", "DINT"] };
const nameOf = (index, sub) => `${index.toString(16).toUpperCase().padStart(4, "0")}.${sub}`;

function textOf(bytes, type) {
  if (/^(s|.*STRING.*)$/i.test(type ?? "")) return new TextDecoder("latin1").decode(new Uint8Array(bytes));
  if (bytes.length > 4 && bytes.every((byte) => byte >= 0x20 && byte < 0x7f)) return String.fromCharCode(...bytes);
  const number = bytes.reduceRight((sum, byte) => sum * 256 + byte, 0);
  return `16#${number.toString(16).toUpperCase().padStart(2 * bytes.length, "0")}  ${number}`;
}
