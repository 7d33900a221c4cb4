// Page "Registers": blocks, search, and the visible registers with live values.

import { server } from "./api.js";
import { fill, h, later, setAttribute, setText } from "./dom.js";
import { feed } from "./feed.js";
import { RowList } from "./list.js";
import { elementsOf, mapOf, provenanceOf, registerAt } from "./map.js";
import { showError } from "./messages.js";
import { isPinned, onPins, pinned, togglePin } from "./pins.js";
import { showRegister } from "./register.js";
import { counted, decoded, isScalar, isSigned, partsOf, short, signed } from "./values.js";

const MOST = 4_000;
/** Number of characters of a meaning that fit into each width of its column. A cell that the browser need not clip is drawn faster. */
const FITTING = 12;

export function registersPage(root, rest, context) {
  const page = new Registers(root, context);
  page.start(decoded(rest[0])).catch(showError);
  return Object.assign(() => page.end(), { key: (event) => page.key(event) });
}

class Registers {
  open = new Set();
  block = "";
  chosen = null;
  ends = [];

  constructor(root, context) {
    this.context = context;
    this.search = h("input", { type: "search", placeholder: "Search names, meanings, values, addresses", label: "Search registers", "aria-keyshortcuts": "/", spellcheck: false });
    this.search.addEventListener("input", later(120, () => this.maps && this.list()));
    this.search.addEventListener("keydown", (event) => this.maps && this.rows.enterFrom(event, () => this.list()));
    this.context.closeDetail = () => this.closeDetail();
    this.tree = h("nav", { class: "blocks", label: "Blocks" });
    this.count = h("span", { class: "muted", role: "status" });
    this.detail = h("aside", { class: "detail", label: "Register" });
    this.rows = new RowList({
      label: "Registers", columns: "registers", head: headRow(), make: makeRow, key: (item) => item.key,
      fillRow: (row, item) => this.fillRow(row, item),
      onchoose: (item, index, isOpened) => this.choose(item, isOpened),
      onrange: later(60, () => this.follow()),
    });
    fill(root, h("div", { class: "split registers-page" },
      h("div", { class: "side" }, h("div", { class: "searchbar" }, this.search, this.count), this.tree),
      this.rows.element, this.detail));
    root.addEventListener("click", (event) => this.pin(event));
    const refresh = () => this.rows.refresh();
    this.ends.push(...["values", "changes", "clock"].map((event) => feed.on(event, refresh)));
    this.ends.push(onPins(() => {
      this.follow();
      if (this.block === "followed" && !this.search.value) this.list();
      else refresh();
    }));
  }

  async start(block) {
    const plcs = this.context.status?.plcs ?? [];
    this.maps = await Promise.all(plcs.map((plc) => mapOf(plc.plc).then((entries) => ({ ...plc, entries }))));
    this.drawTree();
    const first = this.maps[0]?.entries[0];
    const known = [...this.tree.querySelectorAll("[data-block]")].map((it) => it.dataset.block);
    // The plant may be another one than at the time of the choice, without the followed registers and without the block.
    const hasFollowed = this.followed().length > 0;
    const usual = hasFollowed ? "followed" : first && blockOf(first);
    const typed = this.search.value;
    this.show(known.includes(block) && (block !== "followed" || hasFollowed) ? block : usual);
    // Keeps the text that the user has typed in the meantime.
    if (typed) {
      this.search.value = typed;
      this.list();
    }
  }

  end() {
    feed.leave("registers");
    this.ends.forEach((end) => end());
    this.rows.observer.disconnect();
    this.endDetail?.();
  }

  drawTree() {
    const link = (block, text, note) =>
      h("li", null, h("button", { "data-block": block, onclick: () => this.show(block) }, h("span", null, text), note && h("small", null, note)));
    const parts = this.maps.map(({ plc, device, entries }) => {
      const blocks = new Map(entries.map((entry) => [blockOf(entry), entry]));
      const areas = [...blocks].map(([block, entry]) => link(block, entry.area, entry.structure === entry.area ? "" : entry.structure));
      return h("section", null, h("h2", null, plc, " ", h("small", null, device)), h("ul", null, areas));
    });
    fill(this.tree, h("ul", null, link("followed", "Followed registers", "")), parts);
  }

