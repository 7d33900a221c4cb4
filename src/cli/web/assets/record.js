// The recorder: actions of the user become a scenario that `commram test` can run.

import { post, server } from "./api.js";
import { fill, h } from "./dom.js";
import { feed } from "./feed.js";
import { ask, openDialog } from "./dialogs.js";
import { forgetForeign, foreignText, noteOwn, watchForeign } from "./foreign.js";
import { showNote } from "./messages.js";
import { counted, seconds, short } from "./values.js";

/** Operations that a scenario does not repeat. */
const IGNORED = new Set(["save", "forget", "door_open", "door_close", "set_speed", "stop"]);

/** Stores of other programs are in `foreign`, as `{time_us, register}`. */
export const recorder = { isOn: false, actions: [], foreign: [] };
const listeners = new Set();

/** Key under which this tab stores the recording in case of a reload, and the process id of the emulator. */
let kept = null;

/** Calls `listener` when the recording has changed. Returns a function that ends these calls. */
export function onRecord(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}
const changed = () => listeners.forEach((listener) => listener());

/** Continues the recording that this tab has stored, for another instance or after a reload. The recording ends if its emulator process has ended. */
export function loadRecord() {
  keep();
  const { pid } = server.instances.find((it) => it.name === server.instance) ?? {};
  kept = { place: `commram.recording.${server.instance}`, pid };
  const old = JSON.parse(sessionStorage.getItem(kept.place), (_, part) => (part?.bigint ? BigInt(part.bigint) : part));
  const { isOn = false, actions = [], foreign = [] } = old ?? {};
  Object.assign(recorder, { isOn: isOn && old.pid === pid, actions, foreign });
  watch();
  changed();
}

function keep() {
  if (!kept) return;
  const text = JSON.stringify({ pid: kept.pid, ...recorder }, (_, part) => (typeof part === "bigint" ? { bigint: String(part) } : part));
  sessionStorage.setItem(kept.place, text);
}

addEventListener("pagehide", keep);

/** While a recording runs, watches what other programs store and whether they go back in time, even while the page is hidden. */
function watch() {
  feed.keepsOpen = recorder.isOn;
  watchForeign(recorder, changed);
}

feed.onEach("turned", ({ time_us }) => {
  if (!recorder.isOn || performance.now() - turnedAt < OWN_TURN_MS) return;
  undo(time_us);
  changed();
});

/** Begins a new recording, or ends it. A scenario begins at power-on, so the plant first goes back to power-on. */
export function toggleRecord() {
  if (recorder.isOn) return endRecord();
  const old = recorder.actions.length > 0 && h("p", { class: "error" }, `The recording with ${counted(groups().length, "action")} is replaced. To keep it, cancel, and download it with the button "Scenario".`);
  const text = feed.isStepped
    ? "A scenario begins at power-on, and repeats everything since then. The recorder therefore goes back to the start; what was done since then is lost."
    : "A scenario begins at power-on. The clock of this emulator runs in real time, so the scenario can only repeat what you do from now on.";
  ask("Record a scenario", [h("p", null, text), old], feed.isStepped ? "Go back and record" : "Record", async () => {
    if (feed.isStepped) feed.noticeTime((await post("back_to_start", { detached: false })).time);
    begin();
  });
}

function begin() {
  Object.assign(recorder, { isOn: true, actions: [], foreign: [] });
  forgetForeign();
  watch();
  changed();
}

function endRecord() {
  recorder.isOn = false;
  watch();
  changed();
  showRecord();
}

/** Returns the emulated time after an operation, from its reply. */
const endOf = (reply) => reply?.time ?? reply?.waited?.time_us;

/** Adds an action that the emulator has executed. `register`: the name that the scenario uses. */
export function addToRecord({ operation, operations, fields, register, words, reply, replies, beforeUs }) {
  if (!recorder.isOn) return;
  if (operation === "set_parameter") return queueMicrotask(() => showNote("Not recorded: scenarios have no verb for parameters of drives"));
  if (IGNORED.has(operation)) return;
  if (operation === "advance" && mergeSteps(fields.us, beforeUs, reply.time)) return changed();
  const forms = operations ?? [fields && Object.keys(fields).length ? { [operation]: { ...fields } } : operation];
  const all = replies ?? [reply];
  if (/^back/.test(operation) || forms.at(-1).back_until) {
    turnedAt = performance.now();
    // `back_to_start` also undoes actions at the time 0.
    undo(operation === "back_to_start" ? -1 : endOf(all.at(-1)));
    return changed();
  }
  forms.forEach((form) => form.poke && noteOwn(form.poke));
  forms.forEach((form, at) => {
    const isLast = at === forms.length - 1;
    recorder.actions.push({ time_us: beforeUs, end_us: endOf(all[at]), operation: form, register: isLast ? register : undefined, words: isLast ? words : null });
  });
  changed();
}

/** Real time at which this page last made the plant go back, and the longest time until the server reports this; in
/** milliseconds. */
let turnedAt = -Infinity;
const OWN_TURN_MS = 500;

/** Removes the actions after the time to which the plant has gone back. An action that ended later becomes a step up to that time. */
function undo(toUs) {
  recorder.foreign = recorder.foreign.filter((it) => it.time_us <= toUs);
  const step = (us, from) => [{ time_us: from, end_us: toUs, operation: { advance: { us } }, words: `step ${short(us)}` }];
  const left = (it) => (it.endUs <= toUs ? it.actions : it.time_us < toUs ? step(toUs - it.time_us, it.time_us) : []);
  recorder.actions = groups().flatMap(left);
}

