// The recorder: actions of the user become a scenario that `commram test` can run.

import { post, server } from "./api.js";
import { fill, h } from "./dom.js";
import { feed } from "./feed.js";
import { openDialog } from "./dialogs.js";
import { showError, showNote } from "./messages.js";
import { seconds, short } from "./values.js";

/** Operations that a scenario does not repeat. */
const IGNORED = new Set(["save", "forget", "door_open", "door_close", "stop"]);

export const recorder = { isOn: false, actions: [], startUs: 0 };
const listeners = new Set();

/** Calls `listener` when something has been recorded. */
export const onRecord = (listener) => listeners.add(listener);
const changed = () => listeners.forEach((listener) => listener());

/** Begins a new recording, or ends it. */
export function toggleRecord() {
  recorder.isOn = !recorder.isOn;
  if (recorder.isOn) Object.assign(recorder, { actions: [], startUs: feed.timeUs });
  changed();
  if (!recorder.isOn) showRecord();
}

/** Adds an action that the emulator has executed. */
export function addToRecord({ operation, operations, fields, words, beforeUs }) {
  if (!recorder.isOn || IGNORED.has(operation)) return;
  if (operation?.startsWith("back")) return cutAfter(words);
  if (operation === "advance" && mergeSteps(fields.us)) return changed();
  const forms = operations ?? [{ [operation]: { ...fields } }];
  recorder.actions.push({ time_us: beforeUs, ...(forms.length === 1 ? { operation: forms[0] } : { operations: forms }), words });
  changed();
}

/** Adds a step to the last action if it is a step, too. */
function mergeSteps(us) {
  const last = recorder.actions.at(-1);
  const step = last?.operation?.advance;
  if (!step) return false;
  step.us += us;
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

/** Going back deletes what was recorded after the new time, as it never happened. */
function cutAfter(words) {
  const count = recorder.actions.length;
  setTimeout(() => {
    recorder.actions = recorder.actions.filter((action) => action.time_us < feed.timeUs);
    showNote(`${words}: ${count - recorder.actions.length} recorded actions after this time are deleted`);
    changed();
  }, 200);
}

/** Shows the recorded actions and their scenario. */
export function showRecord() {
  const list = h("ol", { class: "recorded" });
  const text = h("pre", { class: "code", tabIndex: 0, "aria-label": "Scenario" });
  const name = h("input", { value: "recorded", pattern: "[a-z0-9_\\-]+", spellcheck: false });
  const make = async () => {
    try {
      const actions = recorder.actions.map(({ words, ...action }) => action);
      const { scenario } = await post("scenario", { name: name.value, actions, end_us: feed.timeUs });
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
    fill(list, recorder.actions.map(row));
    if (recorder.actions.length) make();
    else fill(text, "Nothing was recorded. Press Record, then poke, force, step, set switches, and add expectations in Registers.");
  };
  name.addEventListener("change", make);
  openDialog("Recorded scenario", h("div", { class: "stack" },
    h("p", null, "Run it with ", h("code", null, `commram test ${"FILE"}`), " on the same plant file."), list,
    h("div", { class: "line" }, h("label", null, "Name ", name), save), text), { isWide: true });
  draw();
}

function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  const link = h("a", { href: url, download: name });
  link.click();
  URL.revokeObjectURL(url);
  showNote(`${name} of instance ${server.instance} is downloaded`);
}
