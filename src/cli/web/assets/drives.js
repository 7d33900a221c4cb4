// Page "Drives": state, reference and actual speed of each drive, a chart of the last seconds, parameters.

import { act } from "./actions.js";
import { look } from "./api.js";
import { Chart } from "./chart.js";
import { fill, h, setAttribute, setText } from "./dom.js";
import { feed } from "./feed.js";
import { showError } from "./messages.js";
import { table } from "./plant.js";

/** Emulated time on the chart, in microseconds. */
const SPAN_US = 5_000_000;

export function drivesPage(root) {
  const page = new DrivesPage(root);
  const offs = [feed.on("drives", (data) => page.take(data.drives)), feed.on("turned", () => page.turn()), feed.on("clock", () => page.draw())];
  feed.want("drives", { events: ["drives"] });
  return () => {
    offs.forEach((off) => off());
    feed.leave("drives");
    page.observer?.();
  };
}

class DrivesPage {
  rows = new Map();
  samples = new Map();
  chosen = null;

  constructor(root) {
    this.body = h("tbody");
    const head = ["Drive", "Bus", "State", "Reference", "Speed", "Synchronized", "Fault", "Status word", "Lost references"];
    this.table = h("div", { class: "box scroll", tabIndex: 0, role: "group", "aria-label": "Drives" }, h("table", null, h("thead", null, h("tr", null, head.map((name) => h("th", { scope: "col" }, name)))), this.body));
    this.chart = new Chart({ label: "Reference and speed of the chosen drive" });
    this.title = h("h2");
    this.details = h("div", { class: "box" });
    fill(root, this.table, h("section", { class: "box chartbox" }, h("header", { class: "boxhead" }, this.title, h("small", null, "the last 5 s of emulated time")), this.chart.element), this.details);
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
    const name = h("button", { type: "button", class: "link", onclick: () => this.choose(drive.drive, index) }, drive.drive);
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
    this.chart.draw(Math.max(0, feed.timeUs - SPAN_US), Math.max(feed.timeUs, SPAN_US), [series("reference"), series("speed")]);
  }

  async choose(name, index) {
    this.chosen = name;
    setText(this.title, name);
    for (const [key, row] of this.rows) setAttribute(row, "aria-selected", key === name);
    this.draw();
    try {
      const { drive } = await look("drive", { drive: index });
      if (this.chosen === name) this.showDetails({ ...drive, drive: name }, index);
    } catch (problem) {
      showError(problem);
    }
  }

  showDetails(drive, index) {
    const zk = Object.entries(drive.zk ?? {}).map(([number, value]) => h("tr", null, h("td", { class: "mono" }, number), h("td", { class: "mono" }, String(value))));
    const rows = (drive.parameters ?? []).map((parameter) => h("tr", null, h("td", { class: "mono" }, String(parameter.number)), h("td", null, parameter.name), h("td", null, this.control(parameter, index)), h("td", null, parameter.unit), h("td", { class: "mono" }, `${parameter.min} \u2026 ${parameter.max}`)));
    fill(this.details, h("header", { class: "boxhead" }, h("h2", null, `Parameters of ${drive.drive}`)),
      h("div", { class: "parameters pad" }, table(["No.", "Name", "Value", "Unit", "Range"], rows, "Parameters"), zk.length > 0 && table(["ZK", "Value"], zk, "ZK parameters")));
  }

  control(parameter, index) {
    if (parameter.read_only) return h("span", { class: "mono" }, String(parameter.value));
    const input = h("input", { type: "number", class: "mono", value: parameter.value, min: parameter.min, max: parameter.max, "data-acts": true, "aria-label": `${parameter.number} ${parameter.name}` });
    input.addEventListener("change", () => act("set_parameter", { drive: index, number: parameter.number, value: Number(input.value) }, `parameter ${parameter.number} = ${input.value}`, `Parameter ${parameter.number} is set`));
    return input;
  }
}
