// The pages in the order of the navigation. `load()` returns the function that draws a page, `open(root, rest, context)`. That function
// returns another one that closes the page.

export const PAGES = [
  { id: "plant", title: "Plant", text: "devices, ports, buses with their load", load: () => import("./plant.js").then((it) => it.plantPage) },
  { id: "registers", title: "Registers", text: "registers with values, meanings and pages of the manual", load: () => import("./registers.js").then((it) => it.registersPage) },
  { id: "followed", title: "Plots", text: "the followed registers as a plot, and each of their changes", load: () => import("./followed.js").then((it) => it.followedPage) },
  { id: "bus", title: "Bus", text: "the frames of the last intervals", load: () => import("./bus.js").then((it) => it.busPage) },
  { id: "panel", title: "Front panel", text: "lamps, displays and switches of each device", load: () => import("./panel.js").then((it) => it.panelPage) },
  { id: "drives", title: "Drives", text: "states, speeds and parameters", load: () => import("./drives.js").then((it) => it.drivesPage) },
  { id: "canopen", title: "CANopen", text: "states of nodes, object dictionaries", load: () => import("./objects.js").then((it) => it.canopenPage) },
  { id: "faults", title: "Faults", text: "faults and forced registers", load: () => import("./faults.js").then((it) => it.faultsPage) },
  { id: "findings", title: "Findings", text: "violations of the manual", load: () => import("./findings.js").then((it) => it.findingsPage) },
  { id: "journal", title: "Journal", text: "all records of the emulator", load: () => import("./journal.js").then((it) => it.journalPage) },
];