/** Adds a step to the last action, if that action is a step that ended at the present time. */
function mergeSteps(us, beforeUs, endUs) {
  const last = recorder.actions.at(-1);
  const step = last?.operation?.advance;
  if (!step || last.end_us !== beforeUs) return false;
  step.us += us;
  last.end_us = endUs;
  last.words = `step ${short(step.us)}`;
  return true;
}

/** Adds an expectation: the register has this value at this time. `note` explains the expectation. `isFalse`: the register has another value now. */
export function expectValue(name, value, note, isFalse) {
  recorder.actions.push({ time_us: feed.timeUs, expect: { register: name, value }, words: `expect ${name} = ${value}${note ? `, ${note}` : ""}`, isFalse });
  changed();
}

/** Returns the recorded actions in groups; a group is one action of the user. Only the last action of a group has words. */
function groups() {
  const found = [];
  recorder.actions.forEach(({ words, isFalse }, at) => {
    if (!words) return;
    const begin = found.at(-1)?.end ?? 0;
    const actions = recorder.actions.slice(begin, at + 1);
    found.push({ words, isFalse, actions, begin, end: at + 1, time_us: actions[0].time_us, endUs: Math.max(...actions.map((it) => it.end_us ?? it.time_us)) });
  });
  return found;
}

function shift(actions, us) {
  for (const action of actions) {
    action.time_us += us;
    if (action.end_us !== undefined) action.end_us += us;
  }
}

/** Swaps group `at` with the next one. Both groups keep their durations, and the pair keeps its begin and end. */
function swap(at) {
  const [one, other] = groups().slice(at);
  shift(other.actions, one.time_us - other.time_us);
  shift(one.actions, other.endUs - one.endUs);
  recorder.actions.splice(one.begin, other.end - one.begin, ...other.actions, ...one.actions);
}

/** Deletes a group. The later actions move forward by its duration. */
function remove(at) {
  const { begin, end, time_us, endUs } = groups()[at];
  shift(recorder.actions.slice(end), time_us - endUs);
  recorder.actions.splice(begin, end - begin);
}

export function showRecord() {
  const list = h("ol", { class: "recorded" });
  const text = h("pre", { class: "code", tabIndex: 0, label: "Scenario" });
  const name = h("input", { value: "recorded", pattern: "[a-z0-9_\\-]+", spellcheck: false });
  const plant = h("input", { value: "plant.toml", spellcheck: false });
  const make = async () => {
    try {
      const actions = recorder.actions.map(({ words, isFalse, ...action }) => action);
      const { scenario } = await post("scenario", { name: name.value, actions, plant: feed.isStepped ? undefined : plant.value });
      const foreign = foreignText(recorder.foreign);
      fill(text, foreign && `// ${foreign}\n`, scenario);
      error.textContent = "";
      save.disabled = copy.disabled = false;
    } catch (problem) {
      const at = groups().findIndex(({ end }) => problem.document?.index < end);
      error.textContent = problem.message.replace(/^action \d+/, `Action ${at + 1}`);
      save.disabled = copy.disabled = true;
    }
  };
  const save = h("button", { class: "primary", disabled: true, onclick: () => make().then(() => save.disabled || download(`${name.value}.rhai`, text.textContent)) }, "Download");
  const copy = h("button", { disabled: true, onclick: () => make().then(() => copy.disabled || copyText(text)) }, "Copy");
  const error = h("p", { class: "error", role: "alert" });
  // Buttons of a row: up, down, delete. The focus stays at the button, in the row of the same action.
  const edit = (work, at, button) => () => {
    work();
    draw();
    changed();
    const buttons = [...(list.children[Math.min(at, list.children.length - 1)]?.querySelectorAll("button") ?? [])];
    [buttons[button], ...buttons].find((it) => it && !it.disabled)?.focus();
  };
  const button = (sign, label, disabled, onclick) => h("button", { class: "plain", label, title: label, disabled, onclick }, sign);
  const row = ({ words, time_us, isFalse }, at, all) =>
    h("li", { class: isFalse ? "warn" : "" }, h("span", { class: "mono" }, seconds(time_us)), " ", words, " ",
      button("\u2191", `Move action ${at + 1} up`, at === 0, edit(() => swap(at - 1), at - 1, 0)),
      button("\u2193", `Move action ${at + 1} down`, at + 1 === all.length, edit(() => swap(at), at + 1, 1)),
      button("\u00d7", `Delete action ${at + 1}`, false, edit(() => remove(at), at, 2)));
  const draw = () => {
    fill(list, groups().map(row));
    if (recorder.actions.length) make();
    else fill(text, "Nothing was recorded. Press Record, then poke, force, step, set switches, and add expectations in Registers.");
  };
  name.addEventListener("change", make);
  plant.addEventListener("change", make);
  openDialog("Recorded scenario", h("div", { class: "stack" },
    h("p", null, "Run the file with ", h("code", null, "commram test FILE"), "."), list,
    h("div", { class: "line" }, h("label", null, "Name ", name), !feed.isStepped && h("label", null, "Plant file ", plant), save, copy), error, text), { isWide: true });
  draw();
}

/** Copies the text of `element` to the clipboard. Browsers allow this only at HTTPS and loopback addresses; at other addresses the text is selected. */
function copyText(element) {
  const selectText = () => {
    getSelection().selectAllChildren(element);
    showNote("The browser does not allow this page to use the clipboard. The text is selected: copy it with Ctrl+C.");
  };
  if (!navigator.clipboard) return selectText();
  return navigator.clipboard.writeText(element.textContent).then(() => showNote("The scenario is in the clipboard"), selectText);
}

function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  const link = h("a", { href: url, download: name });
  link.click();
  URL.revokeObjectURL(url);
  showNote(`${name} of instance ${server.instance} is downloaded`);
}
