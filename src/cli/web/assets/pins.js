// Followed registers: kept in this browser for each instance.

import { server } from "./api.js";

let pins = new Set();
const listeners = new Set();
const place = () => `commram.followed.${server.instance}`;

/** Reads the followed registers of the chosen instance. */
export function loadPins() {
  try {
    pins = new Set(JSON.parse(localStorage.getItem(place()) ?? "[]"));
  } catch {
    pins = new Set();
  }
  listeners.forEach((listener) => listener());
}

/** Names of the followed registers, each with its PLC: `line:node2.w_CPU_CONTROL`. */
export const pinned = () => [...pins];
export const isPinned = (key) => pins.has(key);

export function togglePin(key) {
  if (!pins.delete(key)) pins.add(key);
  localStorage.setItem(place(), JSON.stringify([...pins]));
  listeners.forEach((listener) => listener());
}

/** Calls `listener` when the list of followed registers has changed. Returns a function that ends these calls. */
export function onPins(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}
