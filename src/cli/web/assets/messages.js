// Messages of the page: errors and notes at the bottom, lasting states below the clock bar.

import { fill, h } from "./dom.js";

const area = document.getElementById("message");
const bar = document.getElementById("notice");
const lasting = new Map();
let timer;
let isError = false;

function put(text, kind, ms) {
  clearTimeout(timer);
  const close = h("button", { class: "plain", label: "Close the message", onclick: clear }, "\u00d7");
  fill(area, h("div", { class: `toast ${kind}` }, h("span", null, text), close));
  isError = kind === "bad";
  timer = setTimeout(clear, ms);
}

function clear() {
  isError = false;
  fill(area);
}

/** Shows an error in the words of its problem document. */
export const showError = (error) => put(error.message, "bad", 12_000);

/** Removes the error message, because a later action has succeeded. */
export const clearError = () => isError && clear();

export const showNote = (text) => put(text, "good", 3_000);

export const showWarning = (text) => put(text, "warn", 8_000);

/** Shows a lasting state; an empty `text` removes it. `action` is `[label, function]` of a button. */
export function setNotice(key, text, kind = "warn", action) {
  if (text) lasting.set(key, { text, kind, action });
  else if (!lasting.delete(key)) return;
  const one = ({ text, kind, action }) =>
    h("div", { class: `strip ${kind}` }, h("span", null, text), action && h("button", { onclick: action[1] }, action[0]));
  fill(bar, [...lasting.values()].map(one));
}
