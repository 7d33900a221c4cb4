// The register map of each PLC: entries, arrays with their elements, and the numbers that operations need.

import { operationsFor, server, show } from "./api.js";
import { partsOf } from "./values.js";

const maps = new Map();
const places = new Map();

/** Deletes all maps, for another instance. */
export function resetMaps() {
  maps.clear();
  places.clear();
}

export function mapOf(plc) {
  if (!maps.has(plc)) {
    const reading = show("map", { plc }).then((entries) => entries.map((entry) => prepared(entry, plc)));
    reading.catch(() => maps.delete(plc));
    maps.set(plc, reading);
  }
  return maps.get(plc);
}

function prepared(entry, plc) {
  const ranges = [...entry.name.matchAll(/\[(\d+)\.\.(\d+)\]/g)].map(([, from, to]) => [Number(from), Number(to)]);
  const count = ranges.reduce((product, [from, to]) => product * (to - from + 1), 1);
  const search = `${entry.name} ${entry.meaning} ${entry.address} ${entry.structure} ${entry.values.map((it) => `${it.hex} ${it.meaning}`).join(" ")} ${entry.bits.map((it) => `${it.name} ${it.meaning}`).join(" ")}`;
  return { ...entry, plc, plcNumber: entry.plc, ranges, count, form: formOf(entry.name), search: search.toLowerCase() };
}

/** Replaces each index in a name by `[]`. */
const formOf = (name) => name.replace(/\[[^\]]*\]/g, "[]");

/** Returns the map entry of a register or of an element of an array. */
export async function entryOf(plc, register) {
  const entries = await mapOf(plc);
  const form = formOf(register);
  return entries.find((entry) => entry.form === form) ?? null;
}

/** Returns the names of the elements of an entry, each with its distance in bytes from the first element. */
export function* elementsOf(entry) {
  const parts = entry.name.split(/\[\d+\.\.\d+\]/);
  const total = entry.count;
  for (let number = 0; number < total; number += 1) {
    let rest = number;
    const indices = entry.ranges.map(() => 0);
    for (let at = entry.ranges.length - 1; at >= 0; at -= 1) {
      const [from, to] = entry.ranges[at];
      indices[at] = from + (rest % (to - from + 1));
      rest = Math.floor(rest / (to - from + 1));
    }
    const bytes = indices.reduce((sum, index, at) => sum + (index - entry.ranges[at][0]) * (entry.dims[at]?.[1] ?? 0), 0);
    yield [parts.map((part, at) => part + (at < indices.length ? `[${indices[at]}]` : "")).join(""), bytes];
  }
}

/** Returns `plc`, `offset` and `width` of a register for operations. If there are several PLCs, the name begins with the PLC. */
export async function placeOf(name) {
  const key = `${server.instance}/${name}`;
  if (!places.has(key)) {
    const reading = operationsFor({ unforce: name }).then(([first]) => first.unforce);
    reading.catch(() => places.delete(key));
    places.set(key, reading);
  }
  return places.get(key);
}

/** Finds the name of an operation's register by its position in the map: `line:node2.w_CPU_CONTROL`. */
async function nameOf({ plc, offset, width }, plcs) {
  const name = plcs[plc]?.plc;
  const entries = name ? await mapOf(name) : [];
  const fits = (entry) => entry.offset <= offset && entry.width === width && offset - entry.offset <= entry.dims.reduce((sum, [count, stride]) => sum + (count - 1) * stride, 0);
  const entry = entries.find((it) => it.offset === offset && it.width === width && !it.dims.length) ?? entries.find(fits);
  if (!entry) return null;
  let rest = offset - entry.offset;
  const indices = entry.dims.map(([, stride]) => {
    const index = Math.floor(rest / stride);
    rest -= index * stride;
    return index;
  });
  return { key: `${name}:${entry.name.replace(/\[(\d+)\.\.\d+\]/g, (_, from) => `[${Number(from) + indices.shift()}]`)}`, entry };
}

/** Returns the register at the position of an operation that is valid now: registers of several phases share a position. */
export async function liveNameOf(place, plcs) {
  const named = await nameOf(place, plcs);
  if (!named) return null;
  const { plc } = plcs[place.plc];
  const [{ address }] = await show("registers", { name: named.key });
  return (await registerAt(plc, address)) ?? named;
}

/** Returns the register at an address as `{key, name, entry}`; null if the map has no register at the address. */
export async function registerAt(plc, address) {
  const [{ register }] = await show("registers", { name: `${plc}:${address}` });
  const { name } = partsOf(register);
  const entry = await entryOf(plc, name);
  return entry && { key: `${plc}:${name}`, name, entry };
}

/** Returns a text about the sources of an entry's facts: the decisions behind inferred facts, or the manual. */
export function provenanceOf(entry) {
  const facts = Object.entries(entry.provenance ?? {});
  const inferred = facts.filter(([, source]) => source !== "manual");
  const text = inferred.length
    ? `From the manual: ${names(facts.filter(([, source]) => source === "manual"))}. Inferred: ${inferred.map(([fact, source]) => `${fact} (${source.replace("inferred ", "")})`).join(", ")}.`
    : "All facts are from the manual.";
  const isNamed = entry.provenance?.name === "manual" || entry.provenance?.type === "manual";
  return { mark: inferred.length === 0 ? "full" : isNamed ? "half" : "none", text };
}

/** Adds the decision to the text of an inferred fact, such as "switch on (inferred D-87)". */
export const withSource = (text, source) => (source && source !== "manual" ? `${text} (${source})`.trim() : text);

const names = (facts) => facts.map(([fact]) => fact).join(", ") || "nothing";
