// Formats and parses numbers, times and names like the command line.

const UNITS = { us: 1, ms: 1e3, s: 1e6, min: 60e6, h: 3600e6 };

export function seconds(us) {
  return `${(us / 1e6).toFixed(6)} s`;
}

/** Formats a duration in few characters: `850 us`, `2.5 ms`, `3.2 s`, `4 min`. */
export function short(us) {
  if (us < 1e3) return `${us} us`;
  if (us < 1e6) return `${round(us / 1e3)} ms`;
  if (us < 60e6) return `${round(us / 1e6)} s`;
  if (us < 3600e6) return `${round(us / 60e6)} min`;
  return `${round(us / 3600e6)} h`;
}

const round = (number) => String(Math.round(number * (number < 10 ? 100 : 10)) / (number < 10 ? 100 : 10));

/** Parses a time such as `2ms`, `500 us` or `1.5s`; returns microseconds. A number without a unit means milliseconds. Throws an Error for another text. */
export function duration(text) {
  const found = /^\s*(\d+(?:\.\d+)?)\s*(us|µs|ms|s|min|h)?\s*$/.exec(text);
  if (!found) throw new Error(`'${text}' is not a time: write a number and us, ms, s, min or h, for example 2ms`);
  return Math.round(Number(found[1]) * UNITS[(found[2] ?? "ms").replace("µ", "u")]);
}

/** Decodes a part of an address. A text with a broken percent code is a name as it is, so the page reports the unknown name. */
export function decoded(text = "") {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

/** Splits the key of a register, `line:node2.w_CPU_CONTROL`, into the PLC and the name. */
export function partsOf(key) {
  const at = key.indexOf(":");
  return { plc: key.slice(0, at), name: key.slice(at + 1) };
}

export const bytesOf = (type) => ({ BYTE: 1, USINT: 1, SINT: 1, BOOL: 1, WORD: 2, UINT: 2, INT: 2 })[type] ?? 4;

/** True if values of the type are printed with a sign. */
export const isSigned = (type) => type === "SINT" || type === "INT" || type === "DINT";

/** True if the type is a single register, false if it is a range of bytes. */
export const isScalar = (type) => !type.includes("[");

/** Formats a value with this number of bytes in hexadecimal: `16#0043`. */
export const digits = (value, bytes) => `16#${(value >>> 0).toString(16).toUpperCase().padStart(2 * bytes, "0").slice(-2 * bytes)}`;

export const hex = (value, type) => digits(value, bytesOf(type));

const DIGITS = { 16: /^[\da-f]+$/i, 10: /^-?\d+$/, 8: /^[0-7]+$/, 2: /^[01]+$/ };

/** Parses a number such as `16#43`, `0x43`, `8#103`, `2#100_0011`, `67` or `-5`. Returns NaN for another text. */
export function integerOf(text) {
  const [, base = "10", digits] = /^(?:(16|10|8|2)#)?(.*)$/s.exec(text.trim().replace(/^0x/i, "16#"));
  // A separator is between two digits.
  const plain = digits.replace(/(?<=[\da-f])_(?=[\da-f])/gi, "");
  return DIGITS[base].test(plain) ? parseInt(plain, Number(base)) : NaN;
}

/** Parses a number such as `16#43`, `0x43`, `2#1011`, `67` or `-5`, or the meaning of a value. Throws an Error for another text. */
export function parseValue(text, type, values = []) {
  const named = values.find((value) => value.first === value.last && value.meaning === text.trim());
  if (named) return named.first;
  const number = integerOf(text);
  const size = 2 ** (8 * bytesOf(type));
  if (Number.isNaN(number)) throw new Error(`'${text}' is not a value: write a number such as 67, 16#43 or 2#1000011`);
  const least = isSigned(type) ? -size / 2 : 0;
  if (number < least || number >= size) throw new Error(`${text} does not fit a ${type}: ${least} to ${size - 1}`);
  return number < 0 ? number + size : number;
}

/** Converts the bits of a value of a signed type to its number. */
export function signed(value, type) {
  const size = 2 ** (8 * bytesOf(type));
  return isSigned(type) && value >= size / 2 ? value - size : value;
}

export const counted = (count, one, many = `${one}s`) => `${count} ${count === 1 ? one : many}`;
