// Page "Followed": the followed registers as a plot, and every change of them in order.

import { readPast } from "./api.js";
import { fill, h, perFrame, setAttribute, setText } from "./dom.js";
import { Chart } from "./chart.js";
import { shortName } from "./conditions.js";
import { feed, keyOf } from "./feed.js";
import { RowList } from "./list.js";
import { entryOf } from "./map.js";
import { showError } from "./messages.js";
import { onPins, pinned, togglePin } from "./pins.js";
import { digits, duration, hex, partsOf, seconds, short, signed } from "./values.js";

const LANES = 12;
/** Maximum number of changes in the list, and of points of a register. */
const KEPT = 20_000;
/** Number of journal records that are searched for earlier changes. */
const PAST = 8_192;

export function followedPage(root, rest, context) {
  const page = new FollowedPage(root, context);
  const draw = () => page.draw();
  const offs = ["values", "clock"].map((event) => feed.on(event, draw));
  offs.push(feed.onEach("changes", ({ changes }) => page.take(changes)), feed.onEach("turned", () => page.readAgain()));
  offs.push(onPins(() => page.start()));
  page.start();
  return () => {
    page.isOpen = false;
    offs.forEach((off) => off());
    feed.leave("followed");
    page.rows.observer.disconnect();
  };
}

class FollowedPage {
  isOpen = true;
  /** The followed registers that the plant has. */
  names = [];
  points = new Map();
  changes = [];
  /** Length of the plot's time axis in emulated time, in microseconds. */
  spanUs = 100_000;

  constructor(root, context) {
    this.context = context;
    this.span = h("input", { class: "mono", value: short(this.spanUs), size: 6, label: "Time on the plot" });
    this.span.addEventListener("change", () => this.setSpan());
    this.chart = new Chart({ label: "Followed registers over emulated time; the list of changes has the same content" });
    this.list = h("ul", { class: "chips" });
    this.hint = h("small", { class: "grow", hidden: true }, "A line begins where this page has begun to follow the register. For earlier changes, start the emulator with ", h("code", null, "--record"), ".");
    this.rows = new RowList({ label: "Changes", columns: "changes", head: head(), make: makeRow, fillRow: (row, change, index) => this.fillRow(row, change, index), rowHeight: 28 });
    this.note = h("p", { class: "empty", hidden: true }, "No change of a followed register is known yet.");
    this.rows.element.append(this.note);
    this.stick = h("input", { type: "checkbox", checked: true });
    this.rows.element.addEventListener("wheel", (event) => event.deltaY < 0 && (this.stick.checked = false), { passive: true });
    this.draw = perFrame(() => this.drawNow());
    fill(root, h("section", { class: "box chartbox" }, h("header", { class: "boxhead" }, h("h2", null, "Plot"), h("label", { class: "line" }, "last ", this.span), this.hint), this.chart.element, this.list),
      h("div", { class: "line" }, h("h2", { class: "grow" }, "Changes"), h("label", { class: "line" }, this.stick, "Latest")), this.rows.element);
  }

  /** Follows the chosen registers. The plant may be another one than at the time of the choice, and may not have all of them. */
  async start() {
    const chosen = pinned();
    const entryFor = (key) => entryOf(partsOf(key).plc, partsOf(key).name).catch(() => null);
    const entries = await Promise.all(chosen.map(entryFor));
    if (!this.isOpen || `${chosen}` !== `${pinned()}`) return;
    this.names = chosen.filter((_, at) => entries[at]);
    feed.want("followed", { follow: this.names });
    const chip = (key) => {
      const at = this.names.indexOf(key);
      const name = at < 0 ? `${shortName(key)} (not in this plant)` : shortName(key);
      return h("li", { class: at < 0 ? "chip muted" : `chip k${at % 6}` }, h("span", { class: "mono" }, name), h("button", { class: "plain", label: `Stop following ${key}`, onclick: () => togglePin(key) }, "\u00d7"));
    };
    fill(this.list, chosen.length ? chosen.map(chip) : h("li", { class: "muted" }, "No register is followed. Press the star of a register on the page Registers."));
    this.readAgain();
  }

  /** Shows the changes of registers that the journal records (`run --record`), and the changes that the page has received. */
  async readAgain() {
    this.recorded = new Map();
    this.reset(feed.changes);
    try {
      // A change between the end of the past and the begin of the stream would be lost, so the stream begins first.
      await feed.opened();
      const { beginUs, changes: past } = await changesInJournal();
      for (const change of past) this.recorded.set(keyOf(change), beginUs);
      const key = (change) => `${keyOf(change)} ${change.time_us} ${numberOf(change.after)}`;
      const seen = new Set(feed.changes.map(key));
      const earlier = past.filter((change) => !seen.has(key(change)));
      if (earlier.length) this.reset([...earlier, ...feed.changes].sort((one, other) => one.time_us - other.time_us));
    } catch (problem) {
      if (!feed.hasEnded) showError(problem);
    }
  }

