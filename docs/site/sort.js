// Tables of the leaderboard: a click on a title sorts by that column, a second click the other way round.
document.addEventListener("click", ({ target }) => {
  const title = target.closest(".leaderboard th");
  if (!title) return;
  const body = title.closest("table").tBodies[0];
  const key = (row) => row.cells[title.cellIndex].dataset.sort ?? row.cells[title.cellIndex].textContent;
  const sign = (title.dataset.sign = -(title.dataset.sign ?? -1));
  const order = (a, b) => sign * key(a).localeCompare(key(b), "en", { numeric: true });
  body.append(...[...body.rows].sort(order));
});
