"use strict";
// Sorts a table by the column whose head is clicked.
(() => {
  for (const table of document.querySelectorAll("table")) {
    const body = table.tBodies[0];
    table.querySelectorAll("th").forEach((head, column) => {
      head.querySelector("button").addEventListener("click", () => {
        const cells = (row) => row.cells[column];
        const isNumber = body.rows.length && cells(body.rows[0]).hasAttribute("data-by");
        const down = head.getAttribute("aria-sort") ? head.getAttribute("aria-sort") === "ascending" : isNumber;
        const value = (row) => (isNumber ? Number(cells(row).getAttribute("data-by")) : cells(row).textContent);
        const compare = (a, b) => (isNumber ? value(a) - value(b) : value(a).localeCompare(value(b)));
        const sorted = [...body.rows].sort((a, b) => (down ? compare(b, a) : compare(a, b)));
        table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        body.append(...sorted);
      });
    });
  }
})();
