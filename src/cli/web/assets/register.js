// The selected register: its description, its bits as switches, and the controls that write the register.

import { act, guard } from "./actions.js";
import { post } from "./api.js";
import { field, fill, h, newId, setAttribute, setText } from "./dom.js";
import { feed } from "./feed.js";
import { placeOf, provenanceOf, withSource } from "./map.js";
import { clearError, showError, showNote, showWarning } from "./messages.js";
import { isPinned, onPins } from "./pins.js";
import { addToRecord, expectValue, onRecord, recorder } from "./record.js";
import { bytesOf, digits, hex, integerOf, isScalar, parseValue, seconds, signed } from "./values.js";

/** Shows a register in `root`. Returns a function that closes it. */
export function showRegister(root, item, context) {
  const view = new RegisterView(root, item, context);
  const update = () => view.update();
  const ends = ["values", "changes", "ended"].map((event) => feed.on(event, update));
  ends.push(onPins(update));
  return () => [...ends, view.endRecord].forEach((end) => end?.());
}

class RegisterView {
  constructor(root, item, context) {
    Object.assign(this, { root, item, entry: item.entry });
    const { entry } = this;
    const close = h("button", { class: "plain close", label: "Close (Esc)", onclick: context.closeDetail }, "\u00d7");
    const isRegister = isScalar(entry.type) && !item.isArray;
    this.star = isRegister && h("button", { class: "star", "data-pin": item.key, label: `Follow ${item.name}` }, "\u2605");
    this.now = h("output", { class: `now mono b${bytesOf(entry.type)}` });
    this.meaning = h("div", { class: "now-meaning" });
    this.bits = new Map();
    fill(root, h("header", null, h("h2", { class: "mono" }, item.name), this.star, close),
      isRegister && [h("div", { class: "reading" }, this.now, this.meaning), this.form(), this.bitTable()],
      this.facts(), this.valueTable());
    this.update();
  }

  get value() {
    return feed.values.get(this.item.key);
  }

  update() {
    const { value, entry } = this;
    if (value) {
      const number = signed(value.value, entry.type);
      setText(this.now, `${value.hex}  ${number}`);
      setText(this.meaning, `${value.forced ? "forced \u2013 " : ""}${value.meaning || "no meaning"}`);
      setAttribute(this.meaning, "title", value.meaning);
      if (this.address) setText(this.address, value.address);
      setAttribute(this.root, "data-forced", value.forced);
      if (this.last) setText(this.last, value.changedUs === undefined ? "not seen by this page" : seconds(value.changedUs));
    }
    if (this.expected && value) setAttribute(this.expected, "placeholder", value.hex);
    for (const [bit, control] of this.bits) this.updateBit(bit, control, value?.value);
    if (this.star) setAttribute(this.star, "aria-pressed", isPinned(this.item.key));
    if (this.unforce) this.unforce.dataset.why = value?.forced ? "" : "The register is not forced";
    guard(this.root);
  }

  updateBit(bit, control, value) {
    if (value === undefined) return;
    const [first, last] = bit;
    const number = Math.floor(value / 2 ** first) % 2 ** (last - first + 1);
    if (first === last) setAttribute(control, "aria-checked", number === 1);
    else setText(control, String(number));
  }

