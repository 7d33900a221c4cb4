// The recorder: actions of the user become a scenario that `commram test` can run.

import { post, server } from "./api.js";
import { fill, h } from "./dom.js";
import { feed } from "./feed.js";
import { ask, openDialog } from "./dialogs.js";
import { showError, showNote } from "./messages.js";
import { seconds, short } from "./values.js";

/** Operations that a scenario does not repeat. */
const IGNORED = new Set(["save", "forget", "door_open", "door_close", "stop"]);

export const recorder = { isOn: false, actions: [] };
const listeners = new Set();

/** Calls `listener` when something has been recorded. */
export const onRecord = (listener) => listeners.add(listener);
const changed = () => listeners.forEach((listener) => listener());

/** Begins a new recording, or ends it. A scenario begins at power-on, so the plant goes back to it first. */
export function toggleRecord() {
  if (recorder.isOn) return endRecord();
  if (feed.timeUs === 0) return begin();
  const text = feed.isStepped
    ? "A scenario begins at power-on, and repeats everything since then. The recorder therefore goes back to the time 0; what has happened since then is lost."
    : "A scenario begins at power-on. The clock of this emulator runs in real time, so the scenario can only repeat what you do from now on.";
  ask("Record a scenario", [h("p", null, text)], feed.isStepped ? "Go back and record" : "Record", async () => {
    if (feed.isStepped) feed.noticeTime((await post("back", { us: feed.timeUs, detached: false })).time);
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

/** Adds an expectation: the register has this value at this time. */
export function expectValue(name, register) {
  recorder.actions.push({
    time_us: feed.timeUs,
    expect: { register: name, value: register.hex },
    words: `expect ${name} = ${register.hex}${register.meaning ? `, ${register.meaning}` : ""}`,
  });
  changed();
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
      save.disabled = false;
    } catch (problem) {
      const index = problem.document?.index;
      showError(index === undefined ? problem : new Error(`action ${index + 1}: ${problem.message}`));
    }
  };
  const save = h("button", { type: "button", class: "primary", disabled: true, onclick: () => download(`${name.value}.rhai`, text.textContent) }, "Download");
  const row = (action, index) =>
    h("li", null, h("span", { class: "mono" }, seconds(action.time_us)), " ", action.words, " ",
      h("button", { type: "button", class: "plain", "aria-label": `Delete action ${index + 1}`, onclick: () => { recorder.actions.splice(index, 1); draw(); changed(); } }, "\u00d7"));
  const draw = () => {
    fill(list, recorder.actions.map((action, index) => action.words && row(action, index)));
    if (recorder.actions.length) make();
    else fill(text, "Nothing was recorded. Press Record, then poke, force, step, set switches, and add expectations in Registers.");
  };
  name.addEventListener("change", make);
  plant.addEventListener("change", make);
  openDialog("Recorded scenario", h("div", { class: "stack" },
    h("p", null, "Run the file with ", h("code", null, "commram test FILE"), "."), list,
    h("div", { class: "line" }, h("label", null, "Name ", name), !feed.isStepped && h("label", null, "Plant file ", plant), save), text), { isWide: true });
  draw();
}

function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  const link = h("a", { href: url, download: name });
  link.click();
  URL.revokeObjectURL(url);
  showNote(`${name} of instance ${server.instance} is downloaded`);
}
