// Page "Journal": the records of the emulator, with a filter; the newest at the end.

import { server } from "./api.js";
import { choice, fill, h, later, perFrame, setAttribute, setText } from "./dom.js";
import { feed } from "./feed.js";
import { RowList } from "./list.js";
import { digits, seconds } from "./values.js";

/** Number of records that the page keeps, and number of past records that it reads at the start. */
const KEPT = 20_000, PAST = 2_000;
const HIDDEN = new Set(["v", "seq", "time_us", "kind", "line", "count", "first_us", "period_us", "extended", "remote", "length", "search"]);

export function journalPage(root, rest, context) {
  const page = new JournalPage(root, context);
  page.read();
  const off = feed.on("turned", (turned) => page.turn(turned));
  const end = () => {
    off();
    page.endJournal();
    page.rows.observer.disconnect();
  };
  return Object.assign(end, { key: (event) => event.key === "/" && (page.text.select(), true) });
}

class JournalPage {
  records = [];
  kinds = new Set();

  constructor(root, context) {
    this.buses = context.status.buses.map((it) => it.bus);
    this.text = h("input", { type: "search", placeholder: "Filter: words in the text, register, PLC, bus, time", label: "Filter", spellcheck: false, class: "grow" });
    this.kind = choice([["", "All kinds"]], "", { label: "Kind" });
    this.count = h("span", { class: "muted", role: "status" });
    this.text.addEventListener("input", later(150, () => this.filter()));
    this.text.addEventListener("keydown", (event) => this.rows.enterFrom(event, () => this.filter()));
    this.kind.addEventListener("change", () => this.filter());
    this.stick = h("input", { type: "checkbox", checked: true, onchange: () => this.stick.checked && this.toEnd() });
    this.rows = new RowList({ label: "Journal", columns: "journal", head: head(), make: makeRow, fillRow, rowHeight: 28, narrowHeight: 68, key: (record) => record.seq, onchoose: (record) => this.choose(record) });
    this.rows.element.addEventListener("wheel", (event) => event.deltaY < 0 && (this.stick.checked = false), { passive: true });
    this.detail = h("pre", { class: "code record-detail", tabIndex: 0, label: "The chosen record", hidden: true });
    this.jump = h("p", { class: "muted" }, "Choose a record for all its fields.");
    this.note = h("p", { class: "empty", hidden: true }, "No record has this kind and all these words.");
    this.rows.element.append(this.note);
    fill(root, h("div", { class: "line wrap" }, this.text, this.kind, h("label", { class: "line" }, this.stick, "Latest"), this.count), this.rows.element, this.jump, this.detail);
    this.draw = perFrame(() => this.filter());
  }

  read() {
    this.endJournal?.();
    this.records = [];
    this.endJournal = feed.followJournal("journal", PAST, (records) => this.take(records));
  }

  /** Removes later records after the plant has gone back: new records get their numbers. */
  turn({ time_us }) {
    if (this.shown?.time_us >= time_us) {
      this.rows.unchoose();
      this.shown = null;
      this.detail.hidden = true;
      fill(this.jump);
    }
    this.read();
  }

  take(records) {
    const last = this.records.at(-1)?.seq ?? -1;
    for (const record of records) {
      if (typeof record.seq !== "number" || record.seq <= last) continue;
      record.line ??= lineOf(record);
      record.search = `${record.kind} ${record.line} ${seconds(record.time_us)}`.toLowerCase();
      this.records.push(record);
      if (!this.kinds.has(record.kind)) this.addKind(record.kind);
    }
    if (this.records.length > KEPT) this.records.splice(0, this.records.length - KEPT);
    this.draw();
  }

  addKind(kind) {
    this.kinds.add(kind);
    const after = [...this.kind.options].find((option) => option.value > kind);
    this.kind.insertBefore(h("option", { value: kind }, kind), after ?? null);
  }

  filter() {
    const words = this.text.value.toLowerCase().split(/\s+/).filter(Boolean);
    const kind = this.kind.value;
    const found = words.length || kind ? this.records.filter((record) => (!kind || record.kind === kind) && words.every((word) => record.search.includes(word))) : this.records;
    setText(this.count, `${found.length} of ${this.records.length} records`);
    this.rows.set(found);
    this.note.hidden = found.length > 0 || !this.records.length;
    if (this.stick.checked) this.toEnd();
  }

  toEnd() {
    this.rows.element.scrollTop = this.rows.element.scrollHeight;
    this.rows.draw();
  }

  choose(record) {
    this.stick.checked = false;
    this.shown = record;
    this.detail.hidden = false;
    const bus = record.bus ?? this.buses[0];
    fill(this.jump, bus && h("a", { href: `#/${encodeURIComponent(server.instance)}/bus/${encodeURIComponent(bus)}/${record.time_us}` }, `${seconds(record.time_us)} on bus ${bus}`));
    const { line, search, ...fields } = record;
    setText(this.detail, JSON.stringify(fields, null, 1).replace(/\n\s*/g, " "));
  }
}

const hexOf = (value, width) => (typeof value === "number" && width ? digits(value, width) : String(value));

/** Formats a record: source, register, old and new value, meaning, then the other fields. */
function lineOf({ plc, bus, node, register, address, width, from, to, value, text, id, data, ...rest }) {
  const place = [plc ?? bus, node && `node${node}`].filter(Boolean).join(":");
  const change = to === undefined ? (value === undefined ? "" : `:= ${hexOf(value, width)}`) : `${from === undefined ? "" : `${hexOf(from, width)} `}-> ${hexOf(to, width)}`;
  const frame = id === undefined ? "" : `16#${id.toString(16).toUpperCase().padStart(3, "0")}`;
  const more = Object.entries(rest).filter(([name, it]) => !HIDDEN.has(name) && it !== null && it !== false);
  const words = more.map(([name, it]) => `${name.replaceAll("_", " ")} ${typeof it === "object" ? JSON.stringify(it) : it}`).join(", ");
  const bytes = text === undefined && data !== undefined ? String(data).replace(/(..)(?=.)/g, "$1 ") : "";
  return [place, " ", register ?? address, change, frame, bytes, text, words && (text || change || frame ? `(${words})` : words)].filter(Boolean).join(" ");
}

function head() {
  return h("div", { role: "rowgroup", class: "head" }, h("div", { role: "row", class: "row" }, ["Time", "Kind", "Record"].map((name) => h("span", { role: "columnheader" }, name))));
}

function makeRow() {
  const parts = ["time mono", "kind", "line"].map((name) => h("span", { role: "gridcell", class: `j-${name}` }));
  return Object.assign(h("div", { class: "row" }, parts), { parts });
}

function fillRow(row, record) {
  const [time, kind, line] = row.parts;
  setText(time, seconds(record.time_us));
  setText(kind, record.kind);
  setText(line, record.count > 1 ? `${record.line}  (${record.count} times)` : record.line);
  setAttribute(row, "class", /finding|fault|missed|lost|garbled|refused/.test(record.kind) ? "row wrong" : "row");
}
