"use strict";
// Lets tables sort by a column, show only the rows that hold some words, and be kept as CSV.

(() => {
  const [SORTED, CHOSEN] = [4, 16]; // rows: a shorter table is read at a glance
  const plain = (text) => text.replace(/\s+/g, " ").trim().replaceAll("−", "-");

  // The text of a cell without what is there for screen readers alone.
  function written(cell) {
    const copy = cell.cloneNode(true);
    copy.querySelectorAll(".unseen").forEach((each) => each.remove());
    return plain(copy.textContent);
  }

  const number = (text) => (/^[<>]?\s*[-+]?[\d.]/.test(text)
    ? parseFloat(text.replace(/^[<>]\s*/, "")) : NaN);
  const isDay = (text) => /^\d{4}-\d\d-\d\d/.test(text);

  // What a cell is sorted by: its place in an order that its words do not give, or its words.
  const sortedBy = (cell) => cell.dataset.sort ?? written(cell);

  function compare(one, other) {
    if (isDay(one) || isDay(other)) return one < other ? -1 : Number(one > other);
    const [a, b] = [number(one), number(other)];
    if (Number.isNaN(a) !== Number.isNaN(b)) return Number.isNaN(a) ? 1 : -1;
    return Number.isNaN(a) ? one.localeCompare(other, "en", { numeric: true }) : a - b;
  }

  function sort(table, column, heading) {
    const falls = heading.getAttribute("aria-sort") === "ascending";
    table.querySelectorAll("thead th").forEach((each) => each.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", falls ? "descending" : "ascending");
    const body = table.tBodies[0];
    const rows = [...body.rows].map((row) => [sortedBy(row.cells[column]), row]);
    rows.sort(([one], [other]) => (falls ? compare(other, one) : compare(one, other)));
    body.append(...rows.map(([, row]) => row));
  }

  function sortable(table) {
    [...table.tHead.rows[0].cells].forEach((heading, column) => {
      if (!heading.innerText.trim()) return;
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.append(...heading.childNodes);
      button.addEventListener("click", () => sort(table, column, heading));
      heading.append(button);
    });
  }

  function inCsv(table) {
    // No formula for a spreadsheet: a test is named by whoever uploads its file.
    const inert = (text) => (/^([=@]|[-+](?!\s*[\d.]))/.test(text) ? `'${text}` : text);
    const quoted = (text) => (/[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const line = (row) => [...row.cells].map((cell) => quoted(inert(written(cell)))).join(",");
    return [...table.rows].map(line)
      .join("\r\n");
  }

  function keep(table, title) {
    const link = document.createElement("a");
    link.href = table.dataset.csv ?? URL.createObjectURL(new Blob([`\ufeff${inCsv(table)}\r\n`], { type: "text/csv" }));
    link.download = `${title.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "")}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 0);
  }

  // A word is found by its beginning; a number, or a part of a day, only where it ends, too.
  const wordsOf = (text) => plain(text).toLowerCase().split(/[^\p{L}\p{N}.+-]+/u)
    .map((word) => word.replace(/\.+$/, "")).filter(Boolean);

  function holds(text, wanted) {
    const words = wordsOf(text);
    const fits = (word, part) => word === part || word.startsWith(`${part}-`)
      || (!/\d/.test(part) && word.startsWith(part));
    return wanted.every((part) => words.some((word) => fits(word, part)));
  }

  // Rows whose name holds the words; if there is none, rows that hold them anywhere.
  function choose(table, words) {
    const wanted = wordsOf(words);
    const rows = [...table.tBodies[0].rows];
    const named = rows.filter((row) => holds(written(row.cells[0]), wanted));
    for (const row of rows) {
      const text = [...row.cells].map(written).join(" ");
      row.hidden = named.length ? !named.includes(row) : !holds(text, wanted);
    }
  }

  function keeper(table) {
    const title = table.caption?.innerText.trim() || document.title;
    const button = document.createElement("button");
    button.type = "button";
    button.className = "plain only-screen";
    button.textContent = "CSV";
    button.setAttribute("aria-label", `Keep as CSV: ${title}`);
    button.addEventListener("click", () => keep(table, title));
    (table.caption ?? table.createCaption()).append(" ", button);
  }

  function chooser(table) {
    const label = document.createElement("label");
    label.className = "rows only-screen";
    const field = document.createElement("input");
    field.type = "text";
    field.addEventListener("input", () => choose(table, field.value));
    label.append("Only rows with ", field);
    (table.closest(".scroll") ?? table).before(label);
  }

  document.addEventListener("DOMContentLoaded", () => {
    for (const table of document.querySelectorAll("main table")) {
      const count = table.tHead ? (table.tBodies[0]?.rows.length ?? 0) : 0;
      if (!count) continue;
      keeper(table);
      if (count >= SORTED) sortable(table);
      if (count >= CHOSEN) chooser(table);
    }
  });
})();
