// A long list. Only its visible rows exist as elements.

import { h, setAttribute } from "./dom.js";

/** Number of additional rows above and below the visible ones. */
const SPARE = 6;
/** Width in pixels up to which rows have the height `narrowHeight`, as in pages.css. */
const NARROW = 460;

/**
 * A grid of rows with the same height. `make()` creates a row, `fillRow(row, item, index)` fills it. Rows are reused for other items.
 * `onchoose(index)`: Enter, Space or a click. `onrange(first, end)`: other rows are visible. The chosen row follows its item,
 * identified by `key(item)`, when other items move it. The document contains the rows in the order of the screen.
 */
export class RowList {
  items = [];
  chosen = -1;
  #chosenKey;
  #rows = [];
  #first = 0;
  #end = 0;

  constructor({ label, head, make, fillRow, onchoose, onrange, rowHeight = 30, narrowHeight = rowHeight, columns, key = (item) => item }) {
    Object.assign(this, { make, fillRow, onchoose, onrange, rowHeight, key });
    const heights = [rowHeight, narrowHeight];
    this.body = h("div", { class: "rows-body", role: "rowgroup" });
    this.element = h("div", { class: `rows ${columns ?? ""}`, role: "grid", label, tabIndex: 0 }, head, this.body);
    this.element.addEventListener("scroll", () => this.draw(), { passive: true });
    this.element.addEventListener("keydown", (event) => this.#key(event));
    this.body.addEventListener("click", (event) => this.#click(event));
    this.observer = new ResizeObserver(() => {
      const height = heights[this.element.clientWidth <= NARROW ? 1 : 0];
      const isOther = height !== this.rowHeight;
      this.rowHeight = height;
      if (isOther) this.set(this.items);
      else this.draw();
    });
    this.observer.observe(this.element);
  }

  set(items) {
    this.items = items;
    this.body.style.height = `${items.length * this.rowHeight}px`;
    this.element.setAttribute("aria-rowcount", items.length + 1);
    if (this.#chosenKey !== undefined) this.chosen = items.findIndex((item) => this.key(item) === this.#chosenKey);
    this.draw(true);
  }

  unchoose() {
    this.#chosenKey = undefined;
    this.chosen = -1;
    this.refresh();
  }

  get visible() {
    return this.items.slice(this.#first, this.#end);
  }

  refresh() {
    if (this.chosen < this.#first || this.chosen >= this.#end) this.element.removeAttribute("aria-activedescendant");
    for (let index = this.#first; index < this.#end; index += 1) this.#fill(index);
  }

  draw(isOther = false) {
    const head = this.body.offsetTop;
    const top = Math.max(0, this.element.scrollTop - head);
    const count = Math.ceil(this.element.clientHeight / this.rowHeight) + 2 * SPARE;
    const first = Math.max(0, Math.min(Math.floor(top / this.rowHeight) - SPARE, this.items.length - count));
    const end = Math.min(this.items.length, first + count);
    if (!isOther && first === this.#first && end === this.#end) return;
    this.#move(first - this.#first);
    this.#first = first;
    this.#end = end;
    this.#place(end - first);
    this.refresh();
    this.onrange?.(first, end);
  }

  /** Moves rows that leave one end of the screen to the other end. The rows in between keep their items. */
  #move(count) {
    if (Math.abs(count) >= this.#rows.length) return;
    const moved = count > 0 ? this.#rows.splice(0, count) : this.#rows.splice(this.#rows.length + count);
    this.body[count > 0 ? "append" : "prepend"](...moved);
    this.#rows[count > 0 ? "push" : "unshift"](...moved);
  }

  #place(count) {
    while (this.#rows.length < count) {
      const row = this.make();
      row.setAttribute("role", "row");
      this.#rows.push(row);
      this.body.append(row);
    }
    for (const row of this.#rows.splice(count)) row.remove();
  }

  #fill(index) {
    const row = this.#rows[index - this.#first];
    if (!row) return;
    const top = index * this.rowHeight;
    if (row.top !== top || row.dataset.index !== String(index)) {
      row.top = top;
      row.dataset.index = index;
      row.style.top = `${top}px`;
      row.setAttribute("aria-rowindex", index + 2);
    }
    setAttribute(row, "aria-selected", index === this.chosen);
    row.id ||= `row-${Math.random().toString(36).slice(2, 9)}`;
    if (index === this.chosen) setAttribute(this.element, "aria-activedescendant", row.id);
    this.fillRow(row, this.items[index], index);
  }

  choose(index, isOpened = false) {
    if (!this.items.length) return;
    this.chosen = Math.max(0, Math.min(index, this.items.length - 1));
    this.#chosenKey = this.key(this.items[this.chosen]);
    const top = this.chosen * this.rowHeight + this.body.offsetTop;
    const { scrollTop, clientHeight } = this.element;
    if (top - this.body.offsetTop < scrollTop) this.element.scrollTop = top - this.body.offsetTop;
    else if (top + this.rowHeight > scrollTop + clientHeight) this.element.scrollTop = top + this.rowHeight - clientHeight;
    this.draw();
    this.refresh();
    this.onchoose?.(this.items[this.chosen], this.chosen, isOpened);
  }

  /** Handles a key in the search field of the list. Enter and the down arrow choose the first row. `update` searches the rows for the text. */
  enterFrom(event, update) {
    if (event.key !== "Enter" && event.key !== "ArrowDown") return;
    event.preventDefault();
    update();
    if (!this.items.length) return;
    this.element.focus();
    this.choose(Math.max(0, this.chosen));
  }

  #click(event) {
    const row = event.target.closest("[role=row]");
    if (row && !event.target.closest("button, a, input")) this.choose(Number(row.dataset.index), true);
  }

  #key(event) {
    if (event.target !== this.element || event.ctrlKey || event.altKey || event.metaKey) return;
    const page = Math.max(1, Math.floor(this.element.clientHeight / this.rowHeight) - 2);
    const moves = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity };
    if (event.key in moves) this.choose(Math.max(0, this.chosen + moves[event.key]));
    else if (event.key === "Enter" || event.key === " ") this.choose(this.chosen, true);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
}
