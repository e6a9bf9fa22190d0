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
