"use strict";
// The filter, and links to rows that are collapsed or filtered out. The page works without it.
const form = document.getElementById("filter");
const rows = [...document.querySelectorAll("details.row")].map((row) => {
  const claim = row.closest(".claim");
  const chapter = row.closest(".chapter").dataset.chapter;
  const words = [...claim.children].filter((part) => part.className !== "rows");
  const text = [...words, row].map((part) => part.textContent).join(" ") + " " + row.id + " " + claim.id;
  return { row, chapter, text: text.toLowerCase(), origins: row.dataset.origins.split(" ") };
});
const claims = [...document.querySelectorAll(".claims")].map((box) => [box, [...box.children]]);

function filter() {
  const values = new FormData(form);
  const verdicts = new Set(values.getAll("verdict"));
  const origin = values.get("origin"), chapter = values.get("chapter");
  const words = values.get("words").toLowerCase().split(/\s+/).filter(Boolean);
  let found = 0;
  for (const one of rows) {
    const shown = verdicts.has(one.row.dataset.verdict) && (!origin || one.origins.includes(origin))
      && (!chapter || one.chapter === chapter) && words.every((word) => one.text.includes(word));
    one.row.hidden = !shown;
    found += shown;
  }
  const all = found === rows.length;
  for (const box of document.querySelectorAll(".many, .claim, .chapter")) {
    box.hidden = !box.querySelector(".row:not([hidden])");
    if (box.matches(".many")) box.open = !all && found < 60;
  }
  for (const [box, order] of claims) {
    const failures = values.get("order") === "failures";
    box.append(...(failures ? [...order].sort((a, b) => b.dataset.rank - a.dataset.rank) : order));
  }
  for (const part of document.querySelectorAll(".figures, #beyond")) part.hidden = !all;
  form.elements.found.textContent = all ? rows.length + " rows" : found + " of " + rows.length + " rows";
}

function open() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target) return;
  if (target.closest("[hidden]")) { form.reset(); filter(); }
  for (let box = target; box; box = box.parentElement) if (box.matches("details")) box.open = true;
  target.scrollIntoView();
}

form.hidden = false;
form.addEventListener("input", filter);
form.addEventListener("reset", () => setTimeout(filter));
form.addEventListener("submit", (event) => event.preventDefault());
addEventListener("hashchange", open);
addEventListener("beforeprint", () => {
  for (const box of document.querySelectorAll(".many")) box.open = true;
});
filter();
open();
