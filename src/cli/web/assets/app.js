// The page: signing in, instances, routes, keys, light and dark.

import { guard } from "./actions.js";
import { readInstances, server, show, signIn, signOut } from "./api.js";
import { clockKey, resetClock, startClock } from "./clock.js";
import { openDialog } from "./dialogs.js";
import { choice, field, fill, h } from "./dom.js";
import { feed } from "./feed.js";
import { resetMaps } from "./map.js";
import { setNotice, showError } from "./messages.js";
import { PAGES } from "./pages.js";
import { loadPins } from "./pins.js";
import { loadRecord, onRecord, recorder, showRecord, toggleRecord } from "./record.js";
import { decoded } from "./values.js";

const main = document.getElementById("main");
const nav = document.getElementById("nav");
const tools = document.getElementById("tools");
const chooser = document.getElementById("instance");
/** Up to this age, in milliseconds, a status is used again instead of being read. */
const FRESH_MS = 500;
/** Pause before the modules of the other pages are loaded, in milliseconds. */
const IDLE_MS = 300;
let current = null;
let status = null;
let statusAt = -Infinity;
let isBegun = false;
let routes = 0;
let using = null;

function start() {
  applyTheme(localStorage.getItem("commram.theme") ?? "");
  document.getElementById("skip").addEventListener("click", (event) => {
    event.preventDefault();
    main.focus();
  });
  addEventListener("hashchange", () => {
    const token = takeToken();
    if (token) enter(token);
    else if (isBegun) route();
  });
  enter(takeToken());
  // The module of the page is loaded while the browser signs in, so that the page appears sooner.
  pageOf(parts()[1]).load().catch(() => {});
}

/** Removes a token from the address bar, where other people could read it. */
function takeToken() {
  const token = /^#token=([0-9a-f]+)$/i.exec(location.hash)?.[1];
  if (token) history.replaceState(null, "", current ? addressOf(current) : location.pathname);
  return token;
}

/** Shows the page after signing in with the token, or with the session of this browser. */
async function enter(token) {
  try {
    if (token) await signIn(token);
    if (token && isBegun) return location.reload();
    await begin();
  } catch (problem) {
    if (isBegun) showError(problem);
    else if (problem.status === 401) askForToken(token ? problem.message : "");
    else fill(main, h("div", { class: "center" }, h("h1", null, "No connection"), h("p", null, problem.message), h("button", { class: "primary", onclick: () => location.reload() }, "Try again")));
  }
}

function askForToken(error) {
  const input = h("input", { type: "password", autocomplete: "off", required: true, class: "mono" });
  const problem = h("p", { class: "error", role: "alert" }, error);
  const form = h("form", { class: "stack center" }, h("h1", null, "Sign in"),
    h("p", null, "Open the address that ", h("code", null, "commram web"), " has printed, or enter the token from it."),
    field("Token", input), problem, h("button", { type: "submit", class: "primary" }, "Sign in"));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      await signIn(input.value.trim().replace(/^.*#token=/, ""));
      await begin();
    } catch (failed) {
      problem.textContent = failed.message;
    }
  });
  fill(main, form);
  input.focus();
}

async function begin() {
  await readInstances();
  isBegun = true;
  drawTools();
  startClock();
  feed.watchVisibility();
  feed.on("ended", () => guard(document.body));
  addEventListener("keydown", key);
  await route();
}

