// Plain tables: a click on a head cell sorts by its column.
import { onPress } from "./dom.js";
import { numberIn, sortedIndices } from "./numbers.js";

// texts of a column as they are sorted: numbers by value where all are numbers, "" or "-"
export function sortKeys(texts) {
  const keys = texts.map(numberIn);
  const numeric = keys.every((key, i) => key !== null || texts[i] === "" || texts[i] === "-");
  return numeric ? keys : texts;
}

function makeSortable(table) {
  const body = table.tBodies[0];
  Array.from(table.tHead.rows[0].cells).forEach((head, k) => {
    let ascending = false;
    head.classList.add("sortable");
    head.tabIndex = 0;
    onPress(head, () => {
      ascending = !ascending;
      const rows = Array.from(body.rows);
      const texts = rows.map((row) => row.cells[k]?.textContent ?? "");
      body.append(...sortedIndices(sortKeys(texts), ascending).map((i) => rows[i]));
    });
  });
}

export function sortTables() {
  for (const table of document.querySelectorAll("table.data")) {
    if (table.tHead && table.tBodies.length) makeSortable(table);
  }
}
