// The pages in the order of the navigation. `open(root, rest, context)` draws a page and returns the function that ends it.

import { busPage } from "./bus.js";
import { canopenPage } from "./objects.js";
import { drivesPage } from "./drives.js";
import { faultsPage } from "./faults.js";
import { findingsPage } from "./findings.js";
import { followedPage } from "./followed.js";
import { journalPage } from "./journal.js";
import { panelPage } from "./panel.js";
import { plantPage } from "./plant.js";
import { registersPage } from "./registers.js";

export const PAGES = [
  { id: "plant", title: "Plant", text: "devices, ports, buses with their load", open: plantPage },
  { id: "registers", title: "Registers", text: "registers with values, meanings and pages of the manual", open: registersPage },
  { id: "followed", title: "Plots", text: "the followed registers as a plot, and each of their changes", open: followedPage },
  { id: "bus", title: "Bus", text: "the frames of the last intervals", open: busPage },
  { id: "panel", title: "Front panel", text: "lamps, displays and switches of each device", open: panelPage },
  { id: "drives", title: "Drives", text: "states, speeds and parameters", open: drivesPage },
  { id: "canopen", title: "CANopen", text: "states of nodes, object dictionaries", open: canopenPage },
  { id: "faults", title: "Faults", text: "faults and forced registers", open: faultsPage },
  { id: "findings", title: "Findings", text: "violations of the manual", open: findingsPage },
  { id: "journal", title: "Journal", text: "all records of the emulator", open: journalPage },
];