  show(block) {
    this.block = block;
    this.search.value = "";
    this.context.setRest(encodeURIComponent(block ?? ""));
    this.rows.element.scrollTop = 0;
    this.list();
    this.tree.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });
  }

  /** Marks the block to which the rows belong. The results of a search belong to all blocks. */
  markBlock(block) {
    for (const button of this.tree.querySelectorAll("[data-block]")) {
      if (button.dataset.block === block) setAttribute(button, "aria-current", true);
      else button.removeAttribute("aria-current");
    }
  }

  /** Lists the registers of the chosen block, or the results of the search. */
  list() {
    const text = this.search.value.trim().toLowerCase();
    const items = text ? this.found(text) : this.block === "followed" ? this.followed() : this.ofBlock();
    const end = items.length >= MOST ? `first ${MOST} registers` : counted(items.length, "register");
    setText(this.count, end);
    this.markBlock(text ? null : this.block);
    this.rows.set(items);
    this.empty(items.length === 0, text);
    if (!items.length && text.startsWith("%")) this.listAddress(text);
  }

  /** Returns the register at a complete address; it may be an element of an array. */
  async listAddress(text) {
    const found = await Promise.all(this.maps.map(({ plc }) => registerAt(plc, text).catch(() => null)));
    if (this.search.value.trim().toLowerCase() !== text) return;
    const items = found.filter(Boolean).map(({ key, entry, name }) => ({ ...rowOf(entry, name), key, isFull: true }));
    if (!items.length) return;
    setText(this.count, counted(items.length, "register"));
    this.rows.set(items);
    this.empty(false);
  }

  empty(isEmpty, text) {
    this.note?.remove();
    if (!isEmpty) return;
    const reason = text ? `No register has '${text}' in its name, meaning, values or address.` : "No register is followed. Press the star of a register, or F.";
    this.note = h("p", { class: "empty" }, reason);
    this.rows.element.append(this.note);
  }

  ofBlock() {
    const entries = this.maps.flatMap((map) => map.entries);
    return entries.filter((entry) => blockOf(entry) === this.block).flatMap((entry) => this.rowsOf(entry));
  }

  rowsOf(entry) {
    if (!entry.ranges.length) return [{ key: keyOf(entry, entry.name), entry, name: entry.name }];
    const array = { key: keyOf(entry, entry.name), entry, name: entry.name, isArray: true };
    if (!this.open.has(array.key)) return [array];
    return [array, ...elements(entry)];
  }

  followed() {
    const forms = new Map(this.maps.flatMap((map) => map.entries).map((entry) => [`${entry.plc}:${entry.form}`, entry]));
    const items = pinned().map((key) => {
      const entry = forms.get(key.replace(/\[[^\]]*\]/g, "[]"));
      return entry && { ...rowOf(entry, partsOf(key).name), key, isFull: true };
    });
    return items.filter(Boolean);
  }

  found(text) {
    const entries = this.maps.flatMap((map) => map.entries);
    if (/\[\d/.test(text)) {
      const form = text.replace(/\[[^\]]*\]?/g, "[]");
      const arrays = entries.filter((entry) => entry.ranges.length && entry.form.toLowerCase().includes(form));
      return arrays.flatMap((entry) => elements(entry)).filter((item) => item.name.toLowerCase().includes(text)).slice(0, MOST).map((item) => ({ ...item, isFull: true }));
    }
    const words = text.split(/\s+/);
    const hits = entries.filter((entry) => words.every((word) => entry.search.includes(word)));
    return hits.flatMap((entry) => this.rowsOf(entry)).map((item) => ({ ...item, isFull: true })).slice(0, MOST);
  }

  /** Requests values for the visible registers and the chosen register, and every change of the followed ones among them for plots. */
  follow() {
    const names = this.rows.visible.filter((item) => !item.isArray && isScalar(item.entry.type)).map((item) => item.key);
    if (this.chosen && !this.chosen.isArray) names.unshift(this.chosen.key);
    feed.want("registers", { follow: names.filter(isPinned), values: names });
  }

  choose(item, isOpened) {
    if (item.isArray && isOpened) {
      if (!this.open.delete(item.key)) this.open.add(item.key);
      this.list();
      return;
    }
    if (isOpened) this.detail.classList.add("open");
    if (this.chosen?.key === item.key) return;
    this.chosen = item;
    this.endDetail?.();
    this.endDetail = showRegister(this.detail, item, this.context);
    this.detail.classList.add("open");
    this.follow();
  }

  closeDetail() {
    this.detail.classList.remove("open");
    this.rows.element.focus();
  }

  pin(event) {
    const button = event.target.closest("[data-pin]");
    if (button) togglePin(button.dataset.pin);
  }

  key(event) {
    const item = this.rows.items[this.rows.chosen];
    if (event.key === "/") this.search.select();
    else if (event.key === "Escape" && this.detail.classList.contains("open")) this.closeDetail();
    else if (event.key === "f" && item && !item.isArray) togglePin(item.key);
    else if (event.key === "p") this.detail.querySelector("input[name=value]")?.focus();
    else return false;
    return true;
  }

  /** Fills a row. If the row already shows this register, updates only the parts that can change. */
  fillRow(row, item) {
    if (row.item !== item) this.fillFacts(row, item);
    const { parts } = row;
    setAttribute(parts.pin, "aria-pressed", isPinned(item.key));
    if (!row.hasValue) return;
    const value = feed.values.get(item.key);
    const { type } = item.entry;
    const digits = value ? value.hex : "\u2026";
    if (row.digits !== digits) {
      if (row.digits?.startsWith("16#")) flash(row);
      row.digits = digits;
      setText(parts.value, digits);
      const number = value && isSigned(type) ? String(signed(value.value, type)) : "";
      const text = value?.meaning ?? "";
      const meaning = !number || `${text} `.startsWith(`${number} `) ? text : `${number}  ${text}`.trimEnd();
      setText(parts.meaning, meaning);
      setAttribute(parts.meaning, "class", meaning.length > FITTING ? "meaning" : "meaning whole");
    }
    row.classList.toggle("forced", Boolean(value?.forced));
    setText(parts.age, value?.changedUs !== undefined ? age(Math.max(0, feed.timeUs - value.changedUs)) : "");
  }

  fillFacts(row, item) {
    const { entry } = item;
    const { parts } = row;
    row.item = item;
    row.digits = null;
    row.hasValue = !item.isArray && isScalar(entry.type);
    const prefix = item.isFull && this.maps.length > 1 ? `${entry.plc}:` : "";
    setText(parts.name, prefix + (item.isFull ? item.name : item.name.slice(entry.area.length + 1) || item.name));
    setAttribute(parts.name, "title", item.name);
    setAttribute(row, "class", `row${item.isArray ? " array" : ""}${item.isElement ? " element" : ""}`);
    setText(parts.value, "");
    setText(parts.age, "");
    setText(parts.meaning, item.isArray ? `${this.open.has(item.key) ? "\u25be" : "\u25b8"} ${entry.count} ${entry.type}` : row.hasValue ? "" : entry.type);
    setAttribute(parts.meaning, "class", "meaning");
    setText(parts.owner, entry.owner);
    setText(parts.manual, entry.page ? `p. ${entry.page}` : "");
    const mark = provenanceOf(entry);
    setAttribute(parts.mark, "class", `mark ${mark.mark}`);
    setAttribute(parts.mark, "aria-label", mark.text);
    setAttribute(parts.mark, "title", mark.text);
    parts.pin.hidden = !row.hasValue;
    setAttribute(parts.pin, "data-pin", item.key);
    setAttribute(parts.pin, "aria-label", `Follow ${item.name}`);
  }
}

