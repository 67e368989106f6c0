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

  function compare(one, other) {
    if (isDay(one) || isDay(other)) return one < other ? -1 : Number(one > other);
    const [a, b] = [number(one), number(other)];
    if (Number.isNaN(a) !== Number.isNaN(b)) return Number.isNaN(a) ? 1 : -1;
    return Number.isNaN(a) ? one.localeCompare(other) : a - b;
  }

  function sort(table, column, heading) {
    const falls = heading.getAttribute("aria-sort") === "ascending";
    table.querySelectorAll("thead th").forEach((each) => each.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", falls ? "descending" : "ascending");
    const body = table.tBodies[0];
    const rows = [...body.rows].map((row) => [written(row.cells[column]), row]);
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
    link.href = URL.createObjectURL(new Blob([`\ufeff${inCsv(table)}\r\n`], { type: "text/csv" }));
    link.download = `${title.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "")}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 0);
  }

  function choose(table, words) {
    const wanted = plain(words).toLowerCase();
    for (const row of table.tBodies[0].rows) {
      const text = [...row.cells].map(written).join(" ").toLowerCase();
      row.hidden = !text.includes(wanted);
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
