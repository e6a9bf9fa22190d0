"use strict";

// Open the sections around the target of a link, before the browser scrolls to it.
function reveal(hash) {
  const target = document.getElementById(decodeURIComponent(hash.slice(1)));
  for (let part = target; part; part = part.parentElement) if (part.localName === "details") part.open = true;
  return target;
}
addEventListener("click", event => {
  const link = event.target.closest('a[href^="#"]');
  if (link) reveal(link.hash);
});
addEventListener("hashchange", () => reveal(location.hash)?.scrollIntoView());
reveal(location.hash)?.scrollIntoView();

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
for (const button of document.querySelectorAll("th button")) button.onclick = () => sort(button.parentElement);

// Swipe between pictures; choose the attack to show.
for (const slider of document.querySelectorAll(".swipe input"))
  slider.oninput = () => slider.parentElement.style.setProperty("--at", slider.value + "%");
for (const tile of document.querySelectorAll(".tile"))
  tile.onclick = () => {
    const lineup = tile.closest(".lineup");
    for (const other of lineup.querySelectorAll(".tile")) other.ariaPressed = String(other === tile);
    for (const label of lineup.querySelectorAll(".variant")) label.textContent = tile.dataset.variant;
    for (const image of lineup.querySelectorAll(".after"))
      image.src = tile.querySelector(`[data-target="${image.dataset.target}"]`).src;
  };
