// The event stream of an instance: one connection for all parts of the page, and the latest state of each.

import { EventStream, eventsPath, isSignedIn, readInstances, readPast, server } from "./api.js";
import { later, perFrame } from "./dom.js";
import { setNotice, showError } from "./messages.js";

/** Maximum number of registers of one stream. */
const MOST = 256;
/** Number of changes that are kept for plots and lists. */
const KEPT = 20_000;
/** Longest time, in milliseconds, in which all events of one poll of the server arrive. Events of the next poll arrive later. */
const ROUND_MS = 25;
const EVENTS = ["clock", "values", "changes", "journal", "findings", "drives", "scene", "boards", "faults", "forces", "buses", "turned", "lost", "ended"];

/** Key of a register in the maps of the page. */
export const keyOf = (register) => `${register.plc}:${register.register}`;

/** The same register without the name of the PLC in the name of the register. */
const withoutPlc = (it) => (it.register.startsWith(`${it.plc}:`) ? { ...it, register: it.register.slice(it.plc.length + 1) } : it);

class Feed {
  clock = null;
  latest = {};
  /**
   * Registers with their value, meaning and `forced`. `changedUs`: time of the last change that the page knows. `shownUs`: from this
   * time on the page knows that time. `sinceUs`: from this time on every change of the register reaches the page.
   */
  values = new Map();
  changes = [];
  hasEnded = false;
  /** True while a hidden page needs events, too. */
  keepsOpen = false;
  rounds = 0;
  #wants = new Map();
  #listeners = new Map();
  #due = new Set();
  #source = null;
  #path = "";
  #turnedUs = null;
  #isStale = true;
  #waiting = [];
  #followed = new Set();
  #shown = new Set();
  #notify = perFrame(() => this.#deliver());
  #connect = later(120, () => this.#open());

  get timeUs() {
    return this.clock?.time_us ?? 0;
  }
  get isStepped() {
    return this.clock?.clock === "stepped";
  }

  /** Deletes all data, for another instance. */
  reset() {
    this.#close();
    Object.assign(this, { clock: null, latest: {}, changes: [], hasEnded: false });
    this.values.clear();
    setNotice("stream", "");
    setNotice("lost", "");
    this.#connect();
  }

  /**
   * Sets the data that a part of the page needs: registers of which it needs every change (`follow`) or only the latest value (`values`),
   * events, and kinds of journal records.
   */
  want(owner, { follow = [], values = [], events = [], kinds } = {}) {
    this.#wants.set(owner, { follow, values, events, kinds });
    this.#isStale = true;
    this.#connect();
  }

  /** Waits until a stream with all wanted data is open. The page misses no later event. */
  opened() {
    return new Promise((resolve) => {
      this.#waiting.push(resolve);
      this.#connect();
    });
  }

  /**
   * Calls `take` with the last `count` records of the journal, then with each later record once. Returns a function that ends these
   * calls.
   */
  followJournal(owner, count, take) {
    let early = [];
    let isOpen = true;
    const off = this.onEach("journal", ({ records }) => (early ? early.push(...records) : take(records)));
    this.want(owner, { events: ["journal"] });
    const start = async () => {
      // A record between the end of the past and the begin of the stream would be lost, so the stream begins first.
      await this.opened();
      const past = await readPast(count).catch((problem) => (showError(problem), []));
      if (!isOpen) return;
      const end = past.at(-1)?.seq ?? -1;
      take([...past, ...early.filter(({ seq }) => !(seq <= end))]);
      early = null;
    };
    start();
    return () => {
      isOpen = false;
      off();
      this.leave(owner);
    };
  }

