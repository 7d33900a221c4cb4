// The clock bar: emulated time, the controls of a stepped clock, and the speed of a real-time clock.

import { act, actTogether, guard, whyDisabled } from "./actions.js";
import { operationsFor } from "./api.js";
import { conditionsOf, failureOf } from "./conditions.js";
import { ask } from "./dialogs.js";
import { field, fill, h, oneAtATime, setText } from "./dom.js";
import { feed } from "./feed.js";
import { showError } from "./messages.js";
import { duration, seconds, short } from "./values.js";

const root = document.getElementById("clock");
/** "Run" advances the clock in parts: real time between two parts, and emulated time of a part at speed 1, in microseconds. */
const PART_MS = 50;
/** Speeds that a real-time clock can be set to with one press. */
const SPEEDS = [0.1, 1, 10, 100];
/** Minimum time between two drawings of a real-time clock's time, in milliseconds: a user cannot read digits that
/** change faster, and each drawing costs processor time. */
const TIME_MS = 100;
let parts = null;
let running = null;
const showTime = oneAtATime(TIME_MS, () => parts && setText(parts.time, seconds(feed.timeUs)));

/** Builds the bar once. */
export function startClock() {
  feed.on("clock", update);
  feed.on("ended", update);
}

/** Resets the bar for another instance. */
export function resetClock() {
  stopRunning();
  parts = null;
  fill(root);
}

function update() {
  if (!feed.clock) return;
  const kind = feed.isStepped ? "stepped" : "real time";
  if (parts?.kind !== kind) build(kind);
  if (feed.isStepped) setText(parts.time, seconds(feed.timeUs));
  else showTime();
  const { waits_for, speed } = feed.clock;
  const speedText = speed === 0 ? ", paused" : speed && speed !== 1 ? `, speed ${speed}` : "";
  setText(parts.state, waits_for ? `waits for ${waits_for}` : feed.isStepped ? (running ? "stepped, running" : "stepped") : `real time${speedText}`);
  if (feed.isStepped) parts.run.setAttribute("aria-pressed", running !== null);
  else showSpeed(speed);
  guard(root);
}

function build(kind) {
  const time = h("output", { class: "time mono", "aria-live": "off", "aria-label": "Emulated time" });
  const state = h("span", { class: "kind" });
  parts = { kind, time, state };
  const face = h("div", { class: "face" }, time, state);
  if (kind !== "stepped") {
    parts.run = button("Pause", "Space", () => togglePause(), { "aria-pressed": "false", class: "run" });
    parts.speeds = SPEEDS.map((speed) => h("button", { type: "button", "data-acts": true, "data-title": `Set the clock to ${speed} times real time`, "aria-pressed": "false", onclick: () => setSpeed(speed) }, `${speed}\u00d7`));
    const note = "To step and go back, start the emulator with --clock stepped.";
    return fill(root, face, h("div", { class: "line wrap grow" },
      parts.run, h("div", { class: "group", role: "group", "aria-label": "Speed" }, parts.speeds), h("p", { class: "muted grow" }, note)));
  }
  parts.amount = h("input", { value: "2ms", size: 6, "aria-label": "Time of a step", class: "mono", spellcheck: false });
  parts.run = button("Run", "Space", () => toggleRunning(), { "aria-pressed": "false", class: "run" });
  fill(root, face, h("div", { class: "line wrap grow" },
    parts.run,
    h("div", { class: "group" }, h("button", { type: "button", "data-acts": true, "data-title": "Undo everything: the plant as it was before the first action", onclick: () => toStart() }, "To start"), button("Back", "B", () => stepBack()), parts.amount, button("Step", "S", () => step(), { class: "primary" })),
    button("To SYNC", "N", () => toSync()), button("To event", "E", () => toEvent()),
    button("Wait for\u2026", "W", () => waitFor(false)), button("Back to\u2026", "Shift+B", () => backTo())));
}

function button(text, key, onclick, props) {
  const title = `${text} (key ${key})`;
  return h("button", { type: "button", "data-acts": true, "data-title": title, "aria-keyshortcuts": key, onclick, ...props }, text);
}

