// Paper is white: what is printed has the colours of the light theme, whichever is on the screen.
let onScreen;
addEventListener("beforeprint", () => {
  onScreen = document.documentElement.dataset.theme;
  document.documentElement.dataset.theme = "light";
});
addEventListener("afterprint", () => {
  document.documentElement.dataset.theme = onScreen;
});

// What is wider than the page scrolls by itself; a line below it says so.
const SCROLLERS = ".cell_output, .cell_output .output, .bd-article table, .pst-scrollable-table-container";
function tellWhatScrolls() {
  for (const old of document.querySelectorAll(".swipe")) old.remove();
  for (const one of document.querySelectorAll(SCROLLERS)) {
    if (one.scrollWidth <= one.clientWidth + 4 || getComputedStyle(one).overflowX !== "auto") continue;
    const line = document.createElement("p");
    line.className = "swipe";
    line.textContent = "scroll sideways for the rest \u2192";
    one.after(line);
  }
}
addEventListener("load", tellWhatScrolls);
addEventListener("resize", tellWhatScrolls);

const PAGE = document.documentElement.dataset;
const loaded = address => new Promise((done, failed) => {
  const tag = document.createElement("script");
  tag.src = address;
  tag.onload = done;
  tag.onerror = failed;
  document.head.append(tag);
});

// Formulas are drawn when the first of them comes near, and before a page is printed.
let formulas;
const drawFormulas = () => formulas ??= loaded(PAGE.formulasScript)
  .then(() => window.formulasReady).then(() => MathJax.startup.promise);
if (PAGE.formulasScript) {
  addEventListener("DOMContentLoaded", () => {
    const near = new IntersectionObserver(seen => {
      if (!seen.some(one => one.isIntersecting)) return;
      near.disconnect();
      drawFormulas();
    }, {rootMargin: "200px"});
    for (const one of document.querySelectorAll(".math")) near.observe(one);
  });
  const print = window.print.bind(window);
  window.print = () => drawFormulas().finally(print);
  addEventListener("keydown", event => {
    if (event.key.toLowerCase() !== "p" || !(event.ctrlKey || event.metaKey)) return;
    event.preventDefault();
    window.print();
  });
}

// What panels hide at first is loaded when a reader comes to one.
let late;
const lateFrames = () => late ??= loaded(PAGE.lateScript).then(() => window.lateTaken);
function takeLate(texts) {
  for (const one of document.querySelectorAll("[data-late]")) {
    if (one.tagName === "TEMPLATE") one.innerHTML = texts[one.dataset.late];
    else one.dataset.packed = texts[one.dataset.late];
    one.removeAttribute("data-late");
  }
}
for (const kind of ["pointerover", "focusin"])
  addEventListener(kind, event => {
    if (event.target.closest?.("[data-ptae-embed=panel]")?.querySelector("[data-late]")) lateFrames();
  });
