// Sorts the rows of the first table by a column, and hides the rows and sections that do not match the filter.
const table = document.querySelector("table.sortable");
const rows = () => Array.from(table.tBodies[0].rows);
const key = (row, column) => {
  const cell = row.cells[column];
  return cell.dataset.key === undefined ? cell.textContent.trim() : Number(cell.dataset.key);
};
const compare = (one, other) => (typeof one === "number" ? one - other : one.localeCompare(other));
for (const head of table.tHead.rows[0].cells) {
  head.querySelector("button").addEventListener("click", () => {
    const isDescending = head.ariaSort === "ascending";
    for (const other of table.tHead.rows[0].cells) other.ariaSort = "none";
    head.ariaSort = isDescending ? "descending" : "ascending";
    const sorted = rows().sort((one, other) => compare(key(one, head.cellIndex), key(other, head.cellIndex)));
    table.tBodies[0].append(...(isDescending ? sorted.reverse() : sorted));
  });
}
const text = document.querySelector("input[type=search]");
const outcome = document.querySelector("select");
const filter = () => {
  let shown = 0;
  for (const row of rows()) {
    const takes = row.cells[0].textContent.toLowerCase().includes(text.value.trim().toLowerCase())
      && (outcome.value === "" || row.dataset.outcome === outcome.value);
    row.hidden = !takes;
    document.getElementById(row.dataset.section).hidden = !takes;
    shown += takes ? 1 : 0;
  }
  document.querySelector("output").textContent = `${shown} of ${rows().length} shown`;
};
text.addEventListener("input", filter);
outcome.addEventListener("change", filter);
filter();
