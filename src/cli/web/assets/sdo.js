// CANopen from the page: frames on a CAN bus, and reading and writing objects by SDO (CiA 301).

import { act } from "./actions.js";
import { readJournal } from "./api.js";
import { feed } from "./feed.js";

const ATTEMPTS = 60;
/** Duration of an attempt: emulated time with a stepped clock, real time with a real-time clock. */
const STEP_US = 500, PAUSE_MS = 20;

/** Sends a frame on a bus. `data` contains its bytes. Returns true if the frame was sent. */
export function sendFrame(bus, id, data, words) {
  const number = data.reduce((sum, byte, at) => sum | (BigInt(byte) << BigInt(8 * at)), 0n);
  return act("bus_send", { bus, frame: [id, data.length, number] }, words);
}

export const NMT = { Start: 0x01, Stop: 0x02, "Pre-operational": 0x80, "Reset node": 0x81 };

const bytesOf = (text) => (String(text).match(/[0-9a-f]{2}/gi) ?? []).map((digits) => parseInt(digits, 16));

/** Reads and writes the objects of one node. */
export class SdoClient {
  constructor(bus, busName, node) {
    Object.assign(this, { bus, busName, node });
  }

  /** Sends a request and returns the bytes of the answer. Throws an Error. */
  async #ask(data, words) {
    const { end } = await readJournal(Number.MAX_SAFE_INTEGER);
    if (!(await sendFrame(this.bus, 0x600 + this.node, data, words))) throw new Error("the request was not sent");
    let next = end;
    for (let attempt = 0; attempt < ATTEMPTS; attempt += 1) {
      if (feed.isStepped) await act("advance", { us: STEP_US }, "step 500 us");
      else await new Promise((resolve) => setTimeout(resolve, PAUSE_MS));
      const journal = await readJournal(next);
      const answer = journal.records.find((it) => it.kind === "can_frame" && it.bus === this.busName && it.id === 0x580 + this.node);
      if (answer) return this.#checked(bytesOf(answer.data));
      next = Math.max(next, journal.next);
    }
    throw new Error(`node ${this.node} does not answer`);
  }

  #checked(bytes) {
    if (bytes[0] !== 0x80) return bytes;
    const code = bytes.slice(4).reduceRight((sum, byte) => sum * 256 + byte, 0);
    throw new Error(ABORTS[code] ?? `refused with abort code 16#${code.toString(16).toUpperCase().padStart(8, "0")}`);
  }

  async read(index, subindex) {
    const words = `read object ${index.toString(16)}.${subindex} of node ${this.node}`;
    const first = await this.#ask([0x40, index & 0xff, index >> 8, subindex, 0, 0, 0, 0], words);
    if (first[0] & 2) return first.slice(4, 8 - (first[0] & 1 ? (first[0] >> 2) & 3 : 0));
    const all = [];
    for (let toggle = 0; ; toggle ^= 0x10) {
      const part = await this.#ask([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0], words);
      all.push(...part.slice(1, 8 - ((part[0] >> 1) & 7)));
      if (part[0] & 1) return all;
    }
  }

  /** Writes an object of up to four bytes. */
  async write(index, subindex, bytes) {
    const data = [0x23 | ((4 - bytes.length) << 2), index & 0xff, index >> 8, subindex, ...bytes, 0, 0, 0].slice(0, 8);
    await this.#ask(data, `write object ${index.toString(16)}.${subindex} of node ${this.node}`);
  }
}

const ABORTS = { 0x06020000: "there is no such object", 0x06090011: "there is no such subindex", 0x06010001: "the object can only be written", 0x06010002: "the object can only be read", 0x06070010: "the object has another size", 0x06090030: "the value is out of its range", 0x08000022: "not possible in this state of the node" };
