// Page "Plant": devices with their ports, buses with load and stations, drives, and the buses drawn as lines.

import { look } from "./api.js";
import { fill, h, svg, td, tdMono } from "./dom.js";
import { feed } from "./feed.js";
import { showError } from "./messages.js";
import { counted } from "./values.js";

export function plantPage(root, rest, context) {
  const box = h("div", { class: "plant" });
  fill(root, box);
  let timer;
  let before = "";
  const read = async () => {
    try {
      const [status, { buses }] = await Promise.all([context.refreshStatus(), look("buses")]);
      const text = JSON.stringify([status.plcs, status.nodes, status.buses, status.drives, status.faults, status.forced, status.errors, status.warnings, buses]);
      if (text !== before) draw(box, status, buses);
      before = text;
      timer = setTimeout(read, 1_000);
    } catch (problem) {
      if (!feed.hasEnded) showError(problem);
      timer = setTimeout(read, 5_000);
    }
  };
  read();
  return () => clearTimeout(timer);
}

function draw(box, status, buses) {
  const to = (page, text) => h("a", { href: `#/${encodeURIComponent(status.instance)}/${page}` }, text);
  const onBus = status.drives.filter((drive) => drive.bus).length;
  const builtIn = status.drives.length - onBus;
  fill(box,
    h("section", { class: "box pad", label: "Instance" }, h("div", { class: "numbers" },
      number("PLCs", status.plcs.length), number("Buses", status.buses.length), number("Drives", onBus), builtIn > 0 && number("Built-in drives", builtIn),
      number(to("faults", "Faults"), status.faults), number(to("faults", "Forced"), status.forced),
      number(to("findings", "Errors"), status.errors, status.errors > 0 && "bad"), number(to("findings", "Warnings"), status.warnings, status.warnings > 0 && "warn"))),
    h("section", { class: "box pad", label: "Topology" }, topology(status)),
    h("div", { class: "columns" }, status.plcs.map((plc) => device(plc, status)), status.buses.map((bus) => busBox(bus, buses.find((it) => it.bus === bus.bus), status))));
}

function number(label, value, kind) {
  return h("div", { class: `number ${kind || ""}` }, h("b", null, String(value)), h("span", null, label));
}

function device(plc, status) {
  const nodes = status.nodes.filter((node) => node.node.startsWith(`${plc.plc}:`));
  const state = [plc.power === "on" ? "supply on" : "no supply", plc.switch && `switch ${plc.switch}`, plc.program && `program ${plc.program}`];
  const row = (node) => h("tr", null, tdMono(node.node.slice(plc.plc.length + 1)), td(node.bus ?? "\u2013"), td(node.text ?? "\u2013"));
  return h("section", { class: "box" }, h("header", { class: "boxhead" }, h("h2", null, plc.plc), h("small", null, plc.device)),
    h("p", { class: "pad muted" }, state.filter(Boolean).join(", ")),
    table(["Port", "Bus", "State"], nodes.map(row)));
}

function busBox(bus, more, status) {
  const load = bus.load_percent === null ? null : h("div", { class: "load" }, h("meter", { min: 0, max: 100, low: 60, high: 85, optimum: 0, value: bus.load_percent, label: `Load of ${bus.bus}` }), h("span", { class: "mono" }, `${bus.load_percent.toFixed(1)} %`));
  const stations = (more?.stations ?? []).map((it) => h("tr", null, tdMono(it.name), td(it.address ?? ""), td(it.state.replaceAll("_", " ")), td(it.transmit_errors || it.receive_errors ? `${it.transmit_errors} / ${it.receive_errors}` : "")));
  const drives = status.drives.filter((drive) => drive.bus === bus.bus);
  const doors = more?.doors ?? [];
  const guests = more?.guests ?? [];
  return h("section", { class: "box" }, h("header", { class: "boxhead" }, h("h2", null, bus.bus), h("small", null, `${bus.kind}, ${bus.kbit_s} kbit/s`)),
    h("div", { class: "pad" }, h("span", { class: "muted" }, "Load"), load),
    bus.other_rates.length > 0 && h("p", { class: "pad warn" }, `Other baud rates: ${bus.other_rates.join(", ")}`),
    stations.length > 0 && table(["Station", "Address", "State", "Errors"], stations),
    drives.length > 0 && table(["Drive", "No.", "State"], drives.map((drive) => h("tr", null, tdMono(drive.drive), td(String(drive.number ?? "")), td(drive.state.replaceAll("_", " "))))),
    doors.length > 0 && h("p", { class: "pad mono" }, doors.join(", ")),
    guests.length > 0 && h("p", { class: "pad" }, counted(guests.length, "guest"), ": ", guests.map((guest) => guest.name ?? guest.door ?? String(guest)).join(", ")));
}

