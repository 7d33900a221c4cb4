// Page "Drives": state, reference and actual speed of each drive, a chart of the last seconds, parameters.

import { act, guard } from "./actions.js";
import { look } from "./api.js";
import { Chart } from "./chart.js";
import { fill, h, oneAtATime, setAttribute, setText, td, tdMono } from "./dom.js";
import { feed } from "./feed.js";
import { showError } from "./messages.js";
import { table } from "./plant.js";
import { integerOf } from "./values.js";

/** Length of the chart's time axis in emulated time, in microseconds. */
const SPAN_US = 5_000_000;
/** Lengths of the time axis in microseconds before enough time has passed for the full length. */
const SHORTER_US = [100_000, 200_000, 500_000, 1_000_000, 2_000_000];
/** Minimum real time between two readings of the parameters, in milliseconds. */
const PAUSE_MS = 500;

export function drivesPage(root) {
  const page = new DrivesPage(root);
  const offs = [feed.on("drives", (data) => page.take(data.drives)), feed.on("turned", () => page.turn()), feed.on("clock", () => page.draw()), ...["drives", "clock"].map((event) => feed.on(event, () => page.read()))];
  feed.want("drives", { events: ["drives"] });
  return () => {
    offs.forEach((off) => off());
    feed.leave("drives");
    page.isEnded = true;
  };
}

class DrivesPage {
  rows = new Map();
  samples = new Map();
  chosen = null;
  read = oneAtATime(PAUSE_MS, () => this.readNow());

  constructor(root) {
    this.body = h("tbody");
    const head = ["Drive", "Bus", "State", "Reference", "Speed", "Synchronized", "Fault", "Status word", "Lost references"];
    this.table = h("div", { class: "box scroll", tabIndex: 0, role: "group", label: "Drives" }, h("table", null, h("thead", null, h("tr", null, head.map((name) => h("th", { scope: "col" }, name)))), this.body));
    this.chart = new Chart({ label: "Reference and speed of the chosen drive" });
    this.title = h("h2");
    this.details = h("div", { class: "box" });
    fill(root, this.table, h("section", { class: "box chartbox" }, h("header", { class: "boxhead" }, this.title, h("small", null, "at most the last 5 s of emulated time")), this.chart.element), this.details);
  }

  take(drives) {
    if (!drives.length) return fill(this.body, h("tr", null, h("td", { colSpan: 9, class: "muted" }, "The plant has no drive.")));
    for (const [index, drive] of drives.entries()) {
      if (!this.rows.has(drive.drive)) this.addRow(drive, index);
      this.fillRow(this.rows.get(drive.drive), drive);
      this.sample(drive);
    }
    if (this.chosen === null) this.choose(drives[0].drive, 0);
    this.draw();
  }

  addRow(drive, index) {
    const cells = Array.from({ length: 8 }, () => h("td", { class: "mono" }));
    const name = h("button", { class: "link", onclick: () => this.choose(drive.drive, index) }, drive.drive);
    const row = h("tr", null, h("th", { scope: "row" }, name), cells);
    row.cells2 = cells;
    this.rows.set(drive.drive, row);
    this.body.append(row);
  }

  fillRow(row, drive) {
    const texts = [drive.bus ? `${drive.bus} no. ${drive.number}` : "built in", drive.state.replaceAll("_", " "), drive.reference, drive.speed, drive.synchronized ? "yes" : "no", drive.fault || "none", `16#${drive.status_word.toString(16).toUpperCase().padStart(4, "0")}`, drive.lost_references];
    texts.forEach((text, at) => setText(row.cells2[at], String(text)));
    setAttribute(row, "class", drive.fault ? "bad" : "");
  }

  sample(drive) {
    if (!this.samples.has(drive.drive)) this.samples.set(drive.drive, []);
    const list = this.samples.get(drive.drive);
    list.push({ time: feed.timeUs, reference: drive.reference, speed: drive.speed });
    while (list.length > 2 && list[1].time < feed.timeUs - SPAN_US) list.shift();
  }

  turn() {
    for (const list of this.samples.values()) list.splice(0, list.length, ...list.filter((it) => it.time <= feed.timeUs));
  }

  draw() {
    const list = this.samples.get(this.chosen) ?? [];
    const series = (name) => ({ name, points: [...list.map((it) => [it.time, it[name]]), ...(list.length ? [[feed.timeUs, list.at(-1)[name]]] : [])] });
    this.chart.draw(Math.max(0, feed.timeUs - SPAN_US), SHORTER_US.find((us) => us >= feed.timeUs) ?? Math.max(feed.timeUs, SPAN_US), [series("reference"), series("speed")]);
  }

  choose(name, index) {
    Object.assign(this, { chosen: name, index, fields: null });
    setText(this.title, name);
    for (const [key, row] of this.rows) setAttribute(row, "aria-selected", key === name);
    this.draw();
    this.read();
  }

  /** Shows the present parameters of the chosen drive. */
  async readNow() {
    const { chosen: name, index } = this;
    if (name === null || this.isEnded) return;
    try {
      const { drive } = await look("drive", { drive: index });
      if (this.chosen === name && !this.isEnded) this.showDetails({ ...drive, drive: name });
    } catch (problem) {
      if (!feed.hasEnded) showError(problem);
    }
  }

  showDetails({ drive, parameters = [], zk = {} }) {
    const values = [...parameters.map(({ number, value }) => [number, value]), ...Object.entries(zk).map(([number, value]) => [`ZK ${number}`, value])];
    if (this.fields?.size !== values.length || !values.every(([number]) => this.fields.has(number))) this.build(drive, parameters, zk);
    for (const [number, value] of values) this.fields.get(number)(value);
  }

  /** Builds the tables. `fields` maps the number of each parameter to the function that shows its value. */
  build(drive, parameters, zk) {
    this.fields = new Map();
    const rows = parameters.map((it) => h("tr", null, tdMono(String(it.number)), td(it.name), td(this.control(it)), td(it.unit), tdMono(`${it.min} \u2026 ${it.max}`), td(it.provenance ?? "plant file")));
    const zkRows = Object.keys(zk).map((number) => h("tr", null, tdMono(number), td(this.text(`ZK ${number}`))));
    fill(this.details, h("header", { class: "boxhead" }, h("h2", null, `Parameters of ${drive}`)),
      h("div", { class: "parameters pad" }, table(["No.", "Name", "Value", "Unit", "Range", "Provenance"], rows, "Parameters"), zkRows.length > 0 && table(["ZK", "Value"], zkRows, "ZK parameters")));
    guard(this.details);
  }

  text(number) {
    const text = h("span", { class: "mono" });
    this.fields.set(number, (value) => setText(text, String(value)));
    return text;
  }

  control({ number, name, min, max, read_only }) {
    if (read_only) return this.text(number);
    const { index } = this;
    const input = h("input", { class: "mono", acts: true, spellcheck: false, autocomplete: "off", label: `${number} ${name}`, "data-title": "A number such as 15 or 16#000F" });
    let known = "";
    const show = () => (input.value = known);
    this.fields.set(number, (value) => {
      const isEdited = input.value !== known;
      known = String(value);
      if (!isEdited || document.activeElement !== input) show();
    });
    input.addEventListener("change", async () => {
      const value = integerOf(input.value);
      if (!(value >= min && value <= max)) showError(new Error(`'${input.value}' is not a value of parameter ${number}: ${min} to ${max}, for example ${known}`));
      else if (await act("set_parameter", { drive: index, number, value }, `parameter ${number} = ${value}`, `Parameter ${number} is set`)) known = String(value);
      show();
      this.read();
    });
    return input;
  }
}
