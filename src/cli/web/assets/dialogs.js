// Dialogs: one that shows content, and one that asks for a value.

import { h, newId } from "./dom.js";

/** Opens a dialog with a title; Esc and the button close it. Returns the element. */
export function openDialog(title, content, { isWide = false, onclose } = {}) {
  const id = newId();
  const close = h("button", { class: "plain", label: "Close", onclick: () => dialog.close() }, "\u00d7");
  const dialog = h("dialog", { class: isWide ? "wide" : "", "aria-labelledby": id }, h("header", null, h("h2", { id }, title), close), content);
  dialog.addEventListener("close", () => {
    dialog.remove();
    onclose?.();
  });
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  document.body.append(dialog);
  dialog.showModal();
  return dialog;
}

/** Opens a dialog for the input of texts. `fields` are elements that `field` has created. `done` gets the form; if it throws an Error, the dialog shows it. */
export function ask(title, fields, button, done) {
  const error = h("p", { class: "error", role: "alert" });
  const form = h("form", { class: "stack", method: "dialog" }, fields, error,
    h("div", { class: "line end" },
      h("button", { onclick: () => dialog.close() }, "Cancel"),
      h("button", { type: "submit", class: "primary" }, button)));
  const dialog = openDialog(title, form);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    error.textContent = "";
    try {
      await done(form, dialog);
      dialog.close();
    } catch (problem) {
      error.textContent = problem.message;
    }
  });
  form.querySelector("input, select, textarea")?.focus();
  return dialog;
}