  reset(changes) {
    this.changes = [];
    this.points = new Map(this.names.map((key) => [key, []]));
    this.take(changes);
  }

  /** Adds changes to the list and to the points of each register. */
  take(changes) {
    for (const change of changes) {
      const points = this.points.get(keyOf(change));
      if (!points) continue;
      this.changes.push(change);
      if (!points.length) points.push([Math.min(this.beginOf(change), change.time_us), numberOf(change.before)]);
      points.push([change.time_us, numberOf(change.after)]);
    }
    if (this.changes.length > KEPT * 1.25) this.changes = this.changes.slice(-KEPT);
    for (const points of this.points.values()) if (points.length > KEPT * 1.25) points.splice(0, points.length - KEPT);
    this.draw();
  }

  /** Returns the time from which all changes of a register are known. */
  beginOf(change) {
    const key = keyOf(change);
    return this.recorded.get(key) ?? feed.values.get(key)?.sinceUs ?? change.time_us;
  }

  drawNow() {
    this.rows.set(this.changes);
    if (this.stick.checked) {
      this.rows.element.scrollTop = this.rows.element.scrollHeight;
      this.rows.draw();
    }
    const from = Math.max(0, feed.timeUs - this.spanUs);
    const lanes = this.names.slice(0, LANES).map((key) => laneOf(key, this.points.get(key), from));
    this.hint.hidden = !lanes.some(({ points }) => points[0]?.[0] > from);
    this.chart.lanes(from, from + this.spanUs, lanes);
    this.note.hidden = this.changes.length > 0;
  }

  /** Uses the time that the user has entered. Refuses an invalid time. */
  setSpan() {
    try {
      const us = duration(this.span.value);
      if (!us) throw new Error("The time on the plot is at least 1us");
      this.spanUs = us;
    } catch (error) {
      showError(error);
    }
    this.span.value = short(this.spanUs);
    this.draw();
  }

  fillRow(row, change, index) {
    const [time, since, name, before, after, by] = row.parts;
    const previous = this.rows.items[index - 1];
    setText(time, seconds(change.time_us));
    setText(since, previous ? `+${short(change.time_us - previous.time_us)}` : "");
    setText(name, shortName(keyOf(change)));
    setText(before, change.before);
    setText(after, change.meaning ? `${change.after}  ${change.meaning}` : change.after);
    setText(by, change.by ?? "");
    setAttribute(row, "class", "row");
    const at = this.names.indexOf(keyOf(change));
    setAttribute(name, "class", `mono t${at % 6}`);
  }
}

/** Returns the changes of recorded registers in the last records of the journal, in the form of events, and the time of the first record. */
async function changesInJournal() {
  const records = await readPast(PAST);
  const found = records.filter((record) => record.kind === "changed" && record.register);
  const changes = found.map(({ time_us, plc, register, width, from, to, text, by }) => ({ time_us, plc, register, before: digits(from, width), after: digits(to, width), meaning: text, by }));
  return { beginUs: records[0]?.seq ? records[0].time_us : 0, changes };
}

const numberOf = (value) => parseInt(value.slice(3), 16);

/** Returns the points of a register, beginning with the last point before the plot. */
function laneOf(key, all, from) {
  const value = feed.values.get(key);
  let first = all.length;
  while (first > 0 && (first === all.length || all[first][0] > from)) first -= 1;
  const type = value?.type ?? "DWORD";
  const known = all.length ? all.slice(first) : value?.sinceUs === undefined ? [] : [[value.sinceUs, value.value]];
  const points = known.map(([time, number]) => [time, signed(number, type)]);
  if (points.length) points.push([feed.timeUs, points.at(-1)[1]]);
  return { points, text: (number) => (Number.isFinite(number) ? hex(number, type).slice(3) : "") };
}

function head() {
  return h("div", { role: "rowgroup", class: "head" }, h("div", { role: "row", class: "row" }, ["Time", "After", "Register", "Before", "Value", "Writer"].map((name) => h("span", { role: "columnheader" }, name))));
}

function makeRow() {
  const parts = ["mono", "mono since", "mono", "mono before", "mono", "by"].map((name) => h("span", { role: "gridcell", class: name }));
  return Object.assign(h("div", { class: "row" }, parts), { parts });
}
