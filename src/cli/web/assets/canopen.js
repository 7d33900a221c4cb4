// Page "CANopen": states of the nodes, and their object dictionaries.

import { show } from "./api.js";
import { fill, h, later } from "./dom.js";
import { feed } from "./feed.js";
import { showError } from "./messages.js";
import { table } from "./plant.js";

export function canopenPage(root) {
  const page = new CanopenPage(root);
  const off = feed.on("clock", later(200, () => page.read()));
  page.read();
  return () => {
    off();
    page.isEnded = true;
  };
}

class CanopenPage {
  chosen = null;

  constructor(root) {
    this.root = root;
    this.search = h("input", { type: "search", placeholder: "Index, name or value", "aria-label": "Search objects", spellcheck: false });
    this.search.addEventListener("input", () => this.draw());
    this.nodes = h("section", { class: "box", "aria-label": "Nodes" });
    this.objects = h("section", { class: "box scroll", tabIndex: 0, "aria-label": "Object dictionary" });
    this.empty = h("p", { class: "empty" }, "No device of this plant has a CANopen object dictionary.");
    fill(root, this.empty, this.nodes, h("div", { class: "line" }, this.search), this.objects);
    for (const part of [this.nodes, this.objects, this.search]) part.hidden = true;
  }

  async read() {
    if (this.isEnded) return;
    try {
      this.data = await show("objects");
      this.draw();
    } catch (problem) {
      if (problem.status !== 404 && !feed.hasEnded) showError(problem);
    }
  }

  draw() {
    const text = JSON.stringify([this.data, this.chosen, this.search.value]);
    if (text === this.text || this.isEnded) return;
    this.text = text;
    const nodes = this.data ?? [];
    this.empty.hidden = nodes.length > 0;
    for (const part of [this.nodes, this.objects, this.search]) part.hidden = nodes.length === 0;
    const node = nodes.find((it) => it.name === this.chosen) ?? nodes[0];
    const pick = (it) => h("button", { type: "button", class: "link", "aria-pressed": it === node, onclick: () => { this.chosen = it.name; this.draw(); } }, it.name);
    fill(this.nodes, table(["Node", "Number", "Bus", "State"], nodes.map((it) => h("tr", { "aria-selected": it === node }, h("th", { scope: "row" }, pick(it)), h("td", { class: "mono" }, String(it.node ?? "")), h("td", null, it.bus ?? ""), h("td", null, String(it.state ?? "").replaceAll("_", " "))))));
    const words = this.search.value.toLowerCase();
    const hit = (object) => `${hexOf(object.index, 4)} ${object.name} ${object.text ?? object.value}`.toLowerCase().includes(words);
    const row = (object) => h("tr", null, h("td", { class: "mono" }, `${hexOf(object.index, 4)}.${object.subindex ?? 0}`), h("td", null, object.name ?? ""), h("td", { class: "mono" }, String(object.text ?? object.value ?? "")), h("td", null, object.access ?? ""));
    fill(this.objects, table(["Index", "Object", "Value", "Access"], (node?.objects ?? []).filter(hit).map(row), `Object dictionary of ${node?.name}`));
  }
}

const hexOf = (number, digits) => `16#${Number(number).toString(16).toUpperCase().padStart(digits, "0")}`;
