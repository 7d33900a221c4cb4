// Page "Bus": the last intervals of a bus as a timeline with slots and frames, and the frames as a list.

import { look, show } from "./api.js";
import { choice, fill, h, oneAtATime, setText, svg, td, tdMono } from "./dom.js";
import { feed } from "./feed.js";
import { showError } from "./messages.js";
import { counted, decoded, duration, seconds, short } from "./values.js";

const SHOWN = 3;
/** Maximum number of intervals that the server returns. */
const MOST = 64;
/** Minimum real time between two readings, in milliseconds. */
const PAUSE_MS = 100;

export function busPage(root, rest, context) {
  const page = new BusPage(root, rest, context);
  const off = feed.on("clock", () => page.read());
  const turned = feed.on("turned", () => page.latest());
  if (rest[1]) page.goTo(Number(rest[1]));
  else page.read();
  return Object.assign(() => {
    off();
    turned();
    page.isEnded = true;
    page.observer?.disconnect();
  }, { key: (event) => page.key(event) });
}

class BusPage {
  /** Number of intervals after the last displayed one; 0 if the latest interval is displayed. */
  back = 0;
  chosen = null;

  /** Reads the intervals and draws them, at most once per pause. */
  read = oneAtATime(PAUSE_MS, () => this.readNow());

  constructor(root, [name], context) {
    const buses = context.status.buses;
    this.bus = buses.find((bus) => bus.bus === decoded(name))?.bus ?? buses[0]?.bus;
    if (!this.bus) return void fill(root, h("p", { class: "empty" }, "The plant has no bus."));
    const select = choice(buses.map((bus) => [bus.bus, `${bus.bus} (${bus.kind})`]), this.bus, { label: "Bus" });
    select.addEventListener("change", () => {
      this.bus = select.value;
      context.setRest(encodeURIComponent(this.bus));
      this.latest();
    });
    this.info = h("span", { class: "muted grow" });
    const at = h("input", { class: "mono", size: 9, placeholder: "time: 137.5ms", label: "Go to a time", spellcheck: false });
    at.addEventListener("change", () => {
      try {
        if (at.value.trim()) this.goTo(duration(at.value));
      } catch (error) {
        showError(error);
      }
    });
    const button = (text, label, work) => h("button", { label, title: label, onclick: work }, text);
    this.end = button("Latest", "The latest intervals (key End)", () => this.latest());
    this.windows = h("div", { class: "stack" });
    this.observer = new ResizeObserver(() => this.last && this.draw(...this.last));
    this.observer.observe(this.windows);
    this.body = h("tbody");
    const head = ["At", "Takes", "Slot", "Frame"].map((it) => h("th", { scope: "col" }, it));
    fill(root, h("div", { class: "line wrap" }, select, h("div", { class: "group" }, button("\u25c0", "Previous interval (left arrow)", () => this.turn(true)), button("\u25b6", "Next interval (right arrow)", () => this.turn(false))), this.end, at, this.info),
      h("div", { class: "bus-split" }, this.windows, h("div", { class: "box scroll frames", tabIndex: 0, role: "group", label: "Frames" }, h("table", null, h("thead", null, h("tr", null, head)), this.body))));
  }

  latest() {
    this.back = 0;
    this.read();
  }

  key(event) {
    if (event.key === "ArrowLeft") this.turn(true);
    else if (event.key === "ArrowRight") this.turn(false);
    else if (event.key === "End") this.latest();
    else return false;
    return true;
  }

  /** Shows earlier or later intervals, until "Latest". */
  turn(isBack) {
    const most = Math.min(MOST, this.known) - SHOWN;
    this.back = Math.max(0, Math.min(this.back + (isBack ? 1 : -1), most));
    this.read();
  }

  /** Shows the interval that contains this time, and those before it. */
  async goTo(us) {
    try {
      const intervals = await show("frames", { bus: this.bus, count: MOST });
      const at = intervals.findLastIndex(({ window }) => window.begin_us <= us);
      if (at < 0 || us > feed.timeUs) throw new Error(`${seconds(us)} is not in the last ${counted(intervals.length, "interval")}: from ${seconds(intervals[0]?.window.begin_us ?? 0)} to ${seconds(feed.timeUs)}`);
      this.known = intervals.length;
      this.back = Math.max(0, Math.min(intervals.length - SHOWN, intervals.length - 1 - at));
    } catch (problem) {
      showError(problem);
    }
    this.read();
  }

  async readNow() {
    if (!this.bus || this.isEnded) return;
    try {
      const [intervals, { scene }] = await Promise.all([show("frames", { bus: this.bus, count: this.back + SHOWN }), look("scene")]);
      if (!this.isEnded) this.draw(intervals.slice(0, Math.max(SHOWN, intervals.length - this.back)), intervals.length, scene.find((it) => it.name === this.bus));
    } catch (problem) {
      if (!feed.hasEnded) showError(problem);
    }
  }

