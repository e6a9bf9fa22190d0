// Show the part of the page to which the address leads, or the first.
const panels = [...document.querySelectorAll(".panel")];
function reveal() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const shown = target?.closest(".panel") ?? panels[0];
  for (const panel of panels) panel.hidden = panel !== shown;
  for (let part = target; part; part = part.parentElement) if (part.localName === "details") part.open = true;
  (target === shown ? document.body : target)?.scrollIntoView();
  dispatchEvent(new Event("resize"));  // for the 3-D view
  return shown;
}
addEventListener("hashchange", reveal);
addEventListener("DOMContentLoaded", reveal);

// The arrow keys lead from one part to the next.
addEventListener("keydown", event => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], tabs = [...event.target.closest("nav")?.querySelectorAll("a") ?? []];
  const next = tabs[tabs.indexOf(event.target) + step];
  if (!next) return;
  location.hash = next.hash;
  reveal().querySelector("nav [aria-current]")?.focus();
});

// Print the verdict and how it is made, or else what is shown; not the 3-D view, which browsers print blank.
addEventListener("beforeprint", () => { for (const part of document.querySelectorAll("details")) part.open = true; });

// Show the pictures of the attack whose name is clicked, in place of the last ones.
for (const button of document.querySelectorAll(".attacks [data-variant]"))
  button.onclick = () => {
    const columns = [...button.closest(".panel").querySelector(".pictures").children];
    const wanted = columns.find(column => column.dataset.variant === button.dataset.variant);
    if (!wanted.hidden) return;
    const last = columns.find(column => column.className === "chosen");
    if (last) [last.hidden, last.className] = [true, ""];
    [wanted.hidden, wanted.className] = [false, "chosen"];
  };

// A click on the title of a column sorts by it, the next one the other way round. Unknown values stay last.
function keyOf(cell) {
  const text = cell.textContent.trim();
  const number = parseFloat(text.replace("−", "-").replace("∞", "Infinity").replace(/^[<>≥≤] ?/, ""));
  return cell.localName === "th" || Number.isNaN(number) ? text : number;
}
function sort(title) {
  const sign = title.ariaSort === "ascending" ? -1 : 1, body = title.closest("table").tBodies[0];
  const compare = (a, b) => typeof a === "number" && typeof b === "number" ? a - b : `${a}`.localeCompare(b, "en", { numeric: true });
  const keyed = [...body.rows].map(row => ({ row, key: keyOf(row.cells[title.cellIndex]) }));
  keyed.sort((a, b) => (a.key === "–") - (b.key === "–") || sign * compare(a.key, b.key));
  body.append(...keyed.map(({ row }) => row));
  for (const other of title.parentElement.cells) other.ariaSort = null;
  title.ariaSort = sign > 0 ? "ascending" : "descending";
}
for (const title of document.querySelectorAll(":is(.attacks, .table) thead th")) {
  const button = document.createElement("button");
  button.append(...title.childNodes);
  button.onclick = () => sort(title);
  title.append(button);
}
