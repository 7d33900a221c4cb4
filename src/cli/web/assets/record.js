// The recorder: actions of the user become a scenario that `commram test` can run.

import { post, server } from "./api.js";
import { fill, h } from "./dom.js";
import { feed } from "./feed.js";
import { ask, openDialog } from "./dialogs.js";
import { showNote } from "./messages.js";
import { seconds, short } from "./values.js";

/** Operations that a scenario does not repeat. */
const IGNORED = new Set(["save", "forget", "door_open", "door_close", "set_speed", "stop"]);

export const recorder = { isOn: false, actions: [] };
const listeners = new Set();

/** Where this tab keeps the recording when it is loaded again, and the process of the emulator. */
let kept = null;

/** Calls `listener` when something has been recorded. Returns a function that ends it. */
export function onRecord(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}
const changed = () => listeners.forEach((listener) => listener());

/** Another instance, or the page was loaded again: takes up the recording that this tab has kept of the same process. */
export function loadRecord() {
  keep();
  const { pid } = server.instances.find((it) => it.name === server.instance) ?? {};
  kept = { place: `commram.recording.${server.instance}`, pid };
  const old = JSON.parse(sessionStorage.getItem(kept.place), (_, part) => (part?.bigint ? BigInt(part.bigint) : part));
  const { isOn, actions } = old?.pid === pid && pid ? old : { isOn: false, actions: [] };
  Object.assign(recorder, { isOn, actions });
  changed();
}

function keep() {
  if (!kept) return;
  const text = JSON.stringify({ pid: kept.pid, ...recorder }, (_, part) => (typeof part === "bigint" ? { bigint: String(part) } : part));
  sessionStorage.setItem(kept.place, text);
}

addEventListener("pagehide", keep);

/** Begins a new recording, or ends it. A scenario begins at power-on, so the plant goes back to it first. */
export function toggleRecord() {
  if (recorder.isOn) return endRecord();
  const text = feed.isStepped
    ? "A scenario begins at power-on, and repeats everything since then. The recorder therefore goes back to the start; what was done since then is lost."
    : "A scenario begins at power-on. The clock of this emulator runs in real time, so the scenario can only repeat what you do from now on.";
  ask("Record a scenario", [h("p", null, text)], feed.isStepped ? "Go back and record" : "Record", async () => {
    if (feed.isStepped) feed.noticeTime((await post("back_to_start", { detached: false })).time);
    begin();
  });
}

function begin() {
  Object.assign(recorder, { isOn: true, actions: [] });
  changed();
}

function endRecord() {
  recorder.isOn = false;
  changed();
  showRecord();
}

/** Time after an operation, from its reply. */
const endOf = (reply) => reply?.time ?? reply?.waited?.time_us;

/** Adds an action that the emulator has executed. `register`: the name that the scenario uses. */
export function addToRecord({ operation, operations, fields, register, words, reply, replies, beforeUs }) {
  if (!recorder.isOn) return;
  if (operation === "set_parameter") return queueMicrotask(() => showNote("Not recorded: scenarios have no verb for parameters of drives"));
  if (IGNORED.has(operation)) return;
  if (operation === "advance" && mergeSteps(fields.us, reply.time)) return changed();
  const forms = operations ?? [fields && Object.keys(fields).length ? { [operation]: { ...fields } } : operation];
  const all = replies ?? [reply];
  forms.forEach((form, at) => {
    const isLast = at === forms.length - 1;
    recorder.actions.push({ time_us: beforeUs, end_us: endOf(all[at]), operation: form, register: isLast ? register : undefined, words: isLast ? words : null });
  });
  changed();
}

/** Adds a step to the last action if it is a step, too. */
function mergeSteps(us, endUs) {
  const last = recorder.actions.at(-1);
  const step = last?.operation?.advance;
  if (!step) return false;
  step.us += us;
  last.end_us = endUs;
  last.words = `step ${short(step.us)}`;
  return true;
}

/** Adds an expectation: the register has this value at this time. `note` explains it. */
export function expectValue(name, value, note) {
  recorder.actions.push({ time_us: feed.timeUs, expect: { register: name, value }, words: `expect ${name} = ${value}${note ? `, ${note}` : ""}` });
  changed();
}

/** The recorded actions in groups of those that the user did at once; only the last one of a group has words. */
function groups() {
  const found = [];
  recorder.actions.forEach(({ words, time_us }, at) => words && found.push({ words, time_us, begin: found.at(-1)?.end ?? 0, end: at + 1 }));
  return found;
}

/** Shows the recorded actions and their scenario. */
export function showRecord() {
  const list = h("ol", { class: "recorded" });
  const text = h("pre", { class: "code", tabIndex: 0, "aria-label": "Scenario" });
  const name = h("input", { value: "recorded", pattern: "[a-z0-9_\\-]+", spellcheck: false });
  const plant = h("input", { value: "plant.toml", spellcheck: false });
  const make = async () => {
    try {
      const actions = recorder.actions.map(({ words, ...action }) => action);
      const { scenario } = await post("scenario", { name: name.value, actions, plant: feed.isStepped ? undefined : plant.value });
      fill(text, scenario);
      error.textContent = "";
      save.disabled = false;
    } catch (problem) {
      const at = groups().findIndex(({ end }) => problem.document?.index < end);
      error.textContent = problem.message.replace(/^action \d+/, `Action ${at + 1}`);
      save.disabled = true;
    }
  };
  const save = h("button", { type: "button", class: "primary", disabled: true, onclick: () => download(`${name.value}.rhai`, text.textContent) }, "Download");
  const error = h("p", { class: "error", role: "alert" });
  const row = ({ words, time_us, begin, end }, index) =>
    h("li", null, h("span", { class: "mono" }, seconds(time_us)), " ", words, " ",
      h("button", { type: "button", class: "plain", "aria-label": `Delete action ${index + 1}`, onclick: () => { recorder.actions.splice(begin, end - begin); draw(); changed(); } }, "\u00d7"));
  const draw = () => {
    fill(list, groups().map(row));
    if (recorder.actions.length) make();
    else fill(text, "Nothing was recorded. Press Record, then poke, force, step, set switches, and add expectations in Registers.");
  };
  name.addEventListener("change", make);
  plant.addEventListener("change", make);
  openDialog("Recorded scenario", h("div", { class: "stack" },
    h("p", null, "Run the file with ", h("code", null, "commram test FILE"), "."), list,
    h("div", { class: "line" }, h("label", null, "Name ", name), !feed.isStepped && h("label", null, "Plant file ", plant), save), error, text), { isWide: true });
  draw();
}

function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  const link = h("a", { href: url, download: name });
  link.click();
  URL.revokeObjectURL(url);
  showNote(`${name} of instance ${server.instance} is downloaded`);
}
