// Page "Faults": add a fault by its kind and fields, list and clear faults; forced registers.

import { act, guard } from "./actions.js";
import { show } from "./api.js";
import { choice, field, fill, h } from "./dom.js";
import { feed, keyOf } from "./feed.js";
import { placeOf } from "./map.js";
import { showError } from "./messages.js";
import { table } from "./plant.js";
import { seconds } from "./values.js";

export function faultsPage(root) {
  const list = h("section", { class: "box", "aria-label": "Faults" });
  const forces = h("section", { class: "box", "aria-label": "Forced registers" });
  const form = h("section", { class: "box", "aria-label": "Add a fault" });
  fill(root, h("div", { class: "columns" }, form, h("div", { class: "stack" }, list, forces)));
  const draw = (data) => {
    drawFaults(list, data.faults);
    drawForces(forces, data.forces ?? []);
    guard(root);
  };
  const off = feed.on("faults", draw);
  feed.want("faults", { events: ["faults"] });
  draw(feed.latest.faults ?? { faults: [], forces: [] });
  show("fault-kinds").then((kinds) => drawForm(form, kinds), showError);
  return () => {
    off();
    feed.leave("faults");
  };
}

const USUAL = new Set(["number", "state", "hits", "kind"]);

/** A fault in the words of the command line. */
function wordsOf(fault) {
  const fields = Object.entries(fault).filter(([name, value]) => !USUAL.has(name) && value !== null);
  return `${fault.kind} ${fields.map(([name, value]) => `${name}=${value}`).join(" ")}`;
}

function drawFaults(box, faults) {
  const clear = (id, words) => act("fault_clear", { id }, words, "Cleared; the effects of the fault remain");
  const rows = faults.map((fault) => h("tr", null, h("td", null, String(fault.number)), h("td", null, fault.state), h("td", null, String(fault.hits)), h("td", { class: "mono" }, wordsOf(fault)),
    h("td", null, h("button", { type: "button", "data-acts": true, "aria-label": `Clear fault ${fault.number}`, onclick: () => clear(fault.number, `clear fault ${fault.number}`) }, "Clear"))));
  const all = h("button", { type: "button", "data-acts": true, "data-why": faults.length ? "" : "There is no fault", onclick: () => clear(null, "clear all faults") }, "Clear all");
  fill(box, h("header", { class: "boxhead" }, h("h2", { class: "grow" }, "Faults"), all), faults.length ? table(["No.", "State", "Hits", "Fault", ""], rows, "Faults") : h("p", { class: "empty" }, "No fault waits or acts."));
}

function drawForces(box, forces) {
  const release = async (name) => {
    try {
      await act("unforce", await placeOf(name), `unforce ${name}`, `${name}: no longer forced`);
    } catch (error) {
      showError(error);
    }
  };
  const rows = forces.map((it) => h("tr", null, h("td", { class: "mono" }, keyOf(it)), h("td", { class: "mono" }, it.hex), h("td", null, it.meaning), h("td", null, h("button", { type: "button", "data-acts": true, "aria-label": `Unforce ${it.register}`, onclick: () => release(keyOf(it)) }, "Unforce"))));
  fill(box, h("header", { class: "boxhead" }, h("h2", null, "Forced registers")), forces.length ? table(["Register", "Value", "Meaning", ""], rows, "Forced registers") : h("p", { class: "empty" }, "No register is forced."));
}

function drawForm(box, kinds) {
  const kind = choice(kinds.map((it) => [it.kind, it.kind]), kinds[0]?.kind, { "aria-describedby": "fault-text" });
  const text = h("p", { class: "muted", id: "fault-text" });
  const fields = h("div", { class: "wordgrid" });
  const error = h("p", { class: "error", role: "alert" });
  const form = h("form", { class: "pad stack" }, field("Kind", kind), text, fields, error, h("div", null, h("button", { type: "submit", class: "primary", "data-acts": true }, "Add the fault")));
  const one = () => kinds.find((it) => it.kind === kind.value);
  const drawFields = () => {
    text.textContent = one()?.text ?? "";
    error.textContent = "";
    fill(fields, placeField(one()), (one()?.fields ?? []).map(fieldOf),
      field("begin (at)", h("input", { name: "at", class: "mono", placeholder: "now" })), field("hits (count)", h("input", { name: "count", class: "mono", placeholder: "until cleared" })), field("duration", h("input", { name: "duration", class: "mono", placeholder: "until cleared" })));
  };
  kind.addEventListener("change", drawFields);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    error.textContent = "";
    const pairs = [...fields.querySelectorAll("input, select")].filter((input) => input.value.trim() !== "").map((input) => `${input.name}=${input.value.trim()}`);
    const words = [kind.value, ...pairs].join(" ");
    try {
      const fault = await show("fault", { words });
      await act("fault_add", { fault }, `fault ${words}`, "The fault is added");
    } catch (problem) {
      error.textContent = problem.message;
    }
  });
  fill(box, h("header", { class: "boxhead" }, h("h2", null, "Add a fault")), form);
  drawFields();
  guard(box);
}

function placeField(kind) {
  const places = kind?.places ?? [];
  return places.length > 0 && field(kind.place, choice(places, places[0], { name: kind.place }));
}

function fieldOf(it) {
  const range = it.choices?.length ? "" : it.min !== undefined && it.min !== null ? `${it.min} to ${it.max}` : "";
  const input = it.choices?.length ? choice([["", it.is_required ? "choose" : "all"], ...it.choices.map((name) => [name, name])], "", { name: it.name }) : h("input", { name: it.name, class: "mono", placeholder: range, required: Boolean(it.is_required) });
  return field(it.name.replaceAll("_", " "), input, it.text);
}
