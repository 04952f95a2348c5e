/* Tables that sort by a click on a header and filter by a typed word; without a script they stay plain tables. */
"use strict";

(function () {
  const ROWS_WORTH_A_FILTER = 15;

  /* "1.32 ± 0.04", "1,946" and "–" sort as 1.32, 1946 and last. */
  function valueOf(cell) {
    const text = cell.textContent.trim();
    const number = Number.parseFloat(text.replace(/,/g, "").replace("−", "-"));
    return Number.isNaN(number) ? text.toLowerCase() : number;
  }

  function compare(first, second) {
    const isMissing = (value) => value === "–" || value === "";
    if (isMissing(first) || isMissing(second)) return Number(isMissing(first)) - Number(isMissing(second));
    if (typeof first === "number" && typeof second === "number") return first - second;
    return String(first).localeCompare(String(second));
  }

  function sortBy(table, column, header) {
    const rising = header.getAttribute("aria-sort") !== "ascending";
    for (const other of header.parentNode.children) other.removeAttribute("aria-sort");
    header.setAttribute("aria-sort", rising ? "ascending" : "descending");
    const body = table.tBodies[0];
    const rows = [...body.rows].map((row) => ({ row, value: valueOf(row.cells[column]) }));
    rows.sort((first, second) => {
      const order = compare(first.value, second.value);
      const missingStaysLast = first.value === "–" || second.value === "–";
      return rising || missingStaysLast ? order : -order;
    });
    body.append(...rows.map(({ row }) => row));
  }

  function makeSortable(table) {
    [...table.tHead.rows[0].cells].forEach((header, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.append(...header.childNodes);
      button.addEventListener("click", () => sortBy(table, column, header));
      header.append(button);
    });
  }

  function makeFilterable(table) {
    const count = table.tBodies[0].rows.length;
    if (count < ROWS_WORTH_A_FILTER) return;
    const box = document.createElement("input");
    box.type = "search";
    box.className = "filter";
    box.placeholder = `filter ${count} rows`;
    box.setAttribute("aria-label", `filter the ${count} rows of this table`);
    box.addEventListener("input", () => {
      const wanted = box.value.trim().toLowerCase();
      for (const row of table.tBodies[0].rows) row.hidden = !row.textContent.toLowerCase().includes(wanted);
    });
    table.closest(".scroll").before(box);
  }

  for (const table of document.querySelectorAll("table.numbers")) {
    if (!table.tHead || !table.tBodies.length || table.dataset.plain !== undefined) continue;
    makeSortable(table);
    makeFilterable(table);
  }
})();
