// Conditions on registers, as in `commram wait`.

import { operationsFor, server, show } from "./api.js";
import { partsOf } from "./values.js";

/** Converts a text such as `node2.w_OPTION_STATUS==2 and node2.b_AC&1!=0` to `condition` operations. Throws an Error if it is invalid. */
export async function conditionsOf(text) {
  const any = /\s+or\s+/i.test(text);
  if (any && /\s+and\s+/i.test(text)) throw new Error("Join conditions with 'and' or with 'or', not with both");
  const condition = text.split(any ? /\s+or\s+/i : /\s+and\s+/i).map((one) => one.trim());
  return { any, operations: await operationsFor({ condition }) };
}

/** Returns the error of a wait that has failed: the conditions, and the present values of their registers. */
export async function failureOf(text, within) {
  const name = text.split(/\s+(?:and|or)\s+/i).map((one) => one.split(/[&=!<>]/)[0].trim());
  const values = (await show("registers", { name })).map(({ register, hex, meaning }) => `${register} is ${hex}${meaning ? ` (${meaning})` : ""}`);
  return new Error(`${text} did not become true in ${within}: ${values.join(", ")}`);
}

/** Name of a followed register without its PLC if the plant has only one. */
export const shortName = (key) => (server.plcCount === 1 ? partsOf(key).name : key);