/** Creates a table from the names of its columns, its rows and a label. */
export function table(names, rows, label) {
  return h("table", { label }, h("thead", null, h("tr", null, names.map((name) => h("th", { scope: "col" }, name || h("span", { class: "hidden" }, "Action"))))), h("tbody", null, rows));
}

/** Draws buses as horizontal lines, with the ports of devices above and drives below. */
function topology(status) {
  const width = 168, gap = 24;
  const above = status.plcs.map((plc, at) => ({ name: plc.plc, note: plc.device, x: 20 + at * (width + gap) }));
  const onBus = status.drives.filter((drive) => drive.bus);
  const columns = Math.max(above.length, onBus.length, 1);
  const total = 40 + columns * (width + gap);
  const busY = (name) => 118 + 26 * status.buses.findIndex((bus) => bus.bus === name);
  const bottom = 118 + 26 * status.buses.length;
  const lines = status.buses.map((bus, at) => [
    svg("line", { class: `busline k${at % 6}`, x1: 12, x2: total - 12, y1: busY(bus.bus), y2: busY(bus.bus) }),
    svg("text", { class: "small", x: total - 14, y: busY(bus.bus) - 5, "text-anchor": "end" }, bus.bus)]);
  const boxes = above.map(({ name, note, x }) => {
    const nodes = status.nodes.filter((node) => node.node.startsWith(`${name}:`) && node.bus);
    const drops = nodes.map((node, at) => {
      const px = x + (width * (at + 1)) / (nodes.length + 1);
      return [svg("line", { class: "drop", x1: px, x2: px, y1: 68, y2: busY(node.bus) }), svg("circle", { class: "joint", cx: px, cy: busY(node.bus), r: 4 }),
        svg("text", { class: "small", x: px + 5, y: 84 }, node.node.slice(name.length + 1))];
    });
    return [drops, unit(x, 12, width, 56, name, note)];
  });
  const drives = onBus.map((drive, at) => {
    const x = 20 + at * (width + gap), px = x + width / 2;
    return [svg("line", { class: "drop", x1: px, x2: px, y1: busY(drive.bus), y2: bottom + 14 }), svg("circle", { class: "joint", cx: px, cy: busY(drive.bus), r: 4 }),
      unit(x, bottom + 14, width, 44, drive.drive, drive.state.replaceAll("_", " "))];
  });
  const height = bottom + (onBus.length ? 72 : 8);
  const picture = svg("svg", { class: "topology", viewBox: `0 0 ${total} ${height}`, width: total, height, role: "img", label: "Devices, buses and drives; the tables below have the same content" }, lines, boxes, drives);
  return h("div", { class: "scroll", tabIndex: 0, role: "group", label: "Topology" }, picture);
}

function unit(x, y, width, height, name, note) {
  const cut = (text) => (text.length > 22 ? `${text.slice(0, 21)}\u2026` : text);
  return [svg("rect", { class: "unit", x, y, width, height, rx: 6 }), svg("text", { class: "strong", x: x + 12, y: y + height / 2 - 3 }, cut(name)), svg("text", { class: "small", x: x + 12, y: y + height / 2 + 13 }, cut(note))];
}
