// Finds stores of other programs during a recording in the journal. The recording does not contain them.

import { feed } from "./feed.js";
import { setNotice } from "./messages.js";
import { counted, seconds } from "./values.js";

/** Longest time in milliseconds from the journal record of a store of this page until the reply to the store arrives.
/** */
const REPLY_MS = 500;
/** Maximum number of stores that are kept, and of registers that a note names. */
const MOST = 1_000, NAMED = 3;
const BYTES = { Byte: 1, Word: 2, Dword: 4 };

/** Number of stores of this page that have no journal record yet, by width and value. */
const own = new Map();
let end = null;

export function forgetForeign() {
  own.clear();
  setNotice("foreign", "");
}

export function noteOwn({ width, value }) {
  const key = `${BYTES[width]} ${value}`;
  own.set(key, (own.get(key) ?? 0) + 1);
}

function isOwn({ width, value }) {
  const key = `${width} ${value}`;
  const count = own.get(key) ?? 0;
  if (count) own.set(key, count - 1);
  return count > 0;
}

/** Adds the stores of other programs to `recorder.foreign` while a recording runs. */
export function watchForeign(recorder, changed) {
  end?.();
  end = null;
  feed.leave("recorder");
  if (!recorder.isOn) return setNotice("foreign", "");
  feed.want("recorder", { kinds: "channel_write,changed" });
  const { foreign: begun } = recorder;
  const take = (records) => {
    if (!recorder.isOn) return;
    const found = records.filter((it) => (it.kind === "channel_write" ? !isOwn(it) : it.by === "program"));
    if (!found.length) return;
    recorder.foreign = [...recorder.foreign, ...found.map(({ time_us, register, address }) => ({ time_us, register: register ?? address }))].slice(-MOST);
    setNotice("foreign", foreignText(recorder.foreign), "warn");
    changed();
  };
  end = feed.onEach("journal", ({ records }) => {
    const stores = records.filter((it) => it.kind === "channel_write" || it.kind === "changed");
    if (stores.length) setTimeout(take, REPLY_MS, stores);
  });
  if (begun.length) setNotice("foreign", foreignText(begun), "warn");
}

/** Returns a text about stores that the recording does not contain; empty if there are none. */
export function foreignText(foreign) {
  if (!foreign.length) return "";
  const names = [...new Set(foreign.map((it) => it.register))];
  const more = names.length > NAMED ? ` and ${names.length - NAMED} more` : "";
  const [first, last] = [foreign[0], foreign.at(-1)].map((it) => seconds(it.time_us));
  return `Not recorded: ${counted(foreign.length, "store")} of other programs from ${first} to ${last}, to ${names.slice(0, NAMED).join(", ")}${more}`;
}