  /** Removes the requirements of a part of the page. */
  leave(owner) {
    if (this.#wants.delete(owner)) this.#connect();
  }

  /**
   * Calls `listener` at the next frame of the browser after an event of this kind, once in a frame, also if it listens to several kinds.
   * Returns a function that ends these calls.
   */
  on(event, listener) {
    if (!this.#listeners.has(event)) this.#listeners.set(event, new Set());
    this.#listeners.get(event).add(listener);
    return () => this.#listeners.get(event).delete(listener);
  }

  /** Calls `listener` at once with every event of this kind. */
  onEach(event, listener) {
    const name = `each ${event}`;
    if (!this.#listeners.has(name)) this.#listeners.set(name, new Set());
    this.#listeners.get(name).add(listener);
    return () => this.#listeners.get(name).delete(listener);
  }

  /** Sets the clock if a reply has a newer time than the last event. */
  noticeTime(timeUs) {
    if (this.clock && timeUs !== this.clock.time_us) {
      this.clock = { ...this.clock, time_us: timeUs };
      this.#mark("clock");
    }
  }

  #mark(event) {
    this.#due.add(event);
    this.#notify();
  }

  #deliver() {
    const due = [...this.#due];
    this.#due.clear();
    this.rounds += 1;
    const calls = new Map();
    for (const event of due) for (const listener of this.#listeners.get(event) ?? []) calls.set(listener, this.latest[event]);
    for (const [listener, data] of calls) listener(data);
  }

  #close() {
    this.#source?.close();
    this.#source = null;
    this.#path = "";
  }

  #open() {
    if (server.instance === null) return this.#close();
    if (document.hidden) return;
    const [follow, values] = [new Set(), new Set()];
    const fields = { clock: 1 };
    // The parts that need all kinds of records come last, so that their setting wins.
    for (const want of [...this.#wants.values()].sort((one, other) => Boolean(one.kinds) - Boolean(other.kinds))) {
      want.follow.forEach((name) => follow.add(name));
      want.values.forEach((name) => values.add(name));
      want.events.forEach((event) => (fields[event] = 1));
      if (want.kinds) fields.journal ??= want.kinds;
    }
    const followed = [...follow].slice(0, MOST);
    const shown = [...values].filter((name) => !follow.has(name)).slice(0, MOST - followed.length);
    if (followed.length) fields.follow = followed.join(",");
    if (shown.length) fields.values = shown.join(",");
    this.#followed = new Set(followed);
    this.#shown = new Set([...followed, ...shown]);
    for (const [key, value] of this.values) {
      if (!this.#shown.has(key)) value.shownUs = undefined;
      if (!this.#followed.has(key)) value.sinceUs = undefined;
    }
    const path = eventsPath(fields);
    this.#isStale = false;
    if (path === this.#path && this.#source) return this.#source.hasBegun && this.#endWaiting();
    this.#path = path;
    const old = this.#source;
    const source = new EventStream(path);
    this.#source = source;
    const closeOld = () => old?.close();
    source.addEventListener("clock", closeOld, { once: true });
    setTimeout(closeOld, 1_000);
    for (const event of EVENTS) source.addEventListener(event, (message) => this.#take(source, event, message));
    source.onfailed = () => this.#failed(source);
  }

  #endWaiting() {
    this.#waiting.splice(0).forEach((resolve) => resolve());
  }

  #take(source, event, message) {
    if (source !== this.#source) return;
    const data = JSON.parse(message.data);
    setNotice("stream", "");
    // Each stream begins with the clock.
    source.hasBegun = true;
    if (!this.#isStale) this.#endWaiting();
    this.latest[event] = data;
    this["_" + event]?.(data);
    for (const listener of this.#listeners.get(`each ${event}`) ?? []) listener(data);
    this.#mark(event);
  }

  _clock(data) {
    this.clock = data;
    this.hasEnded = false;
  }
  _values(data) {
    for (const value of data.values.map(withoutPlc)) {
      const key = keyOf(value);
      const before = this.values.get(key);
      const isNew = before && before.value !== value.value;
      // The time of a recorded change is exact. If the register changed while the page did not show it, the time is unknown.
      const readUs = !isNew || this.#turnedUs !== null ? before?.changedUs : before.shownUs === undefined ? undefined : value.time_us;
      const sinceUs = this.#followed.has(key) ? (before?.sinceUs ?? value.time_us) : undefined;
      this.values.set(key, { ...value, changedUs: value.changed_us ?? readUs, shownUs: before?.shownUs ?? value.time_us, sinceUs });
    }
  }
  _changes(data) {
    // When the plant has gone back, the server also reports the differences as changes, although no program has stored them.
    data.changes = data.changes.map(withoutPlc).filter(({ by, time_us }) => by !== "channel" || time_us !== this.#turnedUs);
    for (const change of data.changes) {
      const known = this.values.get(keyOf(change)) ?? this.#withAddress(change);
      if (known) known.changedUs = change.time_us;
    }
    this.changes.push(...data.changes);
    if (this.changes.length > KEPT * 1.25) this.changes.splice(0, this.changes.length - KEPT);
  }
  /** Returns the register at the address of a change: the address can have another name at this moment. */
  #withAddress({ plc, address }) {
    for (const key of this.#shown) {
      const value = this.values.get(key);
      if (value?.address === address && value.plc === plc) return value;
    }
    return null;
  }
  _turned({ time_us }) {
    this.#turnedUs = time_us;
    setTimeout(() => (this.#turnedUs = null), ROUND_MS);
    this.changes = this.changes.filter((change) => change.time_us <= time_us);
    for (const value of this.values.values()) {
      if (value.changedUs > time_us) value.changedUs = undefined;
      if (value.shownUs > time_us) value.shownUs = time_us;
      if (value.sinceUs > time_us) value.sinceUs = time_us;
    }
  }
  _lost({ rounds = 0, changes = 0, records = 0 }) {
    const parts = [rounds && `${rounds} updates`, changes && `${changes} changes`, records && `${records} records of the journal`];
    const text = `This page was too slow for the emulator and has lost ${parts.filter(Boolean).join(", ")}. All values shown are current.`;
    setNotice("lost", text, "warn", ["Close", () => setNotice("lost", "")]);
  }
  _ended({ reason, complete = true }) {
    this.hasEnded = true;
    this.#close();
    setNotice("stream", `The emulator has ended: ${reason}${complete ? "" : ". Its last changes and records may be missing"}`, "bad", ["Try again", () => this.#again()]);
  }

  /** Reloads the page if an emulator runs again. It may have another server at the same port, which asks for its own token. */
  async #again() {
    try {
      const instances = (await isSignedIn()) && (await readInstances());
      if (instances && !instances.some((it) => it.name === server.instance)) throw new Error(`The instance ${server.instance} does not run`);
      location.reload();
    } catch (problem) {
      showError(problem);
    }
  }

  async #failed(source) {
    if (source !== this.#source || this.hasEnded) return;
    setNotice("stream", "The connection to the server is interrupted; the values shown are old.", "bad");
    this.#source = null;
    const isIn = await isSignedIn().catch(() => true);
    if (!isIn) return location.reload();
    setTimeout(() => this.#connect(), 1_500);
  }

  /**
   * Closes the stream while the page is hidden, because browsers allow only six connections to a server, and when the browser freezes
   * the page: a stream does not continue after that.
   */
  watchVisibility() {
    let timer;
    document.addEventListener("visibilitychange", () => {
      clearTimeout(timer);
      if (!document.hidden) return this.#connect();
      timer = setTimeout(() => this.keepsOpen || this.#close(), 30_000);
    });
    document.addEventListener("freeze", () => this.#close());
    document.addEventListener("resume", () => this.#connect());
  }
}

/** The stream of the chosen instance. */
export const feed = new Feed();
