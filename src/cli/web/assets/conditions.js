// Conditions on registers, as in `commram wait`: text to operations.

import { entryOf, placeOf } from "./map.js";
import { server, show } from "./api.js";
import { isSigned, parseValue } from "./values.js";

const COMPARE = { "==": "equal", "=": "equal", "!=": "not_equal", "<": "less", "<=": "less_or_equal", ">": "greater", ">=": "greater_or_equal" };
const FULL = { Byte: 0xff, Word: 0xffff, Dword: 0xffffffff };

/** `condition` operations for a text such as `node2.w_OPTION_STATUS==2 and node2.b_AC&1!=0`. Throws an Error. */
export async function conditionsOf(text) {
  const any = /\s+or\s+/i.test(text);
  if (any && /\s+and\s+/i.test(text)) throw new Error("Join conditions with 'and' or with 'or', not with both");
  const parts = text.split(any ? /\s+or\s+/i : /\s+and\s+/i);
  return { any, operations: await Promise.all(parts.map(one)) };
}

async function one(text) {
  const found = /^\s*([^\s=!<>&]+)\s*(?:&\s*([^\s=!<>]+))?\s*(==|!=|<=|>=|=|<|>)\s*(.+?)\s*$/.exec(text);
  if (!found) throw new Error(`'${text}' is no condition: write REGISTER==VALUE`);
  const [, name, maskText, sign, valueText] = found;
  const place = await placeOf(name);
  const entry = await entryFor(name, place);
  const type = entry?.type ?? { Byte: "BYTE", Word: "WORD", Dword: "DWORD" }[place.width];
  const mask = maskText ? parseValue(maskText, type) : FULL[place.width];
  const value = parseValue(valueText, type, entry?.values);
  return { condition: { ...place, test: { mask, compare: COMPARE[sign], is_signed: isSigned(type), value } } };
}

async function entryFor(name, place) {
  const at = name.indexOf(":");
  const plc = at >= 0 ? name.slice(0, at) : (await show("status")).plcs[place.plc]?.plc;
  return plc ? entryOf(plc, name.slice(at + 1)) : null;
}

/** Name of a followed register without its PLC if the plant has only one. */
export const shortName = (key) => (server.plcCount === 1 ? key.slice(key.indexOf(":") + 1) : key);
