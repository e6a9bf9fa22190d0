"use strict";

// Show the part of the page to which the address leads, or the first.
const panels = [...document.querySelectorAll(".panel")];
function reveal() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const shown = target?.closest(".panel") ?? panels[0];
  for (const panel of panels) panel.hidden = panel !== shown;
  for (let part = target; part; part = part.parentElement) if (part.localName === "details") part.open = true;
  (target === shown ? document.body : target)?.scrollIntoView();
  dispatchEvent(new Event("resize"));  // for the 3-D view
}
addEventListener("hashchange", reveal);
addEventListener("DOMContentLoaded", reveal);

// Print everything but the 3-D view, which browsers print blank.
addEventListener("beforeprint", () => { for (const part of document.querySelectorAll("details")) part.open = true; });

// Sort a table by the column whose heading is clicked, numbers from the highest, unknown ones last.
function sort(heading) {
  const column = heading.cellIndex, body = heading.closest("table").tBodies[0];
  const descending = heading.ariaSort ? heading.ariaSort === "ascending" : column > 0;
  const key = row => {
    const text = row.cells[column].textContent.trim().replace("−", "-").replace("≥ ", "").replace("∞", "Infinity");
    return column ? parseFloat(text) : text;
  };
  const compare = (a, b) => (column ? a - b : a.localeCompare(b)) * (descending ? -1 : 1);
  const keyed = [...body.rows].map(row => [key(row), row]);
  keyed.sort(([a], [b]) => Number.isNaN(a) - Number.isNaN(b) || (a === b ? 0 : compare(a, b) || 0));
  body.append(...keyed.map(([, row]) => row));
  for (const other of heading.parentElement.cells) other.ariaSort = null;
  heading.ariaSort = descending ? "descending" : "ascending";
}
for (const button of document.querySelectorAll("th[scope=col] button")) button.onclick = () => sort(button.parentElement);

// Show the pictures of the attack whose name is clicked, in place of the last ones.
for (const button of document.querySelectorAll(".attacks button"))
  button.onclick = () => {
    const columns = [...button.closest(".panel").querySelector(".pictures").children];
    const wanted = columns.find(column => column.dataset.variant === button.dataset.variant);
    if (!wanted.hidden) return;
    const last = columns.find(column => column.className === "chosen");
    if (last) [last.hidden, last.className] = [true, ""];
    [wanted.hidden, wanted.className] = [false, "chosen"];
  };
