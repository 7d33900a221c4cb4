// A chart of values over emulated time on a canvas: steps, because a register has its value until the next change.

import { h } from "./dom.js";

export class Chart {
  constructor({ label, height = 220 }) {
    this.canvas = h("canvas", { role: "img", label });
    this.legend = h("div", { class: "legend" });
    this.element = h("div", { class: "chart" }, this.canvas, this.legend);
    this.canvas.style.height = `${height}px`;
    this.height = height;
    // The width and the colours can change without new data.
    new ResizeObserver(() => this.canvas.clientWidth !== this.width && this.again?.()).observe(this.canvas);
    const recolour = () => (this.canvas.isConnected ? this.again?.() : ends.abort());
    const ends = new AbortController();
    addEventListener("theme", recolour, { signal: ends.signal });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour, { signal: ends.signal });
  }

  /** Draws series `{name, points: [[time, value]]}` between two times, in one field with a common scale. */
  draw(from, until, series) {
    this.again = () => this.draw(from, until, series);
    const { context, width } = this.#begin();
    if (!width) return;
    const all = series.flatMap((it) => it.points.map((point) => point[1]));
    let [least, most] = [Math.min(0, ...all), Math.max(0, ...all)];
    if (least === most) most = least + 1;
    const box = { x: 64, y: 10, width: width - 76, height: this.height - 36, from, until, least, most };
    this.#axes(context, box);
    series.forEach((it, at) => this.#line(context, box, it.points, at));
    this.#names(series.map((it) => [it.name, it.points.at(-1)?.[1]]));
  }

  /** Draws each series in a separate lane, with its values as text. Used for registers. */
  lanes(from, until, series, laneHeight = 46) {
    this.again = () => this.lanes(from, until, series, laneHeight);
    this.height = Math.max(90, series.length * laneHeight + 30);
    this.canvas.style.height = `${this.height}px`;
    const { context, width } = this.#begin();
    if (!width) return;
    const box = { x: 12, width: width - 24, y: 0, height: series.length * laneHeight, from, until };
    this.#times(context, { ...box, height: this.height - 26 });
    series.forEach((it, at) => this.#lane(context, { ...box, y: at * laneHeight, height: laneHeight }, it, at));
  }

  #begin() {
    const ratio = devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    this.width = width;
    this.canvas.width = width * ratio;
    this.canvas.height = this.height * ratio;
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.font = "11px system-ui, sans-serif";
    return { context, width };
  }

  /** Returns a colour of the style sheet in the present colour scheme (light or dark). */
  #colour(name) {
    this.canvas.style.color = `var(${name})`;
    return getComputedStyle(this.canvas).color;
  }

  #times(context, box) {
    context.strokeStyle = this.#colour("--line");
    context.fillStyle = this.#colour("--muted");
    context.lineWidth = 1;
    context.textAlign = "center";
    const step = stepOf((box.until - box.from) / Math.max(2, Math.floor(box.width / 110)));
    const [unit, name] = box.until < 1e3 ? [1, "us"] : box.until < 1e6 ? [1e3, "ms"] : [1e6, "s"];
    const places = Math.max(0, -Math.floor(Math.log10(step / unit)));
    for (let time = Math.ceil(box.from / step) * step; time <= box.until; time += step) {
      const x = Math.round(xOf(box, time)) + 0.5;
      context.beginPath();
      context.moveTo(x, box.y);
      context.lineTo(x, box.y + box.height);
      context.stroke();
      const label = `${(time / unit).toFixed(places)} ${name}`;
      const half = context.measureText(label).width / 2;
      context.fillText(label, Math.max(half, Math.min(x, this.width - half)), box.y + box.height + 16);
    }
  }

  #axes(context, box) {
    this.#times(context, box);
    context.textAlign = "right";
    const step = stepOf((box.most - box.least) / 4);
    for (let value = Math.ceil(box.least / step) * step; value <= box.most; value += step) {
      const y = Math.round(yOf(box, value)) + 0.5;
      context.beginPath();
      context.moveTo(box.x, y);
      context.lineTo(box.x + box.width, y);
      context.stroke();
      context.fillText(value.toLocaleString("en"), box.x - 8, y + 4);
    }
  }

  #line(context, box, points, at) {
    context.strokeStyle = this.#colour(`--c${(at % 6) + 1}`);
    context.lineWidth = 2;
    context.beginPath();
    points.forEach(([time, value], index) => {
      const x = Math.max(box.x, xOf(box, time)), y = yOf(box, value);
      if (index) context.lineTo(x, yOf(box, points[index - 1][1]));
      context[index ? "lineTo" : "moveTo"](x, y);
    });
    context.stroke();
  }

  #lane(context, box, { points, text }, at) {
    const values = points.map((point) => point[1]);
    const [least, most] = [Math.min(...values), Math.max(...values)];
    const inner = { ...box, y: box.y + 20, height: box.height - 26, least: least === most ? least - 1 : least, most };
    this.#line(context, inner, points, at);
    context.textAlign = "left";
    context.fillStyle = this.#colour(`--c${(at % 6) + 1}`);
    let free = box.x;
    points.forEach(([time, value], index) => {
      const x = Math.max(box.x, xOf(box, time));
      if (index && points[index - 1][1] === value) return;
      const next = points[index + 1];
      const isBrief = next?.[0] === time && next[1] !== value;
      if (x < free || isBrief) return;
      const label = text(value);
      const { width } = context.measureText(label);
      context.fillText(label, Math.min(x + 2, box.x + box.width - width - 3), box.y + 13);
      free = x + width + 8;
    });
    context.strokeStyle = this.#colour("--line");
    context.lineWidth = 1;
    context.strokeRect(box.x + 0.5, box.y + 0.5, box.width, box.height);
  }

  #names(pairs) {
    const texts = pairs.map(([name, value]) => `${name} ${value ?? ""}`);
    if (this.legend.children.length !== pairs.length) this.legend.replaceChildren(...pairs.map((_, at) => h("span", { class: `key k${at % 6}` })));
    texts.forEach((text, at) => (this.legend.children[at].textContent = text));
  }
}

const xOf = (box, time) => box.x + ((time - box.from) / Math.max(1, box.until - box.from)) * box.width;
const yOf = (box, value) => box.y + box.height - ((value - box.least) / (box.most - box.least || 1)) * box.height;

/** Returns a round number of at least `least` as the step of a scale. */
function stepOf(least) {
  const power = 10 ** Math.floor(Math.log10(Math.max(least, 1e-9)));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least) ?? power * 10;
}
