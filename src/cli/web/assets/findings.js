// Page "Findings": findings of the access checker, with rule and page of the manual.

import { act, guard } from "./actions.js";
import { fill, h } from "./dom.js";
import { feed } from "./feed.js";
import { counted, seconds } from "./values.js";

export function findingsPage(root) {
  const off = feed.on("findings", ({ findings }) => draw(root, findings));
  feed.want("findings", { events: ["findings"] });
  fill(root, h("p", { class: "empty" }, "Reading\u2026"));
  if (feed.latest.findings) draw(root, feed.latest.findings.findings);
  return () => {
    off();
    feed.leave("findings");
  };
}

function draw(root, findings) {
  const errors = findings.filter((it) => it.severity === "error").length;
  const clear = h("button", { acts: true, "data-why": findings.length ? "" : "There are no findings", onclick: () => act("clear_findings", {}, "clear the findings", "The findings are cleared") }, "Clear");
  const head = h("div", { class: "line" }, h("p", { class: "grow", role: "status" }, findings.length ? `${counted(errors, "error")}, ${counted(findings.length - errors, "warning")}` : "The access checker has found no violation of the manual."), clear);
  fill(root, head, h("ul", { class: "cards" }, findings.map(card)));
  guard(root);
}

const USUAL = new Set(["rule", "name", "severity", "page", "text", "plc", "register", "count", "first_us", "last_us", "time_us", "place", "doc", "note"]);

function card(finding) {
  const place = [finding.plc ?? finding.bus, finding.register].filter(Boolean).join(":");
  const first = finding.first_us ?? finding.time_us;
  const more = Object.entries(finding).filter(([name, value]) => !USUAL.has(name) && value !== null && value !== "" && typeof value !== "object");
  return h("li", { class: `box pad finding ${finding.severity}` },
    h("div", { class: "line wrap" }, h("span", { class: `tag ${finding.severity === "error" ? "bad" : "warn"}` }, finding.severity), h("b", { class: "mono" }, `${finding.rule} ${finding.name ?? ""}`), place && h("span", { class: "mono" }, place), h("span", { class: "grow" }),
      finding.count > 1 && h("span", { class: "muted" }, `${finding.count} times`)),
    finding.note && h("p", null, h("b", null, finding.note)),
    h("p", null, finding.text ?? finding.doc),
    h("p", { class: "muted" }, [finding.page && `manual page ${finding.page}`, first !== undefined && `first at ${seconds(first)}`, finding.last_us !== undefined && finding.last_us !== first && `last at ${seconds(finding.last_us)}`, ...more.map(([name, value]) => `${name.replaceAll("_", " ")} ${value}`)].filter(Boolean).join(", ")));
}