/** Splits the address after `#/` into the instance, the page, and the rest, which only the page uses. */
const parts = () => location.hash.replace(/^#\/?/, "").split("/");

const pageOf = (id) => PAGES.find((page) => page.id === id) ?? PAGES[0];

async function route() {
  const number = ++routes;
  const [name, pageName, ...rest] = parts();
  const instance = decoded(name) || (server.instances.length === 1 ? server.instances[0].name : "");
  if (!instance) return chooseInstance();
  const page = pageOf(pageName);
  let open;
  try {
    if (server.instance !== instance) using = useInstance(instance);
    [open] = await Promise.all([page.load(), using]);
  } catch (problem) {
    if (number !== routes) return;
    server.instance = null;
    return chooseInstance(problem.message);
  }
  // While this page was loading, the user has opened another one.
  if (number !== routes) return;
  if (current?.page === page && current.instance === instance && current.rest === rest.join("/")) return;
  current?.end?.();
  nav.querySelectorAll("a").forEach((link) => setCurrent(link, link.dataset.page === page.id));
  document.title = `${page.title} \u2013 ${instance} \u2013 commram`;
  const root = h("div", { class: `page ${page.id}-page`, id: `page-${page.id}` });
  fill(main, h("h1", { class: "hidden" }, page.title), root);
  current = { page, instance, rest: rest.join("/"), module: null };
  const context = { get status() { return status; }, setRest, refreshStatus };
  const end = open(root, rest, context);
  current.end = () => end?.();
  current.key = end?.key;
  guard(root);
  // Loads the other pages in advance, so that they open without a pause.
  setTimeout(() => PAGES.forEach((it) => it.load().catch(() => {})), IDLE_MS);
}

function setCurrent(link, isCurrent) {
  if (isCurrent) link.setAttribute("aria-current", "page");
  else link.removeAttribute("aria-current");
}

/** Changes the rest of the address without opening a page. */
function setRest(rest) {
  current.rest = rest;
  history.replaceState(null, "", addressOf(current));
}

const addressOf = ({ instance, page, rest }) => `#/${encodeURIComponent(instance)}/${page.id}${rest && `/${rest}`}`;

/** Reads the status, unless it has just been read. */
async function refreshStatus() {
  if (status?.instance === server.instance && performance.now() - statusAt < FRESH_MS) return status;
  status = await show("status");
  statusAt = performance.now();
  server.plcCount = status.plcs.length;
  return status;
}

async function useInstance(instance) {
  server.instance = instance;
  await refreshStatus();
  resetMaps();
  loadPins();
  loadRecord();
  feed.reset();
  drawNav();
  drawChooser();
  resetClock();
  setNotice("read-only", server.isReadOnly ? "Read-only: this server was started with --read-only. Controls that change the plant are disabled." : "", "info");
}

function chooseInstance(error) {
  current?.end?.();
  current = null;
  fill(nav);
  const one = (it) => h("li", null, h("a", { class: "card", href: `#/${encodeURIComponent(it.name)}/${PAGES[0].id}` },
    h("b", null, it.name), h("span", null, it.plcs.join(", ")), h("small", null, `${it.clock}, process ${it.pid}, ${it.state}`)));
  const again = h("button", { onclick: () => readInstances().then(() => chooseInstance()).catch(showError) }, "Look again");
  fill(main, h("div", { class: "center" }, h("h1", null, "Instances"), error && h("p", { class: "error" }, error),
    server.instances.length ? h("ul", { class: "cards" }, server.instances.map(one)) : h("p", null, "No emulator is running. Start one with ", h("code", null, "commram run"), "."), again));
}

function drawChooser() {
  const names = server.instances.map((it) => it.name);
  if (!names.includes(server.instance)) names.push(server.instance);
  const select = choice(names, server.instance, { label: "Instance" });
  select.addEventListener("change", () => (location.hash = `#/${encodeURIComponent(select.value)}/${current?.page.id ?? PAGES[0].id}`));
  fill(chooser, names.length > 1 ? select : h("span", { class: "mono" }, server.instance));
}

function drawNav() {
  const link = (page, index) =>
    h("li", null, h("a", { href: `#/${encodeURIComponent(server.instance)}/${page.id}`, "data-page": page.id, "aria-keyshortcuts": shortcut(index), title: `${page.text} (key ${shortcut(index)})` }, page.title));
  fill(nav, h("ul", null, PAGES.map(link)));
}

const shortcut = (index) => "1234567890"[index] ?? "-";

function drawTools() {
  const record = h("button", { class: "record", "aria-pressed": "false", title: "Record what you do as a scenario (key R)", "aria-keyshortcuts": "r", onclick: toggleRecord }, h("span", { class: "dot" }), h("span", null, "Record"));
  const scenario = h("button", { hidden: true, onclick: showRecord }, "Scenario");
  onRecord(() => {
    record.setAttribute("aria-pressed", recorder.isOn);
    record.lastChild.textContent = recorder.isOn ? `Recording: ${recorder.actions.filter((it) => it.words).length}` : "Record";
    scenario.hidden = !recorder.actions.length;
  });
  const themes = { "": "Auto", light: "Light", dark: "Dark" };
  const theme = choice(Object.entries(themes), localStorage.getItem("commram.theme") ?? "", { label: "Colours" });
  theme.addEventListener("change", () => applyTheme(theme.value));
  const out = h("button", { class: "quiet", onclick: () => signOut().then(() => location.reload()).catch(showError) }, "Sign out");
  fill(tools, record, scenario, theme, h("button", { class: "quiet", label: "Help: keys of this page", "aria-keyshortcuts": "?", onclick: help }, "?"), out);
}

function applyTheme(theme) {
  localStorage.setItem("commram.theme", theme);
  if (theme) document.documentElement.dataset.theme = theme;
  else delete document.documentElement.dataset.theme;
  dispatchEvent(new Event("theme"));
}

function key(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
  if (event.key === "Escape" && event.target.matches("input")) return main.focus();
  const isTyping = event.target.matches("input, select, textarea");
  if (isTyping || (event.key === " " && event.target.matches("button, a"))) return;
  if (current?.key?.(event) || pageKey(event) || clockKey(event)) event.preventDefault();
}

function pageKey(event) {
  const index = "1234567890-".indexOf(event.key);
  if (event.key === "?") help();
  else if (event.key === "r") toggleRecord();
  else if (index >= 0 && PAGES[index] && server.instance) location.hash = `#/${encodeURIComponent(server.instance)}/${PAGES[index].id}`;
  else return false;
  return true;
}

function help() {
  const rows = [
    ...PAGES.map((page, index) => [shortcut(index), `${page.title}: ${page.text}`]),
    ["S", "Step by the time in the clock bar (stepped clock, as all of these)"], ["Space", "Run, and stop; in real time pause, and continue"], ["N", "Step to the next SYNC"], ["E", "Step to the next event"],
    ["W", "Wait for a condition"], ["B", "Go back by the time in the clock bar"], ["Shift+B", "Go back to a condition"],
    ["/", "Search registers or the journal"], ["F", "Follow the chosen register, or end it"], ["P", "Write the chosen register"],
    ["R", "Record, and end recording"], ["Esc", "Close a dialog or the chosen register, leave a field"], ["?", "This help"],
  ];
  openDialog("Keys", h("dl", { class: "facts keys" }, rows.map(([name, text]) => [h("dt", null, h("kbd", null, name)), h("dd", null, text)])), { isWide: true });
}

start();