  form() {
    const { entry, item } = this;
    const options = newId();
    const input = h("input", { name: "value", class: "mono", autocomplete: "off", spellcheck: false, placeholder: "16#0000", list: options });
    input.setAttribute("list", options);
    const known = entry.values.filter((value) => value.first === value.last);
    const write = (operation) => async () => {
      try {
        const value = parseValue(input.value, entry.type, entry.values);
        const verb = operation === "poke" ? "poke" : "force";
        await act(operation, { ...(await placeOf(item.key)), value }, `${verb} ${item.name} = ${hex(value, entry.type)}`, `${item.name}: ${operation === "force" ? "forced" : this.value?.forced ? "written, but the register is forced and keeps its value" : "written"}`, item.key);
      } catch (error) {
        showError(error);
      }
    };
    const poke = write("poke");
    const form = h("form", { class: "write" }, field("New value", input),
      h("datalist", { id: options }, known.map((value) => h("option", { value: value.meaning }, value.hex))),
      button("Poke", { type: "submit", class: "primary" }),
      button("Force", { onclick: write("force"), "data-title": "The register keeps the value against firmware and PLC" }),
      (this.unforce = button("Unforce", { onclick: () => this.release() })));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      poke();
    });
    return [form, this.expectation(options)];
  }

  /** Adds the controls for an expected value, the present one or another. They are shown only while a recording runs. */
  expectation(options) {
    this.expected = h("input", { name: "expected", class: "mono", autocomplete: "off", spellcheck: false });
    this.expected.setAttribute("list", options);
    const send = h("button", { type: "submit" }, "Expect this value");
    const form = h("form", { class: "write" }, field("Expected value; the present one if empty", this.expected), send);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      try {
        this.expect(this.expected.value.trim());
        this.expected.value = "";
      } catch (error) {
        showError(error);
      }
    });
    const show = () => {
      send.disabled = !recorder.isOn;
      send.title = recorder.isOn ? "" : "Press Record first: an expectation is part of a recording";
    };
    this.endRecord = onRecord(show);
    show();
    return form;
  }

  expect(text) {
    const { entry, item, value } = this;
    const wanted = text ? hex(parseValue(text, entry.type, entry.values), entry.type) : value?.hex;
    if (!wanted) throw new Error(`${item.name} has not been read yet`);
    const isNow = wanted === value?.hex;
    expectValue(item.key, wanted, isNow ? value.meaning : `but it was ${value?.hex ?? "unknown"}`, !isNow);
    if (isNow) showNote(`${item.name} = ${wanted}: the scenario expects it`);
    else showWarning(`${item.name} = ${wanted}: the scenario expects it, but the register has ${value?.hex ?? "an unknown value"} now`);
  }

  async release() {
    const { item } = this;
    try {
      await act("unforce", await placeOf(item.key), `unforce ${item.name}`, `${item.name}: no longer forced`, item.key);
    } catch (error) {
      showError(error);
    }
  }

  bitTable() {
    const { entry } = this;
    if (!/^(BYTE|WORD|DWORD|BOOL)$/.test(entry.type) && !entry.bits.length) return null;
    const count = 8 * bytesOf(entry.type);
    const strip = Array.from({ length: count }, (_, at) => this.bitSwitch(count - 1 - at, nameOfBit(entry, count - 1 - at), true));
    const named = entry.bits.filter((bit) => bit.name !== "reserved").map((bit) => this.bitRow(bit));
    return [h("h3", null, "Bits"), h("div", { class: `bitstrip b${count}` }, strip), named.length > 0 && h("ul", { class: "bits" }, named)];
  }

  bitRow(bit) {
    const place = bit.first === bit.last ? String(bit.first) : `${bit.first}\u2013${bit.last}`;
    const value = bit.first === bit.last ? this.bitSwitch(bit.first, bit.name, false) : h("output", { class: "mono" });
    if (bit.first !== bit.last) this.bits.set([bit.first, bit.last], value);
    return h("li", null, h("span", { class: "mono place" }, place), value, h("span", null, h("b", null, bit.name), " ", h("small", null, withSource(bit.meaning, bit.provenance))));
  }

  bitSwitch(bit, name, isSmall) {
    const control = button(isSmall ? String(bit) : "", { role: "switch", "aria-checked": "false", class: isSmall ? "bit" : "switch", label: `Bit ${bit}${name ? `, ${name}` : ""}`, "data-title": name ? `Bit ${bit}: ${name}` : `Bit ${bit}` });
    control.addEventListener("click", () => this.flip(bit));
    this.bits.set([bit, bit], control);
    return control;
  }

  /** Changes one bit. Computes the new value from the shown one, and writes it only if the register still has the shown
  /** value. */
  async flip(bit) {
    const { item, entry } = this;
    const beforeUs = feed.timeUs;
    try {
      const place = await placeOf(item.key);
      let current = this.value?.value ?? 0;
      const isSet = Math.floor(current / 2 ** bit) % 2 === 1;
      for (let attempt = 0; attempt < 8; attempt += 1) {
        const has = Math.floor(current / 2 ** bit) % 2 === 1;
        const value = has === isSet ? current + (isSet ? -1 : 1) * 2 ** bit : current;
        const { exchanged } = await post("compare_exchange", { ...place, current, new: value });
        if (exchanged.ok) {
          clearError();
          return addToRecord({ operation: "poke", fields: { ...place, value }, register: item.key, words: `poke ${item.name} = ${hex(value, entry.type)}, bit ${bit}`, beforeUs });
        }
        if (exchanged.found === current) throw new Error(`${item.name} is forced and keeps its value`);
        current = exchanged.found;
      }
      throw new Error(`${item.name}: other programs change the register all the time`);
    } catch (error) {
      showError(error);
    }
  }

  facts() {
    const { entry } = this;
    const value = this.value;
    const source = provenanceOf(entry);
    const rows = [
      ["Meaning", entry.meaning], ["PLC", entry.plc], ["Address", !this.item.isArray && isScalar(entry.type) ? (this.address = h("span", { class: "mono" }, value?.address ?? (entry.ranges.length ? "\u2026" : entry.address))) : entry.address],
      ["CPU address", entry.cpu_address && digits(integerOf(entry.cpu_address) + (this.item.bytes ?? 0), 4)],
      ["Type", entry.type], ["Structure", entry.structure], ["Variable", entry.variable], ["Written by", entry.owner], ["After reset", entry.reset],
      ["Manual", entry.page && `page ${entry.page}`], ["Values", entry.meaning_page && `page ${entry.meaning_page} of the manual`], ["Facts", source.text],
      ["Last change", isScalar(entry.type) && !this.item.isArray && (this.last = h("span"))],
    ];
    return [h("h3", null, "Facts"), h("dl", { class: "facts" }, rows.filter(([, text]) => text).map(([name, text]) => [h("dt", null, name), h("dd", null, text)]))];
  }

  valueTable() {
    const { values } = this.entry;
    if (!values.length) return null;
    const range = (value) => (value.first === value.last ? value.hex : `${value.first} to ${value.last}`);
    return [h("h3", null, "Values"), h("dl", { class: "facts values" }, values.map((value) => [h("dt", { class: "mono" }, range(value)), h("dd", null, value.meaning, " ", h("small", null, value.provenance))]))];
  }
}

function button(text, props) {
  return h("button", { acts: true, ...props }, text);
}

const nameOfBit = (entry, bit) => entry.bits.find((it) => it.first <= bit && bit <= it.last)?.name ?? "";
