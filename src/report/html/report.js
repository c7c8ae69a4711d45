"use strict";
// Sorts the table by a column's full-precision values, and says when everything has been drawn.
(() => {
  const table = document.getElementById("rows");
  const body = table.tBodies[0];
  const headers = [...table.tHead.rows[0].cells];
  const state = document.getElementById("sorted");
  const original = new Map([...body.rows].map((row, i) => [row, i]));

  function key(row, column, numeric) {
    const text = row.cells[column].dataset.value ?? "";
    if (!numeric) return text === "" ? null : text;
    const number = Number(text);
    return text === "" || Number.isNaN(number) ? null : number;
  }

  function sort(column) {
    const header = headers[column];
    const down = header.getAttribute("aria-sort") === "ascending";
    const numeric = header.dataset.kind === "number";
    headers.forEach((h) => h.removeAttribute("aria-sort"));
    header.setAttribute("aria-sort", down ? "descending" : "ascending");
    const keyed = [...body.rows].map((row) => ({ row, key: key(row, column, numeric) }));
    keyed.sort((a, b) => {
      // What was not measured comes last either way; equals stay in the order of the table as written.
      if (a.key === null || b.key === null) {
        return (a.key === null) - (b.key === null) || original.get(a.row) - original.get(b.row);
      }
      const order = numeric ? Math.sign(a.key - b.key) || 0 : a.key.localeCompare(b.key, "en", { numeric: true });
      return (down ? -order : order) || original.get(a.row) - original.get(b.row);
    });
    body.append(...keyed.map((k) => k.row));
    state.textContent = `sorted by ${header.title}, ${down ? "descending" : "ascending"}`;
  }

  headers.forEach((header, i) => header.firstElementChild.addEventListener("click", () => sort(i)));

  addEventListener("load", () => {
    const seen = (element) => {
      const box = element.getBoundingClientRect();
      return box.width > 0 && box.height > 0;
    };
    const drawn = (svg) => seen(svg) && svg.querySelector("text") !== null && svg.querySelector("polyline, path") !== null;
    const data = document.documentElement.dataset;
    data.rows = body.rows.length;
    data.plots = [...document.querySelectorAll("figure svg")].filter(drawn).length;
    data.pictures = [...document.images].filter((p) => p.complete && p.naturalWidth > 0 && seen(p)).length;
    data.ready = "yes";
  });
})();