/** Handles the keys of the clock. Returns true if `event` was one of them. */
export function clockKey(event) {
  if (!feed.clock || whyDisabled() || !parts) return false;
  const keys = feed.isStepped
    ? { s: step, n: toSync, e: toEvent, w: () => waitFor(), b: stepBack, B: backTo, " ": toggleRunning }
    : { " ": togglePause };
  if (!(event.key in keys)) return false;
  keys[event.key]();
  return true;
}

const amount = () => duration(parts.amount.value);

function step() {
  try {
    const us = amount();
    act("advance", { us }, `step ${short(us)}`);
  } catch (error) {
    showError(error);
  }
}

function stepBack() {
  try {
    const us = Math.min(amount(), feed.timeUs);
    stopRunning();
    const done = us === feed.timeUs ? "What was done at the time 0 is kept; \u201cTo start\u201d undoes that, too" : undefined;
    act("back", { us, detached: false }, `back ${short(us)}`, done);
  } catch (error) {
    showError(error);
  }
}

function toStart() {
  stopRunning();
  act("back_to_start", { detached: false }, "back to the start", "The plant is as it was before the first action");
}

function setSpeed(speed) {
  act("set_speed", { permille: Math.round(speed * 1000) }, speed ? `speed ${speed}` : "pause");
}

/** Pauses a real-time clock, or continues with the speed before the pause. */
function togglePause() {
  setSpeed(feed.clock.speed === 0 ? parts.lastSpeed ?? 1 : 0);
}

function showSpeed(speed) {
  if (speed !== 0) parts.lastSpeed = speed;
  parts.run.setAttribute("aria-pressed", speed === 0);
  parts.speeds.forEach((it, at) => it.setAttribute("aria-pressed", speed === SPEEDS[at]));
}

async function toSync() {
  try {
    const [{ advance_to_sync }] = await operationsFor({ sync: "" });
    act("advance_to_sync", advance_to_sync, "step to SYNC");
  } catch (error) {
    showError(error);
  }
}

function toEvent() {
  act("advance_to_event", { within_us: 1_000_000 }, "step to the next event");
}

function toggleRunning() {
  if (running) stopRunning();
  else {
    running = {};
    runOn(running);
  }
  update();
}

function stopRunning() {
  running = null;
}

/** Advances the clock in parts until the user presses the button again, or a part fails. */
async function runOn(self) {
  while (running === self) {
    const before = performance.now();
    const done = await act("advance", { us: PART_MS * 1000 }, `step ${PART_MS} ms`, false);
    if (!done) break;
    await new Promise((resolve) => setTimeout(resolve, Math.max(0, PART_MS - (performance.now() - before))));
  }
  if (running === self) stopRunning();
  update();
}

function conditionFields(usual) {
  const text = h("input", { name: "text", class: "mono", value: usual, spellcheck: false, autocomplete: "off", required: true });
  return [
    field("Conditions", text, "REGISTER==VALUE, also !=, <, <=, >, >=, REGISTER&MASK==VALUE; join several with \u201cand\u201d or with \u201cor\u201d. The name of the PLC comes before the register if there are several: line:node2.w_X"),
  ];
}

let lastCondition = "node2.w_OPTION_STATUS==2";

function waitFor() {
  const within = h("input", { name: "within", class: "mono", value: "10s" });
  ask("Wait for a condition", [...conditionFields(lastCondition), field("At most (emulated time)", within)], "Wait", async (form) => {
    const text = form.elements.text.value;
    const { operations, any } = await conditionsOf(text);
    lastCondition = text;
    const within_us = duration(within.value);
    stopRunning();
    actTogether([...operations, { wait_for: { any, within_us } }], `wait for ${lastCondition}`, `${lastCondition} is true`, () => failureOf(text, within.value));
  });
}

function backTo() {
  ask("Go back to a condition", [...conditionFields(lastCondition), h("p", { class: "muted" }, "Goes back to the last moment before now at which the condition became true. Later events are lost.")], "Go back", async (form) => {
    const { operations, any } = await conditionsOf(form.elements.text.value);
    lastCondition = form.elements.text.value;
    stopRunning();
    actTogether([...operations, { back_until: { any, detached: false } }], `back to ${lastCondition}`, "The plant is back at that moment");
  });
}