  draw(intervals, known, scene) {
    this.known = known === this.back + SHOWN ? MOST : known;
    const slots = scene?.interval?.slots ?? [];
    const data = { windows: intervals.map(({ window, frames }) => ({ ...window, slots: window.is_interval ? slots : [], frames, begun: frames.filter((frame) => frame.from_us >= window.begin_us) })) };
    const text = JSON.stringify([data.windows, this.windows.clientWidth]);
    this.last = [intervals, known, scene];
    this.end.setAttribute("aria-pressed", this.back === 0);
    setText(this.info, scene ? `${scene.kind}, ${scene.bit_s / 1000} kbit/s${this.back ? `, ${counted(this.back, "interval")} back` : ""}` : "");
    if (text === this.text) return;
    this.text = text;
    fill(this.windows, data.windows.map((window) => this.window(window)));
    const rows = data.windows.flatMap((window) => [
      h("tr", { class: "window-row" }, h("th", { colSpan: 4, scope: "rowgroup" }, `${seconds(window.begin_us)}, ${window.is_interval ? "interval" : "part"} of ${short(window.us)}`)),
      ...(window.begun.length ? window.begun.map((frame) => this.row(frame, window)) : [h("tr", null, h("td", { colSpan: 4, class: "muted" }, window.frames.length ? "no frame begins here" : "no frame"))]),
    ]);
    fill(this.body, rows);
  }

  row(frame, window) {
    const at = `${frame.from_us - window.begin_us} us`;
    return h("tr", { class: `${frame.is_bad ? "bad" : ""}${keyOf(frame) === this.chosen ? " chosen" : ""}`, "data-frame": keyOf(frame) }, tdMono(at), tdMono(frame.until_us > frame.from_us ? `${frame.until_us - frame.from_us} us` : ""), td(slotOf(frame, window)), h("td", { class: "wrap-text" }, frame.text));
  }

  /** An interval as a picture: slots above, frames below, time at the bottom. */
  window(window) {
    const width = Math.max(280, this.windows.clientWidth - 36), scale = (us) => Math.max(0, Math.min(1, (us - window.begin_us) / window.us)) * width;
    const slots = window.slots ?? [];
    const slotEnd = (at) => (at + 1 < slots.length ? slots[at + 1].start_us : window.us);
    const bands = slots.map((slot, at) => {
      const x = (slot.start_us / window.us) * width, w = ((slotEnd(at) - slot.start_us) / window.us) * width;
      return [svg("rect", { class: `slotband${at % 2 ? " odd" : ""}`, x, y: 20, width: Math.max(0, w), height: 54 }), w > 7 * slot.name.length + 4 && svg("text", { class: "small", x: x + 4, y: 14 }, slot.name)];
    });
    const frames = window.frames.map((frame) => this.frame(frame, scale, frame.from_us < window.begin_us));
    const ticks = (width < 420 ? [0, 0.5, 1] : [0, 0.25, 0.5, 0.75, 1]).map((part) => svg("text", { class: "small", x: part * width, y: 92, "text-anchor": part === 0 ? "start" : part === 1 ? "end" : "middle" }, short(Math.round(window.us * part))));
    const now = feed.timeUs >= window.begin_us && feed.timeUs < window.begin_us + window.us && svg("line", { class: "now-line", x1: scale(feed.timeUs), x2: scale(feed.timeUs), y1: 18, y2: 78 });
    return h("section", { class: "box pad" }, h("h2", { class: "mono" }, seconds(window.begin_us)),
      svg("svg", { class: "timeline", viewBox: `0 0 ${width} 96`, width, height: 96, role: "img", label: `Timeline from ${seconds(window.begin_us)}, ${counted(window.begun.length, "frame")}; the list has the same content` },
        svg("rect", { class: "wire", x: 0, y: 20, width, height: 54 }), bands, frames, now, ticks));
  }

  /** Draws a frame. `isRest`: the frame began in the previous interval, which lists it; only its end is in this interval. */
  frame(frame, scale, isRest) {
    const x = scale(frame.from_us), end = scale(frame.until_us);
    const node = frame.is_bad
      ? svg("path", { class: "frame bad-frame", d: `M${x - 5} 40l10 14m0-14l-10 14` })
      : svg("rect", { class: isRest ? "frame rest" : "frame", x, y: 34, width: Math.max(2.5, end - x), height: 30, rx: 2 });
    node.append(svg("title", null, isRest ? `End of: ${frame.text}` : frame.text));
    node.addEventListener("click", () => {
      this.chosen = keyOf(frame);
      for (const row of this.body.rows) row.classList.toggle("chosen", row.dataset.frame === this.chosen);
      this.body.querySelector(".chosen")?.scrollIntoView({ block: "nearest" });
    });
    return node;
  }
}

const slotOf = (frame, { begin_us, slots }) => (frame.is_bad ? "" : (slots.findLast((slot) => slot.start_us <= frame.from_us - begin_us + 1)?.name ?? ""));
const keyOf = (frame) => `${frame.from_us} ${frame.until_us} ${frame.text}`;