const blockOf = (entry) => `${entry.plc}:${entry.area}:${entry.structure}`;
const keyOf = (entry, name) => `${entry.plc}:${name}`;

const elements = (entry) =>
  [...elementsOf(entry)].map(([name, bytes]) => ({ key: keyOf(entry, name), entry, name, bytes, isElement: true }));

/** Creates the row of a register or of an array element from its name. */
const rowOf = (entry, name) => (entry.ranges.length && elements(entry).find((item) => item.name === name)) || { key: keyOf(entry, name), entry, name };

const AGE_STEP_US = 100_000;

/** Formats the age of a value. With a real-time clock the age is rounded: users cannot read digits that change in each frame, and the browser needs a layout for each row. */
const age = (us) => (feed.isStepped ? short(us) : us < AGE_STEP_US ? `<${short(AGE_STEP_US)}` : short(us - (us % AGE_STEP_US)));

/** Highlights a change. A value that changes all the time does not flash. */
function flash(row) {
  const now = performance.now();
  const since = now - (row.flashed ?? -Infinity);
  row.flashed = now;
  if (since < 1_000 || matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  row.parts.value.animate([{ backgroundColor: "var(--flash)" }, { backgroundColor: "transparent" }], { duration: 600 });
}

function headRow() {
  const names = ["", "Name", "Value", "Meaning", "Age", "Writer", "Page", ""];
  const labels = ["Follow", "Name", "Value", "Meaning", "Age: emulated time since the last change that this page has seen", "Writer", "Page of the manual", "Source of the facts"];
  const cells = names.map((name, at) => h("span", { role: "columnheader", title: labels[at] }, name || h("span", { class: "hidden" }, labels[at])));
  return h("div", { role: "rowgroup", class: "head" }, h("div", { role: "row", class: "row" }, cells));
}

function makeRow() {
  const cell = (name, content) => h("span", { role: "gridcell", class: name }, content);
  const pin = h("button", { class: "star", tabIndex: -1 }, "\u2605");
  const mark = h("span", { role: "img" });
  const parts = { pin, mark };
  for (const name of ["name", "value", "meaning", "age", "owner", "manual"]) parts[name] = cell(name);
  const row = h("div", { class: "row" }, cell("pin", pin), parts.name, parts.value, parts.meaning, parts.age, parts.owner, parts.manual, cell("source", mark));
  row.parts = parts;
  return row;
}
