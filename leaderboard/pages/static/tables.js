"use strict";
// Makes tables of class "sortable" sortable by their headings. A cell is sorted by its data-value
// where it has one; columns of data-sort="number" by value, others as people count (2 before 10).
//
// A table that is wider or higher than its place says that it scrolls.
//
// di.tables.enhance(document)

(function (di) {
  const collator = new Intl.Collator("en", { numeric: true });

  function enhance(root) {
    for (const place of root.querySelectorAll(".scroll")) tell_of_scrolling(place);
    for (const table of root.querySelectorAll("table.sortable")) {
      table.querySelectorAll("thead th").forEach((heading, column) => {
        const button = document.createElement("button");
        button.type = "button";
        button.append(...heading.childNodes);
        heading.append(button);
        button.addEventListener("click", () => sort(table, heading, column));
      });
    }
  }

  function tell_of_scrolling(place) {
    const note = document.createElement("p");
    note.className = "hint scrolls";
    place.before(note);
    new ResizeObserver(() => {
      const sideways = place.scrollWidth > place.clientWidth + 1;
      const down = place.scrollHeight > place.clientHeight + 1;
      note.hidden = !sideways && !down;
      note.textContent = `The table scrolls ${[sideways && "sideways ↔", down && "down ↕"].filter(Boolean).join(" and ")}`;
    }).observe(place);
  }

  function sort(table, heading, column) {
    const number = heading.dataset.sort === "number";
    const before = heading.getAttribute("aria-sort");
    const up = before ? before === "descending" : true;
    const key = (row) => {
      const cell = row.cells[column];
      const text = cell.dataset.value ?? cell.textContent;
      return number ? (Number.isNaN(parseFloat(text)) ? -Infinity : parseFloat(text)) : text;
    };
    const order = (one, other) =>
      number ? key(one) - key(other) || 0 : collator.compare(key(one), key(other));
    const body = table.tBodies[0];
    const rows = [...body.rows].sort((one, other) => (up ? order(one, other) : order(other, one)));
    body.append(...rows);
    for (const other of heading.parentElement.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", up ? "ascending" : "descending");
  }

  di.tables = { enhance };
})((globalThis.driveinsight ??= {}));
