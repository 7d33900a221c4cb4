// Requests to the server, signing in, and errors as problem documents (RFC 9457).

const ROOT = "/api/v1";

/** Place of the session's key. The browser keeps it for this address and port only; it would send a cookie to all ports of the host. */
const KEY = "commram.key";

const headersFor = (accept) => {
  const key = localStorage.getItem(KEY);
  return key ? { Accept: accept, Authorization: `Bearer ${key}` } : { Accept: accept };
};

export class Problem extends Error {
  constructor(status, document) {
    super(document.detail ?? document.title ?? `the server answers with status ${status}`);
    this.status = status;
    this.document = document;
  }
}

/** Properties of the server. */
export const server = { instance: null, instances: [], isReadOnly: false, version: "" };

async function send(method, path, body) {
  const options = { method, credentials: "omit", headers: headersFor("application/json") };
  if (method !== "GET") {
    options.headers["Content-Type"] = "application/json";
    options.body = exactJson(body ?? {});
  }
  let response;
  try {
    response = await fetch(ROOT + path, options);
  } catch {
    throw new Problem(0, { detail: "the server does not answer; is `commram web` still running?" });
  }
  if (response.status === 204) return null;
  const text = await response.text();
  if (response.ok) return parsed(text);
  throw new Problem(response.status, parsed(text) ?? {});
}

/** Formats a value as JSON. Numbers that a Number would round are BigInts. */
function exactJson(value) {
  const text = JSON.stringify(value, (_, part) => (typeof part === "bigint" ? `\u0000${part}` : part));
  return text.replace(/"\\u0000(\d+)"/g, "$1");
}

function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return text.startsWith("<svg") ? text : null;
  }
}

/** Formats a query string. A field with an array as its value is repeated. */
const query = (fields) => {
  const pairs = Object.entries(fields ?? {}).flatMap(([name, value]) => [value].flat().map((one) => [name, one])).filter(([, value]) => value !== undefined && value !== null);
  return pairs.length ? `?${new URLSearchParams(pairs)}` : "";
};

function here(rest) {
  if (server.instance === null) throw new Problem(0, { detail: "no instance is chosen; choose one first" });
  return `/instances/${encodeURIComponent(server.instance)}/${rest}`;
}

/** Exchanges the token for the key of a session. */
export async function signIn(token) {
  const { key } = await send("POST", "/session", { token });
  localStorage.setItem(KEY, key);
}

export async function signOut() {
  await send("DELETE", "/session");
  localStorage.removeItem(KEY);
}

export async function isSignedIn() {
  try {
    await send("GET", "/session");
    return true;
  } catch (problem) {
    if (problem.status === 401) return false;
    throw problem;
  }
}

export async function readInstances() {
  const { instances, read_only, version } = await send("GET", "/instances");
  Object.assign(server, { instances, isReadOnly: read_only, version });
  return instances;
}

/** Requests data for a page: the same JSON that a command prints with `--format json`, without the outer name. */
export const show = async (what, fields) => Object.values(await send("GET", here(`show/${what}`) + query(fields)))[0];

/** Converts words of the command line, such as `{ poke: "node2.w_X=1" }`, to operations. */
export const operationsFor = (words) => show("operations", words);

export const look = async (operation, fields) => send("GET", here(operation) + query(fields));

const PART = 1024;

/** Reads a part of the journal from a record on: records, records that are still being counted, number of the next record, and end. */
export async function readJournal(from) {
  const { records: all, end } = (await look("journal", { from, max: PART })).journal;
  const records = all.filter((record) => typeof record.seq === "number");
  const pending = all.filter((record) => typeof record.seq !== "number");
  return { records, pending, end, next: records.length ? records.at(-1).seq + 1 : end };
}

/** Reads at most `count` of the last records of the journal, and the records that are still being counted. */
export async function readPast(count) {
  const { end } = await readJournal(Number.MAX_SAFE_INTEGER);
  const past = [];
  for (let next = Math.max(0, end - count); next < end; ) {
    const part = await readJournal(next);
    past.push(...part.records);
    next = part.next;
  }
  return past;
}

export const post = async (operation, fields) => send("POST", here(operation), fields);

/** A stream of events. EventSource cannot send the key of the session. */
export class EventStream extends EventTarget {
  /** Called at the end of the connection, if `close` was not called. */
  onfailed = () => {};
  #abort = new AbortController();

  constructor(path) {
    super();
    this.#read(path);
  }

  close() {
    this.#abort.abort();
  }

  async #read(path) {
    const { signal } = this.#abort;
    try {
      const response = await fetch(path, { credentials: "omit", headers: headersFor("text/event-stream"), signal });
      if (response.ok) await this.#readBlocks(response.body.pipeThrough(new TextDecoderStream()).getReader());
    } catch {
      // The server has ended, or the connection is interrupted.
    }
    if (!signal.aborted) this.onfailed();
  }

  /** Reads events until the end. An empty line ends an event. */
  async #readBlocks(reader) {
    let rest = "";
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      const blocks = (rest + part.value).split("\n\n");
      rest = blocks.pop();
      blocks.forEach((block) => this.#dispatch(block));
    }
  }

  #dispatch(block) {
    const field = (name) => block.split("\n").filter((line) => line.startsWith(`${name}: `)).map((line) => line.slice(name.length + 2)).join("\n");
    const event = field("event");
    if (event && !this.#abort.signal.aborted) this.dispatchEvent(new MessageEvent(event, { data: field("data") }));
  }
}

export const eventsPath = (fields) => ROOT + here("events") + query(fields);
