// Page "Faults": add a fault by its kind and fields, list and clear faults; forced registers.

import { act, guard } from "./actions.js";
import { operationsFor, show } from "./api.js";
import { choice, field, fill, h, td, tdMono } from "./dom.js";
import { feed } from "./feed.js";
import { liveNameOf } from "./map.js";
import { showError } from "./messages.js";
import { table } from "./plant.js";
import { duration, hex } from "./values.js";

export function faultsPage(root, rest, context) {
  const list = h("section", { class: "box", label: "Faults" });
  const forces = h("section", { class: "box", label: "Forced registers" });
  const form = h("section", { class: "box", label: "Add a fault" });
  fill(root, h("div", { class: "columns" }, form, h("div", { class: "stack" }, list, forces)));
  const draw = ({ faults }) => {
    drawFaults(list, faults);
    guard(root);
  };
  const drawForced = async (data) => {
    const names = await Promise.all(data.forces.map((it) => liveNameOf(it, context.status.plcs)));
    drawForces(forces, data.forces.map((it, at) => ({ ...it, ...names[at] })));
    guard(root);
  };
  const offs = [feed.on("faults", draw), feed.on("forces", (data) => drawForced(data).catch(showError))];
  feed.want("faults", { events: ["faults", "forces"] });
  draw({ faults: [] });
  drawForces(forces, []);
  const { plcs, buses } = context.status;
  const places = { bus: buses.map((it) => it.bus), plc: plcs.map((it) => it.plc) };
  show("fault-kinds").then((kinds) => drawForm(form, kinds, places), showError);
  return () => {
    offs.forEach((off) => off());
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
  const rows = faults.map((fault) => h("tr", null, td(String(fault.number)), td(fault.state), td(String(fault.hits)), tdMono(wordsOf(fault)),
    td(h("button", { acts: true, label: `Clear fault ${fault.number}`, onclick: () => clear(fault.number, `clear fault ${fault.number}`) }, "Clear"))));
  const all = h("button", { acts: true, "data-why": faults.length ? "" : "There is no fault", onclick: () => clear(null, "clear all faults") }, "Clear all");
  fill(box, h("header", { class: "boxhead" }, h("h2", { class: "grow" }, "Faults"), all), faults.length ? table(["No.", "State", "Hits", "Fault", ""], rows, "Faults") : h("p", { class: "empty" }, "No fault waits or acts."));
}

function drawForces(box, forces) {
  const row = ({ plc, offset, width, value, key, entry }) => {
    const name = key ?? `byte ${offset} of PLC ${plc}`;
    const release = () => act("unforce", { plc, offset, width }, `unforce ${name}`, `${name}: no longer forced`, key);
    const type = entry?.type ?? { Byte: "BYTE", Word: "WORD", Dword: "DWORD" }[width];
    return h("tr", null, tdMono(name), tdMono(hex(value, type)), td(entry?.meaning ?? ""), td(h("button", { acts: true, label: `Unforce ${name}`, onclick: release }, "Unforce")));
  };
  fill(box, h("header", { class: "boxhead" }, h("h2", null, "Forced registers")), forces.length ? table(["Register", "Value", "Meaning", ""], forces.map(row), "Forced registers") : h("p", { class: "empty" }, "No register is forced."));
}

function drawForm(box, kinds, places) {
  const kind = choice(kinds.map((it) => [it.kind, it.kind]), kinds[0]?.kind, { "aria-describedby": "fault-text" });
  const text = h("p", { class: "muted", id: "fault-text" });
  const fields = h("div", { class: "wordgrid" });
  const error = h("p", { class: "error", role: "alert" });
  const form = h("form", { class: "pad stack" }, field("Kind", kind), text, fields, error, h("div", null, h("button", { type: "submit", class: "primary", acts: true }, "Add the fault")));
  const one = () => kinds.find((it) => it.kind === kind.value);
  const drawFields = () => {
    const once = one()?.once ? " This fault happens once." : "";
    text.textContent = one() ? `${one().about}.${once} Example: ${kind.value} ${one().example}` : "";
    error.textContent = "";
    fill(fields, (one()?.fields ?? []).map((it) => fieldOf(it, places)));
    guard(box);
  };
  kind.addEventListener("change", drawFields);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    error.textContent = "";
    try {
      const given = [...fields.querySelectorAll("input, select")].map((input) => [input, input.value.trim()]).filter(([, value]) => value);
      const words = [kind.value, ...given.map(([input, value]) => `${input.name}=${input.dataset.form === "time" ? microseconds(value) : value}`)].join(" ");
      const [{ fault_add }] = await operationsFor({ fault: words });
      await act("fault_add", fault_add, `fault ${words}`, "The fault is added");
    } catch (problem) {
      error.textContent = problem.message;
    }
  });
  fill(box, h("header", { class: "boxhead" }, h("h2", null, "Add a fault")), form);
  drawFields();
  guard(box);
}

/** Converts a time to microseconds, the unit in the names of the fields. */
const microseconds = (text) => (/^\d+$/.test(text) ? text : duration(text));

/** Creates the input of a field. An empty input is left out of the fault. */
function fieldOf(it, places) {
  const choices = places[it.name] ?? it.words;
  const isGiven = it.required || (it.form === "name" && choices.length === 1);
  const options = isGiven ? choices : ["", ...choices];
  const range = { time: "5000, or 5ms", port: "name or number", hex: `16#0 to 16#${it.most.toString(16).toUpperCase()}` }[it.form] ?? `${it.least} to ${it.most}`;
  const input = choices.length ? choice(options, options[0], { name: it.name }) : h("input", { name: it.name, class: "mono", placeholder: range, required: it.required, spellcheck: false, "data-form": it.form });
  return field(it.name, input, it.about);
}
